//! Search for the nearest cluster.

use niwaki_core::AreaScale;
use niwaki_core::bottom_up::Cluster;
use niwaki_core::glam::Vec3;
use niwaki_core::{Aabb, to_u32};

/// What all clusters below a node have in common.
#[derive(Clone, Copy)]
struct Bound {
    /// Around their centres.
    centers: Aabb,
    /// The smallest of their extents in each axis, halved.
    half: Vec3,
}

impl Bound {
    const EMPTY: Self = Self { centers: Aabb::EMPTY, half: Vec3::INFINITY };

    fn of(cluster: &Cluster) -> Self {
        let bounds = cluster.aabb();
        let center = bounds.center();
        Self { centers: Aabb::new(center, center), half: bounds.max * 0.5 - bounds.min * 0.5 }
    }

    fn union(&self, other: &Self) -> Self {
        Self { centers: self.centers.union(other.centers), half: self.half.min(other.half) }
    }

    /// A lower bound on the distance of `bounds` and any cluster, up to rounding; `None` if there
    /// are none. Whatever the centre, the box reaches half its extent to both sides of it.
    fn distance(&self, bounds: &Aabb, scale: AreaScale) -> Option<f32> {
        if self.centers.is_empty() {
            return None;
        }
        let low = bounds.min.min(self.centers.max - self.half);
        let high = bounds.max.max(self.centers.min + self.half);
        Some(finite(Aabb::new(low, high).half_area(scale)))
    }
}

/// Neither infinite nor NaN, so that every pair is better than none.
fn finite(distance: f32) -> f32 {
    if distance < f32::MAX { distance } else { f32::MAX }
}

/// Clusters at fixed places, and over them a complete binary tree of bounds.
pub(super) struct SearchTree {
    /// Clusters; `None` where one has been joined to another.
    clusters: Vec<Option<Cluster>>,
    /// The root is node 1, the children of `i` are `2i` and `2i + 1`, and place `p` is node
    /// `width + p`.
    bounds: Vec<Bound>,
    width: usize,
    live: usize,
    scale: AreaScale,
    /// Nodes that a search has yet to visit, with their lower bounds.
    stack: Vec<(f32, usize)>,
}

/// Bytes for `count` clusters, a compaction included.
pub(super) fn bytes(count: usize) -> usize {
    let nodes = 2 * count.next_power_of_two() * size_of::<Bound>();
    nodes + nodes / 2 + count * (size_of::<Option<Cluster>>() * 2 + size_of::<Cluster>() + 4)
}

impl SearchTree {
    pub(super) fn new(clusters: Vec<Cluster>, scale: AreaScale) -> Self {
        let live = clusters.len();
        let clusters = clusters.into_iter().map(Some).collect();
        let mut tree =
            Self { clusters, bounds: Vec::new(), width: 0, live, scale, stack: Vec::new() };
        tree.fill();
        tree
    }

    fn fill(&mut self) {
        self.width = self.clusters.len().next_power_of_two();
        self.bounds.clear();
        self.bounds.resize(2 * self.width, Bound::EMPTY);
        for (bound, cluster) in self.bounds[self.width..].iter_mut().zip(&self.clusters) {
            *bound = cluster.as_ref().map_or(Bound::EMPTY, Bound::of);
        }
        for node in (1..self.width).rev() {
            self.bounds[node] = self.bounds[2 * node].union(&self.bounds[2 * node + 1]);
        }
    }

    /// The first place with a cluster.
    pub(super) fn any(&self) -> usize {
        let mut node = 1;
        while node < self.width {
            node = 2 * node + usize::from(self.bounds[2 * node].centers.is_empty());
        }
        node - self.width
    }

    /// The cluster at a place that has one.
    pub(super) fn cluster(&self, place: usize) -> Cluster {
        self.clusters[place].expect("joined clusters leave the chain")
    }

    /// The nearest to the cluster at `place`, if it is nearer than `bound`.
    pub(super) fn nearer(&mut self, place: usize, bound: f32) -> Option<(usize, f32)> {
        let bounds = self.cluster(place).aabb();
        let mut best = (place, bound);
        self.stack.clear();
        self.stack.push((0.0, 1));
        while let Some((lower, node)) = self.stack.pop() {
            if lower >= best.1 {
                continue;
            }
            if node >= self.width {
                let other = node - self.width;
                if other != place
                    && let Some(cluster) = &self.clusters[other]
                {
                    let d = finite(bounds.union(cluster.aabb()).half_area(self.scale));
                    if d < best.1 {
                        best = (other, d);
                    }
                }
                continue;
            }
            let children = [2 * node, 2 * node + 1]
                .map(|child| (self.bounds[child].distance(&bounds, self.scale), child));
            // The nearer child next; between equals the one on the way to the place itself, whose
            // neighbours in Morton order are likely near.
            let (mut near, mut far) = (children[0], children[1]);
            let home = (self.width + place)
                >> (far.1.leading_zeros() - (self.width + place).leading_zeros());
            if far.0 < near.0 || (far.0 == near.0 && home == far.1) {
                std::mem::swap(&mut near, &mut far);
            }
            for (lower, child) in [far, near] {
                if let Some(lower) = lower
                    && lower < best.1
                {
                    self.stack.push((lower, child));
                }
            }
        }
        (best.0 != place).then_some(best)
    }

    /// Puts `joined` at `place` and removes the cluster at `other`.
    pub(super) fn replace(&mut self, place: usize, other: usize, joined: Cluster) {
        self.clusters[place] = Some(joined);
        self.clusters[other] = None;
        self.live -= 1;
        for (place, bound) in [(place, Bound::of(&joined)), (other, Bound::EMPTY)] {
            let mut node = self.width + place;
            self.bounds[node] = bound;
            while node > 1 {
                node /= 2;
                self.bounds[node] = self.bounds[2 * node].union(&self.bounds[2 * node + 1]);
            }
        }
    }

    /// True if more than half of the places are empty.
    pub(super) fn is_sparse(&self) -> bool {
        2 * self.live < self.clusters.len()
    }

    /// Closes the gaps; returns where each place's cluster has gone.
    pub(super) fn compact(&mut self) -> Vec<u32> {
        let mut live = 0;
        let moved = self
            .clusters
            .iter()
            .map(|cluster| {
                let place = to_u32(live);
                live += usize::from(cluster.is_some());
                place
            })
            .collect();
        self.clusters.retain(Option::is_some);
        self.fill();
        moved
    }
}
