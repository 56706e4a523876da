//! Divides sets of references until they are small enough (thesis paper V, section 4.1).
//!
//! Each set has a region of the array: its references, then free room. References that overlap the
//! plane are known by index; if they are split, one half takes the place of the whole and the other
//! goes to the free room, before the set is partitioned in place. What is left of the room is
//! shared by both sides in proportion to their size. Where the paper moves one side to a new region
//! when the room is used up, all room that splitting may take is part of the array from the start,
//! and a set whose share is used up is not split any more: memory has a bound, and the result does
//! not depend on which set asks first.

use crate::sets::{Plane, Set, Sides, cost};
use crate::shared;
use crate::spread::spread;
use niwaki_core::{Aabb, Clip, PrimRef, layout, to_u32};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Mutex;

/// Larger sets are divided by all threads. The order that this leaves differs from that of one
/// thread, so the limit is the same for any number of them.
const SHARED_FROM: usize = 1 << 16;

/// Sets below this size stay on one thread.
const GRAIN: usize = 1 << 12;

/// When to stop and when to split.
pub(crate) struct Rule {
    pub(crate) group_size: usize,
    pub(crate) reference_cost: f64,
}

impl Rule {
    /// True if a division that costs `cost` and adds `added` references is better than one that
    /// costs `unsplit` over `len`.
    pub(crate) fn pays(&self, cost: f64, unsplit: f64, added: usize, len: usize) -> bool {
        let growth = added as f64 / len as f64;
        cost < unsplit * (1.0 - self.reference_cost * growth)
    }

    /// C_S < C_O for the sets after a split.
    pub(crate) fn prefers(&self, split: &[Set; 2], unsplit: &[Set; 2]) -> bool {
        let count = |sides: &[Set; 2]| sides[0].count + sides[1].count;
        let len = count(unsplit);
        split.iter().all(|set| set.count > 0)
            && self.pays(cost(split), cost(unsplit), count(split).saturating_sub(len), len)
    }
}

/// A set that may have to be divided.
pub(crate) struct Task<'a> {
    /// The references and room for more, which is behind them or, if `at_end`, before them.
    pub(crate) region: &'a mut [PrimRef],
    pub(crate) len: usize,
    pub(crate) at_end: bool,
    /// Index of the region in the whole array.
    pub(crate) first: usize,
    pub(crate) centroids: Aabb,
}

impl Task<'_> {
    /// Where the references are in the region.
    const fn range(&self) -> Range<usize> {
        let start = if self.at_end { self.region.len() - self.len } else { 0 };
        start..start + self.len
    }
}

/// The halves of a reference; the box of a half with nothing in it is empty.
pub(crate) type Halves = [PrimRef; 2];

/// Memory that the sets of one thread share.
#[derive(Default)]
struct Scratch {
    overlapping: Vec<u32>,
    halves: Vec<Halves>,
}

/// Bytes that [`run`] allocates at once for a region of `capacity` that has `count` references.
pub(crate) fn memory_bound(count: usize, capacity: usize) -> usize {
    let room = capacity - count;
    // Indices are in lists that double their size, old and new beside each other.
    let lists = |len: usize| 3 * size_of::<u32>() * len + size_of::<Halves>() * len.min(room);
    let threads = rayon::current_num_threads();
    let groups = 3 * size_of::<Range<u32>>() * capacity;
    lists(capacity).max(threads * lists(capacity.min(SHARED_FROM))) + groups + 65536
}

