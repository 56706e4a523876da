//! Why a scene was not made.

use crate::Kernel;
use niwaki_wide::CollapseError;

/// Why a scene was not made.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// The tree names a triangle that the mesh does not have. Remedy: give the mesh that the
    /// tree was built over.
    #[error("the tree refers to triangle {prim_id}, but the mesh has {triangles}")]
    NoSuchTriangle {
        /// One such id.
        prim_id: u32,
        /// How many triangles there are.
        triangles: usize,
    },
    /// The binary tree is not well formed or too large. Remedy: as the cause says.
    #[error(transparent)]
    Collapse(#[from] CollapseError),
    /// This processor lacks the instructions of the kernel, or there is none for the width of the
    /// tree. Remedy: choose one of [`crate::WideScene::kernels`].
    #[error("the {0} kernel does not trace this width, or this processor cannot run it")]
    KernelUnavailable(Kernel),
}
