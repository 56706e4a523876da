//! The presets and what they are made of.

use crate::CostModel;
use niwaki_build_bonsai::Bonsai;
use niwaki_build_lbvh::Lbvh;
use niwaki_core::{BuildError, Builder, Bvh, PrimRef, TriangleMesh};
use niwaki_optimize::{Budget, Chain, CollapseLeaves, Insertion, Optimized, Reinsertion};

/// A builder by how much quality is wanted: each builds better trees than the one before, and
/// takes longer. Ordered from fast to good.
///
/// A preset is a [`Builder`]; [`Preset::builder`] gives the one that it stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Preset {
    /// Morton order ([`Lbvh`]): for a few rays a triangle, or a tree a frame.
    Fastest,
    /// [`Bonsai::bonsai_p`]: mini trees with pruning.
    Fast,
    /// [`Bonsai::bonsai_p`] and one round of [`Reinsertion`] of the subtrees that matter most.
    Balanced,
    /// [`Bonsai::bonsai_p`] with one triangle a leaf, eight rounds of [`Reinsertion`], and leaves
    /// where they cost least ([`CollapseLeaves`]).
    High,
    /// As [`Preset::High`] with [`Insertion`] first, which finds what single moves do not, and
    /// twice the rounds: for trees that are kept.
    Best,
}

impl Preset {
    /// All, from fast to good.
    pub const ALL: [Self; 5] = [Self::Fastest, Self::Fast, Self::Balanced, Self::High, Self::Best];

    /// The name in tables and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Fastest => "fastest",
            Self::Fast => "fast",
            Self::Balanced => "balanced",
            Self::High => "high",
            Self::Best => "best",
        }
    }

    /// The preset of a name.
    #[must_use]
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|preset| preset.name() == name)
    }

    /// The preset with the least time for building a tree over `triangles` and tracing `rays`
    /// through it, by [`CostModel::measured`].
    #[must_use]
    pub fn for_rays(rays: u64, triangles: usize) -> Self {
        CostModel::measured().best(rays, triangles)
    }

    /// The builder that it stands for.
    #[must_use]
    pub fn builder(self) -> Box<dyn Builder + Send> {
        let reinsertion = |iterations| Reinsertion {
            budget: Budget::iterations(iterations),
            ..Reinsertion::default()
        };
        let single_leaves = Bonsai { max_leaf_size: 1, ..Bonsai::bonsai_p() };
        match self {
            Self::Fastest => Box::new(Lbvh::default()),
            Self::Fast => Box::new(Bonsai::bonsai_p()),
            Self::Balanced => Box::new(Optimized::new(Bonsai::bonsai_p(), reinsertion(1))),
            Self::High => Box::new(Optimized::new(
                single_leaves,
                Chain::new(vec![Box::new(reinsertion(8)), Box::<CollapseLeaves>::default()]),
            )),
            Self::Best => Box::new(Optimized::new(
                single_leaves,
                Chain::new(vec![
                    Box::<Insertion>::default(),
                    Box::new(reinsertion(16)),
                    Box::<CollapseLeaves>::default(),
                ]),
            )),
        }
    }
}

impl std::fmt::Display for Preset {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.name())
    }
}

impl Builder for Preset {
    fn name(&self) -> &str {
        Self::name(*self)
    }

    fn build(&self, prims: &[PrimRef]) -> Result<Bvh, BuildError> {
        self.builder().build(prims)
    }

    fn build_mesh(&self, mesh: &TriangleMesh) -> Result<Bvh, BuildError> {
        self.builder().build_mesh(mesh)
    }

    fn memory_bound(&self, count: usize) -> usize {
        self.builder().memory_bound(count)
    }
}
