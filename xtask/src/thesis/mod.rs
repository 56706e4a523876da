//! `cargo xtask thesis`: the result tables of the thesis's papers IV and V, measured here, beside
//! the published values.

mod args;
mod compare;
mod measure;
mod names;
mod orderings;
mod page;
mod plan;
mod plots;
mod published;
mod tables;

pub(crate) use args::ThesisArgs;

use crate::bench::progress::Progress;
use crate::bench::{Failures, Method, find_peers, pool};
use crate::registry::TreeBuilder;
use crate::results::{Failure, Results, Run, Source};
use crate::{machine, report};
use anyhow::{Result, bail};
use compare::Comparison;
use measure::{SceneResult, Settings};
use names::Standing;
use orderings::{Pair, Tally};
use plan::{Plan, Plans};
use published::{Item, Published};
use serde::Serialize;
use std::path::Path;
use std::process::ExitCode;

/// The version of `thesis.json`'s layout.
const SCHEMA: u32 = 1;

/// Everything that the report shows.
#[derive(Debug, Serialize)]
struct Report {
    schema: u32,
    run: Run,
    /// What was measured.
    scenes: Vec<SceneResult>,
    /// Each published value, and what stands beside it.
    comparisons: Vec<Comparison>,
    /// Each published order of two builders, and whether it holds.
    pairs: Vec<Pair>,
    failures: Vec<Failure>,
    #[serde(skip)]
    published: Published,
}

impl Report {
    /// What was measured in place of a published scene.
    fn standing_for(&self, scene: &str) -> Option<&SceneResult> {
        self.scenes.iter().find(|result| result.stands_for.iter().any(|(name, _)| name == scene))
    }
}

