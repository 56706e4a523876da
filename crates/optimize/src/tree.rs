//! The form that passes work on: nodes in sibling pairs of one cache line, with parent links.

use crate::OptimizeError;
use niwaki_core::glam::{Vec3, Vec4, Vec4Swizzles};
use niwaki_core::{Aabb, AreaScale, Bvh, BvhNode, to_u32};
use rayon::prelude::*;

/// [`Tree::parents`] of the root.
pub(crate) const NONE: u32 = u32::MAX;

/// A [`BvhNode`] in two four-lane registers.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct Node {
    /// The fourth lane holds the bits of [`BvhNode::first`].
    pub(crate) min: Vec4,
    /// The fourth lane holds the bits of [`BvhNode::count`].
    pub(crate) max: Vec4,
}

impl Node {
    pub(crate) fn new(node: &BvhNode) -> Self {
        Self {
            min: node.min.extend(f32::from_bits(node.first)),
            max: node.max.extend(f32::from_bits(node.count)),
        }
    }

    #[inline]
    pub(crate) fn first(&self) -> u32 {
        self.min.w.to_bits()
    }

    #[inline]
    pub(crate) fn set_first(&mut self, first: u32) {
        self.min.w = f32::from_bits(first);
    }

    /// Makes this an inner node with the children `first` and `first + 1`.
    #[inline]
    pub(crate) fn make_inner(&mut self, first: u32) {
        self.set_first(first);
        self.max.w = f32::from_bits(0);
    }

    #[inline]
    pub(crate) fn count(&self) -> u32 {
        self.max.w.to_bits()
    }

    #[inline]
    pub(crate) fn is_leaf(&self) -> bool {
        self.count() != 0
    }

    #[inline]
    pub(crate) fn bounds(&self) -> Bounds {
        Bounds { min: self.min, max: self.max }
    }

    /// Changes the box, keeps the links.
    #[inline]
    pub(crate) fn set_bounds(&mut self, bounds: Bounds) {
        self.min = bounds.min.xyz().extend(self.min.w);
        self.max = bounds.max.xyz().extend(self.max.w);
    }

    pub(crate) fn to_bvh(self, first: u32) -> BvhNode {
        BvhNode { min: self.min.xyz(), first, max: self.max.xyz(), count: self.count() }
    }
}

/// A box whose fourth lanes have no meaning, so that whole registers can be used.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    pub(crate) min: Vec4,
    pub(crate) max: Vec4,
}

impl Bounds {
    #[inline]
    pub(crate) fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Half the surface area of the scaled box, as [`Aabb::half_area`].
    #[inline]
    pub(crate) fn area(self, scale: f32) -> f32 {
        // What stands in the fourth lane are denormal numbers as a rule, which processors take a
        // hundred times as long to multiply: keep them out.
        let e = (self.max - self.min).xyzz() * scale;
        let p = e * e.yzxx();
        p.x + p.y + p.z
    }

    #[inline]
    pub(crate) fn same(self, other: Self) -> bool {
        (self.min.cmpeq(other.min) & self.max.cmpeq(other.max)).bitmask() & 7 == 7
    }

    pub(crate) fn aabb(self) -> Aabb {
        Aabb::new(self.min.xyz(), self.max.xyz())
    }
}

/// Two siblings: one cache line.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Pair(pub(crate) [Node; 2]);

/// A tree of at least one inner node, taken apart for a pass.
///
/// The root is node 0, node 1 is not used, and siblings are `i` and `i ^ 1`. Leaves are those of
/// the [`Bvh`] that the tree was made from, and refer to its [`Bvh::prim_ids`].
#[derive(Clone, Debug)]
pub(crate) struct Tree {
    pub(crate) pairs: Vec<Pair>,
    /// The parent of both nodes of a pair, by half their index.
    pub(crate) parents: Vec<u32>,
    /// [`AreaScale::get`] of the root.
    pub(crate) scale: f32,
}

impl Tree {
    /// Takes a tree over in depth-first order, with inner boxes as tight as the children allow and
    /// the root's as it is. `None` without an inner node.
    pub(crate) fn new(bvh: &Bvh) -> Result<Option<Self>, OptimizeError> {
        let count = bvh.nodes.len();
        check_leaf(bvh, 0)?;
        if count < 2 {
            return Ok(None);
        }
        let pairs_max = count / 2 + 1;
        let mut pairs: Vec<Pair> = Vec::with_capacity(pairs_max);
        let mut parents = Vec::with_capacity(pairs_max);
        let root = Node::new(&bvh.nodes[0]);
        pairs.push(Pair([root, bytemuck::Zeroable::zeroed()]));
        parents.push(NONE);
        let mut references = 0_usize;
        // Inner nodes whose children are still to be copied: index in the source and here.
        let mut stack = vec![(0_usize, 0_u32)];
        while let Some((source, parent)) = stack.pop() {
            let broken = |fault| Err(OptimizeError::BrokenTree { node: source, fault });
            let children = bvh.nodes[source].children();
            if children[1] >= count {
                return broken("its children do not exist");
            }
            if children[0] <= source {
                return broken("its children do not come after it");
            }
            if pairs.len() == pairs_max {
                return broken("its children are those of another node as well");
            }
            let index = to_u32(2 * pairs.len());
            pairs.push(Pair(children.map(|child| Node::new(&bvh.nodes[child]))));
            parents.push(parent);
            pairs[parent as usize / 2].0[parent as usize % 2].set_first(index);
            for (child, here) in [(children[1], index + 1), (children[0], index)] {
                let node = &bvh.nodes[child];
                if node.is_leaf() {
                    check_leaf(bvh, child)?;
                    references += node.count as usize;
                } else {
                    stack.push((child, here));
                }
            }
        }
        if references > bvh.prim_ids.len() {
            let fault = "its leaves share primitive references";
            return Err(OptimizeError::BrokenTree { node: 0, fault });
        }
        let scale = AreaScale::of(&bvh.bounds()).get();
        let mut tree = Self { pairs, parents, scale };
        tree.tighten();
        if !bvh.bounds().contains(&tree.pair_bounds(tree.nodes()[0].first()).aabb()) {
            let fault = "the root does not enclose its children";
            return Err(OptimizeError::BrokenTree { node: 0, fault });
        }
        Ok(Some(tree))
    }

