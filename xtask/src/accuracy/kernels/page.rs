//! The report of the suite.

use super::study::{Row, Study, Summary};
use crate::accuracy::scatter::{Dot, Look, plot};
use crate::report::page::{FOOT, add_table, failures, figure, head, run_header};
use crate::report::table::escape;
use crate::report::{pareto_front, write_page};
use anyhow::Result;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Where no leak stands on a logarithmic axis.
const NO_LEAK: (f64, &str) = (0.1, "0");
/// Where errors stand that are too small for `f32`, so that those of its kernels can be told apart.
const NO_ERROR: (f64, &str) = (1e-9, "less");

const INTRODUCTION: &str = include_str!("introduction.html");

/// Writes `accuracy.html` and `csv/*.csv` into a folder; returns the path of the former.
pub(super) fn write(study: &Study, out: &Path) -> Result<PathBuf> {
    let mut html = head("What accuracy costs: kernels");
    let mut files = Vec::new();
    html.push_str(&run_header(&study.run, None));
    html.push_str(INTRODUCTION);
    failures(&mut html, &study.failures);
    let scenes = study.scenes();
    for (i, (title, table)) in study.tables().iter().enumerate() {
        let _ = writeln!(html, "<h2>{}</h2>", escape(title));
        if i == 0 {
            html.push_str("<div class=\"plots\">\n");
            for rays in study.ray_sets() {
                let caption = format!("{rays} rays: time against leaks.");
                figure(&mut html, &mut files, &leak_plot(study, rays)?, &caption, table)?;
                let caption = format!("{rays} rays: time against the error of distances.");
                figure(&mut html, &mut files, &mean_plot(study, rays)?, &caption, table)?;
            }
            html.push_str("</div>\n");
        } else if let Some(scene) = scenes.iter().find(|scene| *scene == title) {
            html.push_str("<div class=\"plots\">\n");
            for rays in study.ray_sets() {
                let of = |row: &&Row| row.scene == *scene && row.rays == rays;
                let rows: Vec<&Row> = study.rows.iter().filter(of).collect();
                if !rows.is_empty() {
                    let caption = format!("{rays} rays: time against the error of distances.");
                    figure(&mut html, &mut files, &scene_plot(&rows)?, &caption, table)?;
                }
            }
            html.push_str("</div>\n");
        }
        add_table(&mut html, &mut files, table)?;
    }
    html.push_str(FOOT);
    write_page(&html, files, out, "accuracy.html")
}

/// Points with the front marked.
fn dots<'a>(points: &[(&'a str, &'a str, f64, f64)]) -> Vec<Dot<'a>> {
    let costs: Vec<(f64, f64)> = points.iter().map(|p| (p.2, p.3)).collect();
    let dot = |((family, label, x, y), on_front): ((&'a str, &'a str, f64, f64), bool)| Dot {
        family,
        label,
        x,
        y,
        on_front,
        named: true,
    };
    points.iter().copied().zip(pareto_front(&costs)).map(dot).collect()
}

fn look(axes: (&'static str, &'static str), least: (f64, &'static str)) -> Look<'static> {
    Look { axes, least: Some(least), loose: &[] }
}

fn time_of(summary: &Summary, rays: &str) -> Option<f64> {
    summary.sets.iter().find(|set| set.rays == rays)?.time
}

fn leak_plot(study: &Study, rays: &str) -> Result<String> {
    let point = |s: &'_ Summary| Some((s.leaks_per_million?, time_of(s, rays)?));
    let points: Vec<_> = study
        .summaries
        .iter()
        .filter_map(|s| point(s).map(|(x, y)| (s.family.as_str(), s.kernel.as_str(), x, y)))
        .collect();
    let axes = ("leaks in a million rays", "time per ray, relative");
    plot(&dots(&points), &look(axes, NO_LEAK), &format!("Time of {rays} rays against leaks"))
}

fn mean_plot(study: &Study, rays: &str) -> Result<String> {
    let point = |s: &'_ Summary| {
        let set = s.sets.iter().find(|set| set.rays == rays)?;
        Some((set.t_p99?, set.time?))
    };
    let points: Vec<_> = study
        .summaries
        .iter()
        .filter_map(|s| point(s).map(|(x, y)| (s.family.as_str(), s.kernel.as_str(), x, y)))
        .collect();
    let axes = ("relative error of t, 99th percentile", "time per ray, relative");
    plot(&dots(&points), &look(axes, NO_ERROR), &format!("Time of {rays} rays against error"))
}

fn scene_plot(rows: &[&Row]) -> Result<String> {
    let points: Vec<_> = rows
        .iter()
        .filter_map(|r| Some((r.family.as_str(), r.kernel.as_str(), r.t_p99?, r.ns)))
        .collect();
    let axes = ("relative error of t, 99th percentile", "time per ray, ns");
    plot(&dots(&points), &look(axes, NO_ERROR), "Time of rays against the error of distances")
}
