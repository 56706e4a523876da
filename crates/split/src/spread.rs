//! Partitions the references of a region so that one side ends up at its start and the other at
//! its end: the free room then lies between them, and each side has its share without being moved
//! again.

use crate::sets::Plane;
use niwaki_core::PrimRef;

/// Spreads the first `len` references of a region: those left of the plane go to its start, or, if
/// `flip`, to its end, and the others to the other end. Returns how many went to the start.
///
/// Nothing is lost if more places are free than references go to the end.
///
/// # Panics
/// If `len` is more than the region has.
fn forward(region: &mut [PrimRef], len: usize, plane: Plane, flip: bool) -> usize {
    spread_each(region, 0..len, plane, flip)
}

/// As [`forward`] for the last `len` references, from the end to the start: more places have to be
/// free than references go to the start.
///
/// # Panics
/// If `len` is more than the region has.
fn backward(region: &mut [PrimRef], len: usize, plane: Plane, flip: bool) -> usize {
    let range = region.len() - len..region.len();
    spread_each(region, range.rev(), plane, flip)
}

fn spread_each(
    region: &mut [PrimRef],
    places: impl Iterator<Item = usize>,
    plane: Plane,
    flip: bool,
) -> usize {
    let (mut low, mut high) = (0, region.len());
    for i in places {
        // Both places are written and one counts: cheaper than a branch that cannot be predicted.
        let prim = region[i];
        let goes_low = usize::from(plane.is_left(&prim) != flip);
        region[low] = prim;
        region[high - 1] = prim;
        low += goes_low;
        high -= 1 - goes_low;
    }
    low
}

/// Spreads the references of a region, `left` and `right` of a plane, which stand at its end or at
/// its start. Returns whether those on the right went to the start, or `None`, and has done
/// nothing, if there is not room enough.
pub(crate) fn spread(
    region: &mut [PrimRef],
    [left, right]: [usize; 2],
    at_end: bool,
    plane: Plane,
) -> Option<bool> {
    let len = left + right;
    let free = region.len() - len;
    // The side that changes ends needs room, and a place more for what is written and not counted.
    let (usual, flipped) = if at_end { (left, right) } else { (right, left) };
    let flip = free <= usual;
    if flip && free <= flipped {
        return None;
    }
    let low = spread_by(region, len, at_end, plane, flip);
    debug_assert_eq!(low, if flip { right } else { left });
    Some(flip)
}

fn spread_by(region: &mut [PrimRef], len: usize, at_end: bool, plane: Plane, flip: bool) -> usize {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        assert!(len <= region.len());
        // SAFETY: the machine has AVX2, and the length was just checked.
        return unsafe {
            if at_end {
                crate::avx2::spread::<true>(region, len, plane, flip)
            } else {
                crate::avx2::spread::<false>(region, len, plane, flip)
            }
        };
    }
    if at_end { backward(region, len, plane, flip) } else { forward(region, len, plane, flip) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use niwaki_core::glam::Vec3;
    use niwaki_core::{Aabb, to_u32};
    use proptest::prelude::*;

    const PLANE: Plane = Plane { axis: 1, position: 10.0 };

    proptest! {
        #[test]
        fn nothing_is_lost_and_order_is_kept(
            heights in prop::collection::vec(0_u8..20, 1..100),
            free in 0_usize..150,
            at_end: bool,
        ) {
            let prims: Vec<PrimRef> = heights
                .iter()
                .zip(0..)
                .map(|(&y, id)| {
                    let point = Vec3::new(0.0, f32::from(y), 0.0);
                    PrimRef::new(Aabb::new(point, point), id)
                })
                .collect();
            let (left, right): (Vec<PrimRef>, Vec<PrimRef>) =
                prims.iter().partition(|prim| PLANE.is_left(prim));
            let mut region = prims.clone();
            region.resize(prims.len() + free, PrimRef::new(Aabb::EMPTY, u32::MAX));
            if at_end {
                region.reverse();
            }
            let before = region.clone();
            let counts = [left.len(), right.len()];
            let Some(flip) = spread(&mut region, counts, at_end, PLANE) else {
                prop_assert!(free <= left.len().min(right.len()), "there was room");
                prop_assert_eq!(region, before);
                return Ok(());
            };
            let (low, high) = if flip { (&right, &left) } else { (&left, &right) };
            prop_assert!(region[..low.len()].iter().eq(low));
            prop_assert!(region.iter().rev().take(high.len()).eq(high));

            let mut scalar = before;
            let len = prims.len();
            let went = if at_end {
                backward(&mut scalar, len, PLANE, flip)
            } else {
                forward(&mut scalar, len, PLANE, flip)
            };
            prop_assert_eq!(to_u32(went), to_u32(low.len()));
            prop_assert!(scalar[..went].iter().eq(low));
            prop_assert!(scalar.iter().rev().take(high.len()).eq(high));
        }
    }
}
