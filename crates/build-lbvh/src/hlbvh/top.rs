//! The top tree over treelets: binned surface area heuristic (Garanzha et al. 2011, section 4.2).

use niwaki_core::bottom_up::{Cluster, LeafRule, Slots};
use niwaki_core::glam::Vec3;
use niwaki_core::{Aabb, to_u32};

/// A node of the top tree.
#[derive(Clone, Copy)]
enum Node {
    Treelet(usize),
    Inner([usize; 2]),
}

/// Treelets whose centroids fall into one bin.
#[derive(Clone, Copy)]
struct Bin {
    bounds: Aabb,
    prims: u32,
}

impl Bin {
    const EMPTY: Self = Self { bounds: Aabb::EMPTY, prims: 0 };

    fn with(self, other: &Self) -> Self {
        Self { bounds: self.bounds.union(other.bounds), prims: self.prims + other.prims }
    }

    fn cost(&self, rule: &LeafRule) -> f32 {
        rule.leaf_cost(self.bounds.half_area(rule.scale), self.prims)
    }
}

fn centroid(cluster: &Cluster) -> Vec3 {
    cluster.aabb().center()
}

/// Joins the roots of treelets, at least one, by a top-down tree; the join of two sets of treelets
/// takes the slot of the first place of the first treelet of the second.
pub(super) fn build(
    roots: &[Cluster],
    firsts: &[u32],
    bins: usize,
    mut slots: Slots<'_>,
    rule: &LeafRule,
) -> Cluster {
    let mut ids: Vec<u32> = (0..to_u32(roots.len())).collect();
    let mut nodes = vec![Node::Treelet(0)];
    let mut stack = vec![(0, 0..roots.len())];
    let mut table = vec![Bin::EMPTY; bins];
    let mut costs = vec![0.0; bins];
    while let Some((node, range)) = stack.pop() {
        let set = &mut ids[range.clone()];
        if set.len() == 1 {
            nodes[node] = Node::Treelet(set[0] as usize);
            continue;
        }
        let left = split(roots, set, &mut table, &mut costs, rule);
        let children = [nodes.len(), nodes.len() + 1];
        nodes[node] = Node::Inner(children);
        nodes.extend([Node::Treelet(0); 2]);
        let middle = range.start + left;
        stack.push((children[1], middle..range.end));
        stack.push((children[0], range.start..middle));
    }
    // Children come after their parents.
    let mut done = vec![(roots[0], 0_u32); nodes.len()];
    for i in (0..nodes.len()).rev() {
        done[i] = match nodes[i] {
            Node::Treelet(treelet) => (roots[treelet], firsts[treelet]),
            Node::Inner([left, right]) => {
                let ((left, first), (right, slot)) = (done[left], done[right]);
                (slots.join(&left, &right, slot, rule), first)
            }
        };
    }
    done[0].0
}

/// Divides a set of at least two treelets; returns the size of the first part, neither 0 nor all.
fn split(
    roots: &[Cluster],
    set: &mut [u32],
    table: &mut [Bin],
    costs: &mut [f32],
    rule: &LeafRule,
) -> usize {
    let root = |id: u32| &roots[id as usize];
    let bounds = Aabb::from_points(set.iter().map(|&id| centroid(root(id))));
    let last = table.len() - 1;
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in 0..3 {
        if bounds.max[axis] <= bounds.min[axis] {
            continue;
        }
        table.fill(Bin::EMPTY);
        for &id in &*set {
            let cluster = root(id);
            let bin = &mut table[bin_of(cluster, axis, &bounds, last)];
            *bin = bin.with(&Bin { bounds: cluster.aabb(), prims: cluster.prims() });
        }
        let mut right = Bin::EMPTY;
        for i in (1..=last).rev() {
            right = right.with(&table[i]);
            costs[i] = if right.prims == 0 { f32::INFINITY } else { right.cost(rule) };
        }
        let mut left = Bin::EMPTY;
        for i in 1..=last {
            left = left.with(&table[i - 1]);
            let cost = if left.prims == 0 { f32::INFINITY } else { left.cost(rule) + costs[i] };
            if cost < best.map_or(f32::INFINITY, |best| best.0) {
                best = Some((cost, axis, i));
            }
        }
    }
    let Some((_, axis, border)) = best else {
        // One centroid, or areas beyond the range of numbers: by Morton order.
        return set.len() / 2;
    };
    // In place, keeping neither side's order: it depends on nothing but the set's.
    let mut left = 0;
    for i in 0..set.len() {
        if bin_of(root(set[i]), axis, &bounds, last) < border {
            set.swap(i, left);
            left += 1;
        }
    }
    left
}

/// The bin of a treelet along an axis in which the centroid bounds are not flat.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped before")]
fn bin_of(cluster: &Cluster, axis: usize, bounds: &Aabb, last: usize) -> usize {
    // Halves, so that extents do not overflow.
    let low = bounds.min[axis] * 0.5;
    let extent = bounds.max[axis] * 0.5 - low;
    let f = (centroid(cluster)[axis] * 0.5 - low) / extent * (last + 1) as f32;
    // A NaN (0/0 among denormals) becomes 0.
    (f.max(0.0) as usize).min(last)
}
