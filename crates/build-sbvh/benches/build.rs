//! Build time by preset, on the current pool: `cargo bench -p niwaki-build-sbvh`.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use niwaki_build_sbvh::Sbvh;
use niwaki_core::Builder;
use niwaki_hard_cases::soup_mesh;
use std::hint::black_box;

fn build(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("sbvh");
    for count in [10_000, 100_000] {
        // Triangles a few times as long as their distance, so that planes cut many.
        let mesh = soup_mesh(count, 4.0 * (count as f32).cbrt().recip(), 1);
        group.throughput(Throughput::Elements(count as u64));
        group.sample_size(10);
        for builder in [Sbvh::default(), Sbvh::sweep()] {
            let id = BenchmarkId::new(builder.name(), count);
            group.bench_with_input(id, &mesh, |bencher, mesh| {
                bencher.iter(|| builder.build_mesh(black_box(mesh)));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, build);
criterion_main!(benches);
