//! SAH-guided mid-point split partitioning (thesis paper V, sections 3.2 and 4.1).

use crate::blocks;
use crate::divide::{self, Groups, Rule, Task};
use crate::room::Room;
use niwaki_core::builder::MAX_PRIMS;
use niwaki_core::midpoint::{Midpoints, Selection, Source, select};
use niwaki_core::{Aabb, BoxClip, BuildError, Clip, PrimRef, TriangleMesh, scene_bounds};
use std::ops::Range;

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
    /// What C_S has to gain for the references that it adds: overlapping references are split where
    /// C_S < C_O·(1 − `reference_cost`·g), with g the number of added references as a fraction of
    /// those in the set. Finite and not negative.
    ///
    /// 0 is the paper's rule, which has no such bias. It counts a reference at the area of the
    /// whole half that it falls into, and on even tessellations the gain and the cost of splitting
    /// are about the same: references are added that change nothing.
    pub reference_cost: f32,
}

impl Default for SplitPartition {
    /// The paper's settings, with room for three quarters more references: Sponza takes a fifth, and
    /// a tangle of thin diagonal pipes, where almost everything wants to split, is not better with
    /// more.
    fn default() -> Self {
        Self { group_size: GroupSize::Interpolated, max_extra: 0.75, reference_cost: 0.0 }
    }
}

/// Groups of references, side by side in space.
#[derive(Clone, Debug, PartialEq)]
pub struct Partition {
    /// A reference for each primitive, neighbours near each other.
    prims: Vec<PrimRef>,
    /// References that splitting added, with gaps between groups.
    room: Room,
    groups: Groups,
    input: usize,
    bounds: Aabb,
}

/// The references of one group: runs of them in a longer list, and those that splitting added.
#[derive(Clone, Copy, Debug)]
pub struct Group<'a> {
    prims: &'a [PrimRef],
    runs: &'a [Range<u32>],
    added: &'a [PrimRef],
}

impl<'a> Group<'a> {
    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.parts().map(<[PrimRef]>::len).sum()
    }

    /// True without any; no group of a [`Partition`] is.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The references in slices.
    pub fn parts(&self) -> impl Iterator<Item = &'a [PrimRef]> + use<'a> {
        let Self { prims, runs, added } = *self;
        runs.iter().map(move |run| &prims[within(run)]).chain(std::iter::once(added))
    }

    /// All references.
    pub fn iter(&self) -> impl Iterator<Item = &'a PrimRef> + use<'a> {
        self.parts().flatten()
    }
}

const fn within(range: &Range<u32>) -> Range<usize> {
    range.start as usize..range.end as usize
}

impl Partition {
    /// The groups in order. Splitting puts the parts of a primitive into different groups, so a
    /// group holds no primitive twice that the input held once.
    pub fn groups(&self) -> impl ExactSizeIterator<Item = Group<'_>> {
        let room = self.room.prims();
        self.groups.groups.iter().map(move |group| Group {
            prims: &self.prims,
            runs: &self.groups.runs[within(&group.runs)],
            added: &room[within(&group.room)],
        })
    }

    /// The box around all references.
    #[must_use]
    pub const fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// References in all groups.
    #[must_use]
    pub fn references(&self) -> usize {
        self.groups().map(|group| group.len()).sum()
    }

    /// How many of them splitting added.
    #[must_use]
    pub fn added(&self) -> usize {
        self.references() - self.input
    }

    /// The references, group by group.
    #[must_use]
    pub fn into_prims(self) -> Vec<PrimRef> {
        let mut prims = Vec::with_capacity(self.references());
        for group in self.groups() {
            for part in group.parts() {
                prims.extend_from_slice(part);
            }
        }
        prims
    }
}

impl SplitPartition {
    /// Partitions the triangles of a mesh.
    ///
    /// # Errors
    /// [`BuildError::TooManyPrimitives`], and [`BuildError::BadSetting`] as the fields say.
    pub fn partition_mesh(&self, mesh: &TriangleMesh) -> Result<Partition, BuildError> {
        self.run(mesh, mesh)
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
    /// [`BuildError::NonFiniteBounds`] names the first bad reference; others as
    /// [`SplitPartition::partition_mesh`].
    pub fn partition<C: Clip + ?Sized>(
        &self,
        prims: &[PrimRef],
        clip: &C,
    ) -> Result<Partition, BuildError> {
        self.check()?;
        scene_bounds(prims)?;
        self.run(prims, clip)
    }

    /// Partitions references that are made when they are asked for.
    fn run<S: Source + ?Sized, C: Clip + ?Sized>(
        &self,
        source: &S,
        clip: &C,
    ) -> Result<Partition, BuildError> {
        self.check()?;
        let count = source.count();
        if count > MAX_PRIMS {
            return Err(BuildError::TooManyPrimitives { count, max: MAX_PRIMS });
        }
        let midpoints = Midpoints::of(source);
        let bounds = midpoints.scene;
        let group_size = self.group_size.of(count);
        let selection = select(midpoints, group_size);
        let (mut prims, bounds_of_blocks) = blocks::gather(source, &selection);
        drop(selection);
        let mut room = Room::new(self.max_references(count) - count);
        let root = Task::root(blocks::attach(&mut prims, bounds_of_blocks), room.prims_mut());
        let rule = Rule { group_size, reference_cost: f64::from(self.reference_cost) };
        let groups = divide::run(root, &rule, clip);
        Ok(Partition { prims, room, groups, input: count, bounds })
    }

    /// The most references that `count` primitives become.
    #[must_use]
    pub fn max_references(&self, count: usize) -> usize {
        max_references(count, self.max_extra)
    }

    /// The most bytes that partitioning `count` primitives allocates at once, the result included.
    #[must_use]
    pub fn memory_bound(&self, count: usize) -> usize {
        let capacity = self.max_references(count);
        let dividing =
            size_of::<PrimRef>() * (capacity + 1) + divide::memory_bound(count, capacity - count);
        Selection::memory_bound(count).max(dividing)
    }

    fn check(&self) -> Result<(), BuildError> {
        if self.group_size == GroupSize::Fixed(0) {
            return Err(BuildError::BadSetting {
                setting: "group_size",
                value: "0".into(),
                remedy: "a group holds at least 1 reference",
            });
        }
        if !(self.reference_cost.is_finite() && self.reference_cost >= 0.0) {
            return Err(BuildError::BadSetting {
                setting: "reference_cost",
                value: self.reference_cost.to_string(),
                remedy: "a factor, finite and not negative",
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
    let extra = (count as f64 * f64::from(max_extra)) as usize;
    // No tree could hold more.
    count.saturating_add(extra).min(MAX_PRIMS.max(count))
}
