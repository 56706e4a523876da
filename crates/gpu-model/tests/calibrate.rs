//! Fits to times of a device that the model knows nothing of.

use niwaki_gpu_model::{
    Device, Form, FrameModel, KernelCounts, RaySettings, Workload,
    calibrate::{Calibrated, Observation, Parameter, calibrate, calibrate_only, choose},
    hong_kim::Model,
};

const COUNTS: KernelCounts = KernelCounts {
    compute_per_traversal: 95.0,
    compute_per_intersection: 156.0,
    compute_constant: 700.0,
    memory_per_traversal: 6.0,
    memory_per_intersection: 3.0,
    memory_constant: 5.0,
    bytes_per_memory_instruction: 16.0,
};

fn frames() -> Vec<(Workload, RaySettings)> {
    let mut random = fastrand::Rng::with_seed(5);
    (0..40)
        .map(|i| {
            let view = Workload {
                primary_traversals: 5.0 + 60.0 * random.f64(),
                primary_intersections: 8.0 * random.f64(),
                visible_triangles: random.f64(),
                ao_traversals: 40.0 * random.f64(),
                ao_intersections: 8.0 * random.f64(),
                coalescing: random.f64(),
                shadow_traversals: 20.0 * random.f64(),
                shadow_intersections: 3.0 * random.f64(),
                shadow_rays: random.f64(),
                primary_divergence: random.f64(),
                secondary_divergence: 2.0 * random.f64(),
                samples: 576,
            };
            (view, RaySettings { ao_rays: f64::from(i % 9), shadows: i % 2 == 0 })
        })
        .collect()
}

fn observed(truth: &FrameModel) -> Vec<Observation> {
    let seconds = |view, settings| truth.predict(view, settings).unwrap().seconds;
    frames()
        .iter()
        .map(|(workload, settings)| Observation {
            workload: *workload,
            settings: *settings,
            seconds: seconds(workload, settings),
        })
        .collect()
}

fn model_of(device: Device) -> FrameModel {
    FrameModel {
        form: Form::HongKim(Model::continuous()),
        ..FrameModel::new(device, COUNTS, 1 << 20)
    }
}

#[test]
fn finds_parameters_by_times_alone() {
    for name in Device::builtin_names() {
        let device = Device::builtin(name).unwrap();
        let truth = model_of(Device {
            memory_latency_cycles: device.memory_latency_cycles * 2.0,
            departure_delay_coalesced_cycles: device.departure_delay_coalesced_cycles * 0.5,
            departure_delay_uncoalesced_cycles: device.departure_delay_uncoalesced_cycles * 1.7,
            issue_cycles: device.issue_cycles * 0.6,
            ..device.clone()
        });
        let observations = observed(&truth);
        let (fit_on, held_out) = observations.split_at(20);
        let start = model_of(device);
        let made = calibrate(&start, fit_on).unwrap();
        assert!(made.error_after < 0.03, "{name}: {} to {}", made.error_before, made.error_after);
        assert!(made.error_after <= made.error_before);
        // On frames that it has not seen.
        let off = held_out.iter().map(|one| {
            let made = made.model.predict(&one.workload, &one.settings).unwrap().seconds;
            (made / one.seconds).ln().abs()
        });
        let mean = off.sum::<f64>() / held_out.len() as f64;
        assert!(mean < 0.05, "{name}: {mean}");
        // The same every time.
        assert_eq!(calibrate(&start, fit_on).unwrap(), made);
    }
}

/// Another device has other cores, bandwidth and transactions, which are not fitted: what is left
/// is a fraction of what was.
#[test]
fn comes_near_to_another_device() {
    for (from, to) in
        [("geforce-8800", "gtx-280"), ("gtx-280", "geforce-8800"), ("geforce-580", "geforce-8800")]
    {
        let observations = observed(&model_of(Device::builtin(to).unwrap()));
        let made = calibrate(&model_of(Device::builtin(from).unwrap()), &observations).unwrap();
        assert!(
            made.error_after < 0.25 && made.error_after < 0.4 * made.error_before,
            "{from} to {to}: {} to {}",
            made.error_before,
            made.error_after
        );
    }
}

#[test]
fn times_that_are_none_are_refused() {
    let model = FrameModel::new(Device::builtin("gtx-280").unwrap(), COUNTS, 1 << 20);
    let (workload, settings) = frames()[0];
    assert!(calibrate(&model, &[]).is_err());
    for seconds in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let message = calibrate(&model, &[Observation { workload, settings, seconds }])
            .unwrap_err()
            .to_string();
        assert!(message.contains("seconds"), "{message}");
    }
    // Times that no parameters give end in a fit, and no parameter runs away.
    let absurd = Observation { workload, settings, seconds: 1e9 };
    assert!(calibrate(&model, &[absurd]).unwrap().model.device.check().is_ok());
}

/// Where computation bounds every frame, times tell how fast it is, and nothing of memory.
#[test]
fn only_what_times_tell_is_chosen() {
    let fast = Device::builtin("geforce-580").unwrap();
    let fast = Device {
        memory_latency_cycles: 1e-3,
        departure_delay_coalesced_cycles: 1e-6,
        departure_delay_uncoalesced_cycles: 1e-6,
        bandwidth_gb_s: 1e6,
        ..fast
    };
    let truth = model_of(Device { issue_cycles: 7.0 * fast.issue_cycles, ..fast.clone() });
    let mut random = fastrand::Rng::with_seed(8);
    let noisy = |truth: &FrameModel, random: &mut fastrand::Rng| -> Vec<Observation> {
        let mut all = observed(truth);
        for (i, one) in all.iter_mut().enumerate() {
            // Five settings a view.
            one.workload = frames()[i / 5].0;
            one.seconds = truth.predict(&one.workload, &one.settings).unwrap().seconds
                * (0.98 + 0.04 * random.f64());
        }
        all
    };
    let observations = noisy(&truth, &mut random);
    let model = model_of(fast);
    let choice = choose(&model, &observations, &Parameter::ALL).unwrap();
    assert_eq!(choice.parameters, [Parameter::Issue]);
    assert!(choice.left_out_error < 0.02, "{}", choice.left_out_error);
    let made = calibrate_only(&model, &observations, &choice.parameters).unwrap();
    assert!((made.model.device.issue_cycles / truth.device.issue_cycles - 1.0).abs() < 0.01);
    assert_eq!(made.model.device.memory_latency_cycles, model.device.memory_latency_cycles);

    // Threads that wait for each other show as well.
    let mut truth = truth;
    truth.constants.divergence = 0.6;
    let observations = noisy(&truth, &mut random);
    let choice = choose(&model, &observations, &Parameter::ALL).unwrap();
    assert_eq!(choice.parameters, [Parameter::Issue, Parameter::Divergence]);
    let made = calibrate_only(&model, &observations, &choice.parameters).unwrap();
    let found = Parameter::Divergence.value(made.model.frame_model());
    assert!((found - 0.6).abs() < 0.1, "{found}");

    // One observation has nothing to be compared with.
    let one = &observations[..1];
    assert!(choose(&model, one, &Parameter::ALL).unwrap().parameters.is_empty());
    assert!(choose(&model, &[], &Parameter::ALL).is_err());
}
