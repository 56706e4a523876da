//! Fits of the model of frames to times; no device is needed.

use niwaki_gpu_model::{
    Device, RaySettings, Workload,
    calibrate::{Calibrated, Observation, Parameter, calibrate_only, choose},
};
use niwaki_gpu_tracer::{TracerCounts, TracerModel};
use niwaki_trace::Mode;
use niwaki_trace_vulkan::TreeLayout;

fn observed(truth: &TracerModel) -> Vec<Observation> {
    let mut random = fastrand::Rng::with_seed(4);
    let mut all = Vec::new();
    for _ in 0..6 {
        let workload = Workload {
            primary_traversals: 4.0 + 8.0 * random.f64(),
            primary_intersections: 4.0 + 6.0 * random.f64(),
            visible_triangles: 0.5 + 0.5 * random.f64(),
            ao_traversals: 3.0 + 6.0 * random.f64(),
            ao_intersections: 8.0 + 5.0 * random.f64(),
            coalescing: 0.6 + 0.3 * random.f64(),
            shadow_traversals: 3.0 + 4.0 * random.f64(),
            shadow_intersections: 3.0 + 4.0 * random.f64(),
            shadow_rays: 0.5,
            primary_divergence: 0.5 + 0.5 * random.f64(),
            secondary_divergence: 0.5 + random.f64(),
            samples: 576,
        };
        for ao_rays in [0.0, 1.0, 4.0, 16.0, 32.0] {
            let settings = RaySettings { ao_rays, shadows: true };
            // As clocks scatter.
            let seconds =
                truth.seconds(&workload, &settings).unwrap() * (0.99 + 0.02 * random.f64());
            all.push(Observation { workload, settings, seconds });
        }
    }
    all
}

/// A search that tries to let threads wait for thousands of times their rays goes on elsewhere.
#[test]
fn issue_and_divergence_are_found() {
    let counts = TracerCounts::new(TreeLayout::Wide, Mode::Watertight, true).unwrap();
    // Memory that takes next to no time, and bandwidth for all warps at once.
    let device = Device {
        memory_latency_cycles: 1.0,
        departure_delay_coalesced_cycles: 1e-6,
        departure_delay_uncoalesced_cycles: 1e-6,
        bandwidth_gb_s: 1e6,
        ..Device::builtin("geforce-580").unwrap()
    };
    let model = TracerModel::new(device, counts, 160 * 90);
    let mut truth = model.clone();
    truth.frame_model_mut().device.issue_cycles *= 5.0;
    truth.frame_model_mut().constants.divergence = 0.4;
    let observations = observed(&truth);
    let choice = choose(&model, &observations, &Parameter::ALL).unwrap();
    assert_eq!(choice.parameters, [Parameter::Issue, Parameter::Divergence]);
    let made = calibrate_only(&model, &observations, &choice.parameters).unwrap();
    assert!(made.error_before > 0.5 && made.error_after < 0.02, "{made:?}");
    let found = made.model.frame_model().constants.divergence;
    assert!((found - 0.4).abs() < 0.05, "{found}");
}
