//! Milliseconds of a frame, part by part.

use crate::{HybridModelError, ViewWork};
use niwaki_frame_control::{Row, least_squares};
use niwaki_hybrid::{Effect, FrameReport, Settings, Shadows, Stage};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Counts that the time of a part is a sum of.
const COUNTS: usize = 4;

/// How strongly coefficients are drawn to zero ([`least_squares`]).
const RIDGE: f64 = 1e-4;

/// A part of a frame: stages that share what their time depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Part {
    /// Moving vertices and rasterising what the camera sees: a constant, pixels, and triangles.
    View,
    /// Shadow maps: a constant. Nothing is kept from the frame before, as settings change.
    ShadowMaps,
    /// The cube map, its second layer and its pyramid: a constant, faces, triangles, and faces of the
    /// second layer.
    Map,
    /// The near region's tree: a constant, the triangles in it, and those of objects that reach into it.
    Tree,
    /// Shading what the camera sees: pixels, and steps of shadow rays and of rays of ambient occlusion
    /// from points in the near region, the latter also by their length.
    Shading,
    /// Following rays: a constant, rays, their steps, and steps of rays of ambient occlusion where they
    /// end.
    Rays,
}

impl Part {
    /// All parts in the order of a frame.
    pub const ALL: [Self; 6] =
        [Self::View, Self::ShadowMaps, Self::Map, Self::Tree, Self::Shading, Self::Rays];

    const fn of(stage: Stage) -> Self {
        match stage {
            Stage::PrimaryShading => Self::Shading,
            Stage::RayTraversal => Self::Rays,
            Stage::Effect(Effect::ShadowMaps) => Self::ShadowMaps,
            Stage::Effect(Effect::CubeFace(_) | Effect::SecondLayer | Effect::DepthPyramid) => {
                Self::Map
            }
            Stage::Effect(Effect::NearRegion) => Self::Tree,
            _ => Self::View,
        }
    }

    /// What the part has to do. Units are millions of pixels, of triangles, and of steps of rays.
    fn counts(self, settings: &Settings, size: [u32; 2], work: &ViewWork) -> [f64; COUNTS] {
        let flag = |is: bool| f64::from(u8::from(is));
        let pixels = 1e-6 * f64::from(size[0]) * f64::from(size[1]);
        let planned = work.planned(settings);
        let follows = flag(planned.follows);
        let occlusion = f64::from(settings.occlusion_rays);
        let traced = if settings.shadows == Shadows::Traced { f64::from(work.lights) } else { 0.0 };
        // Of one ray of ambient occlusion, by its length.
        let longer = f64::from(settings.occlusion_radius / ViewWork::OCCLUSION_RADIUS);
        match self {
            Self::View => [1.0, pixels, 1e-6 * planned.view_triangles as f64, 0.0],
            Self::ShadowMaps => {
                [flag(settings.shadows != Shadows::None && work.lights > 0), 0.0, 0.0, 0.0]
            }
            Self::Map => {
                let faces = f64::from(planned.faces);
                let again = flag(planned.second_layer) * faces;
                [follows, faces, 1e-6 * planned.face_triangles as f64, again]
            }
            Self::Tree => {
                let needed = flag(planned.follows || occlusion > 0.0 || traced > 0.0);
                let built = 1e-6 * work.near_triangles(settings);
                [needed, needed * built, needed * 1e-6 * work.culled_triangles(settings), 0.0]
            }
            Self::Shading => {
                let shadows = pixels * work.visible * work.near_share(settings) * traced;
                let steps = pixels * occlusion * work.near_occlusion_steps(settings);
                [pixels, shadows * work.ray_steps, steps, steps * longer]
            }
            Self::Rays => {
                let rays = follows * pixels * work.rays_up_to(settings.max_depth);
                let steps = work.near_occlusion_steps(settings) / work.visible.max(1e-3);
                [follows, rays, rays * work.ray_steps, rays * occlusion * steps]
            }
        }
    }
}

/// A frame that was drawn, to fit the model to.
#[derive(Clone, Debug)]
pub struct DrawnFrame {
    /// What it was drawn with.
    pub settings: Settings,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// What its view asked for.
    pub work: Arc<ViewWork>,
    /// What it took.
    pub report: FrameReport,
}

impl DrawnFrame {
    /// Milliseconds of each part on the GPU, in the order of [`Part::ALL`]; `None` if the device has no
    /// timestamps.
    #[must_use]
    pub fn parts(&self) -> Option<[f64; Part::ALL.len()]> {
        let mut parts = [0.0; Part::ALL.len()];
        for stage in &self.report.stages {
            parts[Part::of(stage.stage) as usize] += 1e3 * stage.gpu_time?.as_secs_f64();
        }
        Some(parts)
    }
}

/// Milliseconds of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Prediction {
    /// Of each part, in the order of [`Part::ALL`].
    pub parts: [f64; Part::ALL.len()],
}

impl Prediction {
    /// Of the whole frame.
    #[must_use]
    pub fn milliseconds(&self) -> f64 {
        self.parts.iter().sum()
    }
}

/// What frames take on a device, in one scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HybridModel {
    /// Milliseconds a unit of each count of each part.
    coefficients: [[f64; COUNTS]; Part::ALL.len()],
}

impl HybridModel {
    /// Fits the model: for each part the coefficients that are not negative and leave the least squared
    /// error relative to the time of the whole frame. A dozen frames with different settings in
    /// two or three views will do; what no frame had costs nothing.
    ///
    /// # Errors
    /// [`HybridModelError::NoFrames`] and [`HybridModelError::NoTimes`].
    pub fn fit(frames: &[DrawnFrame]) -> Result<Self, HybridModelError> {
        if frames.is_empty() {
            return Err(HybridModelError::NoFrames);
        }
        let times = frames.iter().enumerate().map(|(frame, drawn)| {
            let parts = drawn.parts().ok_or(HybridModelError::NoTimes { frame })?;
            let whole: f64 = parts.iter().sum();
            if whole > 0.0 { Ok((parts, whole)) } else { Err(HybridModelError::NoTimes { frame }) }
        });
        let times = times.collect::<Result<Vec<_>, _>>()?;
        let coefficients = Part::ALL.map(|part| {
            let rows = frames.iter().zip(&times).map(|(drawn, (parts, whole))| Row {
                features: part.counts(&drawn.settings, drawn.size, &drawn.work),
                value: parts[part as usize],
                weight: (whole * whole).recip(),
            });
            least_squares(rows, RIDGE)
        });
        Ok(Self { coefficients })
    }

    /// What a frame of this size will take. Takes about a microsecond.
    #[must_use]
    pub fn predict(&self, settings: &Settings, size: [u32; 2], work: &ViewWork) -> Prediction {
        let parts = Part::ALL.map(|part| {
            let counts = part.counts(settings, size, work);
            counts.iter().zip(&self.coefficients[part as usize]).map(|(n, ms)| n * ms).sum()
        });
        Prediction { parts }
    }

    /// Counts of a frame in a row: features for a regression that has no model.
    #[must_use]
    pub fn features(settings: &Settings, size: [u32; 2], work: &ViewWork) -> [f64; 8] {
        let of = |part: Part| part.counts(settings, size, work);
        let [_, pixels, ..] = of(Part::View);
        let [_, shadows, occlusion, _] = of(Part::Shading);
        let [follows, rays, steps, occluded] = of(Part::Rays);
        let [_, triangles, ..] = of(Part::Tree);
        [1.0, pixels, shadows, occlusion, follows, rays + steps, occluded, triangles]
    }
}
