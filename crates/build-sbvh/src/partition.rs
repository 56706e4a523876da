//! Dividing a node's references: which side each goes to, and the move.

use crate::boxes::Box4;
use crate::spatial::{Planes, Split};
use crate::weight::Weights;
use niwaki_core::bins::CHUNK;
use niwaki_core::{Aabb, AreaScale, Clip, PrimRef, to_u32};
use rayon::prelude::*;

/// Where a reference goes.
pub(crate) const LEFT: u8 = 0;
/// Where a reference goes.
pub(crate) const RIGHT: u8 = 1;
/// Where a reference goes: it is split.
pub(crate) const BOTH: u8 = 2;

/// While sides are decided: a reference that straddles the plane but may not be split.
const WHOLE: u8 = 3;

/// The two parts of a reference.
pub(crate) type Parts = [PrimRef; 2];

/// The result of [`straddlers`].
pub(crate) struct Straddlers {
    /// Of each reference that goes to both sides, in order.
    pub(crate) parts: Vec<Parts>,
    /// What the split costs after unsplitting.
    pub(crate) cost: f32,
    /// The boxes of both sides after unsplitting.
    pub(crate) boxes: [Aabb; 2],
}

/// Decides to which sides of a plane references go: those that straddle it to both, unless one
/// side alone is cheaper ("reference unsplitting", Stich et al. 2009, section 4.4). If more than
/// `room` straddle the plane, only the largest are split. `None` if a side would stay empty.
#[expect(clippy::too_many_arguments, reason = "all of one node")]
pub(crate) fn straddlers<C: Clip>(
    refs: &[PrimRef],
    sides: &mut [u8],
    split: &Split,
    planes: &Planes,
    clip: &C,
    room: usize,
    scale: AreaScale,
    weights: &Weights,
    parallel: bool,
) -> Option<Straddlers> {
    let Split { axis, bin, boxes, counts, .. } = *split;
    let write = |refs: &[PrimRef], sides: &mut [u8]| {
        for (side, p) in sides.iter_mut().zip(refs) {
            let [first, last] = planes.range(axis, p);
            *side = if last < bin {
                LEFT
            } else if first >= bin {
                RIGHT
            } else {
                BOTH
            };
        }
    };
    if parallel {
        let chunks = sides.par_chunks_mut(CHUNK).zip(refs.par_chunks(CHUNK));
        chunks.for_each(|(sides, refs)| write(refs, sides));
    } else {
        write(refs, sides);
    }
    let split = keep_largest(refs, sides, counts[0] + counts[1] - refs.len(), room, scale);
    let position = planes.position(axis, bin);
    let cut = |p: &PrimRef| {
        let boxes = clip.clip(p, axis, position);
        boxes.map(|b| PrimRef { min: b.min, max: b.max, ..*p })
    };
    let mut parts: Vec<Parts> = Vec::with_capacity(split);
    if parallel {
        let chunks = sides.par_chunks(CHUNK).zip(refs.par_chunks(CHUNK));
        parts.par_extend(chunks.flat_map_iter(|(sides, refs)| {
            sides.iter().zip(refs).filter(|&(&side, _)| side == BOTH).map(|(_, p)| cut(p))
        }));
    } else {
        let both = sides.iter().zip(refs).filter(|&(&side, _)| side == BOTH);
        parts.extend(both.map(|(_, p)| cut(p)));
    }
    // Unsplitting, one reference after the other: each decision changes the boxes and numbers
    // that the next one sees.
    let mut boxes = boxes.map(|b| Box4::from_aabb(&b));
    let mut counts = counts;
    let weight = |count: usize| if count == 0 { 0.0 } else { weights.of(to_u32(count)) };
    let mut areas = boxes.map(|b| b.half_area(scale));
    let mut at = 0;
    let mut kept = 0;
    for (side, p) in sides.iter_mut().zip(refs) {
        if *side != BOTH && *side != WHOLE {
            continue;
        }
        let whole = Box4::of(p);
        let grown = [boxes[0].union(whole), boxes[1].union(whole)];
        let grown_areas = grown.map(|b| b.half_area(scale));
        let [left, right] = counts;
        let to_left = grown_areas[0] * weight(left) + areas[1] * weight(right - 1);
        let to_right = areas[0] * weight(left - 1) + grown_areas[1] * weight(right);
        let cheaper = if to_left < to_right { LEFT } else { RIGHT };
        let (part, only) = if *side == WHOLE {
            ([*p; 2], Some(cheaper))
        } else {
            let part = parts[at];
            at += 1;
            let split = areas[0] * weight(left) + areas[1] * weight(right);
            let only = match part.map(|p| p.aabb().is_empty()) {
                [_, true] => Some(LEFT),
                [true, false] => Some(RIGHT),
                _ => Some(cheaper).filter(|_| to_left.min(to_right) < split),
            };
            (part, only)
        };
        // The last reference of a side stays.
        let other = only.filter(|&only| counts[usize::from(1 - only)] == 1);
        if other.is_some() && (*side == WHOLE || part.iter().any(|p| p.aabb().is_empty())) {
            return None;
        }
        let only = if other.is_some() { None } else { only };
        if let Some(only) = only {
            *side = only;
            counts[usize::from(1 - only)] -= 1;
            let i = usize::from(only);
            boxes[i] = grown[i];
            areas[i] = grown_areas[i];
        } else {
            parts[kept] = part;
            kept += 1;
        }
    }
    parts.truncate(kept);
    let cost = areas[0] * weight(counts[0]) + areas[1] * weight(counts[1]);
    Some(Straddlers { parts, cost, boxes: boxes.map(|b| b.aabb()) })
}

