//! Divides sets of references until they are small enough (thesis paper V, section 4.1).
//!
//! The paper moves references at every plane. Here they stand in the order that mini tree selection
//! gives, which halves midpoints in the same way and moves 16 bytes a primitive, and a set is a list
//! of short blocks of them: most blocks are on one side of a plane, and only what is in the others is
//! looked at. As long as nothing is split, planes are those of the selection and no block has to be
//! cut in two.
//!
//! Of a reference that is split, one half takes the place of the whole, and the other goes to the
//! *room* of its set: those are partitioned at every plane, and what is left of the room is shared by
//! both sides in proportion to their size. Where the paper moves one side to a new region when the
//! room is used up, all room that splitting may take is there from the start, and a set whose share is
//! used up is not split any more: memory has a bound, and the result does not depend on which set asks
//! first.

use crate::blocks::Block;
use crate::step::{self, Scratch, step};
use niwaki_core::midpoint::Plane;
use niwaki_core::{Aabb, Clip, PrimRef, layout, to_u32};
use std::ops::Range;
use std::sync::Mutex;

/// Sets below this size stay on one thread.
const GRAIN: usize = 1 << 12;

/// When to stop and when to split.
pub(crate) struct Rule {
    pub(crate) group_size: usize,
    pub(crate) reference_cost: f64,
}

/// Where the references of all groups are.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Groups {
    pub(crate) groups: Vec<Parts>,
    /// Runs of references in the order of selection.
    pub(crate) runs: Vec<Range<u32>>,
}

/// Where the references of a group are.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Parts {
    /// Which runs.
    pub(crate) runs: Range<u32>,
    /// In the room for halves.
    pub(crate) room: Range<u32>,
}

/// A set that may have to be divided.
pub(crate) struct Task<'a> {
    pub(crate) blocks: Vec<Block<'a>>,
    /// References in blocks.
    pub(crate) in_blocks: usize,
    /// `added` more references, then places for more.
    pub(crate) room: &'a mut [PrimRef],
    pub(crate) added: usize,
    /// Place of `room[0]` in the whole room.
    pub(crate) room_first: usize,
    /// How many references are in sets before this one, at most: for the order of groups.
    pub(crate) before: usize,
}

impl<'a> Task<'a> {
    /// All references, in blocks.
    pub(crate) fn root(blocks: Vec<Block<'a>>, room: &'a mut [PrimRef]) -> Self {
        let in_blocks = blocks.iter().map(|block| block.prims.len()).sum();
        Self { blocks, in_blocks, room, added: 0, room_first: 0, before: 0 }
    }

    pub(crate) const fn len(&self) -> usize {
        self.in_blocks + self.added
    }

    /// Places that are free.
    pub(crate) const fn free(&self) -> usize {
        self.room.len() - self.added
    }

    /// Around the middles of all references.
    pub(crate) fn midpoints(&self) -> Aabb {
        let middles = self.room[..self.added].iter().map(|prim| prim.aabb().center());
        let bounds = self.blocks.iter().map(|block| block.bounds.midpoints);
        bounds.fold(Aabb::from_points(middles), Aabb::union)
    }

    /// Halves a set of at least two references by their order.
    pub(crate) fn halve(mut self) -> [Self; 2] {
        let added_left = self.added / 2;
        // Of an odd number the room has fewer on the left, so blocks have more.
        let mut wanted = self.in_blocks.div_ceil(2);
        let (mut left, mut right) = (Vec::new(), Vec::new());
        for block in std::mem::take(&mut self.blocks) {
            let here = wanted.min(block.prims.len());
            wanted -= here;
            if here == block.prims.len() {
                left.push(block);
            } else if here == 0 {
                right.push(block);
            } else {
                let [a, b] = block.split_at(here);
                left.push(a);
                right.push(b);
            }
        }
        self.share([left, right], added_left)
    }

