//! The workload of a view, sampled on the CPU at low resolution: Paper I of the thesis, sections
//! 4.1 to 4.3.

mod sampler;
mod view;
mod worker;

pub use sampler::{CountingKernel, Pattern, Sampling};
pub use view::{LightSample, View};
pub use worker::{Answered, Background, BackgroundSampler, Sampled, SampledScene};

use crate::program::{ModelError, check};
use serde::{Deserialize, Serialize};

/// What the rays of a view do, on average over its pixels. Symbols are those of the paper's Table
/// 5.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Workload {
    /// `p_t`: traversal steps of a primary ray: inner nodes whose children were tested.
    pub primary_traversals: f64,
    /// `p_i`: triangles that a primary ray tests.
    pub primary_intersections: f64,
    /// `t_v`: visible triangles a pixel: the share of primary rays that hit, 0 to 1.
    pub visible_triangles: f64,
    /// `a_t`: traversal steps a pixel that one AO ray of each visible point takes. Pixels without a
    /// visible point count with none, so that `a_t·a_r` adds to `p_t`.
    pub ao_traversals: f64,
    /// `a_w`: triangles that an AO ray tests, from a visible point. `a_w·t_v·a_r` adds to `p_i`.
    pub ao_intersections: f64,
    /// `m`: the coalescing estimate, 0 to 1: of the rays of a region, those that end at a node at
    /// which another ray of the region ended before.
    pub coalescing: f64,
    /// Traversal steps a pixel of the shadow rays of each visible point, to all lights together.
    /// Not in the paper.
    pub shadow_traversals: f64,
    /// Triangles a pixel that those test. Not in the paper.
    pub shadow_intersections: f64,
    /// Shadow rays a pixel: visible points times the lights that they face. Not in the paper.
    pub shadow_rays: f64,
    /// How much longer the primary ray of a region takes that takes longest than the mean one, at least
    /// 0: threads of a warp wait for each other. Of adjacent pixels with [`Pattern::Blocks`]; others
    /// find more. Not in the paper.
    pub primary_divergence: f64,
    /// The same of shadow and AO rays. Pixels without a visible point have none, and wait for those that
    /// have. Not in the paper.
    pub secondary_divergence: f64,
    /// Primary rays that were sampled.
    pub samples: u32,
}

impl Workload {
    /// True if no primary ray hit anything: what is there for AO and shadow rays is unknown then,
    /// and costs nothing.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.visible_triangles == 0.0
    }

    /// Numbers that a model can use.
    ///
    /// # Errors
    /// [`ModelError::OutOfRange`] names the first that is not one.
    pub fn check(&self) -> Result<(), ModelError> {
        for (field, value) in [
            ("primary_traversals", self.primary_traversals),
            ("primary_intersections", self.primary_intersections),
            ("visible_triangles", self.visible_triangles),
            ("ao_traversals", self.ao_traversals),
            ("ao_intersections", self.ao_intersections),
            ("shadow_traversals", self.shadow_traversals),
            ("shadow_intersections", self.shadow_intersections),
            ("shadow_rays", self.shadow_rays),
            ("primary_divergence", self.primary_divergence),
            ("secondary_divergence", self.secondary_divergence),
        ] {
            check(field, value, 0.0, 1e9, "between 0 and 1e9")?;
        }
        check("coalescing", self.coalescing, 0.0, 1.0, "between 0 and 1")
    }
}
