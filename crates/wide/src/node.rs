//! The wide node and tree.

use niwaki_core::{Aabb, glam::Vec3, to_u32};

const LEAF: u32 = 1 << 31;

/// Where the count begins in the word of a leaf of a `W`-wide tree: right above bit 31 − log₂ W,
/// so that counts of 1 to `W` fit below [`LEAF`].
const fn count_shift<const W: usize>() -> u32 {
    const { assert!(W == 4 || W == 8 || W == 16, "trees are 4, 8 or 16 wide") };
    31 - W.trailing_zeros()
}

/// What a slot of a [`WideNode`] leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Child {
    /// Another node, by index; always larger than its parent's.
    Node(u32),
    /// A leaf.
    Leaf {
        /// Its first reference in [`WideBvh::prim_ids`].
        first: u32,
        /// Its number of references: 1 to the width of the tree.
        count: u32,
    },
}

impl Child {
    /// The 32-bit form in a tree of width `W`: the index of a node, or bit 31 set, `count − 1` in
    /// the log₂ W bits below and `first` in the rest.
    #[must_use]
    #[inline]
    pub const fn to_word<const W: usize>(self) -> u32 {
        match self {
            Self::Node(index) => index,
            Self::Leaf { first, count } => LEAF | (count - 1) << count_shift::<W>() | first,
        }
    }

    /// The child that [`Child::to_word`] packed for the same width.
    #[must_use]
    #[inline]
    pub const fn from_word<const W: usize>(word: u32) -> Self {
        if word & LEAF == 0 {
            Self::Node(word)
        } else {
            let shift = count_shift::<W>();
            Self::Leaf { first: word & ((1 << shift) - 1), count: ((word & !LEAF) >> shift) + 1 }
        }
    }
}

/// A node with up to `W` children; `W` is 4, 8 or 16. 32·`W` bytes: 2, 4 or 8 cache lines.
///
/// The boxes are structure of arrays, a row of `W` `f32` for each of min x, max x, min y,
/// max y, min z, max z: the planes that a ray enters and leaves through differ in one bit of the
/// row, so a kernel finds both by the sign of the direction. Slots are filled from 0 on, inner nodes
/// before leaves. An
/// unused slot has the empty box (min = +∞, max = −∞), which no ray hits, and a child word that
/// names a leaf that exists, so that following it by mistake is harmless.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct WideNode<const W: usize> {
    /// Rows of the boxes: `bounds[2·axis]` the smallest, `bounds[2·axis + 1]` the largest
    /// coordinates.
    pub bounds: [[f32; W]; 6],
    /// The children ([`Child::to_word`]).
    pub children: [u32; W],
    /// The first reference of the node's leaf children; those of all of them are contiguous in
    /// slot order.
    pub first_prim: u32,
    /// How many references the node's leaf children hold together.
    pub prim_count: u32,
    /// How many slots are used: 1 to `W`.
    pub used: u32,
}

/// A node with up to four children: 128 bytes.
pub type Node4 = WideNode<4>;
/// A node with up to eight children: 256 bytes.
pub type Node8 = WideNode<8>;
/// A node with up to sixteen children: 512 bytes.
pub type Node16 = WideNode<16>;

impl<const W: usize> WideNode<W> {
    /// A node without children.
    pub(crate) const fn empty(first_prim: u32) -> Self {
        let (min, max) = ([f32::INFINITY; W], [f32::NEG_INFINITY; W]);
        Self {
            bounds: [min, max, min, max, min, max],
            children: [Child::Leaf { first: 0, count: 1 }.to_word::<W>(); W],
            first_prim,
            prim_count: 0,
            used: 0,
        }
    }

    /// Fills the next slot; there must be one.
    #[inline]
    pub(crate) fn push(&mut self, min: Vec3, max: Vec3, child: Child) {
        let slot = self.used as usize;
        for axis in 0..3 {
            self.bounds[2 * axis][slot] = min[axis];
            self.bounds[2 * axis + 1][slot] = max[axis];
        }
        self.children[slot] = child.to_word::<W>();
        self.used += 1;
    }

    /// The child in a slot; `None` for an unused one.
    #[must_use]
    #[inline]
    pub fn child(&self, slot: usize) -> Option<Child> {
        (slot < self.used as usize).then(|| Child::from_word::<W>(self.children[slot]))
    }