    /// Both halves: their blocks, and how many references in the room are on the left.
    pub(crate) fn share(
        self,
        [blocks_left, blocks_right]: [Vec<Block<'a>>; 2],
        added_left: usize,
    ) -> [Self; 2] {
        let in_left = blocks_left.iter().map(|block| block.prims.len()).sum::<usize>();
        let free_left = share_of(self.free(), in_left + added_left, self.len());
        let border = added_left + free_left;
        // Order does not matter: the first of the right side may become its last.
        let added_right = self.added - added_left;
        let moved = free_left.min(added_right);
        let to = added_left + free_left.max(added_right);
        self.room.copy_within(added_left..added_left + moved, to);
        let (room_left, room_right) = self.room.split_at_mut(border);
        [
            Self {
                blocks: blocks_left,
                in_blocks: in_left,
                room: room_left,
                added: added_left,
                room_first: self.room_first,
                before: self.before,
            },
            Self {
                blocks: blocks_right,
                in_blocks: self.in_blocks - in_left,
                room: room_right,
                added: added_right,
                room_first: self.room_first + border,
                before: self.before + in_left + border,
            },
        ]
    }
}

/// How many of `free` places go to the left side, `left` of `len` references.
#[expect(clippy::cast_possible_truncation, reason = "at most `free`")]
const fn share_of(free: usize, left: usize, len: usize) -> usize {
    (free as u64 * left as u64 / len as u64) as usize
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

/// Divides a set down to groups, in order.
pub(crate) fn run<C: Clip + ?Sized>(root: Task<'_>, rule: &Rule, clip: &C) -> Groups {
    let found = Mutex::new((Vec::new(), Vec::new()));
    layout::divide(root, GRAIN, Task::len, Scratch::default, |task, scratch| {
        if task.len() > rule.group_size {
            return Some(step(task, rule, clip, scratch));
        }
        if task.len() > 0 {
            let room = to_u32(task.room_first)..to_u32(task.room_first + task.added);
            let mut found = found.lock().expect("no holder of the lock can panic");
            let (groups, runs) = &mut *found;
            let first_run = runs.len();
            for block in &task.blocks {
                let run = block.first..block.first + to_u32(block.prims.len());
                match runs[first_run..].last_mut() {
                    Some(Range { end, .. }) if *end == run.start => *end = run.end,
                    _ => runs.push(run),
                }
            }
            groups.push((
                to_u32(task.before),
                Parts { runs: to_u32(first_run)..to_u32(runs.len()), room },
            ));
        }
        None
    });
    let (mut groups, runs) = found.into_inner().expect("no holder of the lock can panic");
    groups.sort_unstable_by_key(|(before, _)| *before);
    let mut sorted =
        Groups { groups: Vec::with_capacity(groups.len()), runs: Vec::with_capacity(runs.len()) };
    for (_, Parts { runs: here, room }) in groups {
        let first = to_u32(sorted.runs.len());
        sorted.runs.extend_from_slice(&runs[here.start as usize..here.end as usize]);
        sorted.groups.push(Parts { runs: first..to_u32(sorted.runs.len()), room });
    }
    sorted
}

/// Bytes that [`run`] and the blocks that it is given take at once, of `count` references with
/// `free` places for more, beside the references.
pub(crate) fn memory_bound(count: usize, free: usize) -> usize {
    // At worst every reference is a block; those of a set and of its halves are there at once.
    let blocks = 2 * size_of::<Block<'_>>() * count;
    // Lists that grow have their old half beside them.
    let groups = 3 * (size_of::<(u32, Parts)>() * (count + free) + size_of::<Range<u32>>() * count);
    blocks + groups + step::memory_bound(count, free)
}

#[cfg(test)]
mod tests {
    use super::*;
    use niwaki_core::TriangleMesh;
    use proptest::prelude::*;

    /// The references of each group, sorted.
    fn groups(mesh: &TriangleMesh, rule: &Rule, block: usize, room: usize) -> Vec<Vec<[u32; 8]>> {
        let mut prims = mesh.prim_refs();
        let mut room = vec![PrimRef::new(Aabb::EMPTY, u32::MAX); room];
        let firsts = (0..).step_by(block);
        let blocks: Vec<Block<'_>> = prims
            .chunks_mut(block)
            .zip(firsts)
            .map(|(prims, first)| Block::new(prims, first))
            .collect();
        let Groups { groups, runs } = run(Task::root(blocks, &mut room), rule, mesh);
        let within = |range: &Range<u32>| range.start as usize..range.end as usize;
        let mut result = Vec::new();
        for Parts { runs: here, room: added } in groups {
            let runs = runs[within(&here)].iter().flat_map(|run| &prims[within(run)]);
            let mut group: Vec<[u32; 8]> =
                runs.chain(&room[within(&added)]).map(|prim| bytemuck::cast(*prim)).collect();
            group.sort_unstable();
            result.push(group);
        }
        result
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        /// One block of everything is the paper's method: each set is looked at as a whole and
        /// partitioned in place.
        #[test]
        fn blocks_only_save_work(
            count in 1_usize..3000,
            size in 0.01_f32..0.3,
            seed in 0_u64..1000,
            block in 1_usize..100,
            group_size in 1_usize..100,
            reference_cost in prop::sample::select(vec![0.0, 1.5]),
            room in 0_usize..4000,
        ) {
            let mesh = niwaki_hard_cases::soup_mesh(count, size, seed);
            let rule = Rule { group_size, reference_cost };
            let whole = groups(&mesh, &rule, mesh.len(), room);
            prop_assert!(whole.iter().all(|group| (1..=group_size).contains(&group.len())));
            prop_assert_eq!(groups(&mesh, &rule, block, room), whole);
        }
    }
}
