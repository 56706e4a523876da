//! Build time by number of triangles, on the current pool: `cargo bench -p niwaki-build-lbvh`.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use niwaki_build_lbvh::{Algorithm, Hlbvh, Lbvh};
use niwaki_core::Builder;
use niwaki_hard_cases::soup_mesh;
use std::hint::black_box;

fn build(criterion: &mut Criterion) {
    let builders: [(&str, Box<dyn Builder>); 5] = [
        ("karras 63", Box::new(Lbvh { algorithm: Algorithm::Karras, ..Lbvh::default() })),
        ("lauterbach 63", Box::new(Lbvh { algorithm: Algorithm::Lauterbach, ..Lbvh::default() })),
        ("apetrei 63", Box::new(Lbvh { algorithm: Algorithm::Apetrei, ..Lbvh::default() })),
        ("hlbvh", Box::new(Hlbvh::default())),
        (
            "apetrei 30",
            Box::new(Lbvh { algorithm: Algorithm::Apetrei, code_bits: 30, ..Lbvh::default() }),
        ),
    ];
    let mut group = criterion.benchmark_group("lbvh");
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
