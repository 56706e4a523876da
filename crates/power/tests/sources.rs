//! Meters, and sensors that are slow.

#![cfg(feature = "analysis")]

use niwaki_power::{
    AnalysisOptions, Block, Clock, Column, FrameLog, FrameLogHeader, FrameRecord, JoinedMeter,
    Meter, PowerError, RaplMeter, Recorder, RecorderOptions, Segmentation, SensorNote, SyncMethod,
    TraceInfo, TraceReader, Unit, analyze,
};
use std::fs;
use std::path::PathBuf;

struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("niwaki-power-{name}-{}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        Self(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn zone(folder: &Folder, name: &str, title: &str, range: u64, energy: u64) {
    let zone = folder.0.join(name);
    fs::create_dir_all(&zone).unwrap();
    fs::write(zone.join("name"), format!("{title}\n")).unwrap();
    fs::write(zone.join("max_energy_range_uj"), format!("{range}\n")).unwrap();
    fs::write(zone.join("energy_uj"), format!("{energy}\n")).unwrap();
}

#[test]
fn counters_wrap_around() {
    let folder = Folder::new("rapl");
    zone(&folder, "intel-rapl:0", "package-0", 1_000_000, 900_000);
    zone(&folder, "intel-rapl:0:0", "core", 1_000_000, 10);
    zone(&folder, "intel-rapl-mmio:0", "package-0", 1_000_000, 0);
    let mut meter = RaplMeter::open_at(&folder.0).unwrap();
    let info = meter.info();
    let names: Vec<_> = info.columns.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["package-0_j", "core_sub_j"]);
    // Parts are not counted beside the whole.
    let rails = niwaki_power::rails_by_name(&info.columns, &[], true).unwrap();
    assert_eq!(rails.len(), 1);
    let mut values = [f64::NAN; 2];
    for (counter, joules) in [(900_000, 0.0), (950_000, 0.05), (20_000, 0.12), (999_999, 1.099_999)]
    {
        zone(&folder, "intel-rapl:0", "package-0", 1_000_000, counter);
        meter.read(&mut values).unwrap();
        assert!((values[0] - joules).abs() < 1e-9, "{counter}: {}", values[0]);
    }
    let empty = Folder::new("none");
    for path in [empty.0.join("missing"), empty.0.clone()] {
        assert!(matches!(RaplMeter::open_at(&path), Err(PowerError::Meter { .. })));
    }
}

struct Counting(u32);

impl Meter for Counting {
    fn info(&self) -> TraceInfo {
        TraceInfo { columns: vec![Column::new("a_w", Unit::Watts)], ..TraceInfo::default() }
    }

    fn read(&mut self, values: &mut [f64]) -> Result<(), PowerError> {
        self.0 += 1;
        values[0] = f64::from(self.0);
        if self.0 > 50 {
            return Err(PowerError::Meter { meter: "test".into(), reason: "unplugged".into() });
        }
        Ok(())
    }
}

#[test]
fn a_recorder_hands_on_every_reading_and_the_error() {
    let meters: Vec<Box<dyn Meter>> = vec![Box::new(Counting(0)), Box::new(Counting(0))];
    let options = RecorderOptions { rate_hz: 2000.0, block_s: 0.01 };
    let mut recorder = Recorder::start(JoinedMeter(meters), &options).unwrap();
    assert_eq!(recorder.info().columns.len(), 2);
    recorder.mark(b'M');
    let mut all = Block::with_columns(2);
    let error = loop {
        match recorder.next_block() {
            Ok(Some(block)) => all.append(&block),
            Ok(None) => panic!("the meter's error is lost"),
            Err(error) => break error,
        }
    };
    assert!(error.to_string().contains("unplugged"));
    // The first reading only tries whether the meter answers.
    assert_eq!(all.channels[0], (2..=50).map(f64::from).collect::<Vec<_>>());
    assert_eq!(all.channels[0], all.channels[1]);
    assert!(all.times_ns.windows(2).all(|p| p[0] < p[1]));
    assert_eq!(all.marks.len(), 1);
    assert!(Recorder::start(Counting(0), &RecorderOptions { rate_hz: 0.0, ..options }).is_err());
}

/// A counter of energy as NVML shows it: asked a thousand times a second, refreshed every 50 ms.
struct Slow {
    info: TraceInfo,
    row: i64,
}

const START: i64 = 5_000_000_000;

fn watts(second: f64) -> f64 {
    if (1.0..9.0).contains(&second) { 250.0 } else { 40.0 }
}

impl TraceReader for Slow {
    fn info(&self) -> &TraceInfo {
        &self.info
    }

