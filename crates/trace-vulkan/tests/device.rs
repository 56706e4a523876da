//! Memory, dispatches, time and errors of a device.

mod common;

use common::{assert_silent, device, device_with};
use niwaki_shaders::{Library, Options};
use niwaki_trace_vulkan::{Device, DeviceOptions, GpuError, Kernel};
use std::time::Duration;

/// Adds a constant to words, in order of invocations.
const ADD: &str = "
override amount: u32 = 1;
var<immediate> count: u32;
@group(0) @binding(0) var<storage, read> from_words: array<u32>;
@group(0) @binding(1) var<storage, read_write> to_words: array<u32>;
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = id.y * groups.x * 64 + id.x;
    if i < count { to_words[i] = from_words[i] + amount; }
}
";

fn kernel(device: &Device, amount: f64) -> Kernel {
    let mut library = Library::default();
    library.insert("add", ADD);
    let options = Options { constants: &[("amount", amount)], ..Options::default() };
    device.kernel_of(&library.compile("add", "main", &options).unwrap()).unwrap()
}

#[test]
fn what_is_written_is_read() {
    let Some(device) = device() else { return };
    // More than a piece of a copy.
    let words: Vec<u32> = (0..10_000_000).collect();
    let buffer = device.upload(&words).unwrap();
    assert_eq!(buffer.read::<u32>().unwrap(), words);
    let part = buffer.view(400, 440).unwrap();
    assert_eq!(part.read::<u32>().unwrap(), words[100..110]);
    part.write(4, &[7_u32, 8]).unwrap();
    assert_eq!(buffer.view(400, 416).unwrap().read::<u32>().unwrap(), [100, 7, 8, 103]);
    assert!(matches!(buffer.view(4, 40_000_004), Err(GpuError::OutOfRange { .. })));
    assert!(matches!(part.write(36, &[0_u64]), Err(GpuError::OutOfRange { .. })));
    let none = device.upload::<u32>(&[]).unwrap();
    assert_eq!((none.size(), none.read::<u32>().unwrap()), (0, vec![]));
    assert_silent(&device);
}

#[test]
fn commands_see_what_those_before_wrote() {
    let Some(device) = device() else { return };
    let (one, ten) = (kernel(&device, 1.0), kernel(&device, 10.0));
    let count = 1_000_u32;
    let [a, b, c] = [0; 3].map(|_| device.buffer(4 * u64::from(count)).unwrap());
    let groups = device.info().groups_for(u64::from(count), 64);
    let indirect = device.upload(&[0, groups[0], 1, 1]).unwrap();
    let mut batch = device.batch().unwrap();
    batch.fill(&a, 5).mark("begin").unwrap();
    for _ in 0..50 {
        batch.dispatch(&one, &[&a, &b], &count, groups).unwrap();
        batch.dispatch_indirect(&ten, &[&b, &a], &count, (&indirect, 4)).unwrap();
    }
    batch.mark("adding").unwrap().copy(&a, &c).unwrap();
    batch.dispatch(&one, &[&a, &c], &count, [0, 1, 1]).unwrap();
    let timings = batch.submit().unwrap();
    assert_eq!(c.read::<u32>().unwrap(), vec![5 + 50 * 11; count as usize]);
    if device.info().timestamp_ns > 0.0 {
        let passes: Vec<_> = timings.passes().collect();
        assert_eq!(passes.len(), 1);
        assert!(passes[0].0 == "adding" && passes[0].1 > 0.0);
        assert_eq!(timings.total(), Some(passes[0].1));
    }
    assert_silent(&device);
}

#[test]
fn a_missing_barrier_is_reported() {
    let Some(device) = device() else { return };
    if !device.is_validated() {
        println!("skipped: no validation layer");
        return;
    }
    let one = kernel(&device, 1.0);
    let [a, b] = [0; 2].map(|_| device.buffer(400).unwrap());
    let mut batch = device.batch().unwrap();
    batch.fill(&a, 5);
    // The dispatch does need what is filled.
    batch.overlap().dispatch(&one, &[&a, &b], &100_u32, [2, 1, 1]).unwrap();
    batch.submit().unwrap();
    let messages = device.messages();
    assert!(messages.iter().any(|m| m.contains("SYNC-HAZARD")), "{messages:?}");
}

#[test]
fn rows_of_workgroups_hold_all_items() {
    let Some(device) = device() else { return };
    let info = device.info();
    for items in [0, 1, 64, 65, 1 << 22, 1 << 26, 1 << 33] {
        let [x, y, z] = info.groups_for(items, 64);
        assert!(u64::from(x) * u64::from(y) * 64 >= items && z == 1);
        assert!(x >= 1 && x <= info.max_groups[0]);
    }
}

