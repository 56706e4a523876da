//! Leaves where they cost least.

use crate::pass::{Outcome, improve};
use crate::tree::Tree;
use crate::{OptimizeError, Optimizer, Report};
use niwaki_core::{Bvh, BvhNode, SahConstants, to_u32};

/// Merges whole subtrees into leaves wherever that lowers the SAH cost: the cheapest of all trees
/// that come about by making leaves of inner nodes, found bottom up (as in Kensler 2008, section
/// 4, and Karras and Aila 2013, section 3).
///
/// The last step after passes that work best with one primitive a leaf. A primitive that a
/// splitting builder put into several of the merged leaves is listed once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CollapseLeaves {
    /// The most primitives of a merged leaf; at least 1. 8 by default. Larger leaves that the tree
    /// already has stay.
    pub max_leaf_size: u32,
    /// What nodes, leaves and triangles cost.
    pub constants: SahConstants,
}

impl Default for CollapseLeaves {
    fn default() -> Self {
        Self { max_leaf_size: 8, constants: SahConstants::default() }
    }
}

impl Optimizer for CollapseLeaves {
    fn name(&self) -> &str {
        "collapse"
    }

    /// One iteration; changes are merged leaves.
    fn optimize(&self, bvh: &mut Bvh) -> Result<Report, OptimizeError> {
        if self.max_leaf_size == 0 {
            return Err(OptimizeError::BadSetting {
                setting: "max_leaf_size",
                value: "0".into(),
                remedy: "a leaf holds at least 1 primitive",
            });
        }
        improve(bvh, &self.constants, |source| {
            let Some(tree) = Tree::new(source)? else { return Ok(None) };
            let merged = self.merged(&tree, source);
            let changes = merged.iter().filter(|m| **m).count() as u64;
            let bvh = (changes > 0).then(|| emit(&tree, source, &merged));
            Ok(Some(Outcome { iterations: 1, changes, bvh }))
        })
    }

    fn memory_bound(&self, nodes: usize, references: usize) -> usize {
        let costs = (8 + 4 + 1) * (nodes + 2);
        crate::pass::rearrange_memory(nodes, references) + costs + 12 * references
    }
}

impl CollapseLeaves {
    /// Which nodes become leaves; nodes below those may be marked as well.
    fn merged(&self, tree: &Tree, source: &Bvh) -> Vec<bool> {
        let nodes = tree.nodes();
        let [inner, leaf, triangle] =
            [self.constants.inner, self.constants.leaf, self.constants.triangle].map(f64::from);
        let most = self.max_leaf_size as usize;
        let repeated = has_repeated(&source.prim_ids);
        let mut ids = Vec::new();
        let mut costs = vec![0.0_f64; nodes.len()];
        let mut counts = vec![0_u32; nodes.len()];
        let mut merged = vec![false; nodes.len()];
        // Children come after their parents.
        for i in (0..nodes.len()).rev().filter(|&i| i != 1) {
            let node = &nodes[i];
            let area = node.bounds().aabb().area();
            if node.is_leaf() {
                counts[i] = node.count();
                costs[i] = area * (leaf + triangle * f64::from(node.count()));
                continue;
            }
            let [a, b] = [node.first() as usize, node.first() as usize + 1];
            counts[i] = counts[a] + counts[b];
            costs[i] = area * inner + costs[a] + costs[b];
            let mut count = counts[i] as usize;
            if repeated && count <= 4 * most {
                gather(tree, source, i, &mut ids);
                ids.sort_unstable();
                ids.dedup();
                count = ids.len();
            }
            let cost = area * (leaf + triangle * count as f64);
            if count <= most && cost <= costs[i] {
                costs[i] = cost;
                merged[i] = true;
            }
        }
        merged
    }
}

/// Whether an id is there twice.
fn has_repeated(ids: &[u32]) -> bool {
    let mut seen = vec![false; ids.iter().max().map_or(0, |&id| id as usize + 1).min(ids.len())];
    // An id past the number of ids leaves another one below it free; ids then are sorted.
    let dense = ids.iter().all(|&id| (id as usize) < seen.len());
    if dense {
        return ids.iter().any(|&id| std::mem::replace(&mut seen[id as usize], true));
    }
    let mut sorted = ids.to_vec();
    sorted.sort_unstable();
    sorted.windows(2).any(|pair| pair[0] == pair[1])
}

/// The ids below a node, from left to right.
fn gather(tree: &Tree, source: &Bvh, node: usize, ids: &mut Vec<u32>) {
    ids.clear();
    let mut stack = vec![to_u32(node)];
    while let Some(i) = stack.pop() {
        let node = &tree.nodes()[i as usize];
        if node.is_leaf() {
            let first = node.first() as usize;
            ids.extend_from_slice(&source.prim_ids[first..first + node.count() as usize]);
        } else {
            stack.extend([node.first() + 1, node.first()]);
        }
    }
}

