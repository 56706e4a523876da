//! What happens to the target when something happens to the view or to the device, and what gain and
//! delay cost: `cargo run --release -p niwaki-frame-control --example disturbances`.

#[allow(dead_code, reason = "another example uses the rest")]
#[path = "../tests/common/mod.rs"]
mod common;

use common::{Case, SETTLING, devices, hybrid_model, ladder, model};
use niwaki_frame_control::sim::{Device, Event, Run, Scene, Script};
use niwaki_frame_control::{
    Aim, Config, CorrectionConfig, FrameController, InnerConfig, Ladder, Summary, admissible_gain,
    frames_off,
};

fn main() {
    scripts();
    gains();
    deadlines();
    println!("\nGain below which the outer loop is stable");
    println!("| sensitivity | delay 1 | 2 | 3 | 5 | 8 |\n|--:|--:|--:|--:|--:|--:|");
    for sensitivity in [0.2, 0.5, 1.0, 1.5, 2.0, 4.0] {
        let bounds = [1, 2, 3, 5, 8].map(|d| format!("{:.2}", admissible_gain(d, sensitivity)));
        println!("| {sensitivity} | {} |", bounds.join(" | "));
    }
}

/// Every controller on a GeForce 580 and scripts of 300 frames.
fn scripts() {
    let drift = || Script::drift(Scene::fairy(), 300);
    let (device, spec) = devices()[0].clone();
    let mut warm = spec.clone();
    (warm.heating_kelvin, warm.heat_ms, warm.throttle_celsius) = (80.0, 4000.0, 75.0);
    let mut interrupted = spec.clone();
    (interrupted.spike_rate, interrupted.spike_factor) = (0.03, 4.0);
    let cases = [
        ("slow drift", spec.clone(), drift()),
        ("wall from 100 to 200", spec.clone(), Script::wall(Scene::fairy(), 300, 100, 200)),
        ("180 degrees at 150", spec.clone(), Script::turn(Scene::cabin(), 300, 150)),
        ("clock 0.6 from 150", spec.clone(), drift().with(150, Event::Clock(0.6))),
        (
            "competing 100 to 200",
            spec.clone(),
            drift().with(100, Event::Competing(0.4)).with(200, Event::Competing(0.0)),
        ),
        ("throttles", warm, drift().with(60, Event::Surroundings(60.0))),
        ("interrupted", interrupted, drift()),
    ];
    println!(
        "Of the frames whose target the ladder reaches, after the first ten: within 5 % of it, number off \
         by more than 10 %"
    );
    println!("| script | no tuning | feedback | regression | feedforward | both |");
    println!("|---|--:|--:|--:|--:|--:|");
    for (name, spec, script) in cases {
        let at = script.frames() - 1;
        let case = Case::new(device, spec, script, at);
        let simulated = Device::new(case.spec.clone(), 0).expect("a valid device");
        let top = ladder().rungs()[65];
        let reachable: Vec<bool> = (0..case.script.frames())
            .map(|frame| simulated.ideal_ms(&case.script.view(frame), &top) > case.target_ms)
            .collect();
        let cells: Vec<String> = case
            .controllers()
            .into_iter()
            .map(|(_, mut controller)| {
                // Frames in which even the best rung leaves time over say nothing.
                let mut records = case.frames(&mut *controller).split_off(SETTLING);
                records.retain(|record| reachable[usize::try_from(record.frame).unwrap_or(0)]);
                let records = &records;
                let share = Summary::of(records).map_or(0.0, |sum| 100.0 * sum.on_target);
                format!("{share:.0} %, {}", frames_off(records, 0.1))
            })
            .collect();
        println!("| {name} | {} |", cells.join(" | "));
    }
}

/// Mean corrected error over three devices, two scenes and eight seeds, for constant gains and for
/// the default, at several delays.
fn gains() {
    println!("\nMean error of the corrected model, in percent");
    println!("| gain | delay 1 | 2 | 4 | 8 |\n|--:|--:|--:|--:|--:|");
    for (name, gain, max_gain) in [
        ("0.1", 0.1, 0.1),
        ("0.2", 0.2, 0.2),
        ("0.4", 0.4, 0.4),
        ("0.6", 0.6, 0.6),
        ("0.8", 0.8, 0.8),
        ("0.2 to 0.8", 0.2, 0.8),
    ] {
        let cells: Vec<String> = [1, 2, 4, 8]
            .iter()
            .map(|&delay| {
                let outer =
                    CorrectionConfig { gain, max_gain, delay: 8, ..CorrectionConfig::default() };
                let config = Config { outer: Some(outer), ..Config::default() };
                let mut errors = Vec::new();
                for script in [Script::fairy(100), Script::cabin(100)] {
                    for (device, spec) in devices() {
                        let mut case = Case::path(device, spec, script.clone());
                        case.run.delay = delay;
                        for seed in 0..8 {
                            case.run.seed = seed;
                            let mut controller = FrameController::new(
                                ladder(),
                                model(device),
                                case.target_ms,
                                config,
                            )
                            .expect("valid settings");
                            let records = &case.frames(&mut controller)[SETTLING..];
                            errors.extend(Summary::of(records).and_then(|s| s.corrected_error));
                        }
                    }
                }
                format!("{:.2}", 100.0 * errors.iter().sum::<f64>() / errors.len() as f64)
            })
            .collect();
        println!("| {name} | {} |", cells.join(" | "));
    }
}

/// The ladder past the thesis, with its coarse steps, on a GeForce 580: what headroom costs and saves.
fn deadlines() {
    println!("\nThe hybrid ladder: share of late frames, mean rung of {}", Ladder::hybrid().top());
    println!("| target of rung | nearest | at most | 3 % headroom | 10 % headroom |");
    println!("|--:|--:|--:|--:|--:|");
    let ladder = Ladder::hybrid();
    let (device, spec) = devices()[0].clone();
    let script = Script::fairy(400);
    for rung in [4, 12, 24, 40, 50] {
        let cells = [
            Aim::Nearest,
            Aim::AtMost { headroom: 0.0 },
            Aim::AtMost { headroom: 0.03 },
            Aim::AtMost { headroom: 0.1 },
        ]
        .map(|aim| {
            let mut simulated = Device::new(spec.clone(), 5).expect("a valid device");
            let target_ms = simulated.ideal_ms(&script.view(200), &ladder.rungs()[rung]);
            let inner = InnerConfig { aim, ..InnerConfig::default() };
            let config = Config { inner, ..Config::default() };
            let mut controller =
                FrameController::new(ladder.clone(), hybrid_model(device), target_ms, config)
                    .expect("valid settings");
            let run = Run::default();
            let records = &run.frames(&mut controller, &ladder, &mut simulated, &script, target_ms)
                [SETTLING..];
            let late = records.iter().filter(|record| record.off_target() > 0.0).count();
            let share = 100.0 * late as f64 / records.len() as f64;
            format!("{share:.0} %, {:.1}", Summary::of(records).map_or(0.0, |sum| sum.mean_rung))
        });
        println!("| {rung} | {} |", cells.join(" | "));
    }
}
