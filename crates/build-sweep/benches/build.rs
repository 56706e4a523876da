//! Sweep builds, by kernel.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use niwaki_build_sweep::{Kernel, SplitRule, Sweep, SweepWorkspace};
use niwaki_core::{Aabb, Builder, PrimRef, SahConstants, glam::Vec3, layout};

fn boxes(count: u32) -> Vec<PrimRef> {
    let mut state = 1_u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 16_777_216.0
    };
    (0..count)
        .map(|id| {
            let min = Vec3::new(random(), random(), random());
            PrimRef::new(Aabb::new(min, min + Vec3::splat(0.02 * random())), id)
        })
        .collect()
}

fn benches(criterion: &mut Criterion) {
    let rule = SplitRule::by_cost(SahConstants::default(), 8).expect("good settings");
    for (name, count) in [("small", 512), ("large", 100_000)] {
        let prims = boxes(count);
        let mut group = criterion.benchmark_group(name);
        group.throughput(Throughput::Elements(u64::from(count)));
        for kernel in Kernel::available() {
            let mut workspace = SweepWorkspace::new(kernel);
            let mut nodes = layout::slots(prims.len());
            let mut ids = vec![0; prims.len()];
            group.bench_function(format!("workspace {kernel:?}"), |b| {
                b.iter(|| {
                    workspace.prims.clear();
                    workspace.prims.extend_from_slice(&prims);
                    workspace.build(&rule, &mut nodes, &mut ids, 0)
                });
            });
            let sweep = Sweep { kernel, ..Sweep::default() };
            group.bench_function(format!("builder {kernel:?}"), |b| b.iter(|| sweep.build(&prims)));
        }
    }
}

criterion_group!(build, benches);
criterion_main!(build);
