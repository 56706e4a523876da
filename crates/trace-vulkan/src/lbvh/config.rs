//! Settings and errors.

use crate::GpuError;
use niwaki_core::builder::{check_max_leaf_size, check_sah};
use niwaki_core::{BuildError, SahConstants};

/// Settings of the builder: those of `niwaki_build_lbvh::Lbvh`, with the same meaning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LbvhConfig {
    /// Bits of a Morton code: 30 (10 per axis) or 63 (21 per axis). Default 63. With 30 the sort takes
    /// half the passes, and primitives within a 1024th of the scene are left in arbitrary order.
    pub code_bits: u32,
    /// The most primitives of a leaf, at least 1. Default 4. Subtrees that are no larger become
    /// leaves where [`LbvhConfig::sah`] says that this is not dearer.
    pub max_leaf_size: usize,
    /// Costs that decide which subtrees become leaves. Default [`SahConstants::THESIS_IV`].
    pub sah: SahConstants,
}

impl Default for LbvhConfig {
    fn default() -> Self {
        Self { code_bits: 63, max_leaf_size: 4, sah: SahConstants::default() }
    }
}

impl LbvhConfig {
    /// For scenes that are built every frame: codes of 30 bits.
    #[must_use]
    pub fn every_frame() -> Self {
        Self { code_bits: 30, ..Self::default() }
    }

    pub(super) fn check(&self) -> Result<(), BuildError> {
        if self.code_bits != 30 && self.code_bits != 63 {
            return Err(BuildError::BadSetting {
                setting: "code_bits",
                value: self.code_bits.to_string(),
                remedy: "use 30 or 63",
            });
        }
        check_max_leaf_size(self.max_leaf_size)?;
        check_sah(&self.sah)
    }
}

/// Why a tree was not built on the GPU.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LbvhError {
    /// Primitives or settings are at fault, as on the CPU. Remedy: as the cause says.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The device is. Remedy: as the cause says, or build on the CPU with `niwaki-build-lbvh`.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The number of primitives that a kernel wrote is over the capacity of the workspace; there is no
    /// tree. Remedy: a larger [`crate::LbvhWorkspace`].
    #[error(
        "{count} primitives were counted on the device, but the workspace has room for {capacity}; make a larger one"
    )]
    OverCapacity {
        /// How many there were.
        count: u32,
        /// How many fit.
        capacity: u32,
    },
}
