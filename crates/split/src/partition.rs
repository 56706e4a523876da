//! SAH-guided mid-point split partitioning (thesis paper V, sections 3.2 and 4.1).

use crate::sets::{Plane, Set, Sides, cost};
use niwaki_core::builder::MAX_PRIMS;
use niwaki_core::{
    Aabb, BoxClip, BuildError, Clip, PrimRef, TriangleMesh, layout, scene_bounds, to_u32,
};
use std::ops::Range;
use std::sync::Mutex;

/// Where partitioning ends: the most references of a group.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum GroupSize {
    /// The paper's: 512 for inputs of up to 100,000 primitives, 8192 for 4,000,000 and more, and
    /// linear in between.
    #[default]
    Interpolated,
    /// This many, at least 1.
    Fixed(u32),
}

impl GroupSize {
    /// The number for an input of `count` primitives.
    #[must_use]
    pub const fn of(self, count: usize) -> usize {
        const FROM: (usize, usize) = (100_000, 512);
        const TO: (usize, usize) = (4_000_000, 8192);
        match self {
            Self::Fixed(size) => size as usize,
            Self::Interpolated if count <= FROM.0 => FROM.1,
            Self::Interpolated if count >= TO.0 => TO.1,
            Self::Interpolated => FROM.1 + (count - FROM.0) * (TO.1 - FROM.1) / (TO.0 - FROM.0),
        }
    }
}

/// Divides references into groups at the middle of their centroids, and those that overlap a plane
/// in two where that is cheaper by the surface area heuristic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplitPartition {
    /// Where partitioning ends.
    pub group_size: GroupSize,
    /// The most references that splitting adds, as a fraction of the input: 0 splits nothing. Room
    /// for them is reserved from the start. Finite and not negative.
    pub max_extra: f32,
}

impl Default for SplitPartition {
    fn default() -> Self {
        Self { group_size: GroupSize::Interpolated, max_extra: 1.0 }
    }
}

/// Groups of references, side by side in space.
#[derive(Clone, Debug, PartialEq)]
pub struct Partition {
    /// Groups with gaps between them.
    prims: Vec<PrimRef>,
    groups: Vec<Range<u32>>,
    input: usize,
    bounds: Aabb,
}

impl Partition {
    /// The groups in order. Splitting puts the parts of a primitive into different groups, so a
    /// group holds no primitive twice that the input held once.
    pub fn groups(&self) -> impl ExactSizeIterator<Item = &[PrimRef]> {
        self.groups.iter().map(|group| &self.prims[group.start as usize..group.end as usize])
    }

    /// The box around all references.
    #[must_use]
    pub const fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// References in all groups.
    #[must_use]
    pub fn references(&self) -> usize {
        self.groups.iter().map(ExactSizeIterator::len).sum()
    }

    /// How many of them splitting added.
    #[must_use]
    pub fn added(&self) -> usize {
        self.references() - self.input
    }

    /// The references without gaps, group by group.
    #[must_use]
    pub fn into_prims(mut self) -> Vec<PrimRef> {
        let mut end = 0;
        for group in &self.groups {
            let group = group.start as usize..group.end as usize;
            let len = group.len();
            if group.start > end {
                self.prims.copy_within(group, end);
            }
            end += len;
        }
        self.prims.truncate(end);
        self.prims
    }
}

impl SplitPartition {
    /// Partitions the triangles of a mesh.
    ///
    /// # Errors
    /// [`BuildError::BadSetting`] and [`BuildError::TooManyPrimitives`].
    pub fn partition_mesh(&self, mesh: &TriangleMesh) -> Result<Partition, BuildError> {
        self.partition(&mesh.prim_refs(), mesh)
    }

    /// Partitions boxes of which nothing else is known.
    ///
    /// # Errors
    /// As [`SplitPartition::partition`].
    pub fn partition_boxes(&self, prims: &[PrimRef]) -> Result<Partition, BuildError> {
        self.partition(prims, &BoxClip)
    }

    /// Partitions references to primitives that `clip` knows.
    ///
    /// # Errors
    /// [`BuildError::NonFiniteBounds`] names the first bad reference;
    /// [`BuildError::TooManyPrimitives`] counts those that splitting may add;
    /// [`BuildError::BadSetting`] as the fields say.
    pub fn partition<C: Clip + ?Sized>(
        &self,
        prims: &[PrimRef],
        clip: &C,
    ) -> Result<Partition, BuildError> {
        self.check()?;
        let input = prims.len();
        let capacity = self.max_references(input);
        if capacity > MAX_PRIMS {
            return Err(BuildError::TooManyPrimitives { count: capacity, max: MAX_PRIMS });
        }
        let bounds = scene_bounds(prims)?.bounds;
        let mut all = bytemuck::zeroed_vec(capacity);
        all[..input].copy_from_slice(prims);
        let groups = run(&mut all, input, self.group_size.of(input), clip);
        Ok(Partition { prims: all, groups, input, bounds })
    }

