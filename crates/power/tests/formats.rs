//! Files: round trips, and whatever bytes.

#![cfg(feature = "analysis")]

use niwaki_power::generator::{FaultPlan, MarkPolicy, Recording, RecordingOptions};
use niwaki_power::{
    AnalysisOptions, Block, FrameLog, PowerError, ReadOptions, TraceFormat, TraceInfo, TraceReader,
    TraceWriter, Unit, analyze, read_trace,
};
use proptest::prelude::*;
use std::io::Cursor;

fn write(recording: &Recording, format: TraceFormat) -> Vec<u8> {
    let mut writer = TraceWriter::new(Vec::new(), format, recording.info()).unwrap();
    let mut reader = recording.reader();
    while let Some(block) = reader.next_block().unwrap() {
        writer.write(&block).unwrap();
    }
    writer.finish().unwrap()
}

fn read(bytes: &[u8], options: &ReadOptions) -> Result<(TraceInfo, Block, u64), PowerError> {
    let mut reader = read_trace(Box::new(Cursor::new(bytes.to_vec())), options)?;
    let info = reader.info().clone();
    let mut all = Block::with_columns(info.columns.len());
    while let Some(block) = reader.next_block()? {
        assert!(!block.is_empty() && block.channels.iter().all(|c| c.len() == block.len()));
        all.append(&block);
    }
    Ok((info, all, reader.broken_lines()))
}

fn small() -> ReadOptions {
    ReadOptions { threads: 3, chunk_bytes: 4096 }
}

fn recording() -> Recording {
    let mut options = RecordingOptions::quick(5);
    options.marks = MarkPolicy::Every(1);
    options.faults = FaultPlan { not_numbers: 3, gaps: 2, ..FaultPlan::default() };
    Recording::new(&options).unwrap()
}

#[test]
fn every_format_holds_what_was_recorded() {
    let recording = recording();
    let mut truth = Block::with_columns(6);
    let mut reader = recording.reader();
    while let Some(block) = reader.next_block().unwrap() {
        truth.append(&block);
    }
    for (format, tolerance) in
        [(TraceFormat::Binary, 1e-6), (TraceFormat::Csv, 6e-6), (TraceFormat::PowerSensor3, 6e-4)]
    {
        let bytes = write(&recording, format);
        let (info, found, broken) = read(&bytes, &small()).unwrap();
        let (_, again, _) = read(&bytes, &ReadOptions::default()).unwrap();
        assert_eq!(format!("{found:?}"), format!("{again:?}"), "pieces make no difference");
        assert_eq!(broken, 0);
        assert_eq!(
            info.columns.iter().map(|c| c.unit).collect::<Vec<_>>(),
            [Unit::Amperes, Unit::Volts].repeat(3)
        );
        assert_eq!(found.times_ns, truth.times_ns, "{format:?}");
        assert_eq!(found.marks, truth.marks, "{format:?}");
        for (a, b) in found.channels.iter().zip(&truth.channels) {
            for (a, b) in a.iter().zip(b) {
                assert!((a - b).abs() <= tolerance || (a.is_nan() && b.is_nan()), "{a} {b}");
            }
        }
        if format != TraceFormat::PowerSensor3 {
            assert_eq!(info.rate_hz, Some(40e3));
        }
    }
}

#[test]
fn files_are_analysed_like_the_recording() {
    let recording = recording();
    let log = recording.log();
    for format in [TraceFormat::Binary, TraceFormat::Csv, TraceFormat::PowerSensor3] {
        let bytes = write(&recording, format);
        // Read twice, because nothing may be kept.
        let options = AnalysisOptions { keep_bytes: 0, ..AnalysisOptions::default() };
        let open = || read_trace(Box::new(Cursor::new(bytes.clone())), &small());
        let analysis = analyze(open, Some(&log), &options).unwrap();
        for (group, truth) in analysis.groups.iter().zip(&recording.truth().nj_per_pixel) {
            let error = group.energy.mean_nj_per_pixel / truth - 1.0;
            assert!(error.abs() < 0.005, "{format:?}: {error}");
        }
    }
}

#[test]
fn dumps_of_the_real_thing() {
    // As version 1.4 of the host library prints: six digits, ten bits of microseconds that wrap around,
    // separate lines for marks; a burst after which the host catches up; and 7 ms that are really lost.
    let mut text = String::from(
        "marker time dt_micro device_timestamp current0 voltage0 power0 power_total\n",
    );
    let mut device = 1000;
    let mut host = 200.0;
    let mut row = |text: &mut String, label: char, step: i64, host_us: i64| {
        device += step;
        host += host_us as f64 * 1e-6;
        *text += &format!("{label} {host:.3} {host_us} {} 2.5 12 30 30\n", device % 1024);
    };
    for i in 0..3000 {
        match i {
            1000 => row(&mut text, 'S', 50, 9050),
            1001..1181 => row(&mut text, 'S', 50, 0),
            2000 => {
                text += "M A\n";
                row(&mut text, 'S', 50, 50);
            }
            2500 => row(&mut text, 'B', 50, 50),
            2800 => row(&mut text, 'S', 7218, 7218),
            _ => row(&mut text, 'S', 50, 50),
        }
    }
    let (_, found, broken) = read(text.as_bytes(), &ReadOptions::default()).unwrap();
    assert_eq!((found.len(), broken), (3000, 0));
    let steps: Vec<_> = found.times_ns.windows(2).map(|p| p[1] - p[0]).collect();
    assert!(steps[..2798].iter().all(|s| *s == 50_000), "bursts are not gaps");
    assert!((steps[2799] - 7_218_000).abs() < 1_024_000, "{}", steps[2799]);
    let marks: Vec<_> = found.marks.iter().map(|m| (m.row, m.label as char)).collect();
    assert_eq!(marks, [(2000, 'A'), (2500, 'B')]);
    assert!(found.channels[0].iter().all(|x| *x == 2.5));
}

