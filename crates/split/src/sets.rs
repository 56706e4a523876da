//! The six sets that a plane divides references into, and what each choice costs (thesis paper V,
//! section 3.2).

use niwaki_core::glam::Vec4;
use niwaki_core::midpoint::Plane;
use niwaki_core::{Aabb, PrimRef};

/// What is known of a set of references: their number and box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Set {
    pub(crate) count: usize,
    /// Corners of the box; the fourth component of each is an id and has no meaning as a number.
    pub(crate) min: Vec4,
    pub(crate) max: Vec4,
}

impl Set {
    pub(crate) const EMPTY: Self = Self { count: 0, min: Vec4::INFINITY, max: Vec4::NEG_INFINITY };

    #[inline]
    pub(crate) fn add(&mut self, prim: &PrimRef) {
        let [min, max]: [Vec4; 2] = bytemuck::cast(*prim);
        self.count += 1;
        self.min = self.min.min(min);
        self.max = self.max.max(max);
    }

    pub(crate) fn union(self, other: Self) -> Self {
        Self {
            count: self.count + other.count,
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    pub(crate) fn bounds(&self) -> Aabb {
        Aabb::new(self.min.truncate(), self.max.truncate())
    }

    /// A·N, the cost of a leaf over the set.
    fn cost(&self) -> f64 {
        self.bounds().area() * self.count as f64
    }
}

/// D and O of both sides: references apart from the plane, and those that overlap it by the side
/// of their middle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sides {
    pub(crate) disjoint: [Set; 2],
    pub(crate) overlap: [Set; 2],
}

impl Sides {
    pub(crate) const EMPTY: Self = Self { disjoint: [Set::EMPTY; 2], overlap: [Set::EMPTY; 2] };

    /// Adds a reference to its set; true if it overlaps the plane.
    #[inline]
    pub(crate) fn add(&mut self, prim: &PrimRef, plane: Plane) -> bool {
        let side = usize::from(!plane.is_left(prim));
        let overlaps = plane.overlaps(prim);
        let sets = if overlaps { &mut self.overlap } else { &mut self.disjoint };
        sets[side].add(prim);
        overlaps
    }

    pub(crate) fn union(&self, other: &Self) -> Self {
        let both = |a: &[Set; 2], b: &[Set; 2]| [a[0].union(b[0]), a[1].union(b[1])];
        Self {
            disjoint: both(&self.disjoint, &other.disjoint),
            overlap: both(&self.overlap, &other.overlap),
        }
    }

    /// |O|, on both sides.
    pub(crate) const fn overlapping(&self) -> usize {
        self.overlap[0].count + self.overlap[1].count
    }

    /// D ∪ O of both sides.
    pub(crate) fn unsplit(&self) -> [Set; 2] {
        [0, 1].map(|side| self.disjoint[side].union(self.overlap[side]))
    }

    /// D ∪ S of both sides.
    pub(crate) fn split(&self, halves: &[Set; 2]) -> [Set; 2] {
        [0, 1].map(|side| self.disjoint[side].union(halves[side]))
    }

    /// A cost that C_S is not below, known before anything is clipped: halves take room, from
    /// where their references begin or end to the plane.
    pub(crate) fn least_split_cost(&self, plane: Plane) -> f64 {
        let across = self.overlap[0].union(self.overlap[1]);
        let [mut left, mut right] = [Set { count: across.count, ..Set::EMPTY }; 2];
        left.min[plane.axis] = across.min[plane.axis];
        left.max[plane.axis] = plane.position;
        right.min[plane.axis] = plane.position;
        right.max[plane.axis] = across.max[plane.axis];
        cost(&self.split(&[left, right]))
    }
}

/// C_O or C_S.
pub(crate) fn cost(sides: &[Set; 2]) -> f64 {
    sides[0].cost() + sides[1].cost()
}
