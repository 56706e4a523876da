//! What a frame took.

use crate::Effect;
use niwaki_render::Image;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// What kernels counted. All zero where nothing was followed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counters {
    /// Pixels that show a surface.
    pub primary_pixels: u64,
    /// Pixels whose surface sends rays on.
    pub spawning_pixels: u64,
    /// Reflected rays.
    pub reflected_rays: u64,
    /// Refracted rays.
    pub refracted_rays: u64,
    /// Rays that went straight on behind blended surfaces.
    pub continued_rays: u64,
    /// Rays to lights.
    pub shadow_rays: u64,
    /// How often a ray went through the tree of the near region, shadow rays aside.
    pub tree_traversals: u64,
    /// How often a ray was marched through a face.
    pub face_marches: u64,
    /// Pixels of the cube map that those marches looked at.
    pub march_samples: u64,
    /// How often a ray went from a face to its neighbour.
    pub face_hops: u64,
    /// How often a ray came back from a face into the near region.
    pub region_returns: u64,
    /// Rays that met a triangle of the near region.
    pub tree_hits: u64,
    /// Rays that met a surface of the cube map.
    pub map_hits: u64,
    /// Rays that ended in the sky.
    pub sky_misses: u64,
    /// Rays that ended in the sky after they had passed behind a surface of the map.
    pub behind_misses: u64,
    /// Rays that were left out at [`Settings::max_rays`](crate::Settings::max_rays).
    pub cut_rays: u64,
    /// Cells of the depth pyramid that marches looked at.
    pub pyramid_cells: u64,
    /// Rays that met a surface of the cube map's second layer; they count in `map_hits` too.
    pub second_layer_hits: u64,
    /// Rays that looked for what holds ambient light back.
    pub occlusion_rays: u64,
}

impl Counters {
    /// Number of counters; each takes two words on the GPU.
    pub(crate) const COUNT: usize = 19;

    pub(crate) fn from_words(words: &[u32]) -> Self {
        let n = |i: usize| {
            let word = |k: usize| u64::from(words.get(2 * i + k).copied().unwrap_or(0));
            word(0) | word(1) << 32
        };
        Self {
            primary_pixels: n(0),
            spawning_pixels: n(1),
            reflected_rays: n(2),
            refracted_rays: n(3),
            continued_rays: n(4),
            shadow_rays: n(5),
            tree_traversals: n(6),
            face_marches: n(7),
            march_samples: n(8),
            face_hops: n(9),
            region_returns: n(10),
            tree_hits: n(11),
            map_hits: n(12),
            sky_misses: n(13),
            behind_misses: n(14),
            cut_rays: n(15),
            pyramid_cells: n(16),
            second_layer_hits: n(17),
            occlusion_rays: n(18),
        }
    }
}

/// The commands of a frame: a part of the GPU's work that is timed as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Stage {
    /// The work of one effect.
    Effect(Effect),
    /// Shading what the primary view shows.
    PrimaryShading,
    /// Following rays.
    RayTraversal,
}

impl std::fmt::Display for Stage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Effect(effect) => effect.fmt(f),
            Self::PrimaryShading => f.pad("primary shading"),
            Self::RayTraversal => f.pad("ray traversal"),
        }
    }
}

/// What a stage was given to do, and how long it took.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StageReport {
    /// Which.
    pub stage: Stage,
    /// Draw commands.
    pub draws: u32,
    /// Dispatches of kernels.
    pub dispatches: u32,
    /// Time on the GPU; `None` on devices without timestamps.
    pub gpu_time: Option<Duration>,
}

impl From<niwaki_gpu_frame::Timed<Stage>> for StageReport {
    fn from(timed: niwaki_gpu_frame::Timed<Stage>) -> Self {
        let gpu_time = timed.gpu_time();
        let niwaki_gpu_frame::Timed { stage, draws, dispatches, .. } = timed;
        Self { stage, draws, dispatches, gpu_time }
    }
}

/// What a frame took. Stages that were skipped are not listed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameReport {
    /// The stages that were given work, in order.
    pub stages: Vec<StageReport>,
    /// What kernels counted.
    pub counters: Counters,
    /// Triangles in the tree of the near region.
    pub region_triangles: u32,
    /// Time from the call to the end of the GPU's work.
    pub total: Duration,
}

impl FrameReport {
    /// What a stage took; `None` if it was given nothing to do.
    #[must_use]
    pub fn stage(&self, stage: Stage) -> Option<&StageReport> {
        self.stages.iter().find(|s| s.stage == stage)
    }
}

/// A frame: its image (linear, not tone-mapped), its plan and what it took.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Linear RGB, rows from the top.
    pub image: Image,
    /// What was decided.
    pub plan: crate::EffectPlan,
    /// What it took.
    pub report: FrameReport,
}
