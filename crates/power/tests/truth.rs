//! What is recovered from recordings whose truth is known.

#![cfg(feature = "analysis")]

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

#[test]
fn by_sparse_marks_some_of_which_are_wrong() {
    let mut options = longer(13, MarkPolicy::Every(7));
    options.faults = FaultPlan { lost_marks: 9, false_marks: 12, ..FaultPlan::default() };
    let recording = Recording::new(&options).unwrap();
    assert_eq!(recording.truth().wrong_marks, (9, 12));
    let analysis = run(&recording, Some(&recording.log()), SyncMethod::Marker);
    let map = analysis.clock.unwrap();
    check_clock(&map, &options);
    let (starts, _) = boundaries(&analysis, &recording);
    assert!(starts <= 3.0, "{starts}");
    check_energy(&analysis, &recording);
}

#[test]
fn by_idle_time() {
    let mut options = longer(14, MarkPolicy::Never);
    options.states.clear();
    let recording = Recording::new(&options).unwrap();
    let analysis = run(&recording, Some(&recording.log()), SyncMethod::Idle);
    let map = analysis.clock.unwrap();
    assert_eq!(map.matched, 2);
    check_clock(&map, &options);
    let (starts, _) = boundaries(&analysis, &recording);
    println!("starts within {starts:.2} samples");
    assert!(starts <= 6.0, "{starts}");
    check_energy(&analysis, &recording);
}

#[test]
fn marks_alone_make_frames() {
    let options = longer(15, MarkPolicy::Every(1));
    let recording = Recording::new(&options).unwrap();
    let analysis = run(&recording, None, SyncMethod::Auto);
    assert_eq!(analysis.frames.len() + 1, recording.truth().frames.len());
    // Without a log nothing tells where one algorithm ends, so frames are compared one by one.
    for (found, truth) in analysis.frames.iter().zip(&recording.truth().frames).take(200) {
        let error = found.energy_j / truth.energy_j - 1.0;
        assert!(error.abs() < 0.01, "{}: {error}", found.frame);
    }
}

#[test]
fn every_fault_is_counted_and_does_little_harm() {
    let mut options = longer(16, MarkPolicy::Every(1));
    options.faults = FaultPlan { lost_marks: 5, false_marks: 5, ..FaultPlan::of_each(6) };
    let recording = Recording::new(&options).unwrap();
    let analysis = run(&recording, Some(&recording.log()), SyncMethod::Correlation);
    let truth = recording.truth();
    let found = |fault: Fault| analysis.quality.count(fault).count;
    let put_in = |fault: Fault| truth.faults[fault as usize];
    for fault in Fault::ALL {
        println!("{}: {} put in, {} found", fault.name(), put_in(fault), found(fault));
        if fault != Fault::Clipped {
            assert_eq!(found(fault), put_in(fault), "{fault:?}");
        }
    }
    // 40 rows of each stretch, all of them pushed beyond the range.
    assert_eq!(found(Fault::Clipped), 40 * put_in(Fault::Clipped));
    let rails: u64 = analysis.quality.rails.iter().map(|r| r.clipped).sum();
    assert_eq!(rails, found(Fault::Clipped));
    assert!(
        analysis.quality.flags.windows(2).all(|p| p[0].from_ns <= p[1].from_ns + 1_000_000_000)
    );

    // Without declared ranges, clipping is suspected where it was.
    let mut rails = recording.rails();
    rails.iter_mut().for_each(|rail| rail.range = None);
    let options = AnalysisOptions { rails: Some(rails), ..AnalysisOptions::default() };
    let blind = analyze(|| Ok(Box::new(recording.reader())), None, &options).unwrap();
    assert_eq!(blind.quality.count(Fault::Clipped).count, 0);
    for (rail, seen) in blind.quality.rails.iter().zip(&analysis.quality.rails) {
        assert_eq!(rail.suspected_run.is_some(), seen.clipped > 0, "{rail:?}");
        assert!(seen.suspected_run.is_none());
    }

    // Frames say which of their samples are not what was there; all others have their energy.
    let spoilt = |f: &&niwaki_power::FrameEnergy| f.is_incomplete || f.is_clipped;
    let holes = analysis.frames.iter().filter(|f| f.is_incomplete).count();
    assert!((6..=60).contains(&holes), "{holes}");
    assert!(
        analysis.frames.iter().any(|f| f.is_clipped)
            && analysis.frames.iter().any(|f| f.is_repaired)
    );
    assert!(analysis.frames.iter().filter(spoilt).count() < analysis.frames.len() / 10);
}
