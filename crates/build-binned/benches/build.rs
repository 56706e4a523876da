//! Build time by number of triangles, on the current pool: `cargo bench -p niwaki-build-binned`.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use niwaki_build_binned::Binned;
use niwaki_core::Builder;
use niwaki_hard_cases::soup_mesh;
use std::hint::black_box;

fn build(criterion: &mut Criterion) {
    let builders: [(&str, Box<dyn Builder>); 3] = [
        ("16 bins", Box::new(Binned::default())),
        ("8 bins", Box::new(Binned { bins: 8, ..Binned::default() })),
        ("64 bins", Box::new(Binned { bins: 64, ..Binned::default() })),
    ];
    let mut group = criterion.benchmark_group("binned");
    for count in [10_000, 100_000] {
        let prims = soup_mesh(count, (count as f32).cbrt().recip(), 1).prim_refs();
        group.throughput(Throughput::Elements(count as u64));
        for (name, builder) in &builders {
            group.bench_with_input(BenchmarkId::new(*name, count), &prims, |bencher, prims| {
                bencher.iter(|| builder.build(black_box(prims)));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, build);
criterion_main!(benches);
