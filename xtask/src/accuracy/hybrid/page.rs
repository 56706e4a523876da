//! The report of the suite.

use super::artifact::{Artifact, Picture, Remedy};
use super::plots;
use super::study::{SceneStudy, Study};
use super::sweep::{GRID, PRESETS, Sweep};
use crate::report::page::{FOOT, add_table, failures, figure, head, picture_data, run_header};
use crate::report::table::{escape, grouped};
use crate::report::write_page;
use anyhow::Result;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

const INTRODUCTION: &str = include_str!("introduction.html");

/// Writes `accuracy.html` and `csv/*.csv` into a folder that holds the pictures; returns the path
/// of the former.
pub(super) fn write(study: &Study, sweep: &Sweep, out: &Path) -> Result<PathBuf> {
    let mut html = head("What accuracy costs: the hybrid renderer");
    let mut files = Vec::new();
    html.push_str(&run_header(&study.run, None));
    let clock = if study.device_times {
        "its own clock"
    } else {
        "the host's clock, as the device has none"
    };
    let _ = writeln!(
        html,
        "<p>{} × {} pixels on <strong>{}</strong>, timed by {clock}.</p>",
        study.width,
        study.height,
        escape(&study.device)
    );
    html.push_str(INTRODUCTION);
    failures(&mut html, &study.failures);
    html.push_str("<h2>Settings, all scenes</h2>\n<div class=\"plots\">\n");
    let summary = study.summary_table(sweep);
    for family in sweep.families() {
        if ![PRESETS, GRID].contains(&family) {
            let svg = plots::knob(&study.scenes, sweep, family)?;
            figure(&mut html, &mut files, &svg, &caption(family), &summary)?;
        }
    }
    html.push_str("</div>\n<p>Geometric means of ratios over scenes; * is the default.</p>\n");
    add_table(&mut html, &mut files, &summary)?;
    html.push_str("<h2>The worst artifact of each scene</h2>\n");
    html.push_str(
        "<p>What removes most of it is looked for among the settings that differ from the default \
         in one knob; <em>little more time</em> is half as much again at most.</p>\n",
    );
    add_table(&mut html, &mut files, &study.artifact_table())?;
    for scene in &study.scenes {
        add_scene(&mut html, &mut files, scene, sweep, out)?;
    }
    html.push_str(FOOT);
    write_page(&html, files, out, "accuracy.html")
}

fn add_scene(
    html: &mut String,
    files: &mut Vec<crate::report::page::Csv>,
    scene: &SceneStudy,
    sweep: &Sweep,
    out: &Path,
) -> Result<()> {
    let frames: Vec<String> = scene.frames.iter().map(ToString::to_string).collect();
    let _ = writeln!(
        html,
        "<h2>{}</h2>\n<p>{} triangles; of the 200 frames of its camera path: {}.</p>",
        escape(&scene.scene),
        grouped(scene.triangles as f64, 0),
        frames.join(", ")
    );
    let table = scene.full_table();
    html.push_str("<div class=\"plots one\">\n");
    let caption = "Time of a frame against its error.";
    figure(html, files, &plots::pareto(scene, sweep)?, caption, &table)?;
    html.push_str("</div>\n");
    add_artifact(html, &scene.artifact, out)?;
    html.push_str("<h3>All settings</h3>\n");
    add_table(html, files, &table)?;
    let passes = scene.pass_table();
    if !passes.is_empty() {
        html.push_str("<h3>Passes</h3>\n");
        add_table(html, files, &passes)?;
    }
    Ok(())
}

/// The frame, then a row of crops for the default and for each remedy.
fn add_artifact(html: &mut String, artifact: &Artifact, out: &Path) -> Result<()> {
    let [x, y, width, height] = artifact.tile;
    let _ = writeln!(
        html,
        "<h3>Worst artifact</h3>\n<p>Frame {}, the {width} × {height} pixels at ({x}, {y}): mean FLIP \
         {:.3} at the default. {}</p>",
        artifact.frame,
        artifact.flip,
        advice(artifact)
    );
    let mut of: Option<&str> = None;
    for picture in &artifact.pictures {
        if of != Some(&picture.of) {
            if of.is_some() {
                html.push_str("</div>\n");
            }
            let title = if picture.of.is_empty() { "At the default" } else { &picture.of };
            let _ = writeln!(html, "<h4>{}</h4>\n<div class=\"crops\">", escape(title));
            of = Some(&picture.of);
        }
        let _ = writeln!(
            html,
            "<figure><img alt=\"{0}\" src=\"{1}\"><figcaption>{0}</figcaption></figure>",
            describe(picture),
            picture_data(&out.join(&picture.file))?
        );
    }
    if of.is_some() {
        html.push_str("</div>\n");
    }
    Ok(())
}

fn describe(picture: &Picture) -> &'static str {
    match picture.shows {
        "frame" => "The frame, with the tile",
        "hybrid" => "Hybrid",
        "Whitted" => "Whitted: what is wanted",
        "FLIP" => "FLIP: black is equal, yellow wholly different",
        _ => {
            "Where the first ray ended: blue in the traced region, red to yellow in the map, light blue in \
              the sky, magenta behind a surface of the map, grey without a ray"
        }
    }
}

/// What removes it, in a sentence.
fn advice(artifact: &Artifact) -> String {
    let remedy = |r: &Remedy| {
        let (setup, removed, time) = (escape(&r.setup), r.removed * 100.0, r.relative);
        format!(
            "<strong>{setup}</strong> removes {removed:.0} % of it and takes {time:.2} times as long"
        )
    };
    match (&artifact.best, &artifact.cheap) {
        (None, _) => "No other value of a single knob removes a tenth of it.".into(),
        (Some(best), None) => format!("{}.", remedy(best)),
        (Some(best), Some(cheap)) => {
            format!("{}; in little more time than the default, {}.", remedy(best), remedy(cheap))
        }
    }
}

/// What a knob does.
fn caption(family: &str) -> String {
    let text = match family {
        "region" => {
            "<code>region</code>: half the side of the traced cube around the camera, as a share of \
             the longest side of the scene; <em>all</em> traces everything."
        }
        "map" => "<code>map</code>: side of a face of the cube map in pixels.",
        "march" => {
            "<code>march</code>: samples at equal distances, every pixel, or every pixel with empty \
             space passed at once."
        }
        "n_min" => "<code>n_min</code>: fewest samples of a linear march through a face.",
        "n_max" => "<code>n_max</code>: most samples of a linear march through a face.",
        "rule" => "<code>rule</code>: what the number of samples between both follows from.",
        "layers" => "<code>layers</code> of the cube map: the second holds what the first hides.",
        "thickness" => {
            "<code>thickness</code>: factor on how far behind their fronts surfaces of the map are \
             met. Too much stretches reflections (III, figure 7), too little makes holes."
        }
        "still" => {
            "<code>still</code>: whether what stands still counts as without end behind its front."
        }
        "behind" => {
            "<code>behind</code>: what becomes of rays that pass behind the map's surfaces."
        }
        "look" => {
            "<code>look</code>: whether rays look through glass, blended and cut-out surfaces of \
             the map, to a second layer behind them."
        }
        "depth" => "<code>depth</code>: most reflections and refractions.",
        "shadows" => "<code>shadows</code>: by shadow maps, or by rays within the region.",
        other => return format!("<code>{}</code>.", escape(other)),
    };
    text.to_owned()
}
