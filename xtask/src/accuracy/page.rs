//! The report: plots of all points, and the tables.

use super::analysis::{MODEL_TABLE, Point, Study};
use crate::report::axis::LogAxis;
use crate::report::canvas::{Area, FAINT, INK, SIZE, chart, draw, failed, text};
use crate::report::page::{FOOT, add_table, failures, figure, head, run_header};
use crate::report::table::{Best, Table, escape};
use crate::report::{Frame, place_labels, ray_counts, write_page};
use anyhow::Result;
use niwaki_presets::{CostModel, Preset};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Colours of families, in the order in which they first appear; they repeat with another marker.
const COLOURS: [RGBColor; 10] = [
    RGBColor(62, 122, 230),
    RGBColor(214, 125, 20),
    RGBColor(20, 150, 100),
    RGBColor(196, 68, 60),
    RGBColor(160, 84, 200),
    RGBColor(150, 110, 80),
    RGBColor(210, 90, 160),
    RGBColor(110, 140, 60),
    RGBColor(16, 158, 178),
    RGBColor(120, 128, 138),
];

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

fn families<'a>(points: &[&'a Point]) -> Vec<&'a str> {
    let mut names: Vec<&str> = Vec::new();
    for point in points {
        if !names.contains(&point.family.as_str()) {
            names.push(&point.family);
        }
    }
    names
}

/// A marker whose shape and colour tell the family.
fn marker(area: &Area<'_>, at: (i32, i32), family: usize, size: i32) -> Result<()> {
    let colour = COLOURS[family % COLOURS.len()];
    match family / COLOURS.len() {
        0 => area.draw(&Circle::new(at, size, colour.filled())),
        1 => area.draw(&TriangleMarker::new(at, size + 2, colour.filled())),
        _ => area.draw(&Cross::new(at, size, colour.stroke_width(2))),
    }
    .map_err(failed)
}

/// The names of families with their markers, in columns at the right.
fn legend(area: &Area<'_>, families: &[&str]) -> Result<()> {
    #[expect(clippy::cast_possible_wrap, reason = "pixels")]
    let x = SIZE.0 as i32 - LEGEND as i32 + 14;
    for (i, family) in families.iter().enumerate() {
        #[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "few")]
        let y = 18 + 18 * i as i32;
        marker(area, (x, y), i, 4)?;
        let style = text(12.0, INK);
        area.draw(&Text::new((*family).to_owned(), (x + 10, y - 7), style)).map_err(failed)?;
    }
    Ok(())
}

/// Width that the legend takes.
const LEGEND: u32 = 134;

/// A plot of points by two quantities, with a line through those of each family.
fn plot(
    points: &[(&Point, f64, f64)],
    labels: (&str, &str),
    description: &str,
    with_front: bool,
) -> Result<String> {
    let all: Vec<&Point> = points.iter().map(|(p, ..)| *p).collect();
    let families = families(&all);
    draw(description, |area| {
        let x = LogAxis::around(points.iter().map(|p| p.1), 0.05);
        let y = LogAxis::around(points.iter().map(|p| p.2), 0.05);
        let mut chart = chart(area, (x, y), labels, LEGEND)?;
        for (i, family) in families.iter().enumerate() {
            let colour = COLOURS[i % COLOURS.len()].mix(0.5);
            let line = points.iter().filter(|(p, ..)| p.family == *family).map(|p| (p.1, p.2));
            chart.draw_series(LineSeries::new(line, colour)).map_err(failed)?;
        }
        if with_front {
            let mut front: Vec<(f64, f64)> =
                points.iter().filter(|(p, ..)| p.on_front).map(|p| (p.1, p.2)).collect();
            front.sort_by(|a, b| a.0.total_cmp(&b.0));
            let line = DashedLineSeries::new(front, 4, 4, FAINT.stroke_width(1));
            chart.draw_series(line).map_err(failed)?;
        }
        let mut ringed = Vec::new();
        for (point, x, y) in points {
            let at = chart.backend_coord(&(*x, *y));
            let family = families.iter().position(|f| *f == point.family).unwrap_or_default();
            marker(area, at, family, 3)?;
            if with_front && point.on_front {
                area.draw(&Circle::new(at, 6, INK.stroke_width(1))).map_err(failed)?;
                ringed.push(((f64::from(at.0), f64::from(at.1)), point.label.clone()));
            }
        }
        let (ringed, names): (Vec<_>, Vec<_>) = ringed.into_iter().unzip();
        let page =
            Frame { x: (72.0, f64::from(SIZE.0 - LEGEND)), y: (6.0, f64::from(SIZE.1) - 56.0) };
        for ((x, y), name) in place_labels(&ringed, &names, 11.0, page).into_iter().zip(names) {
            let style = text(11.0, INK).pos(Pos::new(HPos::Center, VPos::Center));
            #[expect(clippy::cast_possible_truncation, reason = "pixels")]
            let at = (x as i32, y as i32);
            area.draw(&Text::new(name, at, style)).map_err(failed)?;
        }
        legend(area, &families)
    })
}

fn scatter(points: &[&Point]) -> Result<String> {
    let points: Vec<_> = points.iter().map(|p| (*p, p.once_ms, p.ray_ns)).collect();
    let labels = ("mesh to traversable tree, ms", "time per ray, ns");
    plot(&points, labels, "Build time against time per ray", true)
}

fn metric_plot(points: &[&Point], name: &str, value: Metric) -> Result<String> {
    let points: Vec<_> = points
        .iter()
        .filter_map(|p| Some((*p, value(p).filter(|x| *x > 0.0)?, p.ray_ns)))
        .collect();
    let description = format!("{name} against time per ray");
    plot(&points, (name, "time per ray, ns"), &description, false)
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
            chart.draw_series(LineSeries::new(line, COLOURS[i].mix(0.6))).map_err(failed)?;
        }
        for (i, x, y) in &points {
            marker(area, chart.backend_coord(&(*x, *y)), *i, 3)?;
        }
        legend(area, &names)
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
        legend(area, &names)
    })?;
    Ok((svg, data))
}
