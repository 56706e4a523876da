//! What verification found: rows, trees, and what counts against us.

use crate::judge::Tally;
use serde::Serialize;

/// One line of the result: a tree and a kernel of ours against one other on one scene.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Row {
    pub(crate) scene: String,
    pub(crate) triangles: usize,
    pub(crate) builder: String,
    pub(crate) kernel: String,
    /// `brute_force`, `exact`, `embree`, `embree_robust` or `obvhs`.
    pub(crate) against: String,
    /// `closest` or `any`.
    pub(crate) query: &'static str,
    #[serde(flatten)]
    pub(crate) tally: Tally,
}

/// Something that makes verification fail.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Culprit {
    pub(crate) scene: String,
    pub(crate) builder: String,
    /// The kernel, or the check that failed: `validate`, `determinism`, `build`.
    pub(crate) check: String,
    /// What is wrong, with the ray and both answers where there are any.
    pub(crate) what: String,
}

/// Everything that verification found.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Ledger {
    /// Version of this file's layout.
    pub(crate) schema: u32,
    pub(crate) rows: Vec<Row>,
    /// SAH and size of every tree, ours and peers'.
    pub(crate) trees: Vec<TreeRow>,
    /// Peers that could not take part.
    pub(crate) absent: Vec<Absent>,
    pub(crate) culprits: Vec<Culprit>,
}

/// A peer that could not build a scene.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Absent {
    pub(crate) scene: String,
    /// Its builder or kernel.
    pub(crate) peer: String,
    pub(crate) why: String,
}

impl Absent {
    pub(crate) fn new(scene: &str, peer: &str, error: &niwaki_peers::PeerError) -> Self {
        Self { scene: scene.to_owned(), peer: peer.to_owned(), why: error.to_string() }
    }
}

/// One tree that was checked.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct TreeRow {
    pub(crate) scene: String,
    pub(crate) triangles: usize,
    /// `niwaki`, `embree` or `obvhs`.
    pub(crate) source: &'static str,
    pub(crate) builder: String,
    pub(crate) nodes: usize,
    pub(crate) references: usize,
    /// With C_I = 2, C_L = 0, C_T = 1.
    pub(crate) sah: f64,
    pub(crate) valid: bool,
    /// Equal bytes on all numbers of threads that were tried, of the tree and of the 8-wide tree collapsed from it;
    /// `None` where that is not asked (peers).
    pub(crate) deterministic: Option<bool>,
}
