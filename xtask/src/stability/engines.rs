//! What is tried: every builder of ours under every kernel, and the peers' own structures.

use crate::judge::{each_kernel, each_kernel_of_other_widths, kernel_names};
use crate::registry;
use crate::results::Source;
use anyhow::{Context as _, Result};
use niwaki_core::{Builder, Intersector, TriangleMesh};
use niwaki_peers::{Embree, EmbreeScene, ObvhsKernel, ObvhsPreset, ObvhsScene, Quality};
use niwaki_trace::{BruteForce, Mode};

/// A builder of ours, or a structure of a peer.
pub(crate) enum Engine {
    /// No tree: every triangle is tested.
    BruteForce,
    /// One of ours, traced by all kernels.
    Ours(Box<dyn Builder>),
    /// Embree's structure and kernel.
    Embree { quality: Quality, robust: bool },
    /// The structure and kernel of obvhs.
    Obvhs { preset: ObvhsPreset, kernel: ObvhsKernel },
}

/// The builder whose trees are traced with the most rays.
const MAIN: &str = "bonsai_p";

impl Engine {
    /// Those of ours that the names select, and those of peers.
    pub(crate) fn all(builders: &[String], with_peers: bool) -> Result<Vec<Self>> {
        let mut engines = vec![Self::BruteForce];
        engines.extend(registry::select_ours(builders)?.into_iter().map(Self::Ours));
        if with_peers {
            for robust in [false, true] {
                engines.extend(Quality::ALL.map(|quality| Self::Embree { quality, robust }));
            }
            for kernel in ObvhsKernel::ALL {
                engines.extend(
                    [ObvhsPreset::Fastest, ObvhsPreset::Medium]
                        .map(|preset| Self::Obvhs { preset, kernel }),
                );
            }
        }
        Ok(engines)
    }

    pub(crate) const fn source(&self) -> Source {
        match self {
            Self::BruteForce | Self::Ours(_) => Source::Niwaki,
            Self::Embree { .. } => Source::Embree,
            Self::Obvhs { .. } => Source::Obvhs,
        }
    }

    /// The builder or preset.
    pub(crate) fn name(&self) -> &str {
        match self {
            Self::BruteForce => "none",
            Self::Ours(builder) => builder.name(),
            Self::Embree { quality, .. } => quality.name(),
            Self::Obvhs { preset, .. } => preset.name(),
        }
    }

    /// The name of the kernel, where there is but one.
    pub(crate) const fn kernel(&self) -> Option<&'static str> {
        match self {
            Self::BruteForce | Self::Ours(_) => None,
            Self::Embree { robust: false, .. } => Some("fast"),
            Self::Embree { robust: true, .. } => Some("robust"),
            Self::Obvhs { kernel, .. } => Some(kernel.name()),
        }
    }

    /// All three names, which tell engines apart.
    pub(crate) fn label(&self) -> String {
        format!("{}:{}:{}", self.source().name(), self.name(), self.kernel().unwrap_or("all"))
    }

    /// The names of the kernels that [`Engine::each`] tries.
    pub(crate) fn kernels(&self) -> Vec<String> {
        match self {
            Self::BruteForce => vec!["brute".to_owned(), "brute_fast".to_owned()],
            Self::Ours(_) => kernel_names(self.is_main()),
            _ => self.kernel().into_iter().map(str::to_owned).collect(),
        }
    }

    /// True for the one whose kernels get the most rays at closed surfaces, and which is traced 4
    /// and 16 wide as well.
    pub(crate) fn is_main(&self) -> bool {
        matches!(self, Self::Ours(builder) if builder.name() == MAIN)
    }

    /// Builds its structure over a mesh and calls `f` with each kernel.
    pub(crate) fn each(
        &self,
        mesh: &TriangleMesh,
        embree: Option<&Embree>,
        mut f: impl FnMut(&str, &dyn Intersector),
    ) -> Result<()> {
        let kernel = self.kernel().unwrap_or_default();
        match self {
            Self::BruteForce => {
                for mode in Mode::ALL {
                    let name = if mode == Mode::default() { "brute" } else { "brute_fast" };
                    f(name, &BruteForce::new(mode, mesh));
                }
            }
            Self::Ours(builder) => {
                let bvh = builder.build_mesh(mesh)?;
                each_kernel(&bvh, mesh, |kernel, _, scene| f(kernel, scene))?;
                if self.is_main() {
                    each_kernel_of_other_widths(&bvh, mesh, |kernel, _, scene| f(kernel, scene))?;
                }
            }
            Self::Embree { quality, robust } => {
                let embree = embree.context("Embree is not loaded")?;
                f(kernel, &EmbreeScene::new(embree, mesh, *quality, *robust)?);
            }
            Self::Obvhs { preset, kernel: of } => {
                f(kernel, &ObvhsScene::new(mesh, *preset, *of)?);
            }
        }
        Ok(())
    }
}

/// True for kernels of ours that promise to let nothing out of a closed surface.
pub(crate) fn is_watertight(kernel: &str) -> bool {
    !kernel.ends_with("_fast")
}
