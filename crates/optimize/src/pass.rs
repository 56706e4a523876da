//! What all passes share: the trait, the check that a tree got better, chains of passes.

use crate::tree::Tree;
use crate::{OptimizeError, Report};
use niwaki_core::{Bvh, SahConstants};
use niwaki_metrics::sah;
use std::time::Instant;

/// A pass that improves a finished tree. Implementations run on the current rayon pool and, unless
/// they are given a time bound, return the same bytes for every number of threads.
///
/// A pass works on the boxes that the leaves have, never on those of primitives, so that trees
/// with split primitives stay valid: such a leaf's box is smaller than the boxes of its triangles.
/// If nothing is gained, the tree is left as it was, to the byte; otherwise it comes back in
/// depth-first order, with ids in the order of the leaves.
pub trait Optimizer: Sync {
    /// The name in tables, such as `reinsert`.
    fn name(&self) -> &str;

    /// Improves the tree in place. The SAH cost never grows.
    ///
    /// # Errors
    /// [`OptimizeError::BrokenTree`] and [`OptimizeError::BadSetting`] as documented there; the
    /// tree is then left as it was.
    fn optimize(&self, bvh: &mut Bvh) -> Result<Report, OptimizeError>;

    /// An upper bound on the bytes that [`Optimizer::optimize`] allocates at once for a tree of so
    /// many nodes and references, the tree that it returns included, the one given not.
    fn memory_bound(&self, nodes: usize, references: usize) -> usize;
}

/// What a pass made of a tree.
pub(crate) struct Outcome {
    pub(crate) iterations: u32,
    pub(crate) changes: u64,
    /// The new tree; `None` if there is none.
    pub(crate) bvh: Option<Bvh>,
}

/// Runs `work`, which rearranges nodes and returns the iterations it began and the changes it
/// made, and keeps the result if it costs less.
pub(crate) fn rearrange(
    bvh: &mut Bvh,
    constants: &SahConstants,
    work: impl FnOnce(&mut Tree) -> (u32, u64),
) -> Result<Report, OptimizeError> {
    improve(bvh, constants, |source| {
        let Some(mut tree) = Tree::new(source)? else { return Ok(None) };
        let (iterations, changes) = work(&mut tree);
        let bvh = (changes > 0).then(|| tree.to_bvh(source));
        Ok(Some(Outcome { iterations, changes, bvh }))
    })
}

/// Keeps what `work` makes of the tree if it costs less.
pub(crate) fn improve(
    bvh: &mut Bvh,
    constants: &SahConstants,
    work: impl FnOnce(&Bvh) -> Result<Option<Outcome>, OptimizeError>,
) -> Result<Report, OptimizeError> {
    let start = Instant::now();
    check_constants(constants)?;
    let before = sah(bvh, constants);
    let mut report = Report { before, after: before, ..Report::default() };
    if let Some(outcome) = work(bvh)? {
        report.iterations = outcome.iterations;
        if let Some(better) = outcome.bvh {
            let after = sah(&better, constants);
            if after < before {
                *bvh = better;
                report.after = after;
                report.changes = outcome.changes;
            }
        }
    }
    report.time = start.elapsed();
    Ok(report)
}

pub(crate) fn check_constants(constants: &SahConstants) -> Result<(), OptimizeError> {
    niwaki_core::builder::check_sah(constants).map_err(|_| OptimizeError::BadSetting {
        setting: "constants",
        value: format!("{constants:?}"),
        remedy: "costs are finite and not negative",
    })
}

/// Checks a setting that is a share of all nodes.
pub(crate) fn check_fraction(setting: &'static str, fraction: f32) -> Result<(), OptimizeError> {
    if fraction > 0.0 && fraction <= 1.0 {
        return Ok(());
    }
    let remedy = "above 0 and at most 1";
    Err(OptimizeError::BadSetting { setting, value: fraction.to_string(), remedy })
}

/// Checks a setting that is a number of things.
pub(crate) fn check_count(setting: &'static str, count: u32) -> Result<(), OptimizeError> {
    if count > 0 {
        return Ok(());
    }
    Err(OptimizeError::BadSetting { setting, value: "0".into(), remedy: "at least 1" })
}

/// Bytes that [`rearrange`] takes: the tree taken apart, a stack, and the result.
pub(crate) const fn rearrange_memory(nodes: usize, references: usize) -> usize {
    let taken_apart = (64 + 4) * (nodes / 2 + 1);
    let stack = 16 * nodes;
    let result = 32 * nodes + 4 * references;
    taken_apart + stack + result + (1 << 16)
}

/// Passes that run one after the other.
pub struct Chain {
    name: String,
    passes: Vec<Box<dyn Optimizer + Send>>,
}

impl Chain {
    /// Named after the passes, such as `reinsert+collapse`.
    #[must_use]
    pub fn new(passes: Vec<Box<dyn Optimizer + Send>>) -> Self {
        let names: Vec<&str> = passes.iter().map(|pass| pass.name()).collect();
        Self { name: names.join("+"), passes }
    }

    /// The passes, in order.
    #[must_use]
    pub fn passes(&self) -> &[Box<dyn Optimizer + Send>] {
        &self.passes
    }
}

impl std::fmt::Debug for Chain {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Chain").field(&self.name).finish()
    }
}

impl Optimizer for Chain {
    fn name(&self) -> &str {
        &self.name
    }

    /// The cost before is that of the first pass and the cost after that of the last one, each
    /// with the pass's own constants.
    fn optimize(&self, bvh: &mut Bvh) -> Result<Report, OptimizeError> {
        let start = Instant::now();
        let original = bvh.clone();
        let mut total: Option<Report> = None;
        for pass in &self.passes {
            let report = match pass.optimize(bvh) {
                Ok(report) => report,
                Err(error) => {
                    *bvh = original;
                    return Err(error);
                }
            };
            total = Some(Report {
                before: total.map_or(report.before, |total| total.before),
                after: report.after,
                iterations: report.iterations + total.map_or(0, |total| total.iterations),
                changes: report.changes + total.map_or(0, |total| total.changes),
                time: start.elapsed(),
            });
        }
        Ok(total.unwrap_or_default())
    }

    fn memory_bound(&self, nodes: usize, references: usize) -> usize {
        // The copy that a failing pass gives back, and the input of the pass that runs.
        let copy = 2 * (32 * nodes + 4 * references);
        copy + self.passes.iter().map(|p| p.memory_bound(nodes, references)).max().unwrap_or(0)
    }
}