    fn next_block(&mut self) -> Result<Option<Block>, PowerError> {
        let mut block = Block::with_columns(1);
        while self.row < 10_000 && block.len() < 700 {
            let refreshed = self.row / 50 * 50;
            let joules: f64 = (0..refreshed).map(|i| watts(i as f64 * 1e-3) * 1e-3).sum();
            block.times_ns.push(START + self.row * 1_000_000);
            block.channels[0].push(joules);
            self.row += 1;
        }
        Ok(if block.is_empty() { None } else { Some(block) })
    }
}

/// The log of frames of a million pixels, back to back.
fn frames_of(count: u64, first_ns: i64, length_ns: i64) -> FrameLog {
    let frames = (0..count).map(|frame| FrameRecord {
        frame,
        start_ns: first_ns + length_ns * frame as i64,
        end_ns: first_ns + length_ns * (frame as i64 + 1),
        algorithm: "FR".into(),
        width: 1000,
        height: 1000,
        ..FrameRecord::default()
    });
    FrameLog {
        header: FrameLogHeader { clock: Clock::Monotonic, ..FrameLogHeader::default() },
        frames: frames.collect(),
    }
}

#[test]
fn a_slow_sensor_is_named_and_measured_in_windows() {
    let info = TraceInfo {
        columns: vec![Column::new("gpu0_j", Unit::Joules)],
        clock: Clock::Monotonic,
        sensor: SensorNote {
            coverage: Some(0.25),
            source: "a paper".into(),
            ..SensorNote::default()
        },
        ..TraceInfo::default()
    };
    // 16 ms a frame, back to back, from 1 s to 9 s.
    let log = frames_of(500, START + 1_000_000_000, 16_000_000);
    let open = || Ok(Box::new(Slow { info: info.clone(), row: 0 }) as Box<dyn TraceReader>);
    let analysis = analyze(open, Some(&log), &AnalysisOptions::default()).unwrap();
    assert_eq!(analysis.clock.unwrap().method, SyncMethod::SharedClock);
    assert_eq!(analysis.segmentation, Segmentation::LogWindows);
    assert!(analysis.sensor.is_too_slow);
    assert!((analysis.sensor.refresh_s - 0.05).abs() < 2e-3, "{:?}", analysis.sensor);
    assert!(analysis.sensor.words.contains("windows") && analysis.sensor.words.contains("25 %"));
    assert!(analysis.signatures.is_empty() && analysis.waveforms.is_empty());
    // 250 W for 16 ms a frame of a million pixels.
    let group = &analysis.groups[0];
    assert_eq!(group.frames, 500);
    let error = group.energy.mean_nj_per_pixel / 4000.0 - 1.0;
    assert!(error.abs() < 0.01, "{error} {group:?}");
}

/// A meter of a steady 80 W whose single readings, one every 2 ms, are off by up to 70 W.
struct Noisy {
    info: TraceInfo,
    row: i64,
}

impl TraceReader for Noisy {
    fn info(&self) -> &TraceInfo {
        &self.info
    }

    fn next_block(&mut self) -> Result<Option<Block>, PowerError> {
        let mut block = Block::with_columns(1);
        while self.row < 1_200 && block.len() < 500 {
            // Some digits of a multiplicative hash.
            let row = u32::try_from(self.row).unwrap();
            let hash = row.wrapping_mul(2_654_435_761) >> 16;
            block.times_ns.push(START + self.row * 2_000_000);
            block.channels[0].push(80.0 + 140.0 * (f64::from(hash) / 65_536.0 - 0.5));
            self.row += 1;
        }
        Ok(if block.is_empty() { None } else { Some(block) })
    }
}

/// Frames of 20 ms, back to back, from 0.2 s on.
fn course(frames: u64) -> Vec<Vec<f64>> {
    let info = TraceInfo {
        columns: vec![Column::new("gpu0_w", Unit::Watts)],
        clock: Clock::Monotonic,
        ..TraceInfo::default()
    };
    let log = frames_of(frames, START + 200_000_000, 20_000_000);
    let open = || Ok(Box::new(Noisy { info: info.clone(), row: 0 }) as Box<dyn TraceReader>);
    let analysis = analyze(open, Some(&log), &AnalysisOptions::default()).unwrap();
    assert_eq!(analysis.segmentation, Segmentation::Log);
    analysis.signatures.into_iter().map(|s| s.mean_w).collect()
}

#[test]
fn the_course_within_a_frame_has_no_more_parts_than_readings_tell() {
    // Ten readings a frame: eight parts, of 125 readings each.
    let many = course(100);
    assert_eq!(many.len(), 1);
    assert_eq!(many[0].len(), 8);
    assert!(many[0].iter().all(|w| (w - 80.0).abs() < 25.0), "{many:?}");
    // Ten readings a frame in five frames: too few to say what is noise.
    assert!(course(5).is_empty());
}
