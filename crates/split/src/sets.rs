//! The six sets that a plane divides references into, and what each choice costs (thesis paper V,
//! section 3.2).

use niwaki_core::{Aabb, PrimRef, glam::Vec3};

/// What is known of a set of references: their number, box and centroid bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Set {
    pub(crate) count: usize,
    pub(crate) bounds: Aabb,
    /// Around [`centroid`] of each reference.
    pub(crate) centroids: Aabb,
}

impl Set {
    pub(crate) const EMPTY: Self = Self { count: 0, bounds: Aabb::EMPTY, centroids: Aabb::EMPTY };

    #[inline]
    pub(crate) fn add(&mut self, aabb: Aabb) {
        self.count += 1;
        self.bounds = self.bounds.union(aabb);
        self.centroids = self.centroids.grow(centroid(&aabb));
    }

    pub(crate) fn union(self, other: Self) -> Self {
        Self {
            count: self.count + other.count,
            bounds: self.bounds.union(other.bounds),
            centroids: self.centroids.union(other.centroids),
        }
    }

    /// A·N, the cost of a leaf over the set.
    pub(crate) fn cost(&self) -> f64 {
        self.bounds.area() * self.count as f64
    }
}

/// The middle of a box.
#[inline]
pub(crate) fn centroid(aabb: &Aabb) -> Vec3 {
    aabb.center()
}

/// A plane `p[axis] = position`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Plane {
    pub(crate) axis: usize,
    pub(crate) position: f32,
}

impl Plane {
    /// The middle of centroid bounds on their longest axis; `None` where they are a point, so that
    /// no plane separates them. At least one centroid is on either side.
    pub(crate) fn middle(centroids: &Aabb) -> Option<Self> {
        let axis = centroids.longest_axis();
        let (min, max) = (centroids.min[axis], centroids.max[axis]);
        if min >= max {
            return None;
        }
        // Between neighbouring numbers the middle may round down to the smaller, and nothing would
        // be left of it.
        let middle = min * 0.5 + max * 0.5;
        Some(Self { axis, position: if middle > min { middle } else { max } })
    }

    /// True if a reference with this box goes left when it is not split.
    #[inline]
    pub(crate) fn is_left(&self, prim: &PrimRef) -> bool {
        prim.min[self.axis] * 0.5 + prim.max[self.axis] * 0.5 < self.position
    }

    /// True if the plane cuts the inside of the box.
    #[inline]
    pub(crate) fn overlaps(&self, prim: &PrimRef) -> bool {
        prim.min[self.axis] < self.position && prim.max[self.axis] > self.position
    }
}

/// D and O of both sides: references apart from the plane, and those that overlap it by the side
/// of their centroid.
#[derive(Clone, Debug)]
pub(crate) struct Sides {
    pub(crate) disjoint: [Set; 2],
    pub(crate) overlap: [Set; 2],
}

impl Sides {
    pub(crate) const EMPTY: Self = Self { disjoint: [Set::EMPTY; 2], overlap: [Set::EMPTY; 2] };

    /// Adds references; appends the indices, from `first` on, of those that overlap.
    pub(crate) fn measure(
        &mut self,
        prims: &[PrimRef],
        first: u32,
        plane: Plane,
        overlapping: &mut Vec<u32>,
    ) {
        for (prim, index) in prims.iter().zip(first..) {
            let side = usize::from(!plane.is_left(prim));
            if plane.overlaps(prim) {
                self.overlap[side].add(prim.aabb());
                overlapping.push(index);
            } else {
                self.disjoint[side].add(prim.aabb());
            }
        }
    }

    /// D ∪ O of both sides.
    pub(crate) fn unsplit(&self) -> [Set; 2] {
        [0, 1].map(|side| self.disjoint[side].union(self.overlap[side]))
    }

    /// D ∪ S of both sides.
    pub(crate) fn split(&self, split: &[Set; 2]) -> [Set; 2] {
        [0, 1].map(|side| self.disjoint[side].union(split[side]))
    }
}

/// C_O or C_S.
pub(crate) fn cost(sides: &[Set; 2]) -> f64 {
    sides[0].cost() + sides[1].cost()
}