/// The tree with marked nodes as leaves.
fn emit(tree: &Tree, source: &Bvh, merged: &[bool]) -> Bvh {
    let mut bvh = Bvh { nodes: Vec::new(), prim_ids: Vec::with_capacity(source.prim_ids.len()) };
    let node_at = |i: u32| tree.nodes()[i as usize].to_bvh(0);
    bvh.nodes.push(node_at(0));
    let mut ids = Vec::new();
    let mut stack = vec![(0_u32, 0_usize)];
    while let Some((i, place)) = stack.pop() {
        let node = &tree.nodes()[i as usize];
        if node.is_leaf() || merged[i as usize] {
            gather(tree, source, i as usize, &mut ids);
            let first = bvh.prim_ids.len();
            for &id in &ids {
                // Leaves that were there are kept as they are; merged ones are short.
                if node.is_leaf() || !bvh.prim_ids[first..].contains(&id) {
                    bvh.prim_ids.push(id);
                }
            }
            let count = bvh.prim_ids.len() - first;
            let bounds = bvh.nodes[place].aabb();
            bvh.nodes[place] = BvhNode::leaf(bounds, to_u32(first), to_u32(count));
            continue;
        }
        let first = bvh.nodes.len();
        bvh.nodes[place].first = to_u32(first);
        let children = node.first();
        bvh.nodes.extend([node_at(children), node_at(children + 1)]);
        stack.push((children + 1, first + 1));
        stack.push((children, first));
    }
    bvh
}

#[cfg(test)]
mod tests {
    use super::*;
    use niwaki_hard_cases::{median_tree, soup_mesh};
    use niwaki_metrics::sah;

    /// The least cost of a subtree, over all ways to make leaves of inner nodes, times the root's
    /// area.
    fn least(bvh: &Bvh, i: usize, pass: &CollapseLeaves) -> (f64, u32) {
        let node = &bvh.nodes[i];
        let [inner, leaf, triangle] =
            [pass.constants.inner, pass.constants.leaf, pass.constants.triangle].map(f64::from);
        let area = node.aabb().area();
        let as_leaf = |count: u32| area * (leaf + triangle * f64::from(count));
        if node.is_leaf() {
            return (as_leaf(node.count), node.count);
        }
        let [a, b] = node.children().map(|child| least(bvh, child, pass));
        let (count, mut cost) = (a.1 + b.1, area * inner + a.0 + b.0);
        if count <= pass.max_leaf_size {
            cost = cost.min(as_leaf(count));
        }
        (cost, count)
    }

    #[test]
    fn leaves_cost_least() {
        for seed in 0..20 {
            let tree = median_tree(&soup_mesh(200, 0.2, seed), 1);
            for max_leaf_size in [1, 2, 5, 200] {
                for leaf in [0.0, 0.5] {
                    let constants = SahConstants { leaf, ..SahConstants::THESIS_IV };
                    let pass = CollapseLeaves { max_leaf_size, constants };
                    let mut merged = tree.clone();
                    pass.optimize(&mut merged).unwrap();
                    let cost = sah(&merged, &constants);
                    let best = least(&tree, 0, &pass).0 / tree.bounds().area();
                    assert!((cost - best).abs() < 1e-9 * best, "{seed}: {cost} {best}");
                }
            }
        }
    }

    #[test]
    fn primitives_in_several_merged_leaves_are_listed_once() {
        // Two halves of one triangle's box, and another primitive.
        let mesh = soup_mesh(2, 0.1, 1);
        let whole = mesh.bounds();
        let leaf = |i| BvhNode::leaf(whole, i, 1);
        let inner = |first| BvhNode::inner(whole, first);
        let mut bvh = Bvh {
            nodes: vec![inner(1), leaf(0), inner(3), leaf(1), leaf(2)],
            prim_ids: vec![0, 1, 0],
        };
        let report = CollapseLeaves::default().optimize(&mut bvh).unwrap();
        assert_eq!(bvh, Bvh { nodes: vec![BvhNode::leaf(whole, 0, 2)], prim_ids: vec![0, 1] });
        assert_eq!(report.after, 2.0);
    }

    #[test]
    fn repeated_ids_are_noticed() {
        assert!(!has_repeated(&[]));
        assert!(!has_repeated(&[2, 0, 1]));
        assert!(!has_repeated(&[7, 0, u32::MAX]));
        assert!(has_repeated(&[1, 0, 1]));
        assert!(has_repeated(&[9, 3, 9]));
    }
}