/// Partitions the references of `whole`, which stand at the start of `region`; returns the groups
/// in order.
pub(crate) fn run<C: Clip + ?Sized>(
    region: &mut [PrimRef],
    whole: &Set,
    rule: &Rule,
    clip: &C,
) -> Vec<Range<u32>> {
    if whole.count == 0 {
        return Vec::new();
    }
    let len = whole.count;
    let root = Task { region, len, at_end: false, first: 0, centroids: whole.centroids() };
    let (mut large, mut small) = (vec![root], Vec::new());
    while let Some(task) = large.pop() {
        if task.len > SHARED_FROM && task.len > rule.group_size {
            large.extend(shared::step(task, rule, clip));
        } else {
            small.push(task);
        }
    }
    let groups = Mutex::new(Vec::new());
    small.into_par_iter().for_each(|task| {
        layout::divide(
            task,
            GRAIN,
            |task| task.len,
            Scratch::default,
            |task, scratch| {
                if task.len > rule.group_size {
                    return Some(step(task, rule, clip, scratch));
                }
                let range = task.range();
                if task.at_end {
                    // Spreading to the end reverses the order; which of equal primitives comes
                    // first is to depend on the input alone.
                    task.region[range.clone()].reverse();
                }
                let Range { start, end } = range;
                let group = to_u32(task.first + start)..to_u32(task.first + end);
                groups.lock().expect("no holder of the lock can panic").push(group);
                None
            },
        );
    });
    let mut groups = groups.into_inner().expect("no holder of the lock can panic");
    groups.sort_unstable_by_key(|group| group.start);
    groups
}

/// Divides a set of at least two references.
fn step<'a, C: Clip + ?Sized>(
    task: Task<'a>,
    rule: &Rule,
    clip: &C,
    scratch: &mut Scratch,
) -> [Task<'a>; 2] {
    let range = task.range();
    let Task { region, mut len, at_end, first, centroids } = task;
    let Some(plane) = Plane::middle(&centroids) else {
        region.copy_within(range, 0);
        return share(region, len, first, len / 2, [centroids; 2], copy);
    };
    let Scratch { overlapping, halves } = scratch;
    overlapping.clear();
    let sides = Sides::measure(&region[range.clone()], plane, overlapping);
    let mut chosen = sides.unsplit();
    if may_split(&sides, plane, rule, len, region.len()) {
        halves.clear();
        let sets = clip_all(&region[range.clone()], overlapping, plane, clip, halves);
        let split = sides.split(&sets);
        if rule.prefers(&split, &chosen) {
            chosen = split;
            let added = chosen[0].count + chosen[1].count - len;
            let (prims, room) = if at_end {
                let (room, prims) = region.split_at_mut(range.start);
                (prims, &mut room[range.start - added..])
            } else {
                region.split_at_mut(len)
            };
            replace(prims, room, overlapping, halves);
            len += added;
        }
    }
    let mut counts = chosen.map(|set| set.count);
    let mut centroids = chosen.map(|set| set.centroids());
    if let Some(flip) = spread(region, counts, at_end, plane) {
        if flip {
            counts.reverse();
            centroids.reverse();
        }
        return share_spread(region, first, counts, centroids);
    }
    let start = if at_end { region.len() - len } else { 0 };
    region.copy_within(start..start + len, 0);
    let left = partition(&mut region[..len], plane);
    share(region, len, first, left, centroids, copy)
}

/// True if there is something to split, room for it, and a gain that is possible.
pub(crate) fn may_split(
    sides: &Sides,
    plane: Plane,
    rule: &Rule,
    len: usize,
    capacity: usize,
) -> bool {
    let added = sides.overlapping();
    added > 0
        && added <= capacity - len
        && rule.pays(sides.least_split_cost(plane), cost(&sides.unsplit()), added, len)
}

