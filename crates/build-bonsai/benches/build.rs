//! Bonsai builds of a bumpy sheet, by preset, with a full sweep beside them.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use niwaki_build_bonsai::Bonsai;
use niwaki_build_sweep::Sweep;
use niwaki_core::{Builder, glam::Vec3};
use niwaki_hard_cases::sheet;

fn benches(criterion: &mut Criterion) {
    let mesh = sheet(320, |x, y| {
        let (x, y) = (x as f32, y as f32);
        Vec3::new(x, y, (x * 0.1).sin() * (y * 0.07).cos() * 20.0)
    });
    let mut group = criterion.benchmark_group("sheet");
    group.throughput(Throughput::Elements(mesh.len() as u64));
    let builders: [&dyn Builder; 4] =
        [&Sweep::default(), &Bonsai::bonsai(), &Bonsai::bonsai_p(), &Bonsai::bonsai_p_star()];
    for builder in builders {
        group.bench_function(builder.name(), |b| b.iter(|| builder.build_mesh(&mesh)));
    }
}

criterion_group!(build, benches);
criterion_main!(build);
