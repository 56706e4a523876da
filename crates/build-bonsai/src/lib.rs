//! Bonsai BVH builder: mini trees, pruning and a top tree (Ganestam, Barringer, Doggett and
//! Akenine-Möller 2015; thesis paper IV, sections 5 and 6).
//!
//! ```
//! use niwaki_build_bonsai::Bonsai;
//! use niwaki_core::{Builder, TriangleMesh, glam::Vec3};
//!
//! let positions: Vec<Vec3> = (0..3000_u32)
//!     .map(|i| Vec3::new((i % 61) as f32, (i % 53) as f32, (i % 47) as f32))
//!     .collect();
//! let indices = (0..1000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
//! let mesh = TriangleMesh::new(positions, indices)?;
//! let bvh = Bonsai::bonsai_p().build_mesh(&mesh)?;
//! assert_eq!(bvh.prim_ids.len(), 1000);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The five steps of the paper:
//!
//! 1. *Midpoints.* The middle of the box of every triangle.
//! 2. *Mini tree selection.* The midpoints are halved in space along the longest axis of their
//!    bounds until no group holds more than [`Bonsai::mini_tree_size`].
//! 3. *Mini trees.* A full sweep SAH tree over each group, in memory that stays in the cache.
//! 4. *Pruning* (optional). Mini trees that are large compared with the others are cut up; the
//!    pieces are mini trees of their own.
//! 5. *Top tree.* A full sweep SAH tree whose leaves are the mini trees.
//!
//! [`Bonsai::bonsai_s`] puts split partitioning (thesis paper V, [`niwaki_split`]) in the place of the
//! first two steps: groups then hold references, of which a triangle across a border may have several,
//! but never two in one group.
//!
//! There are no feature flags.

mod assemble;
mod mini;
mod prune;
mod timings;

pub use timings::Timings;

use mini::Batch;
use niwaki_build_sweep::{Kernel, SplitRule, SweepWorkspace, build_tree, tree_memory_bound};
use niwaki_core::builder::MAX_PRIMS;
use niwaki_core::midpoint::{Midpoints, Selection, Source, select};
use niwaki_core::{
    AreaScale, BuildError, Builder, Bvh, PrimRef, SahConstants, TriangleMesh, scene_bounds,
};
use niwaki_split::{GroupSize, Partition, SplitPartition};

/// When a mini tree is cut up (thesis paper IV, section 5.4).
///
/// Pruning walks down from the root of every mini tree whose surface area is over a threshold T to
/// the first nodes that are not: those become mini trees. Leaves end the walk.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Pruning {
    /// Mini trees stay as they were built.
    Off,
    /// T is this fraction of the *mean* surface area of the mini tree roots; the paper uses 0.1 and
    /// 0.01. Finite and not negative; 0 cuts every mini tree down to its leaves, or to
    /// nodes whose boxes have no area where those come first.
    Mean(f32),
    /// T is the *mean* plus this many *standard deviations* of the surface areas of the mini tree
    /// roots, at least 0. Finite; may be negative.
    ///
    /// Not the paper's formula: for future work it proposes a fraction of the standard deviation
    /// alone, so that pruning spares evenly tessellated scenes. Root areas vary little there, so
    /// that T would be far below all of them and cut every mini tree up. Counted from the mean,
    /// T cuts only those that stand out.
    Deviation(f32),
}

/// The Bonsai builder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bonsai {
    /// N, the most triangles of a mini tree; from 1 to 65536.
    pub mini_tree_size: u32,
    /// Whether and how mini trees are cut up.
    pub pruning: Pruning,
    /// Groups triangles by split partitioning (thesis paper V) instead of by their midpoints:
    /// those that overlap a border may get a reference on either side of it. Its group size
    /// takes the place of [`Bonsai::mini_tree_size`].
    pub split: Option<SplitPartition>,
    /// SAH constants of the mini trees: finite and not negative. The top tree always splits.
    pub constants: SahConstants,
    /// A node of a mini tree with more primitives is split even where a leaf would be cheaper; at
    /// least 1.
    pub max_leaf_size: u32,
    /// Instruction set of the sweep; by default the best that this machine has. Trees do not
    /// depend on it.
    pub kernel: Kernel,
}

impl Default for Bonsai {
    /// [`Bonsai::bonsai_p`], the paper's balance of build time and quality.
    fn default() -> Self {
        Self::bonsai_p()
    }
}

impl Bonsai {
    /// The largest [`Bonsai::mini_tree_size`].
    pub const MAX_MINI_TREE_SIZE: u32 = 1 << 16;