    /// The most references that `count` primitives become.
    #[must_use]
    pub fn max_references(&self, count: usize) -> usize {
        max_references(count, self.max_extra)
    }

    fn check(&self) -> Result<(), BuildError> {
        if self.group_size == GroupSize::Fixed(0) {
            return Err(BuildError::BadSetting {
                setting: "group_size",
                value: "0".into(),
                remedy: "a group holds at least 1 reference",
            });
        }
        check_max_extra(self.max_extra)
    }
}

pub(crate) fn check_max_extra(max_extra: f32) -> Result<(), BuildError> {
    if !(max_extra.is_finite() && max_extra >= 0.0) {
        return Err(BuildError::BadSetting {
            setting: "max_extra",
            value: max_extra.to_string(),
            remedy: "a fraction of the input, finite and not negative",
        });
    }
    Ok(())
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a checked fraction; what does not fit saturates and is refused by its size"
)]
pub(crate) fn max_references(count: usize, max_extra: f32) -> usize {
    count.saturating_add((count as f64 * f64::from(max_extra)) as usize)
}

/// A set that may have to be divided.
struct Task<'a> {
    /// The references, then room for more.
    region: &'a mut [PrimRef],
    len: usize,
    /// Index of the region in the whole array.
    first: usize,
    centroids: Aabb,
}

/// Partitions the first `count` references of `all`; returns the groups in order.
fn run<C: Clip + ?Sized>(
    all: &mut [PrimRef],
    count: usize,
    group_size: usize,
    clip: &C,
) -> Vec<Range<u32>> {
    if count == 0 {
        return Vec::new();
    }
    let mut whole = Set::EMPTY;
    for prim in &all[..count] {
        whole.add(prim.aabb());
    }
    let groups = Mutex::new(Vec::new());
    layout::divide(
        Task { region: all, len: count, first: 0, centroids: whole.centroids },
        1 << 13,
        |task| task.len,
        Vec::new,
        |task, overlapping| {
            if task.len > group_size {
                return Some(step(task, clip, overlapping));
            }
            let group = to_u32(task.first)..to_u32(task.first + task.len);
            groups.lock().expect("no holder of the lock can panic").push(group);
            None
        },
    );
    let mut groups = groups.into_inner().expect("no holder of the lock can panic");
    groups.sort_unstable_by_key(|group| group.start);
    groups
}

/// Divides a set of at least two references.
fn step<'a, C: Clip + ?Sized>(
    task: Task<'a>,
    clip: &C,
    overlapping: &mut Vec<u32>,
) -> [Task<'a>; 2] {
    let Task { region, mut len, first, centroids } = task;
    let Some(plane) = Plane::middle(&centroids) else {
        return divide(region, len, first, len / 2, [centroids; 2]);
    };
    overlapping.clear();
    let mut sides = Sides::EMPTY;
    sides.measure(&region[..len], 0, plane, overlapping);
    let mut chosen = sides.unsplit();
    if !overlapping.is_empty() && len + overlapping.len() <= region.len() {
        let mut split = [Set::EMPTY; 2];
        for &index in overlapping.iter() {
            let halves = clip.clip(&region[index as usize], plane.axis, plane.position);
            for (set, half) in split.iter_mut().zip(halves) {
                if !half.is_empty() {
                    set.add(half);
                }
            }
        }
        let halved = sides.split(&split);
        if halved.iter().all(|set| set.count > 0) && cost(&halved) < cost(&chosen) {
            chosen = halved;
            for &index in overlapping.iter() {
                let prim = region[index as usize];
                let halves = clip.clip(&prim, plane.axis, plane.position);
                let mut parts = halves.iter().filter(|half| !half.is_empty()).map(|half| PrimRef {
                    min: half.min,
                    max: half.max,
                    ..prim
                });
                if let Some(part) = parts.next() {
                    region[index as usize] = part;
                }
                if let Some(part) = parts.next() {
                    region[len] = part;
                    len += 1;
                }
            }
        }
    }
    let mut left = 0;
    for i in 0..len {
        if plane.is_left(&region[i]) {
            region.swap(i, left);
            left += 1;
        }
    }
    divide(region, len, first, left, chosen.map(|set| set.centroids))
}

/// Gives each side its share of the free room.
fn divide(
    region: &mut [PrimRef],
    len: usize,
    first: usize,
    left: usize,
    centroids: [Aabb; 2],
) -> [Task<'_>; 2] {
    let free = region.len() - len;
    #[expect(clippy::cast_possible_truncation, reason = "at most `free`")]
    let free_left = (free as u64 * left as u64 / len as u64) as usize;
    // Order does not matter: the first of the right side become its last.
    let right = len - left;
    let moved = free_left.min(right);
    region.copy_within(left..left + moved, left + right.max(free_left));
    let (a, b) = region.split_at_mut(left + free_left);
    let [centroids_left, centroids_right] = centroids;
    [
        Task { region: a, len: left, first, centroids: centroids_left },
        Task { region: b, len: right, first: first + left + free_left, centroids: centroids_right },
    ]
}
