//! Build time by radius and number of triangles, on the current pool:
//! `cargo bench -p niwaki-build-ploc`.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use niwaki_build_ploc::Ploc;
use niwaki_core::Builder;
use niwaki_hard_cases::soup_mesh;
use std::hint::black_box;

fn build(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("ploc");
    for count in [10_000, 100_000] {
        let prims = soup_mesh(count, (count as f32).cbrt().recip(), 1).prim_refs();
        group.throughput(Throughput::Elements(count as u64));
        for radius in [1, 6, 14, 32] {
            let builder = Ploc { radius, ..Ploc::default() };
            let name = BenchmarkId::new(format!("radius {radius}"), count);
            group.bench_with_input(name, &prims, |bencher, prims| {
                bencher.iter(|| builder.build(black_box(prims)));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, build);
criterion_main!(benches);
