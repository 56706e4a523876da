//! The matrix of a bench, and its division among machines.

use std::fmt;
use std::str::FromStr;

/// The `part`-th of `parts` parts, counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Shard {
    /// 1 to `parts`.
    pub(crate) part: usize,
    /// At least 1.
    pub(crate) parts: usize,
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` is no part; write K/N with 1 ≤ K ≤ N, such as 2/8");
        let (part, parts) = text.split_once('/').ok_or_else(wrong)?;
        let part: usize = part.trim().parse().map_err(|_| wrong())?;
        let parts: usize = parts.trim().parse().map_err(|_| wrong())?;
        if part < 1 || part > parts {
            return Err(wrong());
        }
        Ok(Self { part, parts })
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.part, self.parts)
    }
}

/// What one process measures of a scene: only whole groups are compared, so a group is never
/// divided.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ScenePlan {
    /// Position in the list of scenes.
    pub(crate) scene: usize,
    /// The numbers of threads to measure.
    pub(crate) threads: Vec<usize>,
    /// Whether to make the scene's pictures: one shard does.
    pub(crate) pictures: bool,
}

/// The groups (scene × threads) of a shard, in order. All shards together have each group once.
pub(crate) fn plan(scenes: usize, threads: &[usize], shard: Option<Shard>) -> Vec<ScenePlan> {
    let Shard { part, parts } = shard.unwrap_or(Shard { part: 1, parts: 1 });
    // The least common multiple: after so many groups the same part would meet the same threads.
    let repeats = (1..=parts).map(|n| n * threads.len()).find(|n| n.is_multiple_of(parts));
    let repeats = repeats.unwrap_or(1).max(1);
    let mut plans: Vec<ScenePlan> = Vec::new();
    for scene in 0..scenes {
        let mine: Vec<bool> = (0..threads.len())
            .map(|t| {
                // In turn, shifted by one whenever the turns begin to repeat, so that no part
                // gets all groups of the same number of threads.
                let group = scene * threads.len() + t;
                (group + group / repeats) % parts == part - 1
            })
            .collect();
        if mine.contains(&true) {
            let selected = threads.iter().zip(&mine).filter(|(_, m)| **m).map(|(&t, _)| t);
            plans.push(ScenePlan { scene, threads: selected.collect(), pictures: mine[0] });
        }
    }
    plans
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_read() {
        assert_eq!("2/3".parse(), Ok(Shard { part: 2, parts: 3 }));
        assert_eq!("2/3".parse::<Shard>().unwrap().to_string(), "2/3");
        for bad in ["", "3", "0/3", "4/3", "a/b", "1/0", "-1/2"] {
            assert!(bad.parse::<Shard>().is_err(), "{bad}");
        }
    }

    #[test]
    fn shards_share_the_matrix_without_gap_or_overlap() {
        for scenes in [1, 2, 7] {
            for threads in [&[1][..], &[1, 2], &[1, 2, 4]] {
                for parts in 1..=9 {
                    let mut groups = Vec::new();
                    let mut pictures = Vec::new();
                    for part in 1..=parts {
                        for plan in plan(scenes, threads, Some(Shard { part, parts })) {
                            groups.extend(plan.threads.iter().map(|&t| (plan.scene, t)));
                            pictures.extend(plan.pictures.then_some(plan.scene));
                        }
                    }
                    groups.sort_unstable();
                    pictures.sort_unstable();
                    let all: Vec<_> =
                        (0..scenes).flat_map(|s| threads.iter().map(move |&t| (s, t))).collect();
                    assert_eq!(groups, all);
                    assert_eq!(pictures, (0..scenes).collect::<Vec<_>>());
                }
            }
        }
    }

    #[test]
    fn no_part_gets_all_the_slow_ones() {
        for parts in 1..=6 {
            for part in 1..=parts {
                let plans = plan(12, &[1, 2], Some(Shard { part, parts }));
                let count =
                    |t: usize| plans.iter().filter(|plan| plan.threads.contains(&t)).count();
                assert!(count(1).abs_diff(count(2)) <= 2, "{part}/{parts}: {plans:?}");
                assert!(count(1) > 0, "{part}/{parts}: {plans:?}");
            }
        }
    }
}