#[test]
fn csv_of_many_kinds() {
    let text = "time_us;GPU_w;note;mark\r\n0;100;x;\r\n10;nan;;S\r\n20;;y;1\r\n30;101,5;z;1\r\n\r\n40;+1e2;;0\r\n";
    let (info, found, broken) = read(text.as_bytes(), &small()).unwrap();
    assert_eq!((info.columns.len(), broken), (1, 0));
    assert_eq!(found.times_ns, [0, 10_000, 20_000, 30_000, 40_000]);
    assert_eq!(found.channels[0][0], 100.0);
    assert!(found.channels[0][1..4].iter().all(|x| x.is_nan()));
    assert_eq!(found.marks.len(), 1);
    let headers =
        ["", "a,b\n1,2\n", "time_s\n1\n", "time_s,x_w,time_ns\n", "gpu_w\n1\n", "\u{feff}\n"];
    for header in headers {
        assert!(
            matches!(read(header.as_bytes(), &small()), Err(PowerError::Header(_))),
            "{header:?}"
        );
    }
    // A few broken lines are counted, many are refused with the number of the first.
    let mut text = String::from("time_s,gpu_w\n");
    for i in 0..2000 {
        text += &if i % 500 == 3 { "rubbish\n".into() } else { format!("{}.5,{i}\n", i) };
    }
    assert_eq!(read(text.as_bytes(), &small()).unwrap().2, 4);
    let bad = "time_s,gpu_w\n".to_owned() + &"1;2\n".repeat(100);
    let error = read(bad.as_bytes(), &small()).unwrap_err();
    assert!(matches!(error, PowerError::Lines { first: 2, .. }), "{error}");
}

#[test]
fn a_recording_that_was_cut_off_is_read_to_there() {
    let recording = recording();
    for format in [TraceFormat::Binary, TraceFormat::Csv, TraceFormat::PowerSensor3] {
        let bytes = write(&recording, format);
        let (_, whole, _) = read(&bytes, &small()).unwrap();
        let (_, part, broken) = read(&bytes[..bytes.len() * 2 / 3], &small()).unwrap();
        assert!(part.len() > whole.len() / 2 && part.len() < whole.len(), "{format:?}");
        assert!(broken <= 1);
        assert_eq!(part.times_ns[..100], whole.times_ns[..100]);
    }
    let mut damaged = write(&recording, TraceFormat::Binary);
    let middle = damaged.len() / 2;
    damaged[middle] ^= 0x10;
    assert!(matches!(read(&damaged, &small()), Err(PowerError::Damaged { .. })));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn whatever_the_bytes_there_is_an_answer(
        which in 0usize..4,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..40),
        cut in any::<prop::sample::Index>(),
    ) {
        let mut options = RecordingOptions::quick(2);
        options.animations.truncate(1);
        options.animations[0].frames = 2;
        options.margin_s = 0.005;
        let recording = Recording::new(&options).unwrap();
        let mut bytes = match which {
            0 => write(&recording, TraceFormat::Binary),
            1 => write(&recording, TraceFormat::Csv),
            2 => write(&recording, TraceFormat::PowerSensor3),
            _ => { let mut log = Vec::new(); recording.log().write_csv(&mut log).unwrap(); log }
        };
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        bytes.truncate(cut.index(bytes.len()) + 1);
        let _ = FrameLog::read(&bytes[..]);
        if let Ok((info, ..)) = read(&bytes, &small()) {
            let rails = niwaki_power::rails_by_name(&info.columns, &[], true);
            let options = AnalysisOptions { rails: rails.ok(), size: Some((64, 64)), ..AnalysisOptions::default() };
            let open = || read_trace(Box::new(Cursor::new(bytes.clone())), &small());
            if let Ok(analysis) = analyze(open, None, &options) {
                prop_assert!(analysis.total_j.is_finite());
            }
        }
    }
}

#[test]
fn frame_logs_hold_what_was_written() {
    let log = recording().log();
    let (mut json, mut csv) = (Vec::new(), Vec::new());
    log.write_json_lines(&mut json).unwrap();
    log.write_csv(&mut csv).unwrap();
    assert_eq!(FrameLog::read(&json[..]).unwrap(), log);
    assert_eq!(FrameLog::read(&csv[..]).unwrap(), log);
    for (bad, line) in [
        ("{\"niwaki_frame_log\":2}\n", 1),
        ("{\"niwaki_frame_log\":1}\n{\"frame\":0,\"start_ns\":5,\"end_ns\":4}\n", 2),
        ("start_ns,end_ns\n5,6\n4,6\n", 3),
        ("start_ns,end_ns\n5,x\n", 2),
        ("frame,end_ns\n0,1\n", 1),
    ] {
        match FrameLog::read(bad.as_bytes()) {
            Err(PowerError::Log { line: found, .. }) => assert_eq!(found, line, "{bad}"),
            other => panic!("{bad}: {other:?}"),
        }
    }
}
