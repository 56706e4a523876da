//! Mini tree selection: midpoints are halved in space (thesis paper IV, section 5.2).

use crate::source::Midpoint;
use niwaki_core::{Aabb, glam::Vec4, layout, to_u32};
use std::ops::Range;
use std::sync::Mutex;

struct Task<'a> {
    /// The midpoints of this set; `spare` is as long.
    items: &'a mut [Midpoint],
    spare: &'a mut [Midpoint],
    /// Where the indices of the set go.
    ids: &'a mut [u32],
    first: usize,
}

/// Splits until no group is larger than `size`. Returns the indices of all primitives, group by
/// group, and the groups as ranges of that list, in order.
pub(crate) fn select(mut midpoints: Vec<Midpoint>, size: usize) -> (Vec<u32>, Vec<Range<u32>>) {
    let count = midpoints.len();
    let mut spare = bytemuck::zeroed_vec(if count > size { count } else { 0 });
    let mut ids = vec![0_u32; count];
    let groups = Mutex::new(Vec::new());
    layout::divide(
        Task { items: &mut midpoints, spare: &mut spare, ids: &mut ids, first: 0 },
        1 << 14,
        |task| task.items.len(),
        || (),
        |task, ()| {
            if task.items.len() > size {
                return Some(halve(task));
            }
            for (id, item) in task.ids.iter_mut().zip(task.items.iter()) {
                *id = item.index;
            }
            let group = to_u32(task.first)..to_u32(task.first + task.ids.len());
            groups.lock().expect("no holder of the lock can panic").push(group);
            None
        },
    );
    let mut groups = groups.into_inner().expect("no holder of the lock can panic");
    groups.sort_unstable_by_key(|group| group.start);
    (ids, groups)
}

/// Splits in the middle of the longest axis of the bounds of the midpoints; sets that this cannot
/// split, such as equal midpoints, in the middle of their order.
fn halve(task: Task<'_>) -> [Task<'_>; 2] {
    let count = task.items.len();
    let bounds = bounds(task.items);
    let axis = bounds.longest_axis();
    let (min, max) = (bounds.min[axis], bounds.max[axis]);
    // Between neighbouring numbers the middle may round down to the smaller, and nothing would
    // go left.
    let middle = min * 0.5 + max * 0.5;
    let plane = if middle > min { middle } else { max };
    let (mut left, mut right) = (0, count);
    if min < max {
        for item in task.items.iter() {
            let is_left = item.center[axis] < plane;
            // Both are written and one counts: cheaper than a branch that cannot be predicted.
            task.spare[left] = *item;
            task.spare[right - 1] = *item;
            left += usize::from(is_left);
            right -= usize::from(!is_left);
        }
    }
    let (items, spare) = if left == 0 || left == count {
        left = count / 2;
        (task.items, task.spare)
    } else {
        (task.spare, task.items)
    };
    let (items_left, items_right) = items.split_at_mut(left);
    let (spare_left, spare_right) = spare.split_at_mut(left);
    let (ids_left, ids_right) = task.ids.split_at_mut(left);
    [
        Task { items: items_left, spare: spare_left, ids: ids_left, first: task.first },
        Task { items: items_right, spare: spare_right, ids: ids_right, first: task.first + left },
    ]
}

/// Around all midpoints. Four boxes grow in turn, because each depends on itself before.
fn bounds(items: &[Midpoint]) -> Aabb {
    const WAYS: usize = 4;
    let items: &[Vec4] = bytemuck::cast_slice(items);
    let (mut min, mut max) = ([Vec4::INFINITY; WAYS], [Vec4::NEG_INFINITY; WAYS]);
    let mut chunks = items.chunks_exact(WAYS);
    for chunk in &mut chunks {
        for way in 0..WAYS {
            // The fourth component is an index and has no meaning as a number.
            min[way] = min[way].min(chunk[way]);
            max[way] = max[way].max(chunk[way]);
        }
    }
    for item in chunks.remainder() {
        min[0] = min[0].min(*item);
        max[0] = max[0].max(*item);
    }
    let min = min.into_iter().fold(Vec4::INFINITY, Vec4::min);
    let max = max.into_iter().fold(Vec4::NEG_INFINITY, Vec4::max);
    Aabb::new(min.truncate(), max.truncate())
}
