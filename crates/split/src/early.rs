//! Early split clipping (Ernst and Greiner 2007).

use crate::partition::{check_max_extra, max_references};
use crate::pieces::{halve, memory_bound, within};
use crate::pre_split::{PreSplitter, check_count};
use niwaki_core::{Aabb, BoxClip, BuildError, Clip, PrimRef, TriangleMesh, scene_bounds};

/// Early split clipping (Ernst and Greiner 2007, "Early Split Clipping for Bounding Volume
/// Hierarchies"): every reference whose box has more than a given surface area is cut in the middle
/// of the box's longest edge, and so are its halves.
///
/// The threshold has to be tuned by hand for every scene, and nothing but the size of a box
/// matters: thesis paper V, section 2, has what is wrong with that.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EarlySplit {
    /// The surface area above which boxes are cut, as a fraction of that of the scene's box.
    /// Finite and positive.
    pub max_area: f32,
    /// The most references that splitting adds, as a fraction of the input. If the threshold
    /// would add more, it is raised by factors of 2^(1/4) until it does not. Finite and not
    /// negative.
    pub max_extra: f32,
}

impl Default for EarlySplit {
    /// A threshold of 2⁻¹² of the scene, and at most as many references again as there were.
    fn default() -> Self {
        Self { max_area: 2.0_f32.powi(-12), max_extra: 1.0 }
    }
}

impl EarlySplit {
    fn check(&self) -> Result<(), BuildError> {
        check_positive("max_area", self.max_area)?;
        check_max_extra(self.max_extra)
    }

    fn split<C: Clip>(
        &self,
        count: usize,
        scene: &Aabb,
        prim: impl Fn(usize) -> PrimRef + Sync,
        clip: &C,
    ) -> Result<Vec<PrimRef>, BuildError> {
        check_count(count)?;
        let threshold = scene.area() * f64::from(self.max_area);
        let most = self.max_references(count);
        Ok(within(count, most, threshold, doublings(self.max_area), |i, threshold, emit| {
            halve(prim(i), clip, threshold, Aabb::area, emit);
        }))
    }
}

/// Doublings of a threshold that lead from a fraction of the scene to all of it.
pub(crate) fn doublings(fraction: f32) -> u32 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "0 to 149 for positive numbers"
    )]
    let doublings = (-fraction.log2()).ceil().max(0.0) as u32;
    doublings + 1
}

pub(crate) fn check_positive(setting: &'static str, value: f32) -> Result<(), BuildError> {
    if !(value.is_finite() && value > 0.0) {
        return Err(BuildError::BadSetting {
            setting,
            value: value.to_string(),
            remedy: "a fraction of the scene, finite and positive",
        });
    }
    Ok(())
}

impl PreSplitter for EarlySplit {
    /// `esc`.
    fn suffix(&self) -> &'static str {
        "esc"
    }

    fn split_mesh(&self, mesh: &TriangleMesh) -> Result<Vec<PrimRef>, BuildError> {
        self.check()?;
        let prims = mesh.prim_refs();
        self.split(prims.len(), &mesh.bounds(), |i| prims[i], mesh)
    }

    fn split_boxes(&self, prims: &[PrimRef]) -> Result<Vec<PrimRef>, BuildError> {
        self.check()?;
        let scene = scene_bounds(prims)?.bounds;
        self.split(prims.len(), &scene, |i| prims[i], &BoxClip)
    }

    fn max_references(&self, count: usize) -> usize {
        max_references(count, self.max_extra)
    }

    fn memory_bound(&self, count: usize) -> usize {
        memory_bound(count, self.max_references(count))
    }
}
