//! Whether the builders come in the published order.

use super::compare::Comparison;
use super::published::Item;
use serde::Serialize;

/// Published values that differ by less than this factor say no order: rows are printed to a
/// percent.
const PUBLISHED_MARGIN: f64 = 1.02;
/// Measured times that differ by less are equal as far as one can tell.
const TIME_MARGIN: f64 = 1.02;
/// Costs and counts have no noise, but a difference below half a percent is no order.
const COUNT_MARGIN: f64 = 1.005;

/// What became of a published order of two builders.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Verdict {
    /// The same.
    Holds,
    /// Measured as equal.
    Tie,
    /// The other way round.
    Reversed,
}

/// Two builders whose published values say that the first is better.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Pair {
    pub(crate) item: Item,
    pub(crate) scene: String,
    pub(crate) quantity: String,
    /// Whether the scene itself was measured.
    pub(crate) had: bool,
    /// The published names.
    pub(crate) better: String,
    pub(crate) worse: String,
    /// Our names.
    pub(crate) our_better: String,
    pub(crate) our_worse: String,
    /// How many times as good the first is, published.
    pub(crate) published: f64,
    /// And measured.
    pub(crate) measured: f64,
    pub(crate) verdict: Verdict,
}

/// All pairs of builders of one item, scene and quantity that the published values order.
pub(crate) fn pairs(comparisons: &[Comparison]) -> Vec<Pair> {
    let mut pairs = Vec::new();
    for (at, a) in comparisons.iter().enumerate() {
        for b in &comparisons[at + 1..] {
            let same = (a.item, &a.scene, &a.quantity) == (b.item, &b.scene, &b.quantity);
            if a.leading && b.leading && same {
                pairs.extend(pair(a, b));
            }
        }
    }
    pairs
}

fn pair(a: &Comparison, b: &Comparison) -> Option<Pair> {
    let ((a_published, a_measured), (b_published, b_measured)) = (a.costs()?, b.costs()?);
    let (better, worse, published, measured) = if a_published < b_published {
        (a, b, b_published / a_published, b_measured / a_measured)
    } else {
        (b, a, a_published / b_published, a_measured / b_measured)
    };
    // Nothing over nothing (two builders that add no reference) is a tie.
    let measured = if measured.is_nan() { 1.0 } else { measured };
    if published < PUBLISHED_MARGIN {
        return None;
    }
    let margin = match a.quantity.as_str() {
        "sah" | "added references" => COUNT_MARGIN,
        _ => TIME_MARGIN,
    };
    let verdict = if measured >= margin {
        Verdict::Holds
    } else if measured > 1.0 / margin {
        Verdict::Tie
    } else {
        Verdict::Reversed
    };
    Some(Pair {
        item: a.item,
        scene: a.scene.clone(),
        quantity: a.quantity.clone(),
        had: a.standing.is_some_and(super::names::Standing::is_had),
        better: better.builder.clone(),
        worse: worse.builder.clone(),
        our_better: better.ours.clone(),
        our_worse: worse.ours.clone(),
        published,
        measured,
        verdict,
    })
}

/// Counts of verdicts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub(crate) struct Tally {
    pub(crate) holds: usize,
    pub(crate) ties: usize,
    pub(crate) reversed: usize,
}

impl Tally {
    /// Of some pairs.
    pub(crate) fn of<'a>(pairs: impl Iterator<Item = &'a Pair>) -> Self {
        let mut tally = Self::default();
        for pair in pairs {
            match pair.verdict {
                Verdict::Holds => tally.holds += 1,
                Verdict::Tie => tally.ties += 1,
                Verdict::Reversed => tally.reversed += 1,
            }
        }
        tally
    }

    /// Pairs in all.
    pub(crate) const fn all(self) -> usize {
        self.holds + self.ties + self.reversed
    }

    /// `9/10`, or nothing where nothing was to be checked.
    pub(crate) fn short(self) -> Option<String> {
        (self.all() > 0).then(|| format!("{}/{}", self.holds, self.all()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thesis::compare::{compare, result, tree};
    use crate::thesis::names::Standing;
    use crate::thesis::published::Published;

    /// The verdict on Bonsai's place before sweep in build time: published 12.6 of 51.4 ms.
    fn verdict(sweep_ms: f64, bonsai_ms: f64) -> Verdict {
        let trees = vec![tree("sweep", sweep_ms, 1.0, 1.0), tree("bonsai", bonsai_ms, 1.0, 1.0)];
        let results = [result("Sponza", Standing::Same, trees)];
        let comparisons = compare(&Published::read().unwrap(), &results);
        let pairs = pairs(&comparisons);
        let of = |p: &&Pair| p.item == Item::IvFigure5 && p.quantity == "build";
        let pairs: Vec<_> = pairs.iter().filter(of).collect();
        assert_eq!(pairs.len(), 1, "{pairs:?}");
        assert_eq!((pairs[0].better.as_str(), pairs[0].worse.as_str()), ("Bonsai", "SweepSAH"));
        assert!((pairs[0].published - 51.4 / 12.6).abs() < 1e-12 && pairs[0].had);
        pairs[0].verdict
    }

    #[test]
    fn an_order_holds_ties_or_is_reversed() {
        assert_eq!(verdict(10.0, 5.0), Verdict::Holds);
        assert_eq!(verdict(10.0, 9.9), Verdict::Tie);
        assert_eq!(verdict(9.9, 10.0), Verdict::Tie);
        assert_eq!(verdict(5.0, 10.0), Verdict::Reversed);
    }

    #[test]
    fn higher_performance_is_better() {
        // Published on Sponza: P* 108 %, Bonsai 90 %.
        let trees = vec![
            tree("sweep", 1.0, 10.0, 1.0),
            tree("bonsai", 1.0, 12.0, 1.0),
            tree("bonsai_p_star", 1.0, 9.0, 1.0),
        ];
        let results = [result("Sponza", Standing::StandIn, trees)];
        let comparisons = compare(&Published::read().unwrap(), &results);
        let all = pairs(&comparisons);
        let of = |p: &&Pair| p.item == Item::IvFigure5 && p.quantity == "performance";
        let tally = Tally::of(all.iter().filter(of));
        assert_eq!(tally, Tally { holds: 3, ties: 0, reversed: 0 });
        assert_eq!(tally.short().as_deref(), Some("3/3"));
        assert!(all.iter().filter(of).all(|p| !p.had));
        assert_eq!(Tally::default().short(), None);
    }

    #[test]
    fn values_that_are_printed_alike_say_no_order() {
        // Sibenik: 100 % for binSAH, Bonsai P and sweep; 1 % apart from nobody.
        let trees = vec![tree("sweep", 1.0, 10.0, 1.0), tree("bonsai_p", 1.0, 20.0, 1.0)];
        let results = [result("Sibenik", Standing::Same, trees)];
        let comparisons = compare(&Published::read().unwrap(), &results);
        let of = |p: &&Pair| p.item == Item::IvFigure5 && p.quantity == "performance";
        assert_eq!(pairs(&comparisons).iter().filter(of).count(), 0);
    }
}
