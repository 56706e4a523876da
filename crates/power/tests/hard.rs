//! Traces that hold little, nothing, or nonsense.

#![cfg(feature = "analysis")]

use niwaki_power::generator::{Animation, Recording, RecordingOptions};
use niwaki_power::{
    AnalysisOptions, Block, Column, Fault, FrameLog, IdlePolicy, PowerError, RowMark, SyncMethod,
    TraceInfo, TraceReader, Unit, analyze,
};
use proptest::prelude::*;

struct Rows {
    info: TraceInfo,
    blocks: Vec<Block>,
}

impl TraceReader for Rows {
    fn info(&self) -> &TraceInfo {
        &self.info
    }

    fn next_block(&mut self) -> Result<Option<Block>, PowerError> {
        Ok(self.blocks.pop())
    }
}

/// Rows of one column, in blocks of this length.
fn rows(times: &[i64], watts: &[f64], block: usize) -> Rows {
    let parts = times.chunks(block).zip(watts.chunks(block));
    let mut blocks: Vec<_> = parts
        .map(|(t, w)| Block { times_ns: t.to_vec(), channels: vec![w.to_vec()], marks: Vec::new() })
        .collect();
    blocks.reverse();
    let columns = vec![Column::new("x_w", Unit::Watts)];
    Rows { info: TraceInfo { columns, ..TraceInfo::default() }, blocks }
}

fn run(times: &[i64], watts: &[f64], block: usize) -> Result<niwaki_power::Analysis, PowerError> {
    let open = || Ok(Box::new(rows(times, watts, block)) as Box<dyn TraceReader>);
    analyze(open, None, &AnalysisOptions::default())
}

fn even(n: usize) -> Vec<i64> {
    (0..n as i64).map(|i| i * 25_000).collect()
}

#[test]
fn little_and_nothing() {
    assert!(matches!(run(&[], &[], 8), Err(PowerError::Empty)));
    assert!(matches!(run(&even(100), &[f64::NAN; 100], 8), Err(PowerError::Empty)));
    for n in [1, 2, 3, 63, 64, 65] {
        let analysis = run(&even(n), &vec![80.0; n], 7).unwrap();
        assert!((analysis.total_j - 80.0 * (n - 1) as f64 * 25e-6).abs() < 1e-9, "{n}");
    }
    // All rows at one time.
    let analysis = run(&[5; 100], &[80.0; 100], 8).unwrap();
    assert_eq!(analysis.quality.count(Fault::Duplicate).count, 99);
    assert_eq!(analysis.total_j, 0.0);
}

#[test]
fn energy_is_exact_for_lines_and_never_made_up() {
    let times = even(10_000);
    let ramp: Vec<_> = (0..10_000).map(f64::from).collect();
    let analysis = run(&times, &ramp, 777).unwrap();
    let truth = 0.5 * 9999.0 * (9999.0 * 25e-6);
    assert!((analysis.total_j / truth - 1.0).abs() < 1e-6);
    // 100 ms in the middle are missing: their energy is, too.
    let kept: Vec<_> = (0..10_000).filter(|i| !(3000..7000).contains(i)).collect();
    let times: Vec<_> = kept.iter().map(|&i| times[i]).collect();
    let analysis = run(&times, &vec![100.0; times.len()], 777).unwrap();
    assert_eq!(analysis.quality.count(Fault::Hole).count, 1);
    assert!(
        (analysis.measured_s - (2999.0 + 2999.0) * 25e-6).abs() < 1e-9,
        "{}",
        analysis.measured_s
    );
    assert!((analysis.total_j - 100.0 * analysis.measured_s).abs() < 1e-9);
}

#[test]
fn a_log_that_does_not_belong_to_the_trace_is_refused() {
    let recording = Recording::new(&RecordingOptions::quick(1)).unwrap();
    // The same power all the time.
    let reader = || {
        let times = even(100_000);
        let mut random = fastrand::Rng::with_seed(1);
        let watts: Vec<_> = times.iter().map(|_| 100.0 + random.f64()).collect();
        Ok(Box::new(rows(&times, &watts, 4096)) as Box<dyn TraceReader>)
    };
    for sync in [
        SyncMethod::Auto,
        SyncMethod::Marker,
        SyncMethod::Correlation,
        SyncMethod::Idle,
        SyncMethod::SharedClock,
    ] {
        let options = AnalysisOptions { sync, ..AnalysisOptions::default() };
        let found = analyze(reader, Some(&recording.log()), &options);
        assert!(matches!(found, Err(PowerError::NoSync(_))), "{sync:?}");
    }
    // Another recording's frames.
    let mut other = RecordingOptions::quick(77);
    other.animations = vec![Animation::z_prepass(200)];
    let other = Recording::new(&other).unwrap();
    let open = || Ok(Box::new(recording.reader()) as Box<dyn TraceReader>);
    let options = AnalysisOptions {
        sync: SyncMethod::Correlation,
        rails: Some(recording.rails()),
        ..AnalysisOptions::default()
    };
    if let Ok(analysis) = analyze(open, Some(&other.log()), &options) {
        let clock = analysis.clock.unwrap();
        assert!(clock.similarity.unwrap() < 0.8, "{clock:?}");
    }
    assert!(analyze(open, Some(&FrameLog::default()), &options).is_err());
}

