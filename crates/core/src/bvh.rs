//! The binary bounding volume hierarchy.

use crate::Aabb;
use glam::Vec3;

/// A node of a binary BVH: 32 bytes.
///
/// `count == 0` marks an inner node, whose children are nodes `first` and `first + 1`; otherwise
/// the node is a leaf that holds `prim_ids[first .. first + count]`.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct BvhNode {
    /// Smallest coordinates of everything below.
    pub min: Vec3,
    /// Index of the first child, or of the first primitive reference of a leaf.
    pub first: u32,
    /// Largest coordinates of everything below.
    pub max: Vec3,
    /// Number of primitive references of a leaf; 0 for an inner node.
    pub count: u32,
}

impl BvhNode {
    /// An inner node with children `first_child` and `first_child + 1`.
    #[must_use]
    pub const fn inner(bounds: Aabb, first_child: u32) -> Self {
        Self { min: bounds.min, first: first_child, max: bounds.max, count: 0 }
    }

    /// A leaf with `count ≥ 1` references from `first` on.
    #[must_use]
    pub const fn leaf(bounds: Aabb, first: u32, count: u32) -> Self {
        Self { min: bounds.min, first, max: bounds.max, count }
    }

    /// True for leaves.
    #[must_use]
    #[inline]
    pub const fn is_leaf(&self) -> bool {
        self.count != 0
    }

    /// The box.
    #[must_use]
    #[inline]
    pub const fn aabb(&self) -> Aabb {
        Aabb { min: self.min, max: self.max }
    }

    /// The indices of both children; meaningless for a leaf.
    #[must_use]
    #[inline]
    pub const fn children(&self) -> [usize; 2] {
        [self.first as usize, self.first as usize + 1]
    }

    /// The range of a leaf in [`Bvh::prim_ids`]; empty for an inner node.
    #[must_use]
    #[inline]
    pub const fn prim_range(&self) -> std::ops::Range<usize> {
        if self.is_leaf() {
            self.first as usize..self.first as usize + self.count as usize
        } else {
            0..0
        }
    }
}

const _: () = assert!(size_of::<BvhNode>() == 32);

/// A binary BVH over primitives that are named by index.
///
/// The root is node 0 and the children of a node are adjacent and come after it. Without
/// primitives there are no nodes. Leaves name their primitives through [`Bvh::prim_ids`], in the
/// order of the leaves; builders that split primitives reference some of them more than once.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bvh {
    /// The nodes, root first.
    pub nodes: Vec<BvhNode>,
    /// Primitive ids in leaf order.
    pub prim_ids: Vec<u32>,
}

impl Bvh {
    /// The box around everything; [`Aabb::EMPTY`] without nodes.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.nodes.first().map_or(Aabb::EMPTY, BvhNode::aabb)
    }

    /// Bytes that nodes and primitive ids take.
    #[must_use]
    pub const fn bytes(&self) -> usize {
        size_of::<BvhNode>() * self.nodes.len() + size_of::<u32>() * self.prim_ids.len()
    }

    /// The ids in a leaf.
    ///
    /// # Panics
    /// If the leaf is not one of this tree.
    #[must_use]
    pub fn leaf_prims(&self, leaf: &BvhNode) -> &[u32] {
        &self.prim_ids[leaf.prim_range()]
    }
}
