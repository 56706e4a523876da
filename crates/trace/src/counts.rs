//! What a ray visited.

use std::ops::{Add, AddAssign};

/// Work that one or more rays caused; the quantities that the surface area heuristic predicts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Inner nodes whose children were tested. For a binary tree the root's own box, which is
    /// tested first, is no node visit.
    pub nodes: u64,
    /// Boxes tested; unused slots of wide nodes do not count.
    pub boxes: u64,
    /// Leaves whose triangles were tested.
    pub leaves: u64,
    /// Triangles tested.
    pub triangles: u64,
}

impl AddAssign for Counts {
    fn add_assign(&mut self, other: Self) {
        self.nodes += other.nodes;
        self.boxes += other.boxes;
        self.leaves += other.leaves;
        self.triangles += other.triangles;
    }
}

impl Add for Counts {
    type Output = Self;

    fn add(mut self, other: Self) -> Self {
        self += other;
        self
    }
}

impl std::iter::Sum for Counts {
    fn sum<I: Iterator<Item = Self>>(iter: I) -> Self {
        iter.fold(Self::default(), Add::add)
    }
}

/// The way of a ray through a tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Walk {
    /// The work.
    pub counts: Counts,
    /// Where the ray ended: the node or leaf that it visited last, as a number that is the same for
    /// the same place in the same scene; `None` if it visited none. Rays with the same end are
    /// likely to have come the same way (Ganestam and Doggett 2012, section 4.2).
    pub end: Option<u64>,
}

/// Where a kernel reports its work; `()` for nowhere, which costs nothing.
pub(crate) trait Counter {
    /// A visit of a node or leaf, by any number that is its own.
    #[inline(always)]
    fn at(&mut self, _place: u64) {}
    /// A visit of the leaf of a wide tree that begins with this triangle.
    #[inline(always)]
    fn at_leaf(&mut self, first: u32) {
        // Above all numbers of nodes.
        self.at(1 << 32 | u64::from(first));
    }
    fn node(&mut self, boxes: u32);
    fn boxes(&mut self, boxes: u32);
    fn leaf(&mut self, triangles: u32);
}

impl Counter for () {
    #[inline(always)]
    fn node(&mut self, _: u32) {}
    #[inline(always)]
    fn boxes(&mut self, _: u32) {}
    #[inline(always)]
    fn leaf(&mut self, _: u32) {}
}

impl Counter for Counts {
    fn node(&mut self, boxes: u32) {
        self.nodes += 1;
        self.boxes += u64::from(boxes);
    }
    fn boxes(&mut self, boxes: u32) {
        self.boxes += u64::from(boxes);
    }
    fn leaf(&mut self, triangles: u32) {
        self.leaves += 1;
        self.triangles += u64::from(triangles);
    }
}

impl Counter for Walk {
    fn at(&mut self, place: u64) {
        self.end = Some(place);
    }
    fn node(&mut self, boxes: u32) {
        self.counts.node(boxes);
    }
    fn boxes(&mut self, boxes: u32) {
        self.counts.boxes(boxes);
    }
    fn leaf(&mut self, triangles: u32) {
        self.counts.leaf(triangles);
    }
}
