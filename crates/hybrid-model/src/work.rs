//! What a view asks for.

use niwaki_hybrid::{NearRegion, Settings};
use niwaki_render::RenderStats;

/// What the effect plan runs for a view.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PlannedWork {
    /// Rays are followed beyond the primary view.
    pub follows: bool,
    /// Faces of the cube map that are drawn, 0 to 6.
    pub faces: u32,
    /// Triangles that the camera's view draws.
    pub view_triangles: u64,
    /// Triangles that all faces together draw.
    pub face_triangles: u64,
    /// Whether a second layer is drawn.
    pub second_layer: bool,
}

/// What a view asks for, whatever the settings.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ViewWork {
    /// The share of pixels that show a surface, 0 to 1.
    pub visible: f64,
    /// Rays a pixel by the number of reflections and refractions that led to them: 0 are those that
    /// go straight on behind blended surfaces, the primary ones aside.
    pub rays: [f64; RenderStats::DEPTHS],
    /// Nodes and triangles that one of those rays tests in a tree of the whole scene, on average.
    pub ray_steps: f64,
    /// Distances of visible points from the camera, the longest of their three coordinates, in
    /// order: what of the view lies in a cube around the camera.
    pub distances: Vec<f32>,
    /// Nodes and triangles that a ray of ambient occlusion tests from each of these points, within
    /// [`ViewWork::OCCLUSION_RADIUS`]; 0 where ambient light does not show.
    pub occlusion_steps: Vec<f32>,
    /// The same distances of triangles, evenly chosen from the whole scene.
    pub triangle_distances: Vec<f32>,
    /// How far from the camera objects begin, and how many triangles each has, in order of the
    /// distance: what is culled one by one because its object reaches into the near region.
    pub objects: Vec<(f32, u32)>,
    /// Triangles of the scene.
    pub triangles: u64,
    /// The longest side of the scene's bounds, in which sizes of the near region count.
    pub longest: f32,
    /// The diagonal of the scene's bounds, in which a rung's near region and rays of ambient occlusion
    /// count.
    pub diagonal: f32,
    /// Lights that shine.
    pub lights: u32,
    /// What is planned without reflections and with them, by half the side of the near region, in
    /// order.
    pub planned: Vec<(f32, [PlannedWork; 2])>,
}

/// The share of sorted numbers up to a limit.
fn share_up_to(sorted: &[f32], limit: f32) -> f64 {
    if sorted.is_empty() {
        return 0.0;
    }
    sorted.partition_point(|&x| x <= limit) as f64 / sorted.len() as f64
}

impl ViewWork {
    /// How far rays of ambient occlusion are followed for their steps, as a share of the diagonal.
    pub const OCCLUSION_RADIUS: f32 = 0.1;

    /// Rays a pixel that go on from surfaces, up to a depth.
    #[must_use]
    pub fn rays_up_to(&self, depth: u32) -> f64 {
        self.rays.iter().take(depth as usize + 1).sum()
    }

    /// Half the side of the near region.
    #[must_use]
    pub fn half_size(&self, settings: &Settings) -> f32 {
        match settings.near_region {
            NearRegion::HalfSize(x) => x,
            NearRegion::ShareOfScene(x) => x * self.longest,
            _ => f32::INFINITY,
        }
    }

    /// The share of visible points within the near region, 0 to 1.
    #[must_use]
    pub fn near_share(&self, settings: &Settings) -> f64 {
        share_up_to(&self.distances, self.half_size(settings))
    }

    /// About how many triangles lie in the near region.
    #[must_use]
    pub fn near_triangles(&self, settings: &Settings) -> f64 {
        self.triangles as f64 * share_up_to(&self.triangle_distances, self.half_size(settings))
    }

    /// Steps of a ray of ambient occlusion from each pixel whose surface is in the near region, a
    /// pixel of the whole image.
    #[must_use]
    pub fn near_occlusion_steps(&self, settings: &Settings) -> f64 {
        let half = self.half_size(settings);
        let near = self.distances.partition_point(|&x| x <= half);
        let sum: f64 = self.occlusion_steps.iter().take(near).map(|&x| f64::from(x)).sum();
        if self.distances.is_empty() {
            0.0
        } else {
            self.visible * sum / self.distances.len() as f64
        }
    }

    /// Triangles of the objects that reach into the near region.
    #[must_use]
    pub fn culled_triangles(&self, settings: &Settings) -> f64 {
        let half = self.half_size(settings);
        let objects = self.objects.iter().take_while(|(from, _)| *from <= half);
        objects.map(|&(_, triangles)| f64::from(triangles)).sum()
    }

    /// What the plan runs with these settings, by the nearest region that was planned for.
    #[must_use]
    pub fn planned(&self, settings: &Settings) -> PlannedWork {
        let half = self.half_size(settings);
        let larger = self.planned.partition_point(|(planned, _)| *planned < half);
        let around = [larger.checked_sub(1), Some(larger)].into_iter().flatten();
        let off = |i: &usize| self.planned.get(*i).map_or(f32::INFINITY, |(x, _)| (x - half).abs());
        let nearest = around.min_by(|a, b| off(a).total_cmp(&off(b)));
        let planned = nearest.and_then(|i| self.planned.get(i)).map(|(_, planned)| planned);
        planned.map_or_else(PlannedWork::default, |p| p[usize::from(settings.max_depth > 0)])
    }
}
