//! What several test files need.

use niwaki_build_sweep::Sweep;
use niwaki_core::{Builder, Bvh, Clip, PrimRef, TriangleMesh};
use niwaki_optimize::{
    Annealing, Budget, CollapseLeaves, Insertion, Optimizer, Prune, Reinsertion, Rotations,
    Treelets,
};

/// Every pass, with budgets that suit small trees.
pub(crate) fn passes() -> Vec<Box<dyn Optimizer>> {
    vec![
        Box::new(Reinsertion::default()),
        Box::new(Reinsertion { batch_fraction: 1.0, batch_size: 64, ..Reinsertion::default() }),
        Box::new(Insertion { budget: Budget::iterations(10), ..Insertion::default() }),
        Box::new(Rotations::default()),
        Box::new(Annealing { budget: Budget::iterations(10), ..Annealing::default() }),
        Box::new(Treelets::default()),
        Box::new(Prune::new(Sweep::default())),
        Box::new(Prune { mini_tree_size: 16, threshold: 0.01, ..Prune::new(Sweep::default()) }),
        Box::new(CollapseLeaves::default()),
    ]
}

/// One primitive a leaf.
pub(crate) fn single() -> Sweep {
    Sweep { max_leaf_size: 1, ..Sweep::default() }
}

/// A tree over triangles that were cut in two, or in four if large.
pub(crate) fn split_tree(mesh: &TriangleMesh, builder: &Sweep) -> Bvh {
    let mut parts: Vec<PrimRef> = mesh.prim_refs();
    for _ in 0..2 {
        parts = parts
            .iter()
            .flat_map(|prim| {
                let axis = prim.aabb().longest_axis();
                mesh.clip(prim, axis, prim.aabb().center()[axis])
                    .into_iter()
                    .filter(|part| !part.is_empty())
                    .map(|part| PrimRef::new(part, prim.prim_id))
            })
            .collect();
    }
    builder.build(&parts).unwrap()
}

pub(crate) fn same_bytes(a: &Bvh, b: &Bvh) -> bool {
    bytemuck::cast_slice::<_, u8>(&a.nodes) == bytemuck::cast_slice::<_, u8>(&b.nodes)
        && a.prim_ids == b.prim_ids
}
