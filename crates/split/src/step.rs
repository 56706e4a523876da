//! One plane: which references overlap it, whether they are split, and what is on either side.

use crate::blocks::{Block, Place};
use crate::divide::{Rule, Task, partition};
use crate::sets::{Set, Sides, cost};
use niwaki_core::glam::Vec4;
use niwaki_core::midpoint::Plane;
use niwaki_core::{Aabb, Clip, PrimRef, to_u32};
use rayon::prelude::*;

/// More references than this are scanned or clipped by all threads.
const SHARED_FROM: usize = 1 << 14;

/// References of one piece of that work.
const CHUNK: usize = 1 << 11;

/// References that are scanned between two looks at what was found.
const SCAN: usize = 64;

/// The halves of a reference by the side of their middle; the box of a half with nothing in it is
/// empty.
type Halves = [PrimRef; 2];

/// Memory that the sets of one thread share.
#[derive(Default)]
pub(crate) struct Scratch {
    /// Blocks that the plane may cut.
    near: Vec<Near>,
    /// References that overlap the plane.
    across: Vec<At>,
    halves: Vec<Halves>,
}

/// A block and where the plane is.
#[derive(Clone, Copy)]
struct Near {
    block: u32,
    place: Place,
}

/// Where a reference is.
#[derive(Clone, Copy)]
struct At {
    /// Which block, or [`At::ROOM`].
    block: u32,
    /// Place in it.
    index: u32,
}

impl At {
    const ROOM: u32 = u32::MAX;

    #[inline]
    fn of<'t>(&self, task: &'t Task<'_>) -> &'t PrimRef {
        if self.block == Self::ROOM {
            &task.room[self.index as usize]
        } else {
            &task.blocks[self.block as usize].prims[self.index as usize]
        }
    }
}

/// Bytes of scratch memory that sets of `count` references with `free` places for more take.
pub(crate) fn memory_bound(count: usize, free: usize) -> usize {
    let lists = |count: usize, free: usize| {
        // A list that grows has its old half beside it; no more are clipped than there is room for.
        let growing = 3 * size_of::<At>() * (count + free);
        size_of::<Near>() * count + growing + size_of::<Halves>() * free
    };
    // Threads work on sets that are disjoint, and keep the lists of small ones.
    let kept = lists(SHARED_FROM.min(count), SHARED_FROM.min(free));
    lists(count, free) + rayon::current_num_threads() * kept + 65536
}

impl Rule {
    /// True if a division that costs `cost` and adds `added` references is better than one that
    /// costs `unsplit` over `len`.
    fn pays(&self, cost: f64, unsplit: f64, added: usize, len: usize) -> bool {
        let growth = added as f64 / len as f64;
        cost < unsplit * (1.0 - self.reference_cost * growth)
    }

    /// True if there is something to split and a gain is possible, before anything is clipped.
    fn may_prefer(&self, sides: &Sides, plane: Plane) -> bool {
        let unsplit = sides.unsplit();
        let len = unsplit[0].count + unsplit[1].count;
        let added = sides.overlapping();
        added > 0 && self.pays(sides.least_split_cost(plane), cost(&unsplit), added, len)
    }

    /// C_S < C_O for the sets after a split.
    fn prefers(&self, split: &[Set; 2], unsplit: &[Set; 2]) -> bool {
        let count = |sides: &[Set; 2]| sides[0].count + sides[1].count;
        let len = count(unsplit);
        split.iter().all(|set| set.count > 0)
            && self.pays(cost(split), cost(unsplit), count(split).saturating_sub(len), len)
    }
}

