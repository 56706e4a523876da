//! Sweep builds, by kernel.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use niwaki_build_sweep::{Kernel, SplitRule, Sweep, SweepWorkspace};
use niwaki_core::{Builder, SahConstants};
use niwaki_hard_cases::soup_mesh;

fn benches(criterion: &mut Criterion) {
    let rule = SplitRule::by_cost(SahConstants::default(), 8).expect("good settings");
    for (name, count) in [("small", 512), ("large", 100_000)] {
        let prims = soup_mesh(count, 0.02, 1).prim_refs();
        let mut group = criterion.benchmark_group(name);
        group.throughput(Throughput::Elements(count as u64));
        for kernel in Kernel::available() {
            let mut workspace = SweepWorkspace::new(kernel);
            let mut ids = vec![0; prims.len()];
            group.bench_function(format!("workspace {kernel:?}"), |b| {
                b.iter(|| {
                    workspace.prims.clear();
                    workspace.prims.extend_from_slice(&prims);
                    workspace.build(&rule, &mut ids, 0).len()
                });
            });
            let sweep = Sweep { kernel, ..Sweep::default() };
            group.bench_function(format!("builder {kernel:?}"), |b| b.iter(|| sweep.build(&prims)));
        }
    }
}

criterion_group!(build, benches);
criterion_main!(build);
