//! The six sets that a plane divides references into, and what each choice costs (thesis paper V,
//! section 3.2).

use niwaki_core::glam::{BVec4A, Vec4};
use niwaki_core::{Aabb, PrimRef};

/// What is known of a set of references: their number, box and centroid bounds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Set {
    pub(crate) count: usize,
    /// Corners of the box; the fourth component of each is an id and has no meaning as a number.
    min: Vec4,
    max: Vec4,
    /// Around the middles of the boxes.
    centroid_min: Vec4,
    centroid_max: Vec4,
}

impl Set {
    pub(crate) const EMPTY: Self = Self {
        count: 0,
        min: Vec4::INFINITY,
        max: Vec4::NEG_INFINITY,
        centroid_min: Vec4::INFINITY,
        centroid_max: Vec4::NEG_INFINITY,
    };

    /// A set of so many references with the corners of its box and of its centroid bounds.
    pub(crate) const fn new(count: usize, [min, max]: [Vec4; 2], centroids: [Vec4; 2]) -> Self {
        let [centroid_min, centroid_max] = centroids;
        Self { count, min, max, centroid_min, centroid_max }
    }

    #[inline]
    pub(crate) fn add(&mut self, prim: &PrimRef) {
        const XYZ: BVec4A = BVec4A::new(true, true, true, false);
        let [min, max]: [Vec4; 2] = bytemuck::cast(*prim);
        // Ids look like denormals, which make arithmetic slow; comparisons do not mind.
        let [a, b] = [min, max].map(|corner| Vec4::select(XYZ, corner, Vec4::ZERO));
        let centroid = a * 0.5 + b * 0.5;
        self.count += 1;
        self.min = self.min.min(min);
        self.max = self.max.max(max);
        self.centroid_min = self.centroid_min.min(centroid);
        self.centroid_max = self.centroid_max.max(centroid);
    }

    pub(crate) fn union(self, other: Self) -> Self {
        Self {
            count: self.count + other.count,
            min: self.min.min(other.min),
            max: self.max.max(other.max),
            centroid_min: self.centroid_min.min(other.centroid_min),
            centroid_max: self.centroid_max.max(other.centroid_max),
        }
    }

    pub(crate) fn bounds(&self) -> Aabb {
        Aabb::new(self.min.truncate(), self.max.truncate())
    }

    pub(crate) fn centroids(&self) -> Aabb {
        Aabb::new(self.centroid_min.truncate(), self.centroid_max.truncate())
    }

    /// A·N, the cost of a leaf over the set.
    fn cost(&self) -> f64 {
        self.bounds().area() * self.count as f64
    }
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

    /// The ends of a box along the axis: two loads, where indexing vectors would branch.
    #[inline]
    fn extent(&self, prim: &PrimRef) -> [f32; 2] {
        let corners: &[[f32; 4]; 2] = bytemuck::cast_ref(prim);
        let axis = self.axis & 3;
        [corners[0][axis], corners[1][axis]]
    }

    /// True if the middle of the box is left of the plane.
    #[inline]
    pub(crate) fn is_left(&self, prim: &PrimRef) -> bool {
        let [min, max] = self.extent(prim);
        min * 0.5 + max * 0.5 < self.position
    }

    /// True if the plane cuts the inside of the box.
    #[inline]
    fn overlaps(&self, prim: &PrimRef) -> bool {
        let [min, max] = self.extent(prim);
        // No branch, as sides are hard to predict.
        (min < self.position) & (max > self.position)
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

    /// The sets of some references; appends the indices of those that overlap.
    pub(crate) fn measure(prims: &[PrimRef], plane: Plane, overlapping: &mut Vec<u32>) -> Self {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the machine has AVX2, and a tree has fewer than 2³² references.
            return unsafe { crate::avx2::measure(prims, plane, overlapping) };
        }
        Self::measure_scalar(prims, plane, overlapping)
    }

    /// [`Sides::measure`] in portable code.
    fn measure_scalar(prims: &[PrimRef], plane: Plane, overlapping: &mut Vec<u32>) -> Self {
        // Two of each, used in turn, because each sum depends on itself before.
        let mut sets = [Set::EMPTY; 8];
        for (prim, index) in prims.iter().zip(0_u32..) {
            let overlaps = plane.overlaps(prim);
            let set = u32::from(!plane.is_left(prim)) | u32::from(overlaps) << 1 | index << 2 & 4;
            sets[set as usize & 7].add(prim);
            if overlaps {
                overlapping.push(index);
            }
        }
        let both = |i: usize| sets[i].union(sets[i + 4]);
        Self { disjoint: [both(0), both(1)], overlap: [both(2), both(3)] }
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

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::*;
    use niwaki_core::glam::Vec3;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn all_kernels_measure_the_same(
            boxes in prop::collection::vec(prop::array::uniform6(-9_i8..9), 0..700),
            axis in 0_usize..3,
            position in -9_i8..9,
        ) {
            if !std::arch::is_x86_feature_detected!("avx2") {
                return Ok(());
            }
            let prims: Vec<PrimRef> = boxes
                .iter()
                .zip(0..)
                .map(|(corners, index)| {
                    let [a, b, c, d, e, f] = corners.map(f32::from);
                    let (p, q) = (Vec3::new(a, b, c), Vec3::new(d, e, f));
                    let ids = PrimRef::new(Aabb::new(p.min(q), p.max(q)), index);
                    PrimRef { geom_id: u32::MAX - index, ..ids }
                })
                .collect();
            let plane = Plane { axis, position: f32::from(position) * 0.5 };
            let (mut expected_across, mut across) = (vec![7], vec![7]);
            let expected = Sides::measure_scalar(&prims, plane, &mut expected_across);
            // SAFETY: the machine has AVX2, and the axis exists.
            let sides = unsafe { crate::avx2::measure(&prims, plane, &mut across) };
            prop_assert_eq!(across, expected_across);
            let facts = |sides: &Sides| {
                [sides.disjoint, sides.overlap].map(|sets| {
                    sets.map(|set| (set.count, set.bounds(), set.centroids()))
                })
            };
            prop_assert_eq!(facts(&sides), facts(&expected));
        }
    }
}