/// Divides a set of at least two references.
pub(crate) fn step<'a, C: Clip + ?Sized>(
    mut task: Task<'a>,
    rule: &Rule,
    clip: &C,
    scratch: &mut Scratch,
) -> [Task<'a>; 2] {
    let Some(plane) = Plane::middle(&task.midpoints()) else {
        return task.halve();
    };
    let sides = measure(&task, plane, scratch);
    let Scratch { near, across, halves } = scratch;
    let mut is_split = false;
    if sides.overlapping() <= task.free() && rule.may_prefer(&sides, plane) {
        let sets = clip_all(&task, across, plane, clip, halves);
        is_split = rule.prefers(&sides.split(&sets), &sides.unsplit());
        if is_split {
            replace(&mut task, across, halves);
        }
    }
    if is_split {
        for near in &*near {
            task.blocks[near.block as usize].refresh();
        }
    }
    let blocks = partition_blocks(std::mem::take(&mut task.blocks), plane);
    if task.len() > SHARED_FROM {
        // Other threads may have sets as large next.
        *scratch = Scratch::default();
    }
    let added_left = partition(&mut task.room[..task.added], plane);
    task.share(blocks, added_left)
}

/// D and O of both sides of the plane; leaves what overlaps in the scratch list.
fn measure(task: &Task<'_>, plane: Plane, scratch: &mut Scratch) -> Sides {
    let Scratch { near, across, .. } = scratch;
    near.clear();
    // No more than that: lists that grow would take more memory.
    near.reserve_exact(task.blocks.len());
    across.clear();
    let mut sides = Sides::EMPTY;
    let mut len = 0;
    for (block, index) in task.blocks.iter().zip(0..) {
        match block.bounds.place(plane) {
            Place::Apart(side) => {
                let Aabb { min, max } = block.bounds.aabb;
                let (min, max) = (min.extend(0.0), max.extend(0.0));
                let set = &mut sides.disjoint[usize::from(side)];
                *set = set.union(Set { count: block.prims.len(), min, max });
            }
            place => {
                near.push(Near { block: index, place });
                len += block.prims.len();
            }
        }
    }
    if len <= SHARED_FROM {
        scan(&task.blocks, near, plane, &mut sides, across);
    } else {
        let parts: Vec<(Sides, Vec<At>)> = near
            .par_chunks((near.len() * CHUNK).div_ceil(len))
            .map(|near| {
                let (mut sides, mut across) = (Sides::EMPTY, Vec::new());
                scan(&task.blocks, near, plane, &mut sides, &mut across);
                (sides, across)
            })
            .collect();
        for (part, found) in parts {
            sides = sides.union(&part);
            across.extend_from_slice(&found);
        }
    }
    for (prim, index) in task.room[..task.added].iter().zip(0..) {
        if sides.add(prim, plane) {
            across.push(At { block: At::ROOM, index });
        }
    }
    sides
}

