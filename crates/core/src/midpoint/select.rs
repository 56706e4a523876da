//! Mini tree selection: midpoints are halved in space (thesis paper IV, section 5.2).

use super::partition::{Kernel, Sides, partition, partition_parallel};
use super::{Midpoint, Midpoints, Plane};
use crate::{Aabb, layout, memory::prefer_large_pages, to_u32};
use std::ops::Range;
use std::sync::Mutex;

/// Sets of more midpoints are split by all threads.
const SHARED_FROM: usize = 1 << 18;

/// What [`select`] found.
#[derive(Clone, Debug, PartialEq)]
pub struct Selection {
    /// Places of all primitives in their source, group by group.
    pub ids: Vec<u32>,
    /// The groups as ranges of `ids`, in order.
    pub groups: Vec<Range<u32>>,
}

impl Selection {
    /// Bytes that selecting groups among `count` midpoints takes at most at once, those of the
    /// midpoints and of the result included.
    #[must_use]
    pub const fn memory_bound(count: usize) -> usize {
        // Lists that grow have their old half beside them.
        let lists = 3 * size_of::<Range<u32>>();
        (2 * size_of::<Midpoint>() + size_of::<u32>() + lists) * count
    }
}

struct Task<'a> {
    /// The midpoints of this set; `spare` is as long.
    items: &'a mut [Midpoint],
    spare: &'a mut [Midpoint],
    /// Around the midpoints.
    bounds: Aabb,
    /// Where the indices of the set go.
    ids: &'a mut [u32],
    first: usize,
}

/// Splits in the middle of the longest axis of the bounds of the midpoints, on the current rayon
/// pool, until no group is larger than `size` (at least 1); sets that this cannot split, such as
/// equal midpoints, in the middle of their order.
#[must_use]
pub fn select(midpoints: Midpoints, size: usize) -> Selection {
    let Midpoints { mut midpoints, bounds, .. } = midpoints;
    let (count, size) = (midpoints.len(), size.max(1));
    let mut spare: Vec<Midpoint> = bytemuck::zeroed_vec(if count > size { count } else { 0 });
    prefer_large_pages(&spare);
    let mut ids = vec![0_u32; count];
    let groups = Mutex::new(Vec::new());
    let kernel = Kernel::best();
    layout::divide(
        Task { items: &mut midpoints, spare: &mut spare, bounds, ids: &mut ids, first: 0 },
        1 << 14,
        |task| task.items.len(),
        || (),
        |task, ()| {
            if task.items.len() > size {
                return Some(halve(task, kernel));
            }
            for (id, item) in task.ids.iter_mut().zip(task.items.iter()) {
                *id = item.index;
            }
            if !task.ids.is_empty() {
                let group = to_u32(task.first)..to_u32(task.first + task.ids.len());
                groups.lock().expect("no holder of the lock can panic").push(group);
            }
            None
        },
    );
    let mut groups = groups.into_inner().expect("no holder of the lock can panic");
    groups.sort_unstable_by_key(|group| group.start);
    Selection { ids, groups }
}

fn halve(task: Task<'_>, kernel: Kernel) -> [Task<'_>; 2] {
    let Task { mut items, mut spare, bounds, ids, first } = task;
    let count = items.len();
    let mut sides = Sides { left: 0, bounds: [bounds; 2] };
    if let Some(Plane { axis, position }) = Plane::middle(&bounds) {
        // One thread is faster as long as it is not alone: sharing takes two passes.
        if count > SHARED_FROM && rayon::current_num_threads() > 1 {
            sides = partition_parallel(kernel, items, spare, axis, position);
        } else {
            sides = partition(kernel, items, spare, axis, position);
            (items, spare) = (spare, items);
        }
    }
    if sides.left == 0 || sides.left == count {
        sides = Sides { left: count / 2, bounds: [bounds; 2] };
    }
    let (items_left, items_right) = items.split_at_mut(sides.left);
    let (spare_left, spare_right) = spare.split_at_mut(sides.left);
    let (ids_left, ids_right) = ids.split_at_mut(sides.left);
    let [bounds_left, bounds_right] = sides.bounds;
    [
        Task { items: items_left, spare: spare_left, bounds: bounds_left, ids: ids_left, first },
        Task {
            items: items_right,
            spare: spare_right,
            bounds: bounds_right,
            ids: ids_right,
            first: first + sides.left,
        },
    ]
}
