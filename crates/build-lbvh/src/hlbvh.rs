//! Hierarchical linear BVH: Morton treelets under a top tree by the surface area heuristic.

mod top;

use niwaki_core::bottom_up::{Cluster, Forest, LeafRule, Slots};
use niwaki_core::morton::{self, Sorted, common_prefix};
use niwaki_core::{
    BuildError, Builder, Bvh, BvhNode, PrimRef, SahConstants, TriangleMesh, scene_bounds, to_u32,
};
use rayon::prelude::*;

/// The HLBVH builder: primitives whose Morton codes share the upper bits form a treelet, built as
/// a linear BVH; a top tree over the treelets is split by the binned surface area heuristic
/// (Pantaleoni and Luebke 2010, section 4; Garanzha et al. 2011).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hlbvh {
    /// Upper bits of the 63 of a code that the primitives of a treelet share: 1 to 30. Default 15,
    /// a grid of 32³ cells. With more bits, more of the tree is split by the heuristic.
    pub treelet_bits: u32,
    /// Bins along each axis of the top tree: 2 to 256. Default 16.
    pub bins: usize,
    /// The most primitives of a leaf, at least 1. Default 4. Subtrees that are no larger become
    /// leaves where [`Hlbvh::sah`] says that this is not dearer.
    pub max_leaf_size: usize,
    /// Costs that decide which subtrees become leaves. Default [`SahConstants::THESIS_IV`].
    pub sah: SahConstants,
}

impl Default for Hlbvh {
    fn default() -> Self {
        Self { treelet_bits: 15, bins: 16, max_leaf_size: 4, sah: SahConstants::default() }
    }
}

const CODE_BITS: u32 = 63;

impl Hlbvh {
    fn check(&self) -> Result<(), BuildError> {
        if !(1..=30).contains(&self.treelet_bits) {
            return Err(BuildError::BadSetting {
                setting: "treelet_bits",
                value: self.treelet_bits.to_string(),
                remedy: "use 1 to 30",
            });
        }
        if !(2..=256).contains(&self.bins) {
            return Err(BuildError::BadSetting {
                setting: "bins",
                value: self.bins.to_string(),
                remedy: "use 2 to 256",
            });
        }
        Ok(())
    }

    /// Builds from references that are dropped as soon as they are not needed.
    fn run(&self, prims: impl AsRef<[PrimRef]>) -> Result<Bvh, BuildError> {
        self.check()?;
        let refs = prims.as_ref();
        let scene = scene_bounds(refs)?;
        let rule = LeafRule::new(self.max_leaf_size, self.sah, scene.area_scale)?;
        if refs.is_empty() {
            return Ok(Bvh::default());
        }
        let Sorted { codes, mut order } = morton::sort(refs, &scene, CODE_BITS);
        let mut forest = Forest::new(refs.len());

        // Treelets, and the slots of their joins: those of their places.
        let mut treelets = Vec::new();
        let mut firsts = Vec::new();
        let mut rest = forest.slots();
        let mut first = 0;
        while let Some(&code) = codes.get(first) {
            let cell = code >> (CODE_BITS - self.treelet_bits);
            let count = codes[first..]
                .partition_point(|code| code >> (CODE_BITS - self.treelet_bits) == cell);
            let (slots, after) = rest.split_at(count);
            treelets.push((first, slots));
            firsts.push(to_u32(first));
            rest = after;
            first += count;
        }
        let roots: Vec<Cluster> = treelets
            .into_par_iter()
            .map(|(first, mut slots)| {
                let leaf = |place: usize| {
                    let bounds = refs[order[place] as usize].aabb();
                    Cluster::single(bounds, to_u32(place))
                };
                treelet(&codes, first, &mut slots, leaf, &rule)
            })
            .collect();
        drop(codes);
        order.par_iter_mut().with_min_len(4096).for_each(|i| *i = refs[*i as usize].prim_id);
        drop(prims);
        let root = top::build(&roots, &firsts, self.bins, forest.slots(), &rule);
        Ok(forest.tree(&root, |place| order[place as usize]))
    }
}

/// A subtree that waits for its neighbour on the left.
struct Waiting {
    cluster: Cluster,
    first: usize,
    /// Common prefix with the neighbour on the right.
    prefix: u32,
}

/// The linear BVH over the places that `slots` stand for, from `first` on: one pass from the last
/// to the first, as `chunk::apetrei`. The join of two neighbours takes the slot of the place where
/// the second begins.
fn treelet(
    codes: &[u64],
    first: usize,
    slots: &mut Slots<'_>,
    leaf: impl Fn(usize) -> Cluster,
    rule: &LeafRule,
) -> Cluster {
    let last = first + slots.len() - 1;
    let mut join = |left: &Waiting, right: &Waiting| {
        slots.join(&left.cluster, &right.cluster, to_u32(right.first), rule)
    };
    // Prefixes grow towards the top of the stack, and are at most 95.
    let mut stack: Vec<Waiting> = Vec::new();
    let mut top = Waiting { cluster: leaf(last), first: last, prefix: 0 };
    for place in (first..last).rev() {
        let prefix = common_prefix(codes, place, place + 1);
        while top.prefix > prefix
            && let Some(right) = stack.pop()
        {
            top = Waiting { cluster: join(&top, &right), prefix: right.prefix, ..top };
        }
        stack.push(top);
        top = Waiting { cluster: leaf(place), first: place, prefix };
    }
    while let Some(right) = stack.pop() {
        top.cluster = join(&top, &right);
    }
    top.cluster
}

impl Builder for Hlbvh {
    fn name(&self) -> &str {
        "hlbvh"
    }

    fn build(&self, prims: &[PrimRef]) -> Result<Bvh, BuildError> {
        self.run(prims)
    }

    fn build_mesh(&self, mesh: &TriangleMesh) -> Result<Bvh, BuildError> {
        self.run(mesh.prim_refs())
    }

    fn memory_bound(&self, count: usize) -> usize {
        let treelets = count.min(1 << self.treelet_bits.min(30));
        let pairs = count * Forest::SLOT_BYTES;
        let nodes = (2 * count).saturating_sub(1) * size_of::<BvhNode>();
        let codes = count * (size_of::<u64>() + size_of::<u32>());
        let building = count * size_of::<PrimRef>() + codes + pairs;
        let closing = pairs + nodes + 2 * count * size_of::<u32>();
        building.max(closing) + treelets * 4 * size_of::<Cluster>() + (1 << 20)
    }
}
