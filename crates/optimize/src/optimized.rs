//! A builder whose trees are optimized.

use crate::Optimizer;
use niwaki_core::{BuildError, Builder, Bvh, PrimRef, TriangleMesh};

/// A builder and a pass over what it builds, as one builder.
#[derive(Clone, Debug)]
pub struct Optimized<B, O> {
    name: String,
    builder: B,
    optimizer: O,
    references: f64,
}

impl<B: Builder, O: Optimizer> Optimized<B, O> {
    /// Named after both, such as `sweep+reinsert`.
    #[must_use]
    pub fn new(builder: B, optimizer: O) -> Self {
        let name = format!("{}+{}", builder.name(), optimizer.name());
        Self { name, builder, optimizer, references: 1.0 }
    }

    /// The same with another name.
    #[must_use]
    pub fn named(self, name: impl Into<String>) -> Self {
        Self { name: name.into(), ..self }
    }

    /// The same for a builder that splits primitives into at most so many references each, on
    /// average, which only [`Builder::memory_bound`] needs to know. 1 by default.
    #[must_use]
    pub fn with_references_per_prim(self, references: f64) -> Self {
        Self { references: references.max(1.0), ..self }
    }

    /// The builder inside.
    pub const fn builder(&self) -> &B {
        &self.builder
    }

    /// The pass.
    pub const fn optimizer(&self) -> &O {
        &self.optimizer
    }
}

impl<B: Builder, O: Optimizer> Builder for Optimized<B, O> {
    fn name(&self) -> &str {
        &self.name
    }

    fn build(&self, prims: &[PrimRef]) -> Result<Bvh, BuildError> {
        let mut bvh = self.builder.build(prims)?;
        self.optimizer.optimize(&mut bvh)?;
        Ok(bvh)
    }

    fn build_mesh(&self, mesh: &TriangleMesh) -> Result<Bvh, BuildError> {
        let mut bvh = self.builder.build_mesh(mesh)?;
        self.optimizer.optimize(&mut bvh)?;
        Ok(bvh)
    }

    fn memory_bound(&self, count: usize) -> usize {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a count times a factor of at least 1, rounded up; saturates"
        )]
        let references = (count as f64 * self.references).ceil() as usize;
        let nodes = 2 * references;
        let tree = 32 * nodes + 4 * references;
        let optimizer = self.optimizer.memory_bound(nodes, references);
        self.builder.memory_bound(count).max(tree + optimizer)
    }
}