/// Fills an empty list with the halves of the references at the given indices and returns S of both
/// sides. A half
/// counts for the side of its middle, which rounding may move to the plane.
pub(crate) fn clip_all<C: Clip + ?Sized>(
    prims: &[PrimRef],
    overlapping: &[u32],
    plane: Plane,
    clip: &C,
    halves: &mut Vec<Halves>,
) -> [Set; 2] {
    let mut sets = [Set::EMPTY; 2];
    if halves.capacity() < overlapping.len() {
        // Nothing is in it, so nothing need be moved.
        *halves = Vec::with_capacity(overlapping.len());
    }
    halves.extend(overlapping.iter().map(|&index| {
        let prim = prims[index as usize];
        let mut halves = clip.clip(&prim, plane.axis, plane.position).map(|half| PrimRef {
            min: half.min,
            max: half.max,
            ..prim
        });
        if halves.iter().all(is_empty) {
            // Nothing of the primitive is in the box, which a builder need not know.
            halves[0] = prim;
        }
        for half in halves.iter().filter(|half| !is_empty(half)) {
            sets[usize::from(!plane.is_left(half))].add(half);
        }
        halves
    }));
    sets
}

pub(crate) fn is_empty(half: &PrimRef) -> bool {
    half.aabb().is_empty()
}

/// Puts one half of each reference in its place and the others into `room`; returns how many those
/// are.
pub(crate) fn replace(
    prims: &mut [PrimRef],
    room: &mut [PrimRef],
    overlapping: &[u32],
    halves: &[Halves],
) -> usize {
    let mut added = 0;
    for (&index, halves) in overlapping.iter().zip(halves) {
        let mut parts = halves.iter().filter(|half| !is_empty(half));
        if let Some(part) = parts.next() {
            prims[index as usize] = *part;
        }
        if let Some(part) = parts.next() {
            room[added] = *part;
            added += 1;
        }
    }
    added
}

/// Moves references whose middle is left of the plane to the front; returns how many there are.
pub(crate) fn partition(prims: &mut [PrimRef], plane: Plane) -> usize {
    // Swaps without a branch, because sides cannot be predicted.
    let mut left = 0;
    for i in 0..prims.len() {
        let prim = prims[i];
        let is_left = plane.is_left(&prim);
        prims[i] = prims[left];
        prims[left] = prim;
        left += usize::from(is_left);
    }
    left
}

/// Copies from the start of the first slice to the second.
fn copy(from: &[PrimRef], to: &mut [PrimRef]) {
    to.copy_from_slice(from);
}

/// How many of `free` places go to the left side of a set of `len` references.
#[expect(clippy::cast_possible_truncation, reason = "at most `free`")]
const fn free_left(free: usize, left: usize, len: usize) -> usize {
    (free as u64 * left as u64 / len as u64) as usize
}

/// Gives each side its share of the free room, which is between them.
fn share_spread(
    region: &mut [PrimRef],
    first: usize,
    [left, right]: [usize; 2],
    [centroids_left, centroids_right]: [Aabb; 2],
) -> [Task<'_>; 2] {
    let len = left + right;
    let border = left + free_left(region.len() - len, left, len);
    let (a, b) = region.split_at_mut(border);
    [
        Task { region: a, len: left, at_end: false, first, centroids: centroids_left },
        Task {
            region: b,
            len: right,
            at_end: true,
            first: first + border,
            centroids: centroids_right,
        },
    ]
}

/// Gives each side its share of the free room; `copy` moves references.
pub(crate) fn share(
    region: &mut [PrimRef],
    len: usize,
    first: usize,
    left: usize,
    centroids: [Aabb; 2],
    copy: impl FnOnce(&[PrimRef], &mut [PrimRef]),
) -> [Task<'_>; 2] {
    let free_left = free_left(region.len() - len, left, len);
    // Order does not matter: the first of the right side become its last.
    let right = len - left;
    let moved = free_left.min(right);
    let (from, to) = region.split_at_mut(left + right.max(free_left));
    copy(&from[left..left + moved], &mut to[..moved]);
    let (a, b) = region.split_at_mut(left + free_left);
    let [centroids_left, centroids_right] = centroids;
    [
        Task { region: a, len: left, at_end: false, first, centroids: centroids_left },
        Task {
            region: b,
            len: right,
            at_end: false,
            first: first + left + free_left,
            centroids: centroids_right,
        },
    ]
}
