//! Bytes a second of writing to memory and of reading with all checks.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use niwaki_core::Bvh;
use niwaki_hard_cases::{median_tree, soup_mesh};
use niwaki_tree_file::TreeFile;
use niwaki_wide::{Bvh8, CollapseSettings};
use std::hint::black_box;

fn round_trip<T: TreeFile>(c: &mut Criterion, name: &str, tree: &T) {
    let mut file = Vec::new();
    tree.write_to(&mut file).expect("memory");
    let mut group = c.benchmark_group(name);
    group.throughput(Throughput::Bytes(file.len() as u64));
    group.bench_function("write", |b| {
        b.iter(|| {
            file.clear();
            black_box(tree).write_to(&mut file)
        });
    });
    group.bench_function("read", |b| b.iter(|| T::read_from(black_box(&file[..])).is_ok()));
    group.finish();
}

fn trees(c: &mut Criterion) {
    let bvh: Bvh = median_tree(&soup_mesh(100_000, 0.02, 1), 2);
    let wide = Bvh8::collapse(&bvh, &CollapseSettings::default()).expect("a tree");
    round_trip(c, "binary", &bvh);
    round_trip(c, "8 wide", &wide);
}

criterion_group!(benches, trees);
criterion_main!(benches);
