//! Joining the nearest pairs of a few clusters, with all distances at hand.

use niwaki_core::AreaScale;
use niwaki_core::bottom_up::{Cluster, LeafRule, Slots};

/// A cluster and its name: a place of one of its primitives, the smallest of the first part's. The
/// join of two takes the slot of the second's name, which ends there, so that tasks need no common
/// counter.
#[derive(Clone, Copy)]
pub(crate) struct Named {
    pub(crate) cluster: Cluster,
    pub(crate) name: u32,
}

/// Clusters and the distance of each two: half the area of their common box.
pub(crate) struct Set {
    pub(crate) clusters: Vec<Named>,
    /// Row by row, each as long as there are clusters; infinite on the diagonal.
    distances: Vec<f32>,
    /// For each cluster.
    nearest: Vec<Nearest>,
}

/// What a cluster's nearest is, and how far.
#[derive(Clone, Copy)]
struct Nearest {
    distance: f32,
    other: usize,
}

impl Nearest {
    /// Takes another cluster if it is nearer.
    #[inline]
    fn improve(&mut self, distance: f32, other: usize) {
        if distance < self.distance {
            *self = Self { distance, other };
        }
    }

    /// The first of the nearest in a row of distances: first the distance, eight at a time, then
    /// where it is.
    fn of(row: &[f32]) -> Self {
        let (blocks, rest) = row.as_chunks::<8>();
        let smaller = |a: f32, b: f32| if a < b { a } else { b };
        let mut lanes = [f32::INFINITY; 8];
        for block in blocks {
            for (lane, &d) in lanes.iter_mut().zip(block) {
                *lane = smaller(d, *lane);
            }
        }
        let distance = lanes.iter().chain(rest).copied().fold(f32::INFINITY, smaller);
        let other = row.iter().position(|&d| d == distance).unwrap_or(0);
        Self { distance, other }
    }
}

fn distance(a: &Named, b: &Named, scale: AreaScale) -> f32 {
    let d = a.cluster.aabb().union(b.cluster.aabb()).half_area(scale);
    // Neither infinite nor NaN, so that every pair is better than none.
    if d < f32::MAX { d } else { f32::MAX }
}

impl Set {
    pub(crate) fn new(clusters: Vec<Named>, scale: AreaScale) -> Self {
        let len = clusters.len();
        let mut distances = vec![f32::INFINITY; len * len];
        let mut nearest = vec![Nearest { distance: f32::INFINITY, other: 0 }; len];
        for i in 1..len {
            for j in 0..i {
                let d = distance(&clusters[i], &clusters[j], scale);
                distances[i * len + j] = d;
                distances[j * len + i] = d;
                nearest[i].improve(d, j);
                nearest[j].improve(d, i);
            }
        }
        Self { clusters, distances, nearest }
    }

    /// All clusters of both; only distances between the two are new (section 3.3).
    pub(crate) fn union(left: &Self, right: &Self, scale: AreaScale) -> Self {
        let (own, others) = (left.clusters.len(), right.clusters.len());
        let len = own + others;
        let clusters = [&left.clusters[..], &right.clusters[..]].concat();
        let mut distances = vec![0.0; len * len];
        let moved = right.nearest.iter().map(|n| Nearest { other: n.other + own, ..*n });
        let mut nearest: Vec<_> = left.nearest.iter().copied().chain(moved).collect();
        for (i, a) in left.clusters.iter().enumerate() {
            distances[i * len..][..own].copy_from_slice(&left.distances[i * own..][..own]);
            for (j, b) in right.clusters.iter().enumerate() {
                let d = distance(a, b, scale);
                distances[i * len + own + j] = d;
                distances[(own + j) * len + i] = d;
                nearest[i].improve(d, own + j);
                nearest[own + j].improve(d, i);
            }
        }
        for j in 0..others {
            distances[(own + j) * len + own..][..others]
                .copy_from_slice(&right.distances[j * others..][..others]);
        }
        Self { clusters, distances, nearest }
    }

