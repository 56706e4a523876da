//! Splits a list of midpoints at a plane.

use super::Midpoint;
use crate::Aabb;
use glam::Vec4;
use rayon::prelude::*;

/// Which loop runs; all give the same result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kernel {
    Scalar,
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Kernel {
    /// The fastest of this machine.
    pub(super) fn best() -> Self {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            return Self::Avx2;
        }
        Self::Scalar
    }
}

/// What a partition finds out on the way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sides {
    /// How many midpoints went to the front.
    pub(super) left: usize,
    /// Around the midpoints of each side; [`Aabb::EMPTY`] for a side without any.
    pub(super) bounds: [Aabb; 2],
}

/// The running bounds of both sides. Fourth components are indices and have no meaning as numbers.
pub(super) struct Running {
    pub(super) min: [Vec4; 2],
    pub(super) max: [Vec4; 2],
}

impl Running {
    const NEW: Self = Self { min: [Vec4::INFINITY; 2], max: [Vec4::NEG_INFINITY; 2] };

    fn sides(&self, left: usize) -> Sides {
        let side = |s: usize| Aabb::new(self.min[s].truncate(), self.max[s].truncate());
        Sides { left, bounds: [side(0), side(1)] }
    }
}

/// Copies the items of `source` whose coordinate on `axis` is below `plane` to the front of
/// `target`, in order, and the others to its end, in reverse order.
///
/// # Panics
/// If the lengths differ or there is no such axis.
pub(super) fn partition(
    kernel: Kernel,
    source: &[Midpoint],
    target: &mut [Midpoint],
    axis: usize,
    plane: f32,
) -> Sides {
    assert!(source.len() == target.len() && axis < 3);
    let mut running = Running::NEW;
    let (mut left, mut right) = (0, source.len());
    #[cfg(target_arch = "x86_64")]
    if kernel == Kernel::Avx2 && std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the machine has AVX2, lengths are equal and the axis exists.
        (left, right) =
            unsafe { super::avx2::partition(source, target, axis, plane, &mut running) };
    }
    let out = target.as_mut_ptr();
    for item in &source[source.len() - (right - left)..] {
        let is_left = item.center[axis] < plane;
        // Both places are written and one counts: cheaper than a branch that cannot be predicted.
        // SAFETY: before each item, `right − left` is the number of items still to come, so that
        // `left < right ≤ source.len()`, which is the length of `target`.
        unsafe {
            out.add(left).write(*item);
            out.add(right - 1).write(*item);
        }
        let side = usize::from(!is_left);
        let center: Vec4 = bytemuck::cast(*item);
        running.min[side] = running.min[side].min(center);
        running.max[side] = running.max[side].max(center);
        left += 1 - side;
        right -= side;
    }
    running.sides(left)
}

/// Midpoints that one task of [`partition_parallel`] moves.
const CHUNK: usize = 1 << 14;

/// [`partition`] with all threads and the same result, for long lists; it ends up in `items`.
///
/// # Panics
/// As [`partition`].
pub(super) fn partition_parallel(
    kernel: Kernel,
    items: &mut [Midpoint],
    spare: &mut [Midpoint],
    axis: usize,
    plane: f32,
) -> Sides {
    assert!(items.len() == spare.len());
    let chunks: Vec<Sides> = items
        .par_chunks(CHUNK)
        .zip(spare.par_chunks_mut(CHUNK))
        .map(|(chunk, spare)| partition(kernel, chunk, spare, axis, plane))
        .collect();
    let left = chunks.iter().map(|sides| sides.left).sum();
    // Fronts of chunks follow each other from the left, backs from the right.
    let (mut front, mut back) = items.split_at_mut(left);
    let mut places = Vec::with_capacity(chunks.len());
    for (chunk, sides) in spare.chunks(CHUNK).zip(&chunks) {
        let (chunk_front, chunk_back) = chunk.split_at(sides.left);
        let (front_here, front_after) = front.split_at_mut(chunk_front.len());
        let (back_after, back_here) = back.split_at_mut(back.len() - chunk_back.len());
        places.push([(chunk_front, front_here), (chunk_back, back_here)]);
        (front, back) = (front_after, back_after);
    }
    places.into_par_iter().flatten().for_each(|(from, to)| to.copy_from_slice(from));
    let bounds = [0, 1].map(|side| {
        chunks.iter().fold(Aabb::EMPTY, |bounds, sides| bounds.union(sides.bounds[side]))
    });
    Sides { left, bounds }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use proptest::prelude::*;

    const BLANK: Midpoint = Midpoint { center: [0.0; 3], index: u32::MAX };

    proptest! {
        #[test]
        fn agrees_with_iterators(
            coordinates in prop::collection::vec((0_u8..20, -9_i8..9), 0..200),
            axis in 0_usize..3,
            plane in 0_u8..22,
        ) {
            let items: Vec<Midpoint> = coordinates
                .iter()
                .zip(0..)
                .map(|(&(c, other), index)| {
                    let mut center = [f32::from(other); 3];
                    center[axis] = f32::from(c);
                    Midpoint { center, index }
                })
                .collect();
            let plane = f32::from(plane);
            let goes_left = |item: &&Midpoint| item.center[axis] < plane;
            let (front, back): (Vec<&Midpoint>, Vec<&Midpoint>) = items.iter().partition(goes_left);
            let around = |items: &[&Midpoint]| {
                Aabb::from_points(items.iter().map(|item| Vec3::from_array(item.center)))
            };
            let expected = Sides { left: front.len(), bounds: [around(&front), around(&back)] };
            for kernel in [Kernel::Scalar, Kernel::best()] {
                let mut target = vec![BLANK; items.len()];
                prop_assert_eq!(partition(kernel, &items, &mut target, axis, plane), expected);
                prop_assert!(target.iter().eq(front.iter().copied().chain(back.iter().rev().copied())));
            }
        }
    }

    #[test]
    fn all_threads_do_what_one_does() {
        let items: Vec<Midpoint> = (0..100_000_u32)
            .map(|index| Midpoint { center: [0.0, (index * 7919 % 1009) as f32, 0.0], index })
            .collect();
        for plane in [-1.0, 0.0, 300.0, 1008.0, 2000.0] {
            let mut expected = items.clone();
            let mut shared = items.clone();
            let mut spare = vec![BLANK; items.len()];
            let sides = partition(Kernel::Scalar, &items, &mut expected, 1, plane);
            let all = partition_parallel(Kernel::best(), &mut shared, &mut spare, 1, plane);
            assert_eq!(all, sides);
            assert_eq!(shared, expected);
        }
    }
}
