//! Time of splitting.

use criterion::{Criterion, criterion_group, criterion_main};
use niwaki_hard_cases::soup_mesh;
use niwaki_split::SplitPartition;

fn split(c: &mut Criterion) {
    let mesh = soup_mesh(200_000, 0.05, 1);
    c.bench_function("split partition, 200,000 triangles", |b| {
        b.iter(|| SplitPartition::default().partition_mesh(&mesh));
    });
}

criterion_group!(benches, split);
criterion_main!(benches);