    /// Joins the nearest pair until at most `target` clusters, and at least one, are left.
    pub(crate) fn join(&mut self, target: usize, slots: &mut Slots<'_>, rule: &LeafRule) {
        let Self { clusters, distances, nearest } = self;
        let stride = clusters.len();
        let target = target.max(1);
        if stride <= target {
            return;
        }
        while clusters.len() > target {
            let mut first = 0;
            for i in 1..nearest.len() {
                if nearest[i].distance < nearest[first].distance {
                    first = i;
                }
            }
            let pair = [first, nearest[first].other];
            let (lower, upper) = (pair[0].min(pair[1]), pair[0].max(pair[1]));
            let [a, b] = [clusters[lower], clusters[upper]];
            clusters[lower].cluster = slots.join(&a.cluster, &b.cluster, b.name, rule);

            // The last cluster takes the place that is free.
            let last = clusters.len() - 1;
            clusters.swap_remove(upper);
            nearest.swap_remove(upper);
            for row in 0..=last {
                distances[row * stride + upper] = distances[row * stride + last];
            }
            distances.copy_within(last * stride..last * stride + last, upper * stride);

            for i in 0..last {
                if i == lower {
                    continue;
                }
                let d = distance(&clusters[i], &clusters[lower], rule.scale);
                distances[i * stride + lower] = d;
                distances[lower * stride + i] = d;
                let lost = nearest[i].other == lower || nearest[i].other == upper;
                if nearest[i].other == last {
                    nearest[i].other = upper;
                }
                if lost && d > nearest[i].distance {
                    nearest[i].distance = f32::INFINITY; // To be searched when all are known.
                } else if lost || d < nearest[i].distance {
                    nearest[i] = Nearest { distance: d, other: lower };
                }
            }
            for (i, nearest) in nearest.iter_mut().enumerate() {
                if i == lower || nearest.distance == f32::INFINITY {
                    *nearest = Nearest::of(&distances[i * stride..][..last]);
                }
            }
        }
        let len = clusters.len();
        for row in 1..len {
            distances.copy_within(row * stride..row * stride + len, row * len);
        }
        distances.truncate(len * len);
        distances.shrink_to_fit();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use niwaki_core::bottom_up::Forest;
    use niwaki_core::glam::Vec3;
    use niwaki_core::{Aabb, SahConstants};
    use proptest::prelude::*;

    proptest! {
        /// The distance of every pair that is joined is the smallest there is, also in a union of
        /// sets; kept distances are right.
        #[test]
        fn the_nearest_pair_is_joined(
            corners in prop::collection::vec(prop::array::uniform6(0_i8..20), 2..40),
            cut in 1_usize..40,
            target in 1_usize..20,
        ) {
            let rule =
                LeafRule { max_leaf_size: 1, sah: SahConstants::default(), scale: AreaScale::ONE };
            let named: Vec<_> = corners
                .iter()
                .zip(0..)
                .map(|(c, name)| {
                    let c = c.map(f32::from);
                    let corners = [Vec3::from_slice(&c[..3]), Vec3::from_slice(&c[3..])];
                    Named { cluster: Cluster::single(Aabb::from_points(corners), name), name }
                })
                .collect();
            let cut = cut.min(named.len() - 1);
            let scale = rule.scale;
            let [left, right] =
                [&named[..cut], &named[cut..]].map(|part| Set::new(part.to_vec(), scale));
            let mut set = Set::union(&left, &right, scale);
            let mut forest = Forest::new(named.len());
            while set.clusters.len() > target {
                let smallest = |clusters: &[Named]| {
                    let pairs = (0..clusters.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
                    pairs
                        .map(|(i, j)| distance(&clusters[i], &clusters[j], scale))
                        .fold(f32::INFINITY, f32::min)
                };
                let before = set.clusters.clone();
                set.join(before.len() - 1, &mut forest.slots(), &rule);
                prop_assert_eq!(set.clusters.len(), before.len() - 1);
                let joined = set.clusters.iter().find(|c| {
                    before.iter().all(|b| b.cluster != c.cluster)
                });
                let area = joined.unwrap().cluster.aabb().half_area(scale);
                prop_assert_eq!(area, smallest(&before));
            }
            // All at once gives what one at a time gives.
            let mut whole = Set::union(&left, &right, scale);
            whole.join(target, &mut Forest::new(named.len()).slots(), &rule);
            let boxes = |set: &Set| {
                let mut all: Vec<_> =
                    set.clusters.iter().map(|c| format!("{:?}", c.cluster.aabb())).collect();
                all.sort();
                all
            };
            prop_assert_eq!(boxes(&whole).len(), boxes(&set).len());
            let len = whole.clusters.len();
            for i in 0..len {
                for j in 0..len {
                    let d = distance(&whole.clusters[i], &whole.clusters[j], scale);
                    prop_assert!(i == j || whole.distances[i * len + j] == d);
                }
            }
        }
    }
}