/// Runs the command.
pub(crate) fn run(args: &ThesisArgs) -> Result<ExitCode> {
    let published = Published::read()?;
    let plans = plan::plan(args, &published)?;
    for file in &plans.unused {
        eprintln!("note: {file} is named like no scene of papers IV and V; it is left out");
    }
    let mut run = machine::describe();
    let mut builders = measure::builders(&published);
    if args.no_peers {
        builders.retain(|builder| builder.source() == Source::Niwaki);
    }
    find_peers(args.peers, "", &mut builders, &mut run)?;
    if args.list {
        list(&plans, &builders);
        return Ok(ExitCode::SUCCESS);
    }
    if plans.plans.is_empty() {
        bail!("no scene is left to measure; leave --no-stand-ins out to use procedural ones");
    }
    let threads = args.threads.map_or_else(machine::cores, usize::from);
    run.threads = vec![threads];
    run.arguments = std::env::args().skip(2).collect();
    run.collapse = args.collapse.name().to_owned();
    run.seconds_per_measurement = args.seconds();
    let method = Method {
        progress: Progress::new(plans.plans.len() * measure::steps(builders.len())),
        builders,
        kernels: vec![crate::kernel::TraceKernel::best()],
        collapse: args.collapse,
        robust: false,
        embree_config: String::new(),
        binary: Vec::new(),
        seconds: args.seconds(),
        brief: true,
        all_cores: pool(machine::cores())?,
    };
    let settings = Settings { threads, ray_count: args.ray_count(), seed: args.seed };
    let mut failures = Failures::default();
    let mut report = Report {
        schema: SCHEMA,
        run,
        scenes: Vec::new(),
        comparisons: Vec::new(),
        pairs: Vec::new(),
        failures: Vec::new(),
        published,
    };
    measure_all(method, settings, &plans, &mut report, &mut failures, &args.out)?;
    print!("{}", as_text(&report));
    for failure in &report.failures {
        eprintln!("failed: {}: {}", failure.scene, failure.error);
    }
    for (what, file) in [("results", "thesis.json"), ("report ", "thesis.html")] {
        println!("{what} {}", args.out.join(file).display());
    }
    Ok(if failures.fatal { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

fn list(plans: &Plans, builders: &[TreeBuilder]) {
    for plan in &plans.plans {
        for (scene, standing) in &plan.stands_for {
            let how = match standing {
                // Whether it is the same version only its triangles will tell.
                Standing::Same | Standing::Version => "by name".to_owned(),
                other => other.to_string(),
            };
            println!("{:<13} {how:<9} {}", scene.published, plan.spec.describe());
        }
    }
    let names: Vec<_> = builders.iter().map(TreeBuilder::full_name).collect();
    println!("builders: {}", names.join(", "));
}

/// Measures scene after scene, and writes the report after each, so that an interrupted run leaves
/// what it had. What fails is noted and left out.
fn measure_all(
    mut method: Method,
    settings: Settings,
    plans: &Plans,
    report: &mut Report,
    failures: &mut Failures,
    out: &Path,
) -> Result<()> {
    let note = |failures: &mut Failures, scene: String, error: &anyhow::Error| {
        failures.fatal = true;
        failures.list.push(Failure { scene, error: format!("{error:#}") });
    };
    for (scene, error) in &plans.failures {
        note(failures, scene.clone(), error);
    }
    for plan in &plans.plans {
        method.binary = binary_builders(plan, &report.published);
        match measure::measure(&method, settings, plan, &report.published, failures) {
            Ok(result) => report.scenes.push(result),
            Err(error) => note(failures, plan.spec.describe(), &error),
        }
        report.comparisons = compare::compare(&report.published, &report.scenes);
        report.pairs = orderings::pairs(&report.comparisons);
        report.failures.clone_from(&failures.list);
        write(report, out)?;
    }
    method.progress.finish();
    Ok(())
}

/// The builders whose binary trees are traced on a scene: those of paper V's table 2, on its scenes.
fn binary_builders(plan: &Plan, published: &Published) -> Vec<String> {
    let scenes = published.scenes(Item::VTable2);
    if !plan.stands_for.iter().any(|(scene, _)| scenes.contains(&scene.published)) {
        return Vec::new();
    }
    let builders = published.builders(Item::VTable2);
    builders.iter().flat_map(|b| names::candidates(b)).map(ToString::to_string).collect()
}

/// The tables for a terminal.
fn as_text(report: &Report) -> String {
    let mut text = String::new();
    let mut add = |title: &str, table: &report::table::Table| {
        if !table.is_empty() {
            text.push_str(&format!("\n{title}\n{}\n", table.to_text()));
        }
    };
    let (comparisons, pairs) = (&report.comparisons, &report.pairs);
    for item in Item::ALL {
        match item {
            Item::IvFigure6 => {
                if let Some(result) = report.standing_for("San Miguel") {
                    let title = format!("{} (measured on {})", item.title(), result.scene);
                    add(&title, &tables::steps(comparisons, result));
                }
            }
            Item::IvFigure7 => add(item.title(), &tables::averages(comparisons)),
            Item::VFigure4 => {
                if let Some(result) = report.standing_for("Power Plant") {
                    let title = format!("{} (measured on {})", item.title(), result.scene);
                    add(&title, &tables::scaling(result));
                }
            }
            _ => {
                for (_, quantity) in tables::MATRICES.into_iter().filter(|(of, _)| *of == item) {
                    let title = format!("{}\n{}", item.title(), tables::heading(item, quantity));
                    add(&title, &tables::matrix(item, quantity, comparisons, pairs));
                }
            }
        }
    }
    add("Scenes", &tables::scenes(&report.published, &report.scenes));
    add("Orderings that hold", &tables::orderings(pairs));
    for (name, of) in [
        ("the papers' scenes", (|p| p.had) as fn(&Pair) -> bool),
        ("all that was measured", |_| true),
    ] {
        let tally = Tally::of(pairs.iter().filter(|p| p.item != Item::IvFigure7 && of(p)));
        if tally.all() > 0 {
            text.push_str(&format!(
                "\nOn {name}, {} of {} published orderings hold, {} are ties, {} are reversed.",
                tally.holds,
                tally.all(),
                tally.ties,
                tally.reversed
            ));
        }
    }
    text.push('\n');
    text
}

/// Writes `thesis.json`, `thesis.html`, `csv/*.csv` and `results.json`.
fn write(report: &Report, out: &Path) -> Result<()> {
    let (html, files) = page::page(report)?;
    report::write_page(&html, files, out, "thesis.html")?;
    let path = out.join("thesis.json");
    crate::results::write_json(&path, report)?;
    let mut results = Results {
        runs: vec![report.run.clone()],
        failures: report.failures.clone(),
        ..Results::default()
    };
    for scene in &report.scenes {
        results.add_scene(scene.info.clone());
        results.rows.extend(scene.rows.iter().cloned());
    }
    results.write(&out.join("results.json"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tiny_run_writes_everything() {
        let out = std::env::temp_dir().join(format!("niwaki-thesis-{}", std::process::id()));
        let scene = out.join("sponza.obj");
        std::fs::create_dir_all(&out).unwrap();
        std::fs::write(&scene, "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\n").unwrap();
        let mut args = ThesisArgs {
            scenes: vec![scene.display().to_string(), "pipes:1000".into()],
            only: ["Sponza", "San Miguel", "Power Plant"].map(String::from).to_vec(),
            triangles: Some(600),
            threads: Some(2),
            ray_count: Some(300),
            quick: true,
            no_peers: true,
            out: out.clone(),
            ..ThesisArgs::default()
        };
        assert!(run(&args).is_ok_and(|code| code == ExitCode::SUCCESS));

        let json = std::fs::read_to_string(out.join("thesis.json")).unwrap();
        let json: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert_eq!(json["schema"], 1);
        let comparisons = json["comparisons"].as_array().unwrap();
        let published = Published::read().unwrap();
        for item in Item::ALL {
            let of = || comparisons.iter().filter(|c| c["item"] == item.id());
            let distinct = published.of(item).filter(|v| v.quantity != "frame relative").count();
            assert!(of().count() >= distinct, "{}: every value is listed", item.id());
        }
        // What each item needs of a builder that is certainly there was measured.
        for (item, scene, ours, quantity) in [
            ("iv-figure-5", "San Miguel", "bonsai", "build"),
            ("iv-figure-5", "San Miguel", "binned", "performance"),
            ("iv-figure-6", "San Miguel", "bonsai_p", "pruning"),
            ("iv-figure-7", "(average)", "bonsai_p_star", "sah"),
            ("iv-figure-8", "Sponza", "binned", "sah"),
            ("v-table-1", "Power Plant", "binned", "frame"),
            ("v-table-2", "San Miguel", "sweep", "frame"),
            ("v-table-5", "Power Plant", "bonsai_p", "sah"),
            ("v-figure-4", "Power Plant", "binned", "scaling"),
        ] {
            let row = comparisons.iter().find(|c| {
                c["item"] == item
                    && c["scene"] == scene
                    && c["ours"] == ours
                    && c["quantity"] == quantity
            });
            let measured = row.and_then(|row| row["measured_relative"].as_f64());
            assert!(measured.is_some_and(|x| x > 0.0), "{item} {scene} {ours} {quantity}");
        }
        let standing = |scene: &str| {
            let row = comparisons.iter().find(|c| c["scene"] == scene).unwrap();
            row["standing"].as_str().unwrap().to_owned()
        };
        assert_eq!(standing("Sponza"), "version", "two triangles are not all of it");
        assert_eq!(standing("San Miguel"), "stand-in");

        let page = std::fs::read_to_string(out.join("thesis.html")).unwrap();
        for attribute in ["src=\"", "href=\""] {
            for rest in page.split(attribute).skip(1) {
                assert!(rest.starts_with("data:") || rest.starts_with('#'), "{}", &rest[..40]);
            }
        }
        assert!(page.matches("<svg ").count() >= 8);
        for file in ["iv-figure-5-build", "iv-figure-6", "v-figure-4", "orderings", "comparisons"] {
            let csv = std::fs::read_to_string(out.join(format!("csv/{file}.csv"))).unwrap();
            assert!(csv.lines().count() >= 3, "{file}: {csv}");
        }
        let results = Results::read(&out.join("results.json")).unwrap();
        assert_eq!(results.scenes.len(), 3);
        assert!(results.traces().any(|row| row.kernel == crate::bench::engines::BINARY));

        args.scenes = vec!["missing.glb".into()];
        assert!(run(&args).is_ok_and(|code| code == ExitCode::FAILURE));
        args.no_stand_ins = true;
        assert!(run(&args).is_err());
        std::fs::remove_dir_all(out).unwrap();
    }
}
