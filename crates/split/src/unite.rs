//! References to one primitive that ended up in one leaf again.

use niwaki_core::{Bvh, to_u32};
use rayon::prelude::*;
use std::collections::HashSet;

/// Leaves larger than this look ids up in a set.
const SMALL: usize = 32;

/// Keeps one of several equal ids of a leaf. Boxes stay: together the parts are what the leaf holds
/// of the primitive.
pub(crate) fn unite_duplicates(bvh: &mut Bvh) {
    let prim_ids = &bvh.prim_ids;
    let repeated: Vec<usize> = bvh
        .nodes
        .par_iter()
        .with_min_len(4096)
        .flat_map_iter(|node| repeated(prim_ids, node.prim_range()))
        .collect();
    if repeated.is_empty() {
        return;
    }
    // New places: how many ids before each are kept.
    let mut places = vec![1_u32; prim_ids.len()];
    for &entry in &repeated {
        places[entry] = 0;
    }
    let mut kept = 0;
    let mut ids = Vec::with_capacity(prim_ids.len() - repeated.len());
    for (place, &id) in places.iter_mut().zip(prim_ids) {
        let is_kept = *place == 1;
        *place = kept;
        if is_kept {
            ids.push(id);
            kept += 1;
        }
    }
    let place = |entry: usize| places.get(entry).map_or(kept, |&place| place);
    bvh.nodes.par_iter_mut().with_min_len(4096).filter(|node| node.is_leaf()).for_each(|node| {
        let range = node.prim_range();
        node.first = place(range.start);
        node.count = place(range.end) - node.first;
    });
    bvh.prim_ids = ids;
    debug_assert_eq!(to_u32(bvh.prim_ids.len()), kept);
}

/// Entries of a leaf whose id is in the leaf before.
fn repeated(ids: &[u32], range: std::ops::Range<usize>) -> Vec<usize> {
    let first = range.start;
    let ids = &ids[range];
    let mut found = Vec::new();
    if ids.len() <= SMALL {
        for i in 1..ids.len() {
            if ids[..i].contains(&ids[i]) {
                found.push(first + i);
            }
        }
    } else {
        let mut seen = HashSet::with_capacity(ids.len());
        found.extend((0..ids.len()).filter(|&i| !seen.insert(ids[i])).map(|i| first + i));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use niwaki_core::{Aabb, BvhNode};

    #[test]
    fn one_of_equal_ids_stays_in_each_leaf() {
        let leaf = |first, count| BvhNode::leaf(Aabb::EMPTY, first, count);
        let large: Vec<u32> = (0..40).map(|i| i % 30).collect();
        // Leaves stand in another order than their ids.
        let mut bvh = Bvh {
            nodes: vec![
                BvhNode::inner(Aabb::EMPTY, 1),
                leaf(43, 4),
                BvhNode::inner(Aabb::EMPTY, 3),
                leaf(0, 3),
                leaf(3, 40),
            ],
            prim_ids: [5, 6, 5].into_iter().chain(large).chain([1, 1, 2, 1]).collect(),
        };
        unite_duplicates(&mut bvh);
        assert_eq!(bvh.leaf_prims(&bvh.nodes[1]), [1, 2]);
        assert_eq!(bvh.leaf_prims(&bvh.nodes[3]), [5, 6]);
        assert!(bvh.leaf_prims(&bvh.nodes[4]).iter().copied().eq(0..30));
        assert_eq!(bvh.prim_ids.len(), 34);
        let before = bvh.clone();
        unite_duplicates(&mut bvh);
        assert_eq!(bvh, before);
    }
}