/// Where more than `room` of the `straddling` references could be split, marks those with smaller
/// boxes as [`WHOLE`]. Returns how many are left to split.
fn keep_largest(
    refs: &[PrimRef],
    sides: &mut [u8],
    straddling: usize,
    room: usize,
    scale: AreaScale,
) -> usize {
    if straddling <= room {
        return straddling;
    }
    let area = |p: &PrimRef| p.aabb().half_area(scale);
    let straddlers = sides.iter().zip(refs).filter(|&(&side, _)| side == BOTH);
    let mut areas: Vec<f32> = Vec::with_capacity(straddling);
    areas.extend(straddlers.map(|(_, p)| area(p)));
    if areas.len() <= room {
        return areas.len();
    }
    // Those of equal area: the first.
    let (larger, &mut least, _) = areas.select_nth_unstable_by(room, |a, b| b.total_cmp(a));
    let mut equal = larger.iter().filter(|&&area| area == least).count();
    for (side, p) in sides.iter_mut().zip(refs).filter(|(side, _)| **side == BOTH) {
        let area = area(p);
        if area == least && equal > 0 {
            equal -= 1;
        } else if area <= least {
            *side = WHOLE;
        }
    }
    room
}

/// One side of a node after [`scatter`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Side {
    pub(crate) count: usize,
    pub(crate) bounds: Box4,
    /// Around twice the centroids.
    pub(crate) centroids: Box4,
}

impl Side {
    const EMPTY: Self = Self { count: 0, bounds: Box4::EMPTY, centroids: Box4::EMPTY };

    fn union(self, other: &Self) -> Self {
        Self {
            count: self.count + other.count,
            bounds: self.bounds.union(other.bounds),
            centroids: self.centroids.union(other.centroids),
        }
    }
}

/// Moves references to `target`: those of the left side to its front, those of the right side to
/// where the share of the left side ends, which is returned with both sides. Each side's share of
/// the places that stay free is by its number of references times its entry in `need`.
pub(crate) fn scatter(
    refs: &[PrimRef],
    sides: &[u8],
    parts: &[Parts],
    target: &mut [PrimRef],
    need: [f32; 2],
    parallel: bool,
) -> ([Side; 2], usize) {
    let tally = |sides: &[u8]| {
        let mut tally = [0_usize; 3];
        for &side in sides {
            tally[usize::from(side)] += 1;
        }
        tally
    };
    if !parallel {
        let [left, right, both] = tally(sides);
        let counts = [left + both, right + both];
        let border = share(target.len(), counts, need);
        let (left, right) = target.split_at_mut(border);
        return (move_chunk(refs, sides, parts, &mut left[..counts[0]], right), border);
    }
    let tallies: Vec<[usize; 3]> = sides.par_chunks(CHUNK).map(tally).collect();
    let total = tallies
        .iter()
        .fold([0, 0], |[l, r], [left, right, both]| [l + left + both, r + right + both]);
    let border = share(target.len(), total, need);
    let (mut lefts, mut rights) = target.split_at_mut(border);
    let mut parts = parts;
    let mut moves = Vec::with_capacity(tallies.len());
    for ((refs, sides), [left, right, both]) in
        refs.chunks(CHUNK).zip(sides.chunks(CHUNK)).zip(tallies)
    {
        let (own_lefts, own_rights, own_parts);
        (own_lefts, lefts) = lefts.split_at_mut(left + both);
        (own_rights, rights) = rights.split_at_mut(right + both);
        (own_parts, parts) = parts.split_at(both);
        moves.push((refs, sides, own_parts, own_lefts, own_rights));
    }
    let moved: Vec<[Side; 2]> = moves
        .into_par_iter()
        .map(|(refs, sides, parts, lefts, rights)| move_chunk(refs, sides, parts, lefts, rights))
        .collect();
    let empty = [Side::EMPTY; 2];
    let sum = moved.iter().fold(empty, |sum, s| [sum[0].union(&s[0]), sum[1].union(&s[1])]);
    (sum, border)
}

/// How many of `capacity` places the left side gets.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a part of a number of places, clamped to it"
)]
fn share(capacity: usize, [left, right]: [usize; 2], need: [f32; 2]) -> usize {
    let free = capacity - left - right;
    let [a, b] = [left as f64 * f64::from(need[0]), right as f64 * f64::from(need[1])];
    let part = if a + b > 0.0 { a / (a + b) } else { 0.5 };
    left + ((free as f64 * part) as usize).min(free)
}

fn move_chunk(
    refs: &[PrimRef],
    sides: &[u8],
    parts: &[Parts],
    lefts: &mut [PrimRef],
    rights: &mut [PrimRef],
) -> [Side; 2] {
    let mut result = [Side::EMPTY; 2];
    let mut parts = parts.iter();
    let [mut left, mut right] = [0, 0];
    let mut add = |side: usize, p: &PrimRef| {
        let bounds = Box4::without_ids(p);
        let centroid2 = bounds.min + bounds.max;
        let centroid = Box4 { min: centroid2, max: centroid2 };
        let to = &mut result[side];
        to.bounds = to.bounds.union(bounds);
        to.centroids = to.centroids.union(centroid);
    };
    for (p, &side) in refs.iter().zip(sides) {
        if side == BOTH {
            if let Some([a, b]) = parts.next() {
                lefts[left] = *a;
                rights[right] = *b;
                add(0, a);
                add(1, b);
            }
            left += 1;
            right += 1;
            continue;
        }
        // Without a branch that could be mispredicted: the place where it does not belong is
        // written again by the next that does.
        if let Some(to) = lefts.get_mut(left) {
            *to = *p;
        }
        if let Some(to) = rights.get_mut(right) {
            *to = *p;
        }
        left += usize::from(side == LEFT);
        right += usize::from(side == RIGHT);
        add(usize::from(side), p);
    }
    result[0].count = left;
    result[1].count = right;
    result
}
