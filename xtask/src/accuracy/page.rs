//! The report: plots of all points, and the tables.

use super::analysis::{MODEL_TABLE, Point, Study};
use super::scatter::{Dot, Look, plot};
use crate::report::axis::LogAxis;
use crate::report::canvas::{LEGEND, PALETTE, chart, draw, failed, legend, marker};
use crate::report::page::{FOOT, add_table, failures, figure, head, run_header};
use crate::report::table::{Best, Table, escape};
use crate::report::{ray_counts, write_page};
use anyhow::Result;
use niwaki_presets::{CostModel, Preset};
use plotters::prelude::*;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Writes `accuracy.html` and `csv/*.csv` into a folder; returns the path of the former.
pub(crate) fn write(study: &Study, out: &Path) -> Result<PathBuf> {
    let mut html = head("What accuracy costs: builders");
    let mut files = Vec::new();
    html.push_str(&run_header(&study.run, None));
    html.push_str(
        "<p>Each point is a tree of one builder with one setting of its knobs. To the left: faster \
         to build; further down: faster to trace. A line joins the settings of one knob. Trees \
         that no other beats in both times are ringed, and the dashed line, the Pareto front, \
         joins them. Times per ray are the mean of camera and bounce rays under one kernel.</p>\n",
    );
    let tables = study.tables();
    for (title, table) in &tables {
        let title = title.trim();
        let _ = writeln!(html, "<h2>{}</h2>", escape(title));
        if let Some(scene) = study.scenes().find(|scene| *scene == title) {
            let points: Vec<&Point> = study.of_scene(scene).collect();
            html.push_str("<div class=\"plots\">\n");
            let svg = scatter(&points)?;
            figure(&mut html, &mut files, &svg, "Build time against time per ray.", table)?;
            for (metric, value) in METRICS {
                let svg = metric_plot(&points, metric, value)?;
                let caption = format!("{metric} against time per ray.");
                figure(&mut html, &mut files, &svg, &caption, table)?;
            }
            html.push_str("</div>\n");
        }
        if table.name == MODEL_TABLE
            && let Some(Ok(model)) = &study.model
        {
            html.push_str(
                "<p>Lines in log₂ n, by least squares of the relative error, of the build time a \
                 triangle and the time a ray; see <code>CostModel::fit</code>.</p>\n",
            );
            html.push_str("<div class=\"plots\">\n");
            let (svg, data) = fit_plot(study, model)?;
            let caption = "Build times a triangle: measured (points) and fitted (lines).";
            figure(&mut html, &mut files, &svg, caption, &data)?;
            let (svg, data) = choice_plot(model)?;
            let caption = "Which preset has the least build + trace time, by triangles and rays.";
            figure(&mut html, &mut files, &svg, caption, &data)?;
            html.push_str("</div>\n");
        }
        add_table(&mut html, &mut files, table)?;
    }
    failures(&mut html, &study.failures);
    html.push_str(FOOT);
    write_page(&html, files, out, "accuracy.html")
}

/// A metric of a tree.
type Metric = fn(&Point) -> Option<f64>;

const METRICS: [(&str, Metric); 3] = [("SAH", |p| p.sah), ("EPO", |p| p.epo), ("LCV", |p| p.lcv)];

fn dot(point: &Point, x: f64, on_front: bool) -> Dot<'_> {
    Dot {
        family: &point.family,
        label: &point.label,
        x,
        y: point.ray_ns,
        on_front,
        named: on_front,
    }
}

fn scatter(points: &[&Point]) -> Result<String> {
    let dots: Vec<_> = points.iter().map(|p| dot(p, p.once_ms, p.on_front)).collect();
    let axes = ("mesh to traversable tree, ms", "time per ray, ns");
    plot(&dots, &Look { axes, least: None, loose: &[] }, "Build time against time per ray")
}

fn metric_plot(points: &[&Point], name: &str, value: Metric) -> Result<String> {
    let dots: Vec<_> =
        points.iter().filter_map(|p| Some(dot(p, value(p).filter(|x| *x > 0.0)?, false))).collect();
    let look = Look { axes: (name, "time per ray, ns"), least: None, loose: &[] };
    plot(&dots, &look, &format!("{name} against time per ray"))
}

/// Build times a triangle by preset: measured and fitted.
fn fit_plot(study: &Study, model: &CostModel) -> Result<(String, Table)> {
    let mut data = Table::new("cost-model-fit")
        .column("preset", Best::Neither)
        .column("scene", Best::Neither)
        .column("triangles", Best::Neither)
        .column("measured ns/triangle", Best::Neither)
        .column("fitted ns/triangle", Best::Neither);
    let mut points = Vec::new();
    for (i, preset) in Preset::ALL.into_iter().enumerate() {
        for p in study.points.iter().filter(|p| p.label == preset.name()) {
            let n = p.triangles as f64;
            let fitted = model.build_ms(preset, p.triangles) * 1e6 / n;
            points.push((i, n, p.once_ms * 1e6 / n));
            data.push(vec![
                preset.name().into(),
                p.scene.clone().into(),
                p.triangles.into(),
                (p.once_ms * 1e6 / n).into(),
                fitted.into(),
            ]);
        }
    }
    let names = Preset::ALL.map(Preset::name);
    let svg = draw("Build times a triangle, measured and fitted", |area| {
        let x = LogAxis::around(points.iter().map(|p| p.1), 0.05);
        let y = LogAxis::around(points.iter().map(|p| p.2), 0.05);
        let range =
            points.iter().fold((f64::INFINITY, 0.0_f64), |r, p| (r.0.min(p.1), r.1.max(p.1)));
        let mut chart = chart(area, (x, y), ("triangles", "build, ns a triangle"), LEGEND)?;
        for (i, preset) in Preset::ALL.into_iter().enumerate() {
            let line = ray_counts(range, 50).map(|n| {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a count"
                )]
                let count = n as usize;
                (n, (model.build_ms(preset, count) * 1e6 / n).max(1e-3))
            });
            chart.draw_series(LineSeries::new(line, PALETTE[i].mix(0.6))).map_err(failed)?;
        }
        for (i, x, y) in &points {
            marker(area, chart.backend_coord(&(*x, *y)), *i, 3)?;
        }
        legend(area, names.into_iter().enumerate())
    })?;
    Ok((svg, data))
}

/// Where each preset is chosen.
fn choice_plot(model: &CostModel) -> Result<(String, Table)> {
    let (triangles, rays) = ((1e3, 1e8), (1e3, 1e12));
    let mut data = Table::new("cost-model-choice")
        .column("triangles", Best::Neither)
        .column("rays", Best::Neither)
        .column("preset", Best::Neither);
    let names = Preset::ALL.map(Preset::name);
    let svg = draw("The preset chosen, by triangles and rays", |area| {
        let axes = (LogAxis::exactly(triangles.0..triangles.1), LogAxis::exactly(rays.0..rays.1));
        let chart = chart(area, axes, ("triangles", "rays"), LEGEND)?;
        for x in ray_counts(triangles, 40) {
            for y in ray_counts(rays, 50) {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "counts"
                )]
                let (n, r) = (x as usize, y as u64);
                let preset = model.best(r, n);
                marker(area, chart.backend_coord(&(x, y)), preset as usize, 3)?;
                data.push(vec![n.into(), y.round().into(), preset.name().into()]);
            }
        }
        legend(area, names.into_iter().enumerate())
    })?;
    Ok((svg, data))
}
