//! What a rendering took, counted.

use crate::surface::Surface;
use niwaki_core::Ray;

/// What a rendering took. An effect that the plan left out shows as a count of 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RenderStats {
    /// Closest-hit queries, continuations through cut-out surfaces included.
    pub closest_hit_rays: u64,
    /// Rays by the number of reflections, refractions and scatterings that led to them, 0 being those
    /// of the camera and what goes straight on behind blended surfaces; the last counts all that are
    /// deeper. Continuations through cut-out surfaces count no more.
    pub rays_by_depth: [u64; Self::DEPTHS],
    /// Queries for visibility between a surface and a light.
    pub shadow_rays: u64,
    /// Rays that went on from a surface on the side that they came from: mirrored or scattered.
    pub reflected_rays: u64,
    /// Rays that went on beyond a surface by refraction.
    pub refracted_rays: u64,
    /// Rays that passed a surface by its alpha, shadow rays included.
    pub continued_rays: u64,
    /// Surfaces whose alpha was looked up.
    pub alpha_tests: u64,
    /// Rays from surfaces that measure ambient occlusion.
    pub occlusion_rays: u64,
    /// Rays that were due but not traced because their pixel had used up
    /// [`WhittedSettings::max_rays`](crate::WhittedSettings::max_rays). 0 for any usual scene and
    /// depth.
    pub cut_rays: u64,
    /// Paths whose radiance was not finite and was left out of the image: overflow at extreme
    /// scales or intensities. 0 for any reasonable scene.
    pub dropped_paths: u64,
}

impl RenderStats {
    /// Length of [`RenderStats::rays_by_depth`].
    pub const DEPTHS: usize = 17;

    pub(crate) fn plus(self, other: Self) -> Self {
        let sum = |d: usize| self.rays_by_depth[d] + other.rays_by_depth[d];
        Self {
            rays_by_depth: std::array::from_fn(sum),
            closest_hit_rays: self.closest_hit_rays + other.closest_hit_rays,
            shadow_rays: self.shadow_rays + other.shadow_rays,
            reflected_rays: self.reflected_rays + other.reflected_rays,
            refracted_rays: self.refracted_rays + other.refracted_rays,
            continued_rays: self.continued_rays + other.continued_rays,
            alpha_tests: self.alpha_tests + other.alpha_tests,
            occlusion_rays: self.occlusion_rays + other.occlusion_rays,
            cut_rays: self.cut_rays + other.cut_rays,
            dropped_paths: self.dropped_paths + other.dropped_paths,
        }
    }
}

/// Sees the rays of a path as they are traced.
pub(crate) trait Observer {
    /// A ray that goes on from the path's vertex number `depth` (0 is the camera).
    fn closest(&mut self, _depth: u32, _ray: &Ray) {}
    /// A ray from a surface towards a light.
    fn shadow(&mut self, _ray: &Ray) {}
    /// The path met a surface after `depth` scattering events.
    fn surface(&mut self, _depth: u32, _surface: &Surface<'_>) {}
    /// The path goes on: `beyond` the surface or on the side that it came from.
    fn scattered(&mut self, _beyond: bool) {}
    /// The alpha of a surface was looked up.
    fn alpha_test(&mut self) {}
    /// A continuation through a cut-out surface.
    fn continuation(&mut self) {}
}

impl Observer for RenderStats {
    fn closest(&mut self, depth: u32, _: &Ray) {
        self.closest_hit_rays += 1;
        self.rays_by_depth[(depth as usize).min(Self::DEPTHS - 1)] += 1;
    }
    fn shadow(&mut self, _: &Ray) {
        self.shadow_rays += 1;
    }
    fn scattered(&mut self, beyond: bool) {
        if beyond {
            self.refracted_rays += 1;
        } else {
            self.reflected_rays += 1;
        }
    }
    fn alpha_test(&mut self) {
        self.alpha_tests += 1;
    }
    fn continuation(&mut self) {
        self.closest_hit_rays += 1;
        self.continued_rays += 1;
    }
}
