//! The presets and what they are made of.

use crate::CostModel;
use niwaki_build_bonsai::Bonsai;
use niwaki_build_lbvh::Lbvh;
use niwaki_build_sbvh::Sbvh;
use niwaki_core::{BuildError, Builder, Bvh, PrimRef, TriangleMesh};
use niwaki_optimize::{Budget, Chain, Cheapest, CollapseLeaves, Optimized, Reinsertion};
use niwaki_split::{PreSplit, SlackSplit};

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
    /// Large triangles split where that saves most ([`SlackSplit`]), [`Bonsai::bonsai_p`] with one
    /// reference a leaf, eight rounds of [`Reinsertion`], and leaves where they cost least
    /// ([`CollapseLeaves`]).
    High,
    /// Two trees, one as in [`Preset::High`] and one by [`Sbvh`], each after two rounds of
    /// [`Reinsertion`]; the one of lower cost ([`Cheapest`]) gets twelve more and its leaves merged:
    /// for trees that are kept.
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
        let split = SlackSplit::default();
        let references = 1.0 + f64::from(split.max_extra);
        let single_leaves =
            || PreSplit::new(Bonsai { max_leaf_size: 1, ..Bonsai::bonsai_p() }, split);
        let then_collapse =
            |pass: Reinsertion| Chain::new(vec![Box::new(pass), Box::<CollapseLeaves>::default()]);
        match self {
            Self::Fastest => Box::new(Lbvh::default()),
            Self::Fast => Box::new(Bonsai::bonsai_p()),
            Self::Balanced => Box::new(Optimized::new(Bonsai::bonsai_p(), reinsertion(1))),
            Self::High => Box::new(
                Optimized::new(single_leaves(), then_collapse(reinsertion(8)))
                    .with_references_per_prim(references),
            ),
            Self::Best => {
                let few_splits = Optimized::new(single_leaves(), reinsertion(2))
                    .with_references_per_prim(references);
                let sbvh = Sbvh { max_leaf_size: 1, alpha: 1e-3, ..Sbvh::default() };
                let most = f64::from(sbvh.max_references);
                let spatial = Optimized::new(sbvh, reinsertion(2)).with_references_per_prim(most);
                let start = Cheapest::new(few_splits, references).or(spatial, most);
                Box::new(
                    Optimized::new(start, then_collapse(reinsertion(12)))
                        .with_references_per_prim(most.max(references)),
                )
            }
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