    /// The paper's *Bonsai*: mini trees of up to 512 triangles, no pruning. The fastest build.
    #[must_use]
    #[expect(clippy::self_named_constructors, reason = "the paper's name for this preset")]
    pub fn bonsai() -> Self {
        Self {
            mini_tree_size: 512,
            pruning: Pruning::Off,
            split: None,
            constants: SahConstants::default(),
            max_leaf_size: SplitRule::DEFAULT_MAX_LEAF_SIZE,
            kernel: Kernel::best(),
        }
    }

    /// The paper's *Bonsai P*: mini trees of up to 512 triangles, threshold 0.1 of the mean.
    #[must_use]
    pub fn bonsai_p() -> Self {
        Self { pruning: Pruning::Mean(0.1), ..Self::bonsai() }
    }

    /// The paper's *Bonsai P\**: mini trees of up to 4096 triangles, threshold 0.01 of the mean.
    /// The best quality.
    #[must_use]
    pub fn bonsai_p_star() -> Self {
        Self { mini_tree_size: 4096, pruning: Pruning::Mean(0.01), ..Self::bonsai() }
    }

    /// Paper V's *Bonsai S*: groups by SAH-guided split partitioning, pruning as in
    /// [`Bonsai::bonsai_p`].
    ///
    /// Splits have to gain 1.5 times what they add in references
    /// ([`SplitPartition::reference_cost`]; the paper asks for no such gain). On evenly tessellated
    /// scenes that leaves well under 2 % of extra references, where the paper's rule adds 6 % to no
    /// use, and about two thirds of them on others at the same SAH.
    #[must_use]
    pub fn bonsai_s() -> Self {
        let split = SplitPartition { reference_cost: 1.5, ..SplitPartition::default() };
        Self { split: Some(split), ..Self::bonsai_p() }
    }

    /// Builds a tree over a mesh and reports what each step took.
    ///
    /// # Errors
    /// As [`Builder::build_mesh`].
    pub fn build_mesh_timed(&self, mesh: &TriangleMesh) -> Result<(Bvh, Timings), BuildError> {
        let rule = self.rule()?;
        check_count(mesh.len())?;
        match &self.split {
            None => Ok(self.run(mesh, rule)),
            Some(split) => self.run_split(|| split.partition_mesh(mesh), rule),
        }
    }

    /// Builds a tree over references and reports what each step took.
    ///
    /// # Errors
    /// As [`Builder::build`].
    pub fn build_timed(&self, prims: &[PrimRef]) -> Result<(Bvh, Timings), BuildError> {
        let rule = self.rule()?;
        match &self.split {
            None => {
                scene_bounds(prims)?;
                Ok(self.run(prims, rule))
            }
            Some(split) => self.run_split(|| split.partition_boxes(prims), rule),
        }
    }

    fn rule(&self) -> Result<SplitRule, BuildError> {
        if !(1..=Self::MAX_MINI_TREE_SIZE).contains(&self.mini_tree_size) {
            return Err(BuildError::BadSetting {
                setting: "mini_tree_size",
                value: self.mini_tree_size.to_string(),
                remedy: "from 1 to 65536 triangles",
            });
        }
        if let Some(split) = &self.split
            && let GroupSize::Fixed(size) = split.group_size
            && size > Self::MAX_MINI_TREE_SIZE
        {
            return Err(BuildError::BadSetting {
                setting: "split.group_size",
                value: size.to_string(),
                remedy: "from 1 to 65536 triangles",
            });
        }
        let (value, good) = match self.pruning {
            Pruning::Off => (0.0, true),
            Pruning::Mean(f) => (f, f.is_finite() && f >= 0.0),
            Pruning::Deviation(f) => (f, f.is_finite()),
        };
        if !good {
            return Err(BuildError::BadSetting {
                setting: "pruning",
                value: value.to_string(),
                remedy: "a finite number, for `Mean` not negative",
            });
        }
        SplitRule::by_cost(self.constants, self.max_leaf_size)
    }

    fn run<S: Source + ?Sized>(&self, source: &S, rule: SplitRule) -> (Bvh, Timings) {
        let mut timings = Timings::default();
        let count = source.count();
        if count == 0 {
            return (Bvh::default(), timings);
        }
        let mut clock = timings::Clock::start();
        let midpoints = Midpoints::of(source);
        let scale = AreaScale::of(&midpoints.scene);
        let rule = rule.with_scale(scale);
        timings.midpoints = clock.lap();
        let size = (self.mini_tree_size as usize).min(count);
        let Selection { mut ids, groups } = select(midpoints, size);
        timings.selection = clock.lap();
        let build = mini::Build { rule: &rule, kernel: self.kernel, size };
        let minis = build.over_source(source, &groups, &mut ids);
        timings.mini_trees = clock.lap();
        (self.join(&minis, &ids, scale, clock, &mut timings), timings)
    }

