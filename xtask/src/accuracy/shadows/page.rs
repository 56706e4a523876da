//! The report of the suite.

use super::{Point, SceneStudy, Study};
use crate::accuracy::scatter::{Dot, Look, plot};
use crate::report::page::{FOOT, add_table, failures, figure, head, picture_data, run_header};
use crate::report::table::{Best, Cell, Table, escape, grouped};
use crate::report::{slug, write_page};
use anyhow::Result;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Where no error stands on a logarithmic axis.
const NO_ERROR: (f64, &str) = (1e-5, "0");

const INTRODUCTION: &str = include_str!("introduction.html");

/// Writes `accuracy.html` and `csv/*.csv` into a folder that holds the pictures; returns the path
/// of the former.
pub(super) fn write(study: &Study, out: &Path) -> Result<PathBuf> {
    let mut html = head("What accuracy costs: shadows");
    let mut files = Vec::new();
    html.push_str(&run_header(&study.run, None));
    let clock = if study.device_times {
        "its own clock"
    } else {
        "the host's clock, as the device has none"
    };
    let _ = writeln!(
        html,
        "<p>{} × {} pixels, frames: {}, lights: {}, on <strong>{}</strong>, timed by {clock}.</p>",
        study.width,
        study.height,
        study.frames,
        study.lights,
        escape(&study.device)
    );
    let meter = study.meter.as_deref().unwrap_or("none, so there are times alone");
    let _ = writeln!(
        html,
        "<p>Meter: {}. {}</p>",
        escape(meter),
        escape(&study.meter_notes.join("; "))
    );
    html.push_str(INTRODUCTION);
    failures(&mut html, &study.failures);
    for scene in &study.scenes {
        let triangles = grouped(scene.triangles as f64, 0);
        let _ = writeln!(html, "<h2>{}, {triangles} triangles</h2>", escape(&scene.scene));
        let table = table(scene);
        html.push_str("<div class=\"plots\">\n");
        let caption = "Time of a frame against the error of its shadows.";
        figure(&mut html, &mut files, &scatter(scene, |p| p.ms, "frame, ms")?, caption, &table)?;
        let caption = "Time of the passes for shadowed lights alone.";
        let svg = scatter(scene, |p| p.shadow_ms, "shadows and lights, ms")?;
        figure(&mut html, &mut files, &svg, caption, &table)?;
        if scene.points.iter().all(|p| p.nj_per_pixel.is_some()) {
            let caption = "Energy of a pixel along the camera path.";
            let nj = |p: &Point| p.nj_per_pixel.unwrap_or(f64::NAN);
            let svg = scatter(scene, nj, "energy, nJ/pixel")?;
            figure(&mut html, &mut files, &svg, caption, &table)?;
        }
        html.push_str("</div>\n<div class=\"plots\">\n");
        for (what, file) in &scene.pictures {
            let _ = writeln!(
                html,
                "<figure><img alt=\"{0}\" src=\"{1}\"><figcaption>{0}</figcaption></figure>",
                escape(what),
                picture_data(&out.join(file))?
            );
        }
        html.push_str("</div>\n");
        add_table(&mut html, &mut files, &table)?;
    }
    html.push_str(FOOT);
    write_page(&html, files, out, "accuracy.html")
}

fn family(point: &Point) -> String {
    if point.knob.is_empty() {
        point.algorithm.clone()
    } else {
        format!("{} {}", point.algorithm, point.knob)
    }
}

fn scatter(scene: &SceneStudy, time: fn(&Point) -> f64, axis: &str) -> Result<String> {
    let names: Vec<(String, String)> = scene
        .points
        .iter()
        .map(|p| (family(p), format!("{} {}", p.algorithm, p.value).trim_end().to_owned()))
        .collect();
    let dots: Vec<Dot<'_>> = scene
        .points
        .iter()
        .zip(&names)
        .map(|(p, (family, label))| Dot {
            family,
            label,
            x: p.mean,
            y: time(p),
            on_front: p.on_front,
            named: p.on_front,
        })
        .collect();
    let axes = ("mean error of the share of light", axis);
    let look = Look { axes, least: Some(NO_ERROR), loose: &["SM bias", "VSM bias"] };
    plot(&dots, &look, &format!("Time against error of shadows in {}", scene.scene))
}

/// All points of a scene.
pub(super) fn table(scene: &SceneStudy) -> Table {
    let mut table = Table::new(format!("shadows-{}", slug(&scene.scene)))
        .column("algorithm", Best::Neither)
        .column("knob", Best::Neither)
        .column("setting", Best::Neither)
        .column("map\nside", Best::Neither)
        .column_with_digits("mean\nerror %", Best::Low, 3)
        .column_with_digits("leaked\n%", Best::Low, 3)
        .column_with_digits("lost\n%", Best::Low, 3)
        .column("wrong\npixels", Best::Low)
        .column("wrong at\nsilhouettes", Best::Low)
        .column("silhouette\npixels", Best::Neither)
        .column("facing\npixels", Best::Neither)
        .column_with_digits("frame\nms", Best::Low, 2)
        .column_with_digits("shadows\nms", Best::Low, 2);
    let has_energy = scene.points.iter().any(|p| p.nj_per_pixel.is_some());
    if has_energy {
        table = table
            .column_with_digits("nJ/pixel", Best::Low, 1)
            .column_with_digits("± 95 %", Best::Neither, 2)
            .column_with_digits("mean W", Best::Neither, 2);
    }
    for p in &scene.points {
        let mut row = vec![
            p.algorithm.clone().into(),
            p.knob.clone().into(),
            p.value.clone().into(),
            (p.resolution > 0).then_some(p.resolution as usize).into(),
            (100.0 * p.mean).into(),
            (100.0 * p.leaked).into(),
            (100.0 * p.lost).into(),
            p.error.wrong_elsewhere.into(),
            p.error.wrong_at_silhouettes.into(),
            p.error.silhouettes.into(),
            p.error.facing().into(),
            p.ms.into(),
            p.shadow_ms.into(),
        ];
        if has_energy {
            row.extend([p.nj_per_pixel, p.nj_half_width, p.mean_w].map(Cell::from));
        }
        table.push(row);
    }
    table
}
