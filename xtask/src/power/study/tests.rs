//! The whole chain on the device that there is, with counters and a trace whose power is known.

use super::rows::mean;
use super::*;
use crate::cli::{Cli, Command as Xtask};
use crate::power::args::PowerCommand;
use crate::power::simulated::{Folder, Ticker, WATTS, counter};
use crate::testing::is_there;
use clap::Parser;
use niwaki_power::now_ns;
use std::io::Write as _;

fn parse(more: &[&str]) -> Result<StudyArgs, String> {
    let all = [&["xtask", "power", "study", "--quick"], more].concat();
    let cli = Cli::try_parse_from(all).map_err(|error| error.to_string())?;
    match cli.command {
        Xtask::Power(power) => match power.command {
            PowerCommand::Study(args) => Ok(args),
            _ => panic!("not a study"),
        },
        _ => panic!("not power"),
    }
}

fn has_device() -> bool {
    is_there(Gpu::new())
}

fn json(out: &Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(out.join("study.json")).unwrap()).unwrap()
}

#[test]
fn without_a_meter_there_are_times_and_the_report_says_so() {
    if !has_device() {
        return;
    }
    let folder = Folder::new("times");
    let out = folder.0.join("out");
    let args =
        parse(&["--source", "none", "--repeats", "2", "--out", out.to_str().unwrap()]).unwrap();
    let study = measure_all(&args).unwrap();
    assert!(study.failures.is_empty(), "{:?}", study.failures);
    // Three in the atrium; three and three times two in the tessellated scene.
    assert_eq!(study.cells.len(), 3 + 3 + 6);
    for cell in &study.cells {
        assert!(cell.drawn == 8 && cell.path_ms.len() == 4 && cell.ms > 0.0, "{cell:?}");
        assert!(cell.energy.is_none() && cell.repeats_ms.len() == 2);
        if study.device_times {
            let sum: f64 = cell.passes.iter().map(|p| p.ms).sum();
            let gpu = cell.gpu_ms.unwrap();
            assert!((sum / gpu - 1.0).abs() < 1e-9 && gpu < 1.05 * cell.ms, "{gpu} {}", cell.ms);
        }
    }
    assert_eq!(study.answers.len(), 5);
    assert!(study.answers.iter().all(|a| !a.is_answered && !a.words.is_empty()));
    let page = std::fs::read_to_string(out.join("study.html")).unwrap();
    for part in ["Times only.", "GeForce 580 (published, 4 lights)", "Is energy directly", "<svg "]
    {
        assert!(page.contains(part), "{part}");
    }
    for file in ["study-cells", "study-table-1-relative", "study-tessellated-96x54-shadows-passes"]
    {
        let csv = std::fs::read_to_string(out.join(format!("csv/{file}.csv"))).unwrap();
        assert!(csv.lines().count() > 3, "{file}: {csv}");
    }
    assert_eq!(json(&out)["cells"].as_array().unwrap().len(), 12);
    let log = std::fs::File::open(out.join("frames.jsonl")).unwrap();
    let log = FrameLog::read(std::io::BufReader::new(log)).unwrap();
    assert_eq!(log.frames.len(), 12 * 8);
}

/// Every cell must come out at the power of the meter, and energy per pixel at that power times the time.
fn check_energy(study: &Study) {
    assert!(study.failures.is_empty(), "{:?}", study.failures);
    assert!(!study.cells.is_empty());
    for cell in &study.cells {
        let energy = cell.energy.as_ref().expect("energy");
        println!(
            "{}: {:.2} W, {:.1} nJ/pixel",
            cell.key.name(),
            energy.mean_w,
            energy.nj_per_pixel
        );
        // Wide enough for a thread of the meter that waits for a busy machine.
        assert!((energy.mean_w / WATTS - 1.0).abs() < 0.1, "{} {energy:?}", cell.key.name());
        let ms = mean(cell.repeats_ms.iter().copied());
        let expected = 1e9 * WATTS * 1e-3 * ms / cell.key.pixels();
        assert!((energy.nj_per_pixel / expected - 1.0).abs() < 0.12, "{expected} {energy:?}");
        assert!((energy.idle_w.unwrap() / WATTS - 1.0).abs() < 0.1, "{energy:?}");
    }
    // The same power everywhere is what proportional means, as far as the meter was on time.
    let answer = &study.answers[1];
    let power = |c: &Cell| c.energy.as_ref().map_or(f64::NAN, |e| e.mean_w);
    let off = study.cells.iter().map(|c| (power(c) / WATTS - 1.0).abs()).fold(0.0, f64::max);
    let is_yes = answer.words[0].starts_with("Yes");
    assert!(answer.is_answered && (is_yes || off > 0.02), "{off} {answer:?}");
    assert!(
        study.answers[4].words[0].starts_with("On this device it would not"),
        "{:?}",
        study.answers[4]
    );
}

#[test]
fn counters_of_energy_give_the_energy_of_pixels() {
    if !has_device() {
        return;
    }
    let folder = Folder::new("rapl");
    let mut tick = counter(&folder.0);
    tick();
    let ticker = Ticker::new(tick);
    let source = format!("rapl:{}", folder.0.display());
    let out = folder.0.join("out");
    let args = parse(&[
        "--source",
        &source,
        "--algorithms",
        "FR,DR,SM",
        "--lights",
        "2",
        "--scene",
        "tessellated",
        "--margin",
        "0.3",
        "--frames",
        "60",
        "--out",
        out.to_str().unwrap(),
    ]);
    let study = measure_all(&args.unwrap()).unwrap();
    drop(ticker);
    check_energy(&study);
    assert_eq!(study.source.name.as_deref(), Some("RAPL"));
    let refresh = study.source.refresh_s.unwrap();
    // Frames are as many as windows of the meter need, not four.
    for cell in &study.cells {
        let seconds = 1e-3 * cell.ms * cell.drawn as f64;
        assert!(seconds > 150.0 * refresh, "{seconds} s of frames, new readings every {refresh} s");
    }
    let page = std::fs::read_to_string(out.join("study.html")).unwrap();
    assert!(page.contains("Energy over time") && !page.contains("Times only."));
}

