//! Every pass over a median tree and a sweep tree of 100,000 triangles.

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use niwaki_build_sweep::Sweep;
use niwaki_core::{Builder, TriangleMesh};
use niwaki_hard_cases::{median_tree, soup};
use niwaki_optimize::{
    Budget, CollapseLeaves, Insertion, Optimizer, Prune, Reinsertion, Rotations, Treelets, refit,
};
use std::hint::black_box;

fn passes(c: &mut Criterion) {
    let triangles = [soup(99_000, 0.01, 1), soup(1000, 0.3, 2)].concat();
    let mesh = TriangleMesh::from_triangles(&triangles).expect("finite");
    let sweep = Sweep { max_leaf_size: 1, ..Sweep::default() };
    let trees = [
        ("median", median_tree(&mesh, 1)),
        ("sweep", sweep.build_mesh(&mesh).expect("finite boxes")),
    ];
    let once = Budget::iterations(1);
    let passes: [Box<dyn Optimizer>; 6] = [
        Box::new(Reinsertion::default()),
        Box::new(Insertion { budget: once, ..Insertion::default() }),
        Box::new(Rotations { budget: once, ..Rotations::default() }),
        Box::new(Treelets { budget: once, ..Treelets::default() }),
        Box::new(Prune::new(sweep)),
        Box::new(CollapseLeaves::default()),
    ];
    for (name, tree) in &trees {
        let mut group = c.benchmark_group(*name);
        group.sample_size(10);
        for pass in &passes {
            group.bench_function(pass.name(), |b| {
                b.iter_batched_ref(
                    || tree.clone(),
                    |tree| pass.optimize(black_box(tree)),
                    BatchSize::LargeInput,
                );
            });
        }
        group.bench_function("refit", |b| {
            b.iter_batched_ref(
                || tree.clone(),
                |tree| refit(black_box(tree), &mesh),
                BatchSize::LargeInput,
            );
        });
        group.finish();
    }
}

criterion_group!(benches, passes);
criterion_main!(benches);
