//! How a binary tree is collapsed.

use crate::CollapseError;

/// How the children of a wide node are chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum CollapseMethod {
    /// The child with the largest surface area is opened until the node is full (thesis section
    /// 3.10; Wald, Benthin and Boulos 2008). One pass from the root down.
    Greedy,
    /// The children that give the least expected cost of the whole wide tree, by dynamic
    /// programming from the leaves up (Ylitie, Karras and Laine 2017, section 3.1). Takes 18 to
    /// 40 % more time for 8-wide trees, and 4·`W` bytes more a binary node while it runs. The
    /// default: its trees are smaller and faster to trace.
    #[default]
    Optimal,
}

/// What visits cost a long random ray, in any unit: only ratios matter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WideCosts {
    /// Testing the boxes of a node: C_n of Ylitie et al. The greedy method does not ask for it,
    /// as it decides about leaves while there are slots left anyway.
    pub node: f32,
    /// Entering a leaf, whatever it holds: one test of a block of triangles.
    pub leaf: f32,
    /// Each reference of a leaf on top: C_p of Ylitie et al. Vectors make the arithmetic of up to
    /// `W` triangles one test, but each takes a part of a cache line more.
    pub reference: f32,
}

impl Default for WideCosts {
    /// 1, 1 and 0.1: measured with the 8-wide kernels of `niwaki-trace`, for which waiting for
    /// memory counts more than arithmetic.
    fn default() -> Self {
        Self { node: 1.0, leaf: 1.0, reference: 0.1 }
    }
}

/// Settings of [`crate::WideBvh::collapse`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CollapseSettings {
    /// How children are chosen. Default: optimally.
    pub method: CollapseMethod,
    /// The most references of a leaf, at least 1. The width of the tree is a limit as well, so
    /// that one vector holds a leaf. Default 16, which leaves the limit to the width.
    pub max_leaf: usize,
    /// What is minimised. A subtree that fits into one leaf is opened all the same where that
    /// lowers the expected cost (and, for the greedy method, while slots last).
    pub costs: WideCosts,
}

impl Default for CollapseSettings {
    fn default() -> Self {
        Self { method: CollapseMethod::default(), max_leaf: 16, costs: WideCosts::default() }
    }
}

impl CollapseSettings {
    /// The default settings with [`CollapseMethod::Greedy`].
    #[must_use]
    pub fn greedy() -> Self {
        Self { method: CollapseMethod::Greedy, ..Self::default() }
    }

    /// The default settings with [`CollapseMethod::Optimal`].
    #[must_use]
    pub fn optimal() -> Self {
        Self { method: CollapseMethod::Optimal, ..Self::default() }
    }

    pub(crate) fn check(&self) -> Result<(), CollapseError> {
        let bad =
            |setting, value, remedy| Err(CollapseError::BadSetting { setting, value, remedy });
        if self.max_leaf == 0 {
            return bad("max_leaf", "0".into(), "a leaf holds at least 1 reference");
        }
        let WideCosts { node, leaf, reference } = self.costs;
        if ![node, leaf, reference].iter().all(|c| c.is_finite() && *c >= 0.0) {
            let value = format!("{:?}", self.costs);
            return bad("costs", value, "costs are finite and not negative");
        }
        Ok(())
    }
}
