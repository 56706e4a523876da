//! Every controller on the thesis's three devices (simulated) and two scenes, with the thesis's
//! model as the predictor: `cargo run --release -p niwaki-frame-control --example
//! compare_controllers`.

#[allow(dead_code, reason = "another example uses the rest")]
#[path = "../tests/common/mod.rs"]
mod common;

use common::{Case, compare, devices};
use niwaki_frame_control::sim::{Scene, Script};

fn main() {
    for (name, script, scene) in [
        ("fairy", Script::fairy(100), Scene::fairy()),
        ("cabin", Script::cabin(100), Scene::cabin()),
    ] {
        for (device, spec) in devices() {
            let path = Case::path(device, spec.clone(), script.clone());
            let turn = Case::turn(device, spec.clone(), scene.clone());
            let cuts = Case::cuts(device, spec, scene.clone());
            println!(
                "\n{name}, {device}: target {:.0} ms; the model ranks settings with tau {:.3}",
                path.target_ms,
                path.ranking()
            );
            println!(
                "| controller  | model err % | corrected err % | target err % | on target % | mean \
                 rung | flicker | after turn: off >10 % | worst % | cuts: on target % |"
            );
            println!("|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|");
            for row in compare(&path, &turn, &cuts) {
                let percent = |share: Option<f64>| {
                    share.map_or("-".into(), |share| format!("{:.1}", 100.0 * share))
                };
                println!(
                    "| {:11} | {} | {} | {} | {} | {:.1} | {} | {} | {} | {} |",
                    row.controller,
                    percent(row.all.model_error),
                    percent(row.all.corrected_error),
                    percent(Some(row.all.target_error)),
                    percent(Some(row.settled.on_target)),
                    row.all.mean_rung,
                    row.all.flicker,
                    row.off_after_turn,
                    percent(Some(row.worst_after_turn)),
                    percent(Some(row.on_target_cuts)),
                );
            }
        }
    }
}