#[test]
fn the_trace_of_an_instrument_is_brought_together_with_the_log() {
    if !has_device() {
        return;
    }
    let folder = Folder::new("trace");
    let path = folder.0.join("trace.csv");
    let mut file = std::fs::File::create(&path).unwrap();
    writeln!(file, "# clock: monotonic\ntime_ns,card_w").unwrap();
    // An instrument has a clock of its own and misses nothing when this machine is busy.
    let mut due = now_ns();
    let ticker = Ticker::new(move || {
        while due <= now_ns() {
            writeln!(file, "{due},{WATTS}").unwrap();
            due += 500_000;
        }
    });
    let source = format!("csv:{}", path.display());
    let out = folder.0.join("out");
    let args = parse(&[
        "--source",
        &source,
        "--algorithms",
        "SM,VSM",
        "--lights",
        "3",
        "--scene",
        "tessellated",
        "--margin",
        "0.1",
        "--repeats",
        "3",
        "--out",
        out.to_str().unwrap(),
    ]);
    let study = measure_all(&args.unwrap()).unwrap();
    drop(ticker);
    check_energy(&study);
    assert_eq!(study.cells.len(), 2);
    assert!(study.source.notes.iter().any(|n| n.contains("shared clock")), "{:?}", study.source);
}

#[test]
fn what_cannot_be_is_refused_in_words() {
    for (arguments, part) in [
        (&["--algorithms", "FR,XR"][..], "XR"),
        (&["--lights", "0"], "0 is not in 1..=8"),
        (&["--lights", "9"], "9 is not in 1..=8"),
        (&["--size", "0x90"], "1 to 16384"),
        (&["--size", "320"], "320"),
        (&["--frames", "0"], "0 is not in"),
        (&["--source", "wattmeter"], "csv:FILE"),
    ] {
        let error = parse(arguments).err().unwrap_or_default();
        assert!(error.contains(part), "{arguments:?}: {error}");
    }
    for (arguments, part) in [
        (&["--scene", "no/such.glb"][..], "no/such.glb"),
        (&["--dragon", "no/such.obj"], "no/such.obj"),
        (&["--scene", "tessellated", "--dragon", "serpents"], "not among"),
        (&["--margin", "-1"], "--margin"),
        (&["--idle", "outside", "--margin", "0"], "idle time"),
        (&["--idle", "much"], "--idle"),
    ] {
        let arguments: Vec<String> = arguments.iter().map(|a| (*a).to_owned()).collect();
        let joined: Vec<String> = match arguments.iter().position(|a| a == "--margin") {
            // Clap takes a negative number for an option unless it is joined.
            Some(at) => {
                let mut all = arguments.clone();
                all[at] = format!("--margin={}", all[at + 1]);
                all.remove(at + 1);
                all
            }
            None => arguments,
        };
        let words: Vec<&str> = joined.iter().map(String::as_str).collect();
        let error = measure_all(&parse(&words).unwrap()).err().map(|e| format!("{e:#}"));
        assert!(error.as_ref().is_some_and(|e| e.contains(part)), "{words:?}: {error:?}");
    }
    if !has_device() {
        return;
    }
    for source in ["rapl:/no/such/folder", "csv:no-such-trace.csv"] {
        let error = measure_all(&parse(&["--source", source]).unwrap()).err();
        let error = error.map(|e| format!("{e:#}")).unwrap_or_default();
        assert!(error.contains("no-such") || error.contains("/no/such"), "{source}: {error}");
    }
}

#[test]
fn what_fails_is_reported_and_the_rest_measured() {
    if !has_device() {
        return;
    }
    let folder = Folder::new("failed");
    let (out, broken) = (folder.0.join("out"), folder.0.join("broken.glb"));
    std::fs::write(&broken, "no scene").unwrap();
    // A meter that is gone after some seconds, in the middle of it.
    let mut tick = counter(&folder.0);
    tick();
    let zone = folder.0.join("intel-rapl:0");
    let begun = std::time::Instant::now();
    let ticker = Ticker::new(move || match begun.elapsed() < Duration::from_secs(3) {
        true => tick(),
        false => drop(std::fs::remove_dir_all(&zone)),
    });
    let source = format!("rapl:{}", folder.0.display());
    let scenes = ["--scene", broken.to_str().unwrap(), "--scene", "tessellated:300"];
    let more = ["--algorithms", "FR,ZR,SM", "--lights", "1", "--margin", "1.5", "--repeats", "2"];
    let places = ["--source", &source, "--out", out.to_str().unwrap()];
    let study = measure_all(&parse(&[&scenes[..], &more, &places].concat()).unwrap()).unwrap();
    drop(ticker);
    assert_eq!(study.cells.len(), 3, "{:?}", study.failures);
    assert!(study.cells.iter().all(|c| c.repeats_ms.len() == 2));
    assert!(study.failures[0].scene.contains("broken"), "{:?}", study.failures);
    assert!(study.failures[1..].iter().all(|f| f.error.contains("times alone")));
    assert!(study.failures.len() > 2, "{:?}", study.failures);
    let page = std::fs::read_to_string(out.join("study.html")).unwrap();
    assert!(page.contains("What failed") && page.contains("broken.glb"));
}
