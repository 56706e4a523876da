//! Counts of agreements and settled disagreements, and answers in words.

use niwaki_core::{Hit, Ray};
use niwaki_exact::{Side, Verdict};
use serde::{Deserialize, Serialize};

/// What a comparison of many answers came to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Tally {
    /// Rays compared.
    pub(crate) rays: u64,
    /// Equal distances, or closer than `f32` can tell.
    pub(crate) tie: u64,
    /// One of the two lost or gained a hit within a few units in the last place of a border, or
    /// exactly at an end of the ray's range.
    pub(crate) rounding: u64,
    /// Of `rounding`: where exact arithmetic contradicts us alone.
    pub(crate) ours_rounded: u64,
    /// Of `rounding`: where exact arithmetic contradicts the other alone.
    pub(crate) peer_rounded: u64,
    /// The exact answer contradicts the peer.
    pub(crate) peer_wrong: u64,
    /// The exact answer contradicts us.
    pub(crate) ours_wrong: u64,
}

impl Tally {
    /// Counts one comparison; `side` is who rounded.
    pub(crate) fn add(&mut self, (verdict, side): (Verdict, Option<Side>)) {
        self.rays += 1;
        match side {
            Some(Side::Ours) => self.ours_rounded += 1,
            Some(Side::Theirs) => self.peer_rounded += 1,
            None => {}
        }
        match verdict {
            Verdict::Tie => self.tie += 1,
            Verdict::Rounding => self.rounding += 1,
            Verdict::PeerWrong => self.peer_wrong += 1,
            Verdict::OursWrong => self.ours_wrong += 1,
            _ => {}
        }
    }

    /// The counts of both together.
    pub(crate) fn merge(self, other: Self) -> Self {
        Self {
            rays: self.rays + other.rays,
            tie: self.tie + other.tie,
            rounding: self.rounding + other.rounding,
            ours_rounded: self.ours_rounded + other.ours_rounded,
            peer_rounded: self.peer_rounded + other.peer_rounded,
            peer_wrong: self.peer_wrong + other.peer_wrong,
            ours_wrong: self.ours_wrong + other.ours_wrong,
        }
    }
}

/// A ray and both answers in a form that can be pasted into a test.
pub(crate) fn describe(ray: &Ray, ours: &str, theirs: &str) -> String {
    format!(
        "ray from {:?} along {:?}, t {:?} to {:?}: ours {ours}; other {theirs}",
        ray.origin.to_array(),
        ray.direction.to_array(),
        ray.t_min,
        ray.t_max
    )
}

/// A hit in few words.
pub(crate) fn describe_hit(hit: &Hit) -> String {
    if hit.is_hit() {
        format!("triangle {} at t = {:?}", hit.prim_id, hit.t)
    } else {
        "no hit".to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tallies_count_and_merge() {
        let mut a = Tally::default();
        a.add((Verdict::Agree, None));
        a.add((Verdict::Tie, None));
        a.add((Verdict::Rounding, Some(Side::Ours)));
        let mut b = Tally::default();
        b.add((Verdict::OursWrong, None));
        b.add((Verdict::PeerWrong, None));
        b.add((Verdict::Rounding, None));
        b.add((Verdict::Rounding, Some(Side::Theirs)));
        let expected = Tally {
            rays: 7,
            tie: 1,
            rounding: 3,
            ours_rounded: 1,
            peer_rounded: 1,
            peer_wrong: 1,
            ours_wrong: 1,
        };
        assert_eq!(a.merge(b), expected);
    }
}
