//! Why a tree could not be collapsed.

/// Why a tree was refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CollapseError {
    /// An inner node's children are missing or stand before it, a leaf's range leaves
    /// [`niwaki_core::Bvh::prim_ids`], or nodes are reached so often that more references result
    /// than there are. (A node with two parents may go unnoticed otherwise; the result is sound
    /// all the same.) Remedy: correct the builder; `niwaki_metrics::validate` names every fault.
    #[error("node {node} of {nodes} is not part of a well-formed tree")]
    Malformed {
        /// The node at which the fault showed.
        node: usize,
        /// How many nodes the tree has.
        nodes: usize,
    },
    /// More primitive references than a leaf can address. Remedy: split primitives less, or build
    /// several trees.
    #[error("{count} primitive references are more than the {max} that a wide tree can address")]
    TooManyReferences {
        /// How many the tree has.
        count: usize,
        /// How many are allowed: [`crate::WideBvh::MAX_REFERENCES`].
        max: usize,
    },
    /// A setting is out of its range. Remedy: see the field's documentation.
    #[error("collapse setting `{setting}` is {value}: {remedy}")]
    BadSetting {
        /// The field.
        setting: &'static str,
        /// What it holds.
        value: String,
        /// What it may hold.
        remedy: &'static str,
    },
}
