//! Build time by number of triangles, on the current pool: `cargo bench -p niwaki-build-aac`.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use niwaki_build_aac::{Aac, Agglomerative};
use niwaki_core::Builder;
use niwaki_hard_cases::soup_mesh;
use std::hint::black_box;

fn build(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("aac");
    for count in [10_000, 100_000] {
        let prims = soup_mesh(count, (count as f32).cbrt().recip(), 1).prim_refs();
        group.throughput(Throughput::Elements(count as u64));
        let mut run = |builder: &dyn Builder| {
            let name = BenchmarkId::new(builder.name(), count);
            group.bench_with_input(name, &prims, |bencher, prims| {
                bencher.iter(|| builder.build(black_box(prims)));
            });
        };
        run(&Aac::hq());
        run(&Aac::lq());
        if count <= 10_000 {
            run(&Agglomerative::default());
        }
    }
    group.finish();
}

criterion_group!(benches, build);
criterion_main!(benches);
