//! Deciding a frame and learning from one: `cargo bench -p niwaki-frame-control`.

#[allow(dead_code, reason = "the examples and tests use the rest")]
#[path = "../tests/common/mod.rs"]
mod common;

use criterion::{Criterion, criterion_group, criterion_main};
use niwaki_frame_control::sim::{Counters, Script};
use niwaki_frame_control::{
    Aim, Config, Controller, Correction, CorrectionConfig, FrameController, InnerConfig, InnerLoop,
    Ladder, RegressionConfig, RegressionController, RenderSettings, Search, kendall_tau_b,
};
use std::hint::black_box;

/// As many operations as a small analytical model.
fn model(settings: &RenderSettings, seen: &Counters) -> f64 {
    let ao = f64::from(settings.ao_rays) * seen.ao_traversals;
    let misses = 1.0 - (-(seen.ao_traversals + seen.primary_traversals) / 23.0).exp2();
    (seen.primary_traversals + ao) * (1.0 + misses * (1.0 - seen.coalescing).powi(2))
}

fn features(settings: &RenderSettings, seen: &Counters) -> [f64; 5] {
    let ao = f64::from(settings.ao_rays);
    let tests = seen.ao_intersections * seen.visible * ao;
    [1.0, seen.primary_traversals, seen.primary_intersections, ao * seen.ao_traversals, tests]
}

fn decide(c: &mut Criterion) {
    let ladder = || Ladder::ray_tracing(64, 0.1).unwrap();
    let seen = Script::fairy(2).view(0).counters;
    let target = model(&ladder().rungs()[30], &seen);
    let ladder_top = ladder().rungs()[65];
    let mut group = c.benchmark_group("decide, 66 rungs");
    for (name, aim, search) in [
        ("nearest, exhaustive", Aim::Nearest, Search::Exhaustive),
        ("at most, exhaustive", Aim::AtMost { headroom: 0.05 }, Search::Exhaustive),
        ("nearest, bisection", Aim::Nearest, Search::Bisection),
    ] {
        let config = InnerConfig { aim, search, ..InnerConfig::default() };
        let mut inner = InnerLoop::new(ladder(), target, config).unwrap();
        group.bench_function(format!("inner loop, {name}"), |b| {
            b.iter(|| inner.choose(|settings| model(settings, black_box(&seen))));
        });
    }
    let mut both = FrameController::new(ladder(), model, target, Config::default()).unwrap();
    group.bench_function("both loops, with a measurement", |b| {
        b.iter(|| {
            let decision = both.decide(black_box(&seen));
            both.measure(decision.frame, Some(1.1 * target))
        });
    });
    let thesis = common::model("geforce-580");
    let target = thesis(&ladder().rungs()[30], &seen);
    group.bench_function("the thesis's model, once", |b| {
        b.iter(|| thesis(&ladder_top, black_box(&seen)));
    });
    let mut both =
        FrameController::new(ladder(), thesis.clone(), target, Config::default()).unwrap();
    group.bench_function("both loops over the thesis's model, with a measurement", |b| {
        b.iter(|| {
            let decision = both.decide(black_box(&seen));
            both.measure(decision.frame, Some(1.1 * target))
        });
    });
    let config = RegressionConfig::default();
    let mut learnt = RegressionController::new(ladder(), features, target, 30, config).unwrap();
    group.bench_function("regression on 5 features, with a measurement", |b| {
        b.iter(|| {
            let decision = learnt.decide(black_box(&seen));
            learnt.measure(decision.frame, Some(target))
        });
    });
    group.finish();
    let mut correction = Correction::new(CorrectionConfig::default()).unwrap();
    c.bench_function("learn", |b| b.iter(|| correction.learn(black_box(10.0), Some(11.0))));
    let x: Vec<f64> = (0..10_000).map(|i| f64::from((i * 7919) % 10_007)).collect();
    let y: Vec<f64> = (0..10_000).map(|i| f64::from((i * 104_729) % 1_009)).collect();
    c.bench_function("Kendall's tau of 10,000", |b| b.iter(|| kendall_tau_b(&x, black_box(&y))));
}

criterion_group!(benches, decide);
criterion_main!(benches);
