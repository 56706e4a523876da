//! Micro-benchmarks on the device at hand.
#![cfg(feature = "vulkan")]

use niwaki_gpu_model::{
    Device,
    microbench::{Fit, MicrobenchError, Origin, Settings, measure},
};
use niwaki_trace_vulkan::{DeviceOptions, GpuError};

/// The device, or `None` where there is no Vulkan and none is required.
fn gpu(options: &DeviceOptions) -> Option<niwaki_trace_vulkan::Device> {
    match niwaki_trace_vulkan::Device::open(options) {
        Ok(device) => Some(device),
        Err(error @ (GpuError::NoLoader(_) | GpuError::NoDevice(_))) => {
            let is_required = std::env::var_os("NIWAKI_REQUIRE_VULKAN").is_some_and(|x| x != "0");
            assert!(!is_required, "NIWAKI_REQUIRE_VULKAN is set: {error}");
            println!("skipped: {error}");
            None
        }
        Err(error) => panic!("{error}"),
    }
}

#[test]
fn a_device_is_measured_and_comes_back_from_its_table() {
    let Some(gpu) = gpu(&DeviceOptions::checked()) else { return };
    let settings = Settings {
        working_set_bytes: Some(1 << 22),
        repeats: 2,
        lengths: 3,
        ..Settings::default()
    };
    let measured = match measure(&gpu, &settings) {
        Ok(measured) => measured,
        // Which a machine that does much else can make of any measurement.
        Err(error @ MicrobenchError::NoSlope { .. }) => return println!("{error}"),
        Err(error) => panic!("{error}"),
    };
    let device = &measured.device;
    assert_eq!(device.name, gpu.name());
    assert_eq!(measured.working_set_bytes, 1 << 22);
    assert_eq!(device.warp_size, gpu.info().subgroup_size);
    assert_eq!(&Device::parse(&device.to_toml(), "it").unwrap(), device);
    // Seconds are the fits', whatever the clock is taken for.
    let per_cycle = 1e-9 / device.clock_ghz;
    let latency = device.memory_latency_cycles * per_cycle;
    assert!((latency / measured.latency.slope_s - 1.0).abs() < 1e-9);
    let bytes = device.bandwidth_gb_s * 1e9;
    assert!((bytes * measured.bandwidth.slope_s - 1.0).abs() < 1e-9);
    // A load takes at least as long as a sum, whatever else the machine does.
    assert!(measured.latency.slope_s > 0.2 * measured.chain.slope_s);
    for fit in [&measured.latency, &measured.chain, &measured.issue, &measured.bandwidth] {
        assert_eq!(fit.samples.len(), 3);
        assert!(fit.residual >= 0.0 && fit.residual.is_finite());
    }
    assert_eq!(measured.clock_from, Origin::Measured);
    assert_eq!(gpu.messages(), Vec::<String>::new());
}

#[test]
fn what_is_given_is_not_measured() {
    let Some(gpu) = gpu(&DeviceOptions::default()) else { return };
    let settings = Settings {
        // Rounded up, and never nothing.
        working_set_bytes: Some(0),
        repeats: 0,
        lengths: 0,
        clock_ghz: Some(2.5),
        cores: Some(7),
        residency: Some([3, 9]),
        ..Settings::default()
    };
    let measured = match measure(&gpu, &settings) {
        Ok(measured) => measured,
        Err(error @ MicrobenchError::NoSlope { .. }) => return println!("{error}"),
        Err(error) => panic!("{error}"),
    };
    let device = measured.device;
    assert_eq!((device.clock_ghz, device.cores), (2.5, 7));
    assert_eq!((device.max_blocks_per_core, device.max_warps_per_core), (3, 9));
    assert_eq!(
        [measured.clock_from, measured.cores_from, measured.residency_from],
        [Origin::Given; 3]
    );
    assert_eq!(measured.working_set_bytes, 1 << 16);
    // A clock that cannot be.
    let settings = Settings { clock_ghz: Some(f64::NAN), ..settings };
    match measure(&gpu, &settings) {
        Err(MicrobenchError::Device(error)) => assert!(error.to_string().contains("clock_ghz")),
        Err(MicrobenchError::NoSlope { .. }) => {}
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_device_without_timestamps_is_an_error() {
    let Some(gpu) = gpu(&DeviceOptions { timestamps: false, ..DeviceOptions::default() }) else {
        return;
    };
    let error = measure(&gpu, &Settings::default()).unwrap_err();
    assert!(matches!(error, MicrobenchError::NoTimestamps { .. }));
    assert!(error.to_string().contains(gpu.name()) && error.to_string().contains("by hand"));
}

#[test]
fn lines_through_times() {
    let exact = Fit::of("it", vec![(1.0, 5.0), (2.0, 7.0), (4.0, 11.0)]).unwrap();
    assert!((exact.slope_s - 2.0).abs() < 1e-12 && (exact.intercept_s - 3.0).abs() < 1e-12);
    assert!(exact.residual < 1e-12);
    // Off the line by 1, 1 and 1 around a mean of 10: slope 0 ± is no line, this one rises.
    let noisy = Fit::of("it", vec![(0.0, 9.0), (1.0, 11.0), (2.0, 9.5), (3.0, 12.5)]).unwrap();
    assert!(noisy.residual > 0.05 && noisy.residual < 0.2);
    for samples in [
        vec![],
        vec![(1.0, 1.0)],
        vec![(1.0, 1.0), (1.0, 2.0)],
        vec![(1.0, 2.0), (2.0, 1.0)],
        vec![(1.0, f64::INFINITY), (2.0, 1.0)],
        vec![(1.0, f64::NAN), (2.0, 1.0)],
    ] {
        let error = Fit::of("it", samples).unwrap_err();
        assert!(matches!(error, MicrobenchError::NoSlope { .. }), "{error}");
    }
}