#[test]
fn wrong_use_is_an_error_with_a_remedy() {
    let Some(device) = device() else { return };
    let one = kernel(&device, 1.0);
    let [a, b] = [0; 2].map(|_| device.buffer(400).unwrap());
    let mut batch = device.batch().unwrap();
    let few = batch.dispatch(&one, &[&a], &100_u32, [2, 1, 1]);
    assert!(matches!(few, Err(GpuError::Mismatch { .. })));
    let long = batch.dispatch(&one, &[&a, &b], &100_u64, [2, 1, 1]);
    assert!(matches!(long, Err(GpuError::Mismatch { .. })));
    let limit = device.info().max_groups[1];
    if let Some(many) = limit.checked_add(1) {
        let error = batch.dispatch(&one, &[&a, &b], &100_u32, [1, many, 1]).unwrap_err();
        assert!(matches!(error, GpuError::TooLarge { limit: l, .. } if l == u64::from(limit)));
        assert!(error.to_string().contains("several dispatches"));
    }
    let huge = device.buffer(u64::MAX / 2).unwrap_err();
    assert!(matches!(huge, GpuError::TooLarge { .. } | GpuError::OutOfMemory { .. }), "{huge}");
    let options =
        DeviceOptions { device: Some("no such thing".into()), ..DeviceOptions::default() };
    let error = Device::open(&options).unwrap_err().to_string();
    assert!(error.contains("no such thing") && error.contains(device.name()), "{error}");
    assert_silent(&device);
}

#[test]
fn a_binding_above_the_limit_is_reported() {
    let options = DeviceOptions { max_binding_bytes: Some(4096), ..DeviceOptions::checked() };
    let Some(device) = device_with(&options) else { return };
    let one = kernel(&device, 1.0);
    let [a, b] = [0; 2].map(|_| device.buffer(8192).unwrap());
    let mut batch = device.batch().unwrap();
    let error = batch.dispatch(&one, &[&a, &b], &100_u32, [2, 1, 1]).unwrap_err();
    assert!(
        matches!(error, GpuError::TooLarge { wanted: 8192, limit: 4096, .. }),
        "unexpected: {error}"
    );
    let [a, b] = [a, b].map(|buffer| buffer.view(4096, 8192).unwrap());
    batch.dispatch(&one, &[&a, &b], &100_u32, [2, 1, 1]).unwrap();
    batch.submit().unwrap();
    assert_silent(&device);
}

#[test]
fn a_device_that_does_not_answer_is_lost() {
    // The loop takes seconds, not forever: the driver's threads have to end before the process
    // does.
    let options = DeviceOptions { timeout: Duration::from_millis(1), ..DeviceOptions::default() };
    let Some(device) = device_with(&options) else { return };
    let one = kernel(&device, 1.0);
    let count = 1_u32 << 20;
    let size = 4 * u64::from(count);
    let Ok(a) = device.buffer(size) else { return };
    let Ok(b) = device.buffer(size) else { return };
    let mut batch = device.batch().unwrap();
    for _ in 0..500 {
        let groups = device.info().groups_for(u64::from(count), 64);
        batch.dispatch(&one, &[&a, &b], &count, groups).unwrap();
    }
    let error = batch.submit().unwrap_err();
    assert!(matches!(error, GpuError::DeviceLost { .. }), "{error}");
    assert!(device.is_lost());
    assert!(matches!(device.buffer(16), Err(GpuError::DeviceLost { .. })));
    assert!(matches!(a.read::<u32>(), Err(GpuError::DeviceLost { .. })));
    assert!(matches!(device.batch(), Err(GpuError::DeviceLost { .. })));
    // Dropping everything now must do no harm.
}

#[test]
fn a_device_may_be_used_without_its_timestamps() {
    let options = DeviceOptions { timestamps: false, ..DeviceOptions::checked() };
    let Some(device) = device_with(&options) else { return };
    let mut batch = device.batch().unwrap();
    batch.mark("begin").unwrap();
    batch.mark("end").unwrap();
    assert_eq!(batch.submit().unwrap().total(), None);
    assert_silent(&device);
}

#[test]
fn statistics_are_told_or_missed_by_name() {
    let Some(device) = device() else { return };
    let error = kernel(&device, 1.0).statistics().unwrap_err().to_string();
    assert!(error.contains("DeviceOptions::statistics"), "{error}");
    let options = DeviceOptions { statistics: true, ..DeviceOptions::checked() };
    let Some(device) = device_with(&options) else { return };
    match kernel(&device, 1.0).statistics() {
        Ok(statistics) => {
            assert!(device.info().has_statistics);
            assert!(statistics.iter().all(|one| !one.name.is_empty()), "{statistics:?}");
        }
        Err(error) => {
            assert!(!device.info().has_statistics && matches!(error, GpuError::NotOffered { .. }));
        }
    }
    assert_silent(&device);
}
