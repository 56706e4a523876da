//! The catalogue, and the exact answers to its rays.

use super::worker::Row;
use crate::judge::{Reference, any, closest};
use niwaki_checks::exact_answers;
use niwaki_core::{Hit, Intersector, Ray, TriangleMesh};
use niwaki_hard_cases::{Closed, rays};

/// Triangle tests that the exact answers to a ray of a case may take, for each ray asked for.
const TESTS_A_RAY: usize = 1_000;

/// A mesh of the catalogue.
pub(crate) enum Case {
    /// Answers are compared with the exact ones.
    Open(niwaki_hard_cases::Case),
    /// Rays from inside must hit something.
    Closed(Closed),
}

/// All, in the order of tables.
pub(crate) fn all() -> Vec<Case> {
    let open = niwaki_hard_cases::meshes().into_iter().map(Case::Open);
    open.chain(niwaki_hard_cases::closed().into_iter().map(Case::Closed)).collect()
}

impl Case {
    pub(crate) const fn name(&self) -> &'static str {
        match self {
            Self::Open(case) => case.name,
            Self::Closed(case) => case.name,
        }
    }

    pub(crate) const fn why(&self) -> &'static str {
        match self {
            Self::Open(case) => case.why,
            Self::Closed(case) => case.why,
        }
    }

    pub(crate) const fn mesh(&self) -> &TriangleMesh {
        match self {
            Self::Open(case) => &case.mesh,
            Self::Closed(case) => &case.mesh,
        }
    }
}

/// Rays of a case and their exact answers.
pub(crate) struct Exact {
    rays: Vec<Ray>,
    hits: Vec<Hit>,
}

impl Exact {
    /// Answers about `count` rays, or as many as the size of the mesh allows.
    pub(crate) fn new(case: &niwaki_hard_cases::Case, count: usize, seed: u64) -> Self {
        // The catalogue makes eleven rays at a time.
        let affordable = count * TESTS_A_RAY / case.mesh.len().max(1);
        let affordable = affordable.min(count).div_ceil(11);
        let (rays, hits) = exact_answers(&case.mesh, &rays(&case.mesh, affordable, seed));
        Self { rays, hits }
    }
}

/// Compares kernels with the exact answers, and remembers what it settled: many trees give the
/// same answers.
pub(crate) struct Judge<'a> {
    rays: &'a [Ray],
    hits: Reference<'a, Hit>,
    flags: Reference<'a, bool>,
}

impl<'a> Judge<'a> {
    pub(crate) fn new(mesh: &'a TriangleMesh, Exact { rays, hits }: &'a Exact) -> Self {
        let occluded = hits.iter().map(Hit::is_hit).collect();
        Self {
            rays,
            hits: Reference::new(mesh, rays, hits.clone()),
            flags: Reference::new(mesh, rays, occluded),
        }
    }

    /// How a kernel answers.
    pub(crate) fn ask(&self, scene: &dyn Intersector) -> (Vec<Hit>, Vec<bool>) {
        (closest(scene, self.rays), any(scene, self.rays))
    }

    /// What its answers are worth.
    pub(crate) fn judge(&self, (hits, flags): &(Vec<Hit>, Vec<bool>)) -> Row {
        let (tally, wrong) = self.hits.compare(hits);
        let (any_tally, any_wrong) = self.flags.compare(flags);
        Row {
            tally: tally.merge(any_tally),
            example: wrong.into_iter().chain(any_wrong).next(),
            ..Row::default()
        }
    }
}