    /// The used slots' children in order.
    pub fn iter(&self) -> impl Iterator<Item = Child> + '_ {
        self.children[..self.used as usize].iter().map(|&word| Child::from_word::<W>(word))
    }

    /// The box of a slot; [`Aabb::EMPTY`] for an unused one.
    #[must_use]
    #[inline]
    pub fn aabb(&self, slot: usize) -> Aabb {
        let b = &self.bounds;
        Aabb::new(
            Vec3::new(b[0][slot], b[2][slot], b[4][slot]),
            Vec3::new(b[1][slot], b[3][slot], b[5][slot]),
        )
    }
}

const _: () =
    assert!(size_of::<Node4>() == 128 && size_of::<Node8>() == 256 && size_of::<Node16>() == 512);

/// A BVH of width `W`, which is 4, 8 or 16.
///
/// It can only be made by [`WideBvh::collapse`] and [`WideBvh::from_parts`], so the following always holds, and traversal
/// kernels may rely on it without checks: node 0 is the root; every [`Child::Node`] names a node
/// after its parent; every node but the root has one parent; every leaf's range lies in
/// [`WideBvh::prim_ids`]; leaf ranges do not overlap and follow each other in the order of nodes
/// and slots; a tree with nodes has at least one reference.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WideBvh<const W: usize> {
    pub(crate) nodes: Vec<WideNode<W>>,
    pub(crate) prim_ids: Vec<u32>,
    pub(crate) bounds: Option<Aabb>,
    pub(crate) levels: usize,
}

/// A 4-wide BVH: a node's boxes fill 128-bit vectors.
pub type Bvh4 = WideBvh<4>;
/// An 8-wide BVH: a node's boxes fill 256-bit vectors.
pub type Bvh8 = WideBvh<8>;
/// A 16-wide BVH: a node's boxes fill 512-bit vectors.
pub type Bvh16 = WideBvh<16>;

impl<const W: usize> WideBvh<W> {
    /// The most references of one tree: 2²⁹, 2²⁸ or 2²⁷ for widths of 4, 8 and 16.
    pub const MAX_REFERENCES: usize = 1 << count_shift::<W>();

    /// The most references of one leaf: as many as the vectors that fit the width have lanes.
    pub const MAX_LEAF: usize = W;

    /// The nodes, level by level, root first.
    #[must_use]
    pub fn nodes(&self) -> &[WideNode<W>] {
        &self.nodes
    }

    /// Primitive ids in the order of the leaves.
    #[must_use]
    pub fn prim_ids(&self) -> &[u32] {
        &self.prim_ids
    }

    /// The box around everything; [`Aabb::EMPTY`] without nodes.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.bounds.unwrap_or(Aabb::EMPTY)
    }

    /// Takes the tree apart into nodes and primitive ids, for a kernel that keeps both.
    #[must_use]
    pub fn into_parts(self) -> (Vec<WideNode<W>>, Vec<u32>) {
        (self.nodes, self.prim_ids)
    }

    /// Number of node levels: 0 without nodes, 1 for a root whose children are leaves.
    #[must_use]
    pub const fn levels(&self) -> usize {
        self.levels
    }

    /// An upper bound on the entries of a traversal stack that a node's children are pushed onto
    /// all at once after the node was popped: each level leaves at most `W` − 1 behind.
    #[must_use]
    pub const fn stack_bound(&self) -> usize {
        (W - 1) * self.levels + 1
    }

    /// Bytes that nodes and primitive ids take.
    #[must_use]
    pub const fn bytes(&self) -> usize {
        size_of::<WideNode<W>>() * self.nodes.len() + size_of::<u32>() * self.prim_ids.len()
    }

    /// The share of node slots that are used, 0 to 1; 1 without nodes.
    #[must_use]
    pub fn fill(&self) -> f64 {
        if self.nodes.is_empty() {
            return 1.0;
        }
        let used: usize = self.nodes.iter().map(|n| n.used as usize).sum();
        used as f64 / (W * self.nodes.len()) as f64
    }

    /// Ids of the leaf range `first .. first + count` of a [`Child::Leaf`].
    ///
    /// # Panics
    /// If the range is not one of this tree.
    #[must_use]
    pub fn leaf_prims(&self, first: u32, count: u32) -> &[u32] {
        &self.prim_ids[first as usize..(first + count) as usize]
    }

    /// The node count as 32 bits, which bounds every child word.
    #[must_use]
    pub fn node_count(&self) -> u32 {
        to_u32(self.nodes.len())
    }
}
