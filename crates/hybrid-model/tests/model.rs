//! The model on frames whose times are known sums.

use niwaki_frame_control::Ladder;
use niwaki_hybrid::{Effect, Face, FrameReport, Settings, Stage, StageReport};
use niwaki_hybrid_model::{
    DrawnFrame, HybridModel, HybridModelError, PlannedWork, ViewWork, settings,
};
use std::{sync::Arc, time::Duration};

const SIZE: [u32; 2] = [320, 180];

/// A view with so many rays a pixel at depths 1 and 2, in a hall where all is at distances from 0 to 10.
fn view(first: f64, second: f64) -> Arc<ViewWork> {
    let mut rays = [0.0; 17];
    (rays[1], rays[2]) = (first, second);
    let distances: Vec<f32> = (0..=100_u8).map(|i| f32::from(i) / 10.0).collect();
    let view = PlannedWork { view_triangles: 60_000, ..PlannedWork::default() };
    let follows = PlannedWork { follows: true, faces: 5, face_triangles: 150_000, ..view };
    Arc::new(ViewWork {
        visible: 0.9,
        rays,
        ray_steps: 20.0,
        occlusion_steps: vec![8.0; distances.len()],
        distances: distances.clone(),
        triangle_distances: distances,
        objects: vec![(0.0, 40_000), (3.0, 60_000)],
        triangles: 100_000,
        longest: 20.0,
        diagonal: 25.0,
        lights: 2,
        planned: vec![(f32::INFINITY, [view, follows])],
    })
}

/// A device that takes a millisecond a stage, 20 for a million pixels of the view, 300 for a million rays,
/// and 9 for 100,000 triangles of the tree.
fn drawn(settings: Settings, size: [u32; 2], work: &Arc<ViewWork>) -> DrawnFrame {
    let pixels = 1e-6 * f64::from(size[0]) * f64::from(size[1]);
    let mut stages = vec![(Stage::Effect(Effect::PrimaryView), 1.0 + 20.0 * pixels)];
    stages.push((Stage::PrimaryShading, 30.0 * pixels));
    if settings.max_depth > 0 {
        stages.push((Stage::Effect(Effect::CubeFace(Face::PosX)), 1.0));
        let tree = 1.0 + 9e-5 * work.near_triangles(&settings);
        stages.push((Stage::Effect(Effect::NearRegion), tree));
        let rays = pixels * work.rays_up_to(settings.max_depth);
        stages.push((Stage::RayTraversal, 1.0 + 300.0 * rays));
    }
    let stages = stages.into_iter().map(|(stage, ms)| StageReport {
        stage,
        draws: 1,
        dispatches: 0,
        gpu_time: Some(Duration::from_secs_f64(1e-3 * ms)),
    });
    let report = FrameReport { stages: stages.collect(), ..FrameReport::default() };
    DrawnFrame { settings, size, work: work.clone(), report }
}

fn rungs() -> Vec<(Settings, [u32; 2])> {
    let base = Settings { shadows: niwaki_hybrid::Shadows::None, ..Settings::default() };
    let ladder = Ladder::hybrid();
    let no_light = |s: Settings| Settings { occlusion_rays: 0, ..s };
    let rung = |r: &niwaki_frame_control::RenderSettings| {
        (no_light(settings(&base, r, 20.0)), r.scaled(SIZE))
    };
    ladder.rungs().iter().map(rung).collect()
}

fn total(frame: &DrawnFrame) -> f64 {
    frame.report.stages.iter().map(|s| 1e3 * s.gpu_time.unwrap().as_secs_f64()).sum()
}

#[test]
fn known_sums_are_found() {
    let views = [view(0.3, 0.1), view(0.05, 0.02)];
    let frames: Vec<DrawnFrame> = views
        .iter()
        .flat_map(|work| rungs().into_iter().step_by(2).map(move |(s, size)| drawn(s, size, work)))
        .collect();
    let model = HybridModel::fit(&frames).unwrap();
    // Of another view, and of all rungs.
    let other = view(0.15, 0.12);
    for (settings, size) in rungs() {
        let frame = drawn(settings.clone(), size, &other);
        let predicted = model.predict(&settings, size, &other).milliseconds();
        let measured = total(&frame);
        assert!((predicted - measured).abs() < 0.01 * measured, "{predicted} {measured}");
    }
}

#[test]
fn higher_rungs_are_never_predicted_to_be_quicker() {
    let work = view(0.3, 0.1);
    let frames: Vec<DrawnFrame> =
        rungs().into_iter().map(|(s, size)| drawn(s, size, &work)).collect();
    let model = HybridModel::fit(&frames).unwrap();
    let times: Vec<f64> =
        rungs().iter().map(|(s, size)| model.predict(s, *size, &work).milliseconds()).collect();
    assert!(times.is_sorted(), "{times:?}");
}

#[test]
fn what_cannot_be_fitted_is_an_error() {
    assert!(matches!(HybridModel::fit(&[]), Err(HybridModelError::NoFrames)));
    let work = view(0.3, 0.1);
    let good = drawn(Settings::default(), SIZE, &work);
    let mut timeless = good.clone();
    timeless.report.stages[0].gpu_time = None;
    let error = HybridModel::fit(&[good.clone(), timeless]).unwrap_err();
    assert!(matches!(error, HybridModelError::NoTimes { frame: 1 }), "{error}");
    let mut still = good;
    still.report.stages.clear();
    assert!(matches!(HybridModel::fit(&[still]), Err(HybridModelError::NoTimes { frame: 0 })));
}
