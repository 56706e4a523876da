//! `cargo xtask report`: merges results and shows them as tables, CSV and one HTML file.

mod against;
pub(crate) mod axis;
mod break_even;
pub(crate) mod canvas;
mod html;
mod model;
pub(crate) mod page;
mod plots;
pub(crate) mod table;
mod tables;

use crate::cli::ReportArgs;
use crate::results::{Results, Row};
use anyhow::{Context, Result};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

pub(crate) use model::{geometric_mean, groups, is_peers, pareto_front};
pub(crate) use plots::{Frame, place_labels, ray_counts};
pub(crate) use tables::{slug, summary_as_text};

/// Runs the command.
pub(crate) fn run(args: &ReportArgs) -> Result<ExitCode> {
    let parts = args.files.iter().map(|file| Results::read(file)).collect::<Result<Vec<_>>>()?;
    let results = Results::merge(parts);
    print!("{}", tables::groups_as_text(&groups(&results)));
    println!("{}", summary_as_text(&results));
    results.write(&args.out.join("results.json"))?;
    let page = write(&results, &args.out)?;
    println!("{}", page.display());
    Ok(ExitCode::SUCCESS)
}

/// The tables of some rows of the results.
pub(crate) fn group_as_text(results: &Results, rows: &[Row]) -> String {
    let part = Results {
        runs: results.runs.clone(),
        scenes: results.scenes.clone(),
        rows: rows.to_vec(),
        ..Results::default()
    };
    tables::groups_as_text(&groups(&part))
}

/// Writes `report.html` and `csv/*.csv` into a folder; returns the path of the former.
pub(crate) fn write(results: &Results, out: &Path) -> Result<PathBuf> {
    let (html, files) = html::page(results)?;
    write_page(&html, files, out, "report.html")
}

/// Writes a page and its `csv/*.csv` into a folder; returns the path of the former.
pub(crate) fn write_page(
    html: &str,
    files: Vec<page::Csv>,
    out: &Path,
    name: &str,
) -> Result<PathBuf> {
    let csv = out.join("csv");
    std::fs::create_dir_all(&csv).with_context(|| format!("cannot create {}", csv.display()))?;
    for (name, text) in files {
        let path = csv.join(format!("{name}.csv"));
        std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    }
    let path = out.join(name);
    std::fs::write(&path, html).with_context(|| format!("cannot write {}", path.display()))?;
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::tests::{build, trace};
    use crate::results::{Failure, HeatMap, Run, SceneInfo};

    #[test]
    fn the_page_stands_alone() {
        let out = std::env::temp_dir().join(format!("niwaki-report-{}", std::process::id()));
        std::fs::create_dir_all(&out).unwrap();
        let png = out.join("a.png");
        std::fs::write(&png, [0x89, b'P', b'N', b'G']).unwrap();
        let results = Results {
            runs: vec![Run::default()],
            scenes: vec![SceneInfo {
                name: "a".into(),
                triangles: 1000,
                credit: Some("A <Person>, CC0".into()),
                picture: Some(png.clone()),
                heat_map: Some(HeatMap {
                    picture: png,
                    builder: "sweep".into(),
                    mean: 20.0,
                    top: 90.0,
                }),
                ..SceneInfo::default()
            }],
            rows: vec![
                Row::Build(build("a", "sweep", 1, 10.0)),
                Row::Build(build("a", "lbvh", 1, 2.0)),
                Row::Trace(trace("a", "sweep", 1, 3.0)),
                Row::Trace(trace("a", "lbvh", 1, 2.0)),
            ],
            failures: vec![Failure { scene: "bad.obj".into(), error: "line 3".into() }],
            ..Results::default()
        };
        let page = std::fs::read_to_string(write(&results, &out).unwrap()).unwrap();
        for part in ["A &lt;Person&gt;, CC0", "bad.obj", "data:image/png;base64,iVBORw", "<svg "] {
            assert!(page.contains(part), "{part}");
        }
        // Nothing is fetched: every reference is to data or to a place in the page.
        for attribute in ["src=\"", "href=\""] {
            for rest in page.split(attribute).skip(1) {
                assert!(rest.starts_with("data:") || rest.starts_with('#'), "{}", &rest[..40]);
            }
        }
        for file in ["a-1000-1t-totals", "a-1000-1t-scatter", "a-1000-1t-break-even", "builds"] {
            let csv = std::fs::read_to_string(out.join(format!("csv/{file}.csv"))).unwrap();
            assert!(csv.lines().count() >= 2, "{file}: {csv}");
        }
        std::fs::remove_dir_all(out).unwrap();
    }

    #[test]
    fn a_report_of_nothing_is_still_a_page() {
        let (html, _) = html::page(&Results::default()).unwrap();
        assert!(html.contains("</html>"));
    }
}
