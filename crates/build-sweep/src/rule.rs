//! What a split costs and when a node becomes a leaf.

use niwaki_core::builder::check_max_leaf_size;
use niwaki_core::{AreaScale, BuildError, SahConstants};

/// Decides between leaf and split. Built by [`SplitRule::by_cost`] or [`SplitRule::to_the_end`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplitRule {
    pub(crate) inner: f32,
    pub(crate) leaf: f32,
    pub(crate) triangle: f32,
    pub(crate) max_leaf_size: usize,
    pub(crate) always_split: bool,
    pub(crate) scale: AreaScale,
}

/// What to do with a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Decision {
    Leaf,
    /// Split where the sweep found the lowest cost.
    Best,
    /// No split lowers the cost, but the node may not stay whole: halve it by order.
    Halve,
}

impl SplitRule {
    /// The default of [`SplitRule::by_cost`]'s second argument.
    pub const DEFAULT_MAX_LEAF_SIZE: u32 = 8;

    /// Splits while that is cheaper than a leaf (thesis paper IV, equation 2, children counted as
    /// leaves), and where a node holds more than `max_leaf_size` primitives.
    ///
    /// # Errors
    /// [`BuildError::BadSetting`] if a constant is negative or not finite or `max_leaf_size` is 0.
    pub fn by_cost(constants: SahConstants, max_leaf_size: u32) -> Result<Self, BuildError> {
        for (setting, value) in [
            ("constants.inner", constants.inner),
            ("constants.leaf", constants.leaf),
            ("constants.triangle", constants.triangle),
        ] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(BuildError::BadSetting {
                    setting,
                    value: value.to_string(),
                    remedy: "costs are finite and not negative",
                });
            }
        }
        check_max_leaf_size(max_leaf_size as usize)?;
        Ok(Self {
            inner: constants.inner,
            leaf: constants.leaf,
            triangle: constants.triangle,
            max_leaf_size: max_leaf_size as usize,
            always_split: false,
            scale: AreaScale::ONE,
        })
    }

    /// Splits down to single primitives, always at the lowest `A(l)·N(l) + A(r)·N(r)`: the top
    /// tree of Bonsai, whose primitives are mini trees (thesis paper IV, section 5.5).
    #[must_use]
    pub const fn to_the_end() -> Self {
        Self {
            inner: 0.0,
            leaf: 0.0,
            triangle: 1.0,
            max_leaf_size: 1,
            always_split: true,
            scale: AreaScale::ONE,
        }
    }

    /// The same rule with areas formed at another scale; [`niwaki_core::SceneBounds`] has the one
    /// that a scene needs.
    #[must_use]
    pub const fn with_scale(self, scale: AreaScale) -> Self {
        Self { scale, ..self }
    }

    /// Cost per area of a leaf with `count` primitives.
    #[inline]
    pub(crate) fn weight(&self, count: usize) -> f32 {
        self.leaf + self.triangle * count as f32
    }

    /// True if no split of `count` primitives can be cheaper than a leaf, whatever their boxes.
    #[inline]
    pub(crate) fn is_leaf_by_count(&self, count: usize) -> bool {
        count == 1
            || (!self.always_split
                && count <= self.max_leaf_size
                && self.weight(count) <= self.inner)
    }

    /// The decision for a node of `count ≥ 2` primitives and (half) area `area` whose cheapest
    /// split costs `best` without the traversal of the node itself.
    #[inline]
    pub(crate) fn decide(&self, count: usize, area: f32, best: f32) -> Decision {
        let leaf = area * self.weight(count);
        if !self.always_split && count <= self.max_leaf_size {
            // Written so that a cost that is not a number ends in a leaf.
            return if self.inner * area + best < leaf { Decision::Best } else { Decision::Leaf };
        }
        // A split that gains nothing (equal boxes, no area) would go to one side, node after
        // node, and take quadratic time.
        if best < leaf { Decision::Best } else { Decision::Halve }
    }
}
