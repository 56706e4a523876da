//! Bringing any binary tree into the layout of [`Bvh`].

use niwaki_core::{Aabb, Bvh, BvhNode, to_u32};

/// What a foreign node is.
pub(crate) enum Read<H> {
    /// A leaf, whose ids have been appended.
    Leaf,
    /// An inner node: its children and their boxes.
    Inner([(H, Aabb); 2]),
    /// No node.
    Missing,
}

/// Walks a tree depth first, with a stack of its own, and lays it out with siblings adjacent and
/// behind their parent. `read` tells what a node is and appends the ids of a leaf. `None` if a
/// node is missing or a leaf is empty.
pub(crate) fn flatten<H: Copy>(
    root: H,
    bounds: Aabb,
    mut read: impl FnMut(H, &mut Vec<u32>) -> Read<H>,
) -> Option<Bvh> {
    let mut nodes = vec![BvhNode::leaf(bounds, 0, 1)];
    let mut prim_ids = Vec::new();
    let mut stack = vec![(root, 0)];
    while let Some((node, place)) = stack.pop() {
        let first = prim_ids.len();
        let bounds = nodes[place].aabb();
        match read(node, &mut prim_ids) {
            Read::Missing => return None,
            Read::Leaf => {
                let count = prim_ids.len() - first;
                if count == 0 {
                    return None;
                }
                nodes[place] = BvhNode::leaf(bounds, to_u32(first), to_u32(count));
            }
            Read::Inner([(left, left_bounds), (right, right_bounds)]) => {
                let child = nodes.len();
                nodes[place] = BvhNode::inner(bounds, to_u32(child));
                nodes.push(BvhNode::leaf(left_bounds, 0, 1));
                nodes.push(BvhNode::leaf(right_bounds, 0, 1));
                stack.push((right, child + 1));
                stack.push((left, child));
            }
        }
    }
    Some(Bvh { nodes, prim_ids })
}

#[cfg(test)]
mod tests {
    use super::*;
    use niwaki_core::glam::Vec3;

    #[test]
    fn a_chain_of_a_million_levels_is_flattened() {
        const LEVELS: u32 = 1_000_000;
        let unit = Aabb::new(Vec3::ZERO, Vec3::ONE);
        // Even handles are inner nodes: a leaf, and the next inner node or a last leaf.
        let bvh = flatten(0_u32, unit, |node, ids| {
            if node % 2 == 1 || node / 2 == LEVELS {
                ids.push(node / 2);
                return Read::Leaf;
            }
            Read::Inner([(node + 1, unit), (node + 2, unit)])
        })
        .unwrap();
        assert_eq!(bvh.nodes.len(), 2 * LEVELS as usize + 1);
        assert!(bvh.prim_ids.iter().copied().eq(0..=LEVELS));
        let inner = bvh.nodes.iter().enumerate().filter(|(_, node)| !node.is_leaf());
        for (i, node) in inner {
            assert!(node.first as usize > i, "children come after their parent");
        }
    }

    #[test]
    fn broken_trees_are_noticed() {
        let unit = Aabb::new(Vec3::ZERO, Vec3::ONE);
        assert_eq!(flatten((), unit, |(), _| Read::Missing), None);
        assert_eq!(flatten((), unit, |(), _| Read::Leaf), None);
        let with_hole = |node: u32, ids: &mut Vec<u32>| match node {
            0 => Read::Inner([(1, unit), (2, unit)]),
            1 => {
                ids.push(0);
                Read::Leaf
            }
            _ => Read::Missing,
        };
        assert_eq!(flatten(0, unit, with_hole), None);
    }
}
