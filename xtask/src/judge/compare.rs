//! Tracing of ray sets and comparison of our answers with reference answers.

use super::tally::{Tally, describe, describe_hit};
use niwaki_core::{Hit, Intersector, Ray, TriangleMesh};
use niwaki_exact::{Anchor, SettleOptions, Side, Verdict, settle_any_with, settle_with};
use rayon::prelude::*;
use std::{
    collections::HashMap,
    sync::{Mutex, PoisonError},
};

/// Rays a task: enough to pay for the task, few enough to balance.
const CHUNK: usize = 1024;

/// At most this many culprits are described a comparison; the tally counts them all.
const MAX_CULPRITS: usize = 5;

/// The closest hits of all rays.
pub(crate) fn closest(scene: &(impl Intersector + ?Sized), rays: &[Ray]) -> Vec<Hit> {
    let mut hits = vec![Hit::MISS; rays.len()];
    hits.par_chunks_mut(CHUNK)
        .zip(rays.par_chunks(CHUNK))
        .for_each(|(hits, rays)| scene.closest_hits(rays, hits));
    hits
}

/// Whether each ray hits anything.
pub(crate) fn any(scene: &(impl Intersector + ?Sized), rays: &[Ray]) -> Vec<bool> {
    let mut flags = vec![false; rays.len()];
    flags
        .par_chunks_mut(CHUNK)
        .zip(rays.par_chunks(CHUNK))
        .for_each(|(flags, rays)| scene.any_hits(rays, flags));
    flags
}

/// The verdict, and of rounding who rounded.
type Settled = (Verdict, Option<Side>);

/// Fast kernels and peers measure distances from a triangle's first corner.
fn options() -> SettleOptions {
    SettleOptions { anchor: Anchor::First, ..SettleOptions::default() }
}

/// An answer to a ray that can be settled against another.
pub(crate) trait Answer: Copy + Sync {
    /// Bits that are equal only for equal answers; the key of the memory.
    fn key(self) -> u64;
    /// The exact test.
    fn settle(self, theirs: Self, ray: &Ray, mesh: &TriangleMesh) -> Settled;
    /// In words.
    fn describe(self) -> String;
}

impl Answer for Hit {
    fn key(self) -> u64 {
        u64::from(self.prim_id) << 32 | u64::from(self.t.to_bits())
    }
    fn settle(self, theirs: Self, ray: &Ray, mesh: &TriangleMesh) -> Settled {
        let settled = settle_with(ray, mesh, &self, &theirs, &options());
        (settled.verdict, settled.rounding_side)
    }
    fn describe(self) -> String {
        describe_hit(&self)
    }
}

impl Answer for bool {
    fn key(self) -> u64 {
        u64::from(self)
    }
    fn settle(self, theirs: Self, ray: &Ray, mesh: &TriangleMesh) -> Settled {
        let settled = settle_any_with(ray, mesh, self, theirs, &options());
        (settled.verdict, settled.rounding_side)
    }
    fn describe(self) -> String {
        if self { "occluded" } else { "not occluded" }.to_owned()
    }
}

/// Reference answers to a set of rays, and a memory of what has been settled: many trees and
/// kernels of ours disagree with a peer in the same way about the same ray, and an exact search
/// of millions of triangles is worth doing once.
pub(crate) struct Reference<'a, A> {
    mesh: &'a TriangleMesh,
    rays: &'a [Ray],
    answers: Vec<A>,
    settled: Mutex<HashMap<(usize, u64), Settled>>,
}

impl<'a, A: Answer + Send> Reference<'a, A> {
    pub(crate) fn new(mesh: &'a TriangleMesh, rays: &'a [Ray], answers: Vec<A>) -> Self {
        assert_eq!(rays.len(), answers.len(), "one answer per ray");
        Self { mesh, rays, answers, settled: Mutex::default() }
    }

    /// Counts agreements and settles every difference; describes what counts against us.
    pub(crate) fn compare(&self, ours: &[A]) -> (Tally, Vec<String>) {
        assert_eq!(self.rays.len(), ours.len(), "one answer per ray");
        let one = |(mut tally, mut wrong): (Tally, Vec<String>), i: usize| {
            let settled = self.settle(i, ours[i]);
            tally.add(settled);
            if settled.0 == Verdict::OursWrong && wrong.len() < MAX_CULPRITS {
                let (our, their) = (ours[i].describe(), self.answers[i].describe());
                wrong.push(describe(&self.rays[i], &our, &their));
            }
            (tally, wrong)
        };
        (0..ours.len()).into_par_iter().fold(Default::default, one).reduce(
            Default::default,
            |(a, mut wrong), (b, more)| {
                wrong.extend(more);
                wrong.truncate(MAX_CULPRITS);
                (a.merge(b), wrong)
            },
        )
    }

    fn settle(&self, i: usize, our: A) -> Settled {
        // Equal bits need no settling, and that is almost all of them.
        if our.key() == self.answers[i].key() {
            return (Verdict::Agree, None);
        }
        let place = (i, our.key());
        if let Some(&known) = self.memory().get(&place) {
            return known;
        }
        let settled = our.settle(self.answers[i], &self.rays[i], self.mesh);
        self.memory().insert(place, settled);
        settled
    }

    fn memory(&self) -> std::sync::MutexGuard<'_, HashMap<(usize, u64), Settled>> {
        self.settled.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use niwaki_core::glam::Vec3;

    fn mesh() -> TriangleMesh {
        TriangleMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]).expect("finite")
    }

    #[test]
    fn a_lost_hit_counts_against_the_one_who_lost_it() {
        let mesh = mesh();
        let rays = [Ray::new(Vec3::new(0.2, 0.2, 1.0), Vec3::NEG_Z); 3];
        let hit = Hit { t: 1.0, u: 0.2, v: 0.2, prim_id: 0 };
        let reference = Reference::new(&mesh, &rays, vec![hit, Hit::MISS, hit]);
        let (tally, wrong) = reference.compare(&[hit, hit, Hit::MISS]);
        assert_eq!((tally.rays, tally.peer_wrong, tally.ours_wrong), (3, 1, 1));
        assert_eq!(wrong.len(), 1);
        // The memory gives the same answers again.
        assert_eq!(reference.compare(&[hit, hit, Hit::MISS]).0, tally);
    }

    #[test]
    fn occlusion_is_settled_too() {
        let mesh = mesh();
        let rays = [Ray::new(Vec3::new(0.2, 0.2, 1.0), Vec3::NEG_Z); 2];
        let reference = Reference::new(&mesh, &rays, vec![true, false]);
        let (tally, wrong) = reference.compare(&[false, true]);
        assert_eq!((tally.peer_wrong, tally.ours_wrong, wrong.len()), (1, 1, 1));
    }
}
