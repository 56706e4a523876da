//! Why a pass did not run.

use niwaki_core::BuildError;

/// Why a tree was not optimized. The tree is left as it was.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OptimizeError {
    /// The tree breaks the layout that [`niwaki_core::Bvh`] promises. Remedy: repair what made it;
    /// `niwaki_metrics::validate` names all faults.
    #[error("the tree is broken at node {node}: {fault}")]
    BrokenTree {
        /// Index of the first such node.
        node: usize,
        /// What is wrong there.
        fault: &'static str,
    },
    /// A setting is out of its range. Remedy: see the field's documentation.
    #[error("setting `{setting}` is {value}: {remedy}")]
    BadSetting {
        /// The field.
        setting: &'static str,
        /// What it holds.
        value: String,
        /// What it may hold.
        remedy: &'static str,
    },
    /// The tree names triangles that the mesh does not have. Remedy: give the mesh that the tree
    /// was built over, or one with as many triangles in the same order.
    #[error("the tree holds primitive {prim_id}, but the mesh has only {triangles} triangles")]
    PrimOutOfRange {
        /// The first such id in the order of the leaves.
        prim_id: u32,
        /// Triangles of the mesh.
        triangles: usize,
    },
    /// The builder of a new top tree failed, or split what it was given. Remedy: see the source; a
    /// builder that splits primitives cannot build a top tree over finished subtrees.
    #[error("the top tree could not be built")]
    Build(#[from] BuildError),
}

impl From<OptimizeError> for BuildError {
    fn from(error: OptimizeError) -> Self {
        match error {
            OptimizeError::BrokenTree { node, fault } => Self::BrokenTree { node, fault },
            OptimizeError::BadSetting { setting, value, remedy } => {
                Self::BadSetting { setting, value, remedy }
            }
            OptimizeError::PrimOutOfRange { .. } => {
                Self::BrokenTree { node: 0, fault: "a leaf names a primitive that does not exist" }
            }
            OptimizeError::Build(error) => error,
        }
    }
}
