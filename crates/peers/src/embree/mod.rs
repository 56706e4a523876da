//! Embree, found at run time.
//!
//! Two ways to compare with it: [`EmbreeScene`] answers rays with Embree's own wide trees and
//! kernels, and [`Embree::build_bvh`] brings the binary trees of its builders into [`Bvh`]s for
//! any other kernel.
//!
//! [`Bvh`]: niwaki_core::Bvh

mod build;
mod device;
mod error;
mod ffi;
mod scene;

pub use build::EmbreeBvhSettings;
pub use device::{Embree, EmbreeSettings, EmbreeVersion, LIBRARY_NAMES};
pub use scene::EmbreeScene;

use crate::PeerError;

/// How much time Embree spends on a tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Quality {
    /// Morton codes: for geometry that changes every frame.
    Low,
    /// Binned surface area heuristic; Embree's default.
    #[default]
    Medium,
    /// Binned surface area heuristic with spatial splits.
    High,
}

impl Quality {
    /// All, from fast to good.
    pub const ALL: [Self; 3] = [Self::Low, Self::Medium, Self::High];
    /// Their names, in the order of [`Quality::ALL`].
    pub const NAMES: &[&str] = &["low", "medium", "high"];

    /// The name in tables and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Low => "low",
            Self::Medium => "medium",
            Self::High => "high",
        }
    }
}

impl std::str::FromStr for Quality {
    type Err = PeerError;

    fn from_str(name: &str) -> Result<Self, PeerError> {
        Self::ALL.into_iter().find(|quality| quality.name() == name).ok_or_else(|| {
            PeerError::UnknownName {
                what: "Embree build quality",
                name: name.to_owned(),
                known: Self::NAMES,
            }
        })
    }
}
