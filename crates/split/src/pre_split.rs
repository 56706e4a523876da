//! Splitting as a pass ahead of any builder.

use crate::SplitPartition;
use crate::unite::unite_duplicates;
use niwaki_core::builder::MAX_PRIMS;
use niwaki_core::{BuildError, Builder, Bvh, PrimRef, TriangleMesh};

/// Splits references before a tree is built over them.
pub trait PreSplitter: Sync {
    /// What the names of builders behind this pass end in, such as `pre` in `sweep_pre`.
    fn suffix(&self) -> &'static str;

    /// References to the triangles of a mesh; their boxes together cover each triangle.
    ///
    /// # Errors
    /// [`BuildError::BadSetting`] and [`BuildError::TooManyPrimitives`].
    fn split_mesh(&self, mesh: &TriangleMesh) -> Result<Vec<PrimRef>, BuildError>;

    /// References that together cover each of the given boxes.
    ///
    /// # Errors
    /// As [`PreSplitter::split_mesh`], and [`BuildError::NonFiniteBounds`].
    fn split_boxes(&self, prims: &[PrimRef]) -> Result<Vec<PrimRef>, BuildError>;

    /// The most references that `count` primitives become.
    fn max_references(&self, count: usize) -> usize;

    /// The most bytes that splitting `count` primitives allocates at once, the result included.
    fn memory_bound(&self, count: usize) -> usize;
}

impl PreSplitter for SplitPartition {
    fn suffix(&self) -> &'static str {
        "pre"
    }

    fn split_mesh(&self, mesh: &TriangleMesh) -> Result<Vec<PrimRef>, BuildError> {
        Ok(self.partition_mesh(mesh)?.into_prims())
    }

    fn split_boxes(&self, prims: &[PrimRef]) -> Result<Vec<PrimRef>, BuildError> {
        Ok(self.partition_boxes(prims)?.into_prims())
    }

    fn max_references(&self, count: usize) -> usize {
        self.max_references(count)
    }

    fn memory_bound(&self, count: usize) -> usize {
        // The list without gaps takes less than what partitioning has released by then.
        self.memory_bound(count)
    }
}

/// A builder with a splitting pass ahead of it. Where the builder puts several references to one
/// primitive into one leaf, the leaf keeps one of them.
#[derive(Clone, Debug, PartialEq)]
pub struct PreSplit<B, S> {
    builder: B,
    splitter: S,
    name: String,
}

impl<B: Builder, S: PreSplitter> PreSplit<B, S> {
    /// `builder` over what `splitter` makes of its input, named `builder_suffix`.
    #[must_use]
    pub fn new(builder: B, splitter: S) -> Self {
        let name = format!("{}_{}", builder.name(), splitter.suffix());
        Self { builder, splitter, name }
    }

    fn over(&self, prims: &[PrimRef]) -> Result<Bvh, BuildError> {
        let mut bvh = self.builder.build(prims)?;
        unite_duplicates(&mut bvh);
        Ok(bvh)
    }
}

impl<B: Builder, S: PreSplitter> Builder for PreSplit<B, S> {
    fn name(&self) -> &str {
        &self.name
    }

    fn build(&self, prims: &[PrimRef]) -> Result<Bvh, BuildError> {
        self.over(&self.splitter.split_boxes(prims)?)
    }

    fn build_mesh(&self, mesh: &TriangleMesh) -> Result<Bvh, BuildError> {
        self.over(&self.splitter.split_mesh(mesh)?)
    }

    fn memory_bound(&self, count: usize) -> usize {
        let references = self.splitter.max_references(count);
        let build = size_of::<PrimRef>() * references + self.builder.memory_bound(references);
        // Uniting takes less than building: two lists of ids beside the tree.
        build.max(self.splitter.memory_bound(count))
    }
}

/// Refuses more primitives than a tree can hold.
pub(crate) const fn check_count(count: usize) -> Result<(), BuildError> {
    if count > MAX_PRIMS {
        return Err(BuildError::TooManyPrimitives { count, max: MAX_PRIMS });
    }
    Ok(())
}
