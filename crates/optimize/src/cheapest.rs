//! Several builders, of whose trees the best is kept.

use niwaki_core::{BuildError, Builder, Bvh, PrimRef, SahConstants, TriangleMesh};
use niwaki_metrics::sah;

/// Builds a tree by each of several builders and keeps the one of the least SAH cost; the first
/// among equals.
///
/// No builder is the best on all scenes: those that split triangles win by far where triangles are
/// long and cross, and lose where they are walls. Passes that follow can leave the neighbourhood of
/// the tree they are given only so far, so that building twice pays when a tree is kept for long.
///
/// Trees are built one after the other, each on all threads.
pub struct Cheapest {
    name: String,
    /// With the most references a primitive that each builder makes.
    builders: Vec<(Box<dyn Builder + Send>, f64)>,
    constants: SahConstants,
}

impl Cheapest {
    /// The first builder to choose from, which makes at most so many references a primitive: 1
    /// unless it splits. Costs are by the default [`SahConstants`].
    #[must_use]
    pub fn new(builder: impl Builder + Send + 'static, references: f64) -> Self {
        let name = builder.name().to_owned();
        let builders: Vec<(Box<dyn Builder + Send>, f64)> =
            vec![(Box::new(builder), references.max(1.0))];
        Self { name, builders, constants: SahConstants::default() }
    }

    /// The same with another builder to choose from; the name becomes `first|second`.
    #[must_use]
    pub fn or(mut self, builder: impl Builder + Send + 'static, references: f64) -> Self {
        self.name = format!("{}|{}", self.name, builder.name());
        self.builders.push((Box::new(builder), references.max(1.0)));
        self
    }

    /// The same by other constants.
    #[must_use]
    pub fn with_constants(self, constants: SahConstants) -> Self {
        Self { constants, ..self }
    }

    fn least(
        &self,
        build: impl Fn(&dyn Builder) -> Result<Bvh, BuildError>,
    ) -> Result<Bvh, BuildError> {
        let mut best = Bvh::default();
        let mut least = f64::INFINITY;
        for (i, (builder, _)) in self.builders.iter().enumerate() {
            let bvh = build(builder.as_ref())?;
            let cost = sah(&bvh, &self.constants);
            if i == 0 || cost < least {
                (best, least) = (bvh, cost);
            }
        }
        Ok(best)
    }
}

impl std::fmt::Debug for Cheapest {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Cheapest").field(&self.name).finish()
    }
}

impl Builder for Cheapest {
    fn name(&self) -> &str {
        &self.name
    }

    fn build(&self, prims: &[PrimRef]) -> Result<Bvh, BuildError> {
        self.least(|builder| builder.build(prims))
    }

    fn build_mesh(&self, mesh: &TriangleMesh) -> Result<Bvh, BuildError> {
        self.least(|builder| builder.build_mesh(mesh))
    }

    fn memory_bound(&self, count: usize) -> usize {
        // The largest tree kept so far stays while the next is built.
        let (mut kept, mut most) = (0, 0);
        for (builder, references) in &self.builders {
            most = most.max(kept + builder.memory_bound(count));
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a count times a factor of at least 1, rounded up; saturates"
            )]
            let references = (count as f64 * references).ceil() as usize;
            kept = kept.max((2 * 32 + 4) * references);
        }
        // Two trees at least, and what the cost needs: a bit a node and a stack.
        most.max(2 * kept) + kept / 4
    }
}