    /// The nodes; see [`Tree`] for their order.
    #[inline]
    pub(crate) fn nodes(&self) -> &[Node] {
        bytemuck::cast_slice(&self.pairs)
    }

    #[inline]
    pub(crate) fn nodes_mut(&mut self) -> &mut [Node] {
        bytemuck::cast_slice_mut(&mut self.pairs)
    }

    #[inline]
    pub(crate) fn parent(&self, node: u32) -> u32 {
        self.parents[node as usize / 2]
    }

    /// Around both nodes of the pair that starts at `first`.
    #[inline]
    pub(crate) fn pair_bounds(&self, first: u32) -> Bounds {
        let [a, b] = &self.pairs[first as usize / 2].0;
        a.bounds().union(b.bounds())
    }

    /// Sum of the areas of all inner nodes, in `f64`; the same for every number of threads.
    pub(crate) fn inner_area(&self) -> f64 {
        let sums: Vec<f64> = self
            .nodes()
            .par_chunks(1 << 14)
            .map(|nodes| {
                let inner = nodes.iter().filter(|node| !node.is_leaf());
                inner.map(|node| f64::from(node.bounds().area(self.scale))).sum()
            })
            .collect();
        sums.iter().sum()
    }

    /// Brings the pairs back into depth-first order and makes the parent links anew, which need
    /// not be right before.
    pub(crate) fn relayout(&mut self) {
        let mut pairs: Vec<Pair> = Vec::with_capacity(self.pairs.len());
        self.parents.clear();
        self.parents.push(NONE);
        pairs.push(self.pairs[0]);
        let mut stack = vec![0_u32];
        while let Some(here) = stack.pop() {
            let node = &mut pairs[here as usize / 2].0[here as usize % 2];
            let source = node.first();
            let index = to_u32(2 * self.parents.len());
            node.set_first(index);
            self.parents.push(here);
            let pair = self.pairs[source as usize / 2];
            pairs.push(pair);
            for side in [1, 0] {
                if !pair.0[side].is_leaf() {
                    stack.push(index + to_u32(side));
                }
            }
        }
        self.pairs = pairs;
    }

    /// Boxes of inner nodes from their children. Only for depth-first order, in which children
    /// come after their parents.
    fn tighten(&mut self) {
        for pair in (2..self.pairs.len()).rev() {
            let bounds = self.pair_bounds(to_u32(2 * pair));
            let parent = self.parents[pair] as usize;
            self.nodes_mut()[parent].set_bounds(bounds);
        }
    }

    /// The tree in the layout of [`Bvh`], depth first; `source` is what it was made from.
    pub(crate) fn to_bvh(&self, source: &Bvh) -> Bvh {
        let mut nodes: Vec<BvhNode> = Vec::with_capacity(self.nodes().len() - 1);
        let mut prim_ids = Vec::with_capacity(source.prim_ids.len());
        nodes.push(self.nodes()[0].to_bvh(0));
        let mut stack = vec![(0_u32, 0_usize)];
        while let Some((node, place)) = stack.pop() {
            let node = &self.nodes()[node as usize];
            if node.is_leaf() {
                nodes[place].first = to_u32(prim_ids.len());
                let first = node.first() as usize;
                prim_ids.extend_from_slice(&source.prim_ids[first..first + node.count() as usize]);
                continue;
            }
            let first = nodes.len();
            nodes[place].first = to_u32(first);
            let children = node.first();
            for child in [children, children + 1] {
                nodes.push(self.nodes()[child as usize].to_bvh(0));
            }
            stack.push((children + 1, first + 1));
            stack.push((children, first));
        }
        Bvh { nodes, prim_ids }
    }
}

/// Checks box and range of a leaf, which passes rely on; nothing for inner nodes.
fn check_leaf(bvh: &Bvh, index: usize) -> Result<(), OptimizeError> {
    let Some(node) = bvh.nodes.get(index).filter(|node| node.is_leaf()) else { return Ok(()) };
    let broken = |fault| Err(OptimizeError::BrokenTree { node: index, fault });
    if !node.aabb().is_finite() || node.aabb().is_empty() {
        return broken("its box is not finite");
    }
    if node.prim_range().end > bvh.prim_ids.len() {
        return broken("its primitive references do not exist");
    }
    Ok(())
}

const _: () = assert!(size_of::<Node>() == 32 && size_of::<Pair>() == 64);
const _: () = assert!(size_of::<Vec3>() == 12);