    /// As [`Bonsai::run`] with groups from split partitioning.
    fn run_split(
        &self,
        partition: impl FnOnce() -> Result<Partition, BuildError>,
        rule: SplitRule,
    ) -> Result<(Bvh, Timings), BuildError> {
        let mut timings = Timings::default();
        let mut clock = timings::Clock::start();
        let partition = partition()?;
        timings.selection = clock.lap();
        let count = partition.references();
        if count == 0 {
            return Ok((Bvh::default(), timings));
        }
        let scale = AreaScale::of(&partition.bounds());
        let rule = rule.with_scale(scale);
        let size = partition.groups().map(|group| group.len()).max().unwrap_or(0);
        let mut ids = vec![0; count];
        let build = mini::Build { rule: &rule, kernel: self.kernel, size };
        let minis = build.over_groups(partition.groups(), &mut ids);
        drop(partition);
        timings.mini_trees = clock.lap();
        Ok((self.join(&minis, &ids, scale, clock, &mut timings), timings))
    }

    /// Pruning, top tree and assembly.
    fn join(
        &self,
        minis: &[Batch],
        ids: &[u32],
        scale: AreaScale,
        mut clock: timings::Clock,
        timings: &mut Timings,
    ) -> Bvh {
        let roots = prune::roots(minis, self.pruning, scale);
        timings.pruning = clock.lap();
        let top = build_tree(
            &prune::references(&roots),
            SplitRule::to_the_end().with_scale(scale),
            self.kernel,
        );
        timings.top_tree = clock.lap();
        let bvh = assemble::assemble(&top, &roots, ids);
        timings.assembly = clock.lap();
        bvh
    }
}

impl Builder for Bonsai {
    /// `bonsai`, `bonsai_p`, `bonsai_p_star` or `bonsai_s` for the groups and pruning of these
    /// presets; `bonsai_custom` otherwise.
    fn name(&self) -> &str {
        [
            ("bonsai", Self::bonsai()),
            ("bonsai_p", Self::bonsai_p()),
            ("bonsai_p_star", Self::bonsai_p_star()),
            ("bonsai_s", Self::bonsai_s()),
        ]
        .into_iter()
        .find(|(_, preset)| {
            preset.pruning == self.pruning
                && preset.split == self.split
                && (self.split.is_some() || preset.mini_tree_size == self.mini_tree_size)
        })
        .map_or("bonsai_custom", |(name, _)| name)
    }

    fn build(&self, prims: &[PrimRef]) -> Result<Bvh, BuildError> {
        Ok(self.build_timed(prims)?.0)
    }

    fn build_mesh(&self, mesh: &TriangleMesh) -> Result<Bvh, BuildError> {
        Ok(self.build_mesh_timed(mesh)?.0)
    }

    fn memory_bound(&self, count: usize) -> usize {
        let (grouping, held, count, largest) = match &self.split {
            None => (0, 0, count, self.mini_tree_size as usize),
            Some(split) => {
                let most = split.max_references(count);
                let size = split.group_size.of(count);
                // References stay until mini trees are built over them.
                (split.memory_bound(count), size_of::<PrimRef>() * most, most, size)
            }
        };
        // Nodes of mini trees, and ids.
        let minis = (mini::BYTES + 4) * count;
        let largest = largest.min(count);
        let workspaces = 2
            * rayon::current_num_threads()
            * (SweepWorkspace::bytes(largest) + mini::copy_bytes(largest));
        // If pruning cuts everything into single triangles: a root for each, then either the top
        // tree with its references, or the top tree and the places and nodes of the result.
        let roots = size_of::<prune::Root<'_>>() * count;
        let top = size_of::<PrimRef>() * count + tree_memory_bound(count);
        let assembly = (68 + assemble::PLACE_BYTES + 68) * count;
        let joining = minis + roots + top.max(assembly);
        grouping.max(minis + workspaces + held).max(joining) + 65536
    }
}

const fn check_count(count: usize) -> Result<(), BuildError> {
    if count > MAX_PRIMS {
        return Err(BuildError::TooManyPrimitives { count, max: MAX_PRIMS });
    }
    Ok(())
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
