//! What is recovered from recordings whose truth is known.

use niwaki_power::generator::{FaultPlan, MarkPolicy, Recording, RecordingOptions};
use niwaki_power::{Analysis, AnalysisOptions, ClockMap, Fault, FrameLog, SyncMethod, analyze};

const SAMPLE_NS: f64 = 25_000.0;

fn run(recording: &Recording, log: Option<&FrameLog>, sync: SyncMethod) -> Analysis {
    let options = AnalysisOptions {
        rails: Some(recording.rails()),
        sync,
        size: Some((2560, 1440)),
        ..AnalysisOptions::default()
    };
    analyze(|| Ok(Box::new(recording.reader())), log, &options).unwrap()
}

/// Largest distances of starts and of ends of work from the truth, in samples.
fn boundaries(analysis: &Analysis, recording: &Recording) -> (f64, f64) {
    let truth = &recording.truth().frames;
    assert_eq!(analysis.frames.len(), truth.len());
    analysis.frames.iter().zip(truth).fold((0.0, 0.0), |(starts, ends): (f64, f64), (found, t)| {
        let busy_end = found.start_ns + 1e9 * found.busy_s;
        (
            starts.max((found.start_ns - t.start_ns).abs() / SAMPLE_NS),
            ends.max((busy_end - t.busy_end_ns).abs() / SAMPLE_NS),
        )
    })
}

fn check_energy(analysis: &Analysis, recording: &Recording) {
    for (group, truth) in analysis.groups.iter().zip(&recording.truth().nj_per_pixel) {
        let error = group.energy.mean_nj_per_pixel / truth - 1.0;
        println!(
            "{} {}: {:.2} nJ/pixel, {:+.4} %",
            group.algorithm,
            group.lights,
            truth,
            100.0 * error
        );
        assert!(error.abs() < 0.005, "{} {}: {error}", group.algorithm, group.lights);
        assert_eq!(group.incomplete, 0);
    }
}

fn longer(seed: u64, marks: MarkPolicy) -> RecordingOptions {
    let mut options = RecordingOptions::paper(seed, 240);
    options.marks = marks;
    options
}

fn check_clock(map: &ClockMap, options: &RecordingOptions) {
    println!("{map:?}");
    assert!((map.drift_ppm - options.drift_ppm).abs() < 5.0, "{map:?}");
    assert!((map.drift_ppm - options.drift_ppm).abs() < 5.0 * map.drift_error_ppm, "{map:?}");
}

#[test]
fn by_marker() {
    let options = longer(11, MarkPolicy::Every(1));
    let recording = Recording::new(&options).unwrap();
    let analysis = run(&recording, Some(&recording.log()), SyncMethod::Marker);
    let (starts, _) = boundaries(&analysis, &recording);
    println!("starts within {starts:.2} samples");
    assert!(starts <= 1.0, "{starts}");
    check_energy(&analysis, &recording);
    check_clock(&analysis.clock.unwrap(), &options);
}

#[test]
fn by_correlation() {
    let options = longer(12, MarkPolicy::Never);
    let recording = Recording::new(&options).unwrap();
    let analysis = run(&recording, Some(&recording.log()), SyncMethod::Auto);
    let map = analysis.clock.unwrap();
    assert_eq!(map.method, SyncMethod::Correlation);
    let (starts, ends) = boundaries(&analysis, &recording);
    println!("starts within {starts:.2}, ends within {ends:.2} samples");
    assert!(starts <= 3.0 && ends <= 3.0, "{starts} {ends}");
    check_energy(&analysis, &recording);
    check_clock(&map, &options);
    assert!(!map.is_ambiguous(), "{map:?}");
}