#[test]
fn idle_is_subtracted_by_the_policy_that_is_asked_for() {
    let options = RecordingOptions::quick(3);
    let recording = Recording::new(&options).unwrap();
    let run = |idle| {
        let settings =
            AnalysisOptions { idle, rails: Some(recording.rails()), ..AnalysisOptions::default() };
        let open = || Ok(Box::new(recording.reader()) as Box<dyn TraceReader>);
        analyze(open, Some(&recording.log()), &settings).unwrap()
    };
    let keep = run(IdlePolicy::Keep);
    for policy in [IdlePolicy::Watts(45.0), IdlePolicy::Outside, IdlePolicy::Lowest] {
        let less = run(policy);
        assert!((less.idle.watts - options.idle_w).abs() < 0.5, "{:?}", less.idle);
        for (a, b) in keep.groups.iter().zip(&less.groups) {
            let expected = a.energy_j.mean - less.idle.watts * a.time_s.mean;
            assert!((b.energy_j.mean / expected - 1.0).abs() < 1e-9);
        }
    }
}

#[test]
fn states_and_delays_are_found() {
    let mut options = RecordingOptions::quick(4);
    options.animations = vec![Animation::shadow_maps(200, 4)];
    options.states = vec![(80, 1.3)];
    options.delays = vec![(140, 9e-3)];
    let recording = Recording::new(&options).unwrap();
    let open = || Ok(Box::new(recording.reader()) as Box<dyn TraceReader>);
    let settings = AnalysisOptions { rails: Some(recording.rails()), ..AnalysisOptions::default() };
    let analysis = analyze(open, Some(&recording.log()), &settings).unwrap();
    let states: Vec<_> = analysis.states.iter().map(|s| s.frame).collect();
    assert_eq!(states, [80], "{:?}", analysis.states);
    let spikes: Vec<_> = analysis.spikes.iter().map(|s| s.frame).collect();
    assert_eq!(spikes, [140]);
    // The paper's reading of its figure 3: more idle time, the same power.
    let spike = analysis.spikes[0];
    assert!(spike.idle_share > 0.95 && (spike.busy_ratio - 1.0).abs() < 0.03, "{spike:?}");
    assert_eq!(analysis.delays[0].frames_s.len(), 8);
    // Four lights, each with an idle stretch of 12 parts of 4.58.
    let inside = analysis.gaps.iter().filter(|g| g.place == niwaki_power::GapPlace::Inside).count();
    assert!((780..=820).contains(&inside), "{inside}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn whatever_the_rows_energy_is_finite(
        steps in prop::collection::vec(prop_oneof![
            20 => Just(25_000i64), 2 => 20_000i64..30_000, 1 => any::<i64>(), 1 => Just(0), 1 => -100_000i64..100_000,
        ], 1..600),
        values in prop::collection::vec(prop_oneof![
            20 => 0.0f64..400.0, 1 => Just(f64::NAN), 1 => Just(f64::INFINITY), 1 => -1e30f64..1e30,
        ], 600),
        marks in prop::collection::vec(0usize..600, 0..5),
        block in 1usize..200,
    ) {
        let times: Vec<_> = steps
            .iter()
            .scan(0i64, |t, s| { *t = t.wrapping_add(*s) / 2 * 2; Some(*t / 4) })
            .collect();
        let mut source = rows(&times, &values[..times.len()], block);
        for mark in marks {
            let last = source.blocks.len() - 1;
            if let Some(b) = source.blocks.get_mut(last - (mark / block).min(last)) {
                let row = mark % block;
                if row < b.len() && b.marks.is_empty() {
                    b.marks.push(RowMark { row, label: b'x' });
                }
            }
        }
        let mut once = Some(source);
        let open = || Ok(Box::new(once.take().unwrap()) as Box<dyn TraceReader>);
        match analyze(open, None, &AnalysisOptions::default()) {
            Ok(analysis) => {
                prop_assert!(analysis.total_j.is_finite());
                prop_assert!(analysis.measured_s >= 0.0);
            }
            Err(error) => prop_assert!(matches!(error, PowerError::Empty), "{}", error),
        }
    }
}