/// Adds the references of some blocks, and appends where those are that overlap the plane.
fn scan(
    blocks: &[Block<'_>],
    near: &[Near],
    plane: Plane,
    sides: &mut Sides,
    across: &mut Vec<At>,
) {
    let mut found = [0; SCAN];
    for &Near { block, place } in near {
        for (prims, start) in blocks[block as usize].prims.chunks(SCAN).zip((0..).step_by(SCAN)) {
            let count = match place {
                Place::Near(0) => {
                    scan_near::<false>(prims, plane, &mut sides.disjoint[0], &mut found)
                }
                Place::Near(_) => {
                    scan_near::<true>(prims, plane, &mut sides.disjoint[1], &mut found)
                }
                _ => {
                    found = std::array::from_fn(to_u32);
                    prims.len()
                }
            };
            for &index in &found[..count] {
                if sides.add(&prims[index as usize], plane) {
                    across.push(At { block, index: start + index });
                }
            }
        }
    }
}

/// Adds references with their middle left of the plane, or right of it, to D of that side, but for
/// those that reach to the plane and beyond it. Lists those and returns their number.
#[inline]
fn scan_near<const RIGHT: bool>(
    prims: &[PrimRef],
    plane: Plane,
    set: &mut Set,
    found: &mut [u32; SCAN],
) -> usize {
    let position = Vec4::splat(plane.position);
    let (mut min, mut max) = (set.min, set.max);
    let mut count = 0;
    for (prim, index) in prims.iter().zip(0..) {
        let corners: [Vec4; 2] = bytemuck::cast(*prim);
        let [low, high] = plane.extent(prim);
        let is_beyond = if RIGHT {
            Vec4::splat(low).cmplt(position)
        } else {
            Vec4::splat(high).cmpgt(position)
        };
        min = min.min(Vec4::select(is_beyond, Vec4::INFINITY, corners[0]));
        max = max.max(Vec4::select(is_beyond, Vec4::NEG_INFINITY, corners[1]));
        // Storing each place, whether it counts or not, costs less than a branch.
        found[count & (SCAN - 1)] = index;
        count += (is_beyond.bitmask() & 1) as usize;
    }
    (set.min, set.max) = (min, max);
    set.count += prims.len() - count;
    count
}

/// Fills a list with the halves of some references and returns S of both sides.
fn clip_all<C: Clip + ?Sized>(
    task: &Task<'_>,
    across: &[At],
    plane: Plane,
    clip: &C,
    halves: &mut Vec<Halves>,
) -> [Set; 2] {
    halves.clear();
    // No more than that: lists may be as long as the room.
    halves.reserve_exact(across.len());
    if across.len() > SHARED_FROM {
        let clipped = across.par_iter().with_min_len(CHUNK);
        clipped.map(|at| clip_one(at.of(task), plane, clip)).collect_into_vec(halves);
    } else {
        halves.extend(across.iter().map(|at| clip_one(at.of(task), plane, clip)));
    }
    let mut sets = [Set::EMPTY; 2];
    for halves in &*halves {
        for (set, half) in sets.iter_mut().zip(halves).filter(|(_, half)| !is_empty(half)) {
            set.add(half);
        }
    }
    sets
}

fn clip_one<C: Clip + ?Sized>(prim: &PrimRef, plane: Plane, clip: &C) -> Halves {
    let half = |aabb: Aabb| PrimRef { min: aabb.min, max: aabb.max, ..*prim };
    let empty = half(Aabb::EMPTY);
    let alone = |part: PrimRef| if plane.is_left(&part) { [part, empty] } else { [empty, part] };
    let parts = clip.clip(prim, plane.axis, plane.position).map(half);
    match parts.each_ref().map(is_empty) {
        [false, false] if plane.is_left(&parts[0]) && !plane.is_left(&parts[1]) => parts,
        [false, true] => alone(parts[0]),
        [true, false] => alone(parts[1]),
        // Nothing of the primitive is in the box, which a builder need not know; or rounding moves
        // the middle of a half to the other side, and a group would name the primitive twice.
        _ => alone(*prim),
    }
}

fn is_empty(half: &PrimRef) -> bool {
    half.aabb().is_empty()
}

/// Puts one half of each reference in its place and the other into the room.
fn replace(task: &mut Task<'_>, across: &[At], halves: &[Halves]) {
    for (at, [left, right]) in across.iter().zip(halves) {
        let [stays, goes] = if is_empty(left) { [right, left] } else { [left, right] };
        let place = if at.block == At::ROOM {
            &mut task.room[at.index as usize]
        } else {
            &mut task.blocks[at.block as usize].prims[at.index as usize]
        };
        *place = *stays;
        if !is_empty(goes) {
            task.room[task.added] = *goes;
            task.added += 1;
        }
    }
}

/// Deals out blocks by the side of their midpoints and cuts those that have some on either.
fn partition_blocks<'a>(blocks: Vec<Block<'a>>, plane: Plane) -> [Vec<Block<'a>>; 2] {
    let (mut left, mut right) = (Vec::new(), Vec::new());
    // Exactly as many as there will be: lists that grow would take more memory.
    let mut counts = [0, 0];
    for block in &blocks {
        let place = block.bounds.place(plane);
        counts[0] += usize::from(!matches!(place, Place::Apart(1) | Place::Near(1)));
        counts[1] += usize::from(!matches!(place, Place::Apart(0) | Place::Near(0)));
    }
    left.reserve_exact(counts[0]);
    right.reserve_exact(counts[1]);
    for block in blocks {
        match block.bounds.place(plane) {
            Place::Apart(0) | Place::Near(0) => left.push(block),
            Place::Apart(_) | Place::Near(_) => right.push(block),
            Place::Astride => {
                let border = partition(block.prims, plane);
                let [a, b] = block.split_at(border);
                left.push(a);
                right.push(b);
            }
        }
    }
    [left, right]
}
