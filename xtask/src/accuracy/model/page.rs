//! The report of the suite.

use super::{SceneStudy, Study, occlusion, sampling};
use crate::accuracy::scatter::{Dot, Look, plot};
use crate::report::page::{FOOT, add_table, failures, figure, head, picture_data, run_header};
use crate::report::table::{Best, Cell, Table, escape, grouped};
use crate::report::{pareto_front, slug, write_page};
use anyhow::Result;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Where no error stands on a logarithmic axis.
const NO_ERROR: (f64, &str) = (1e-4, "0");

const INTRODUCTION: &str = include_str!("introduction.html");

/// Writes `accuracy.html` and `csv/*.csv` into a folder that holds the pictures; returns the path
/// of the former.
pub(super) fn write(study: &Study, out: &Path) -> Result<PathBuf> {
    let mut html = head("What accuracy costs: frames that keep their time");
    let mut files = Vec::new();
    html.push_str(&run_header(&study.run, None));
    let simulated = if study.is_simulated {
        " Its times are no measurements; pictures are the processor's."
    } else {
        ""
    };
    let _ = writeln!(
        html,
        "<p>{} × {} pixels on <strong>{}</strong>.{simulated}</p>",
        study.width,
        study.height,
        escape(&study.device)
    );
    html.push_str(INTRODUCTION);
    failures(&mut html, &study.failures);
    for scene in &study.scenes {
        let triangles = grouped(scene.triangles as f64, 0);
        let _ = writeln!(html, "<h2>{}, {triangles} triangles</h2>", escape(&scene.scene));
        if let Some(measured) = &scene.sampling {
            add_sampling(&mut html, &mut files, scene, measured)?;
        }
        if let Some(measured) = &scene.occlusion {
            add_occlusion(&mut html, &mut files, scene, measured, out)?;
        }
    }
    html.push_str(FOOT);
    write_page(&html, files, out, "accuracy.html")
}

fn add_sampling(
    html: &mut String,
    files: &mut Vec<crate::report::page::Csv>,
    scene: &SceneStudy,
    measured: &sampling::Measured,
) -> Result<()> {
    html.push_str("<h3>Sampling</h3>\n");
    if let Some(fit) = &scene.fit {
        let _ = writeln!(html, "<p>{}.</p>", escape(&fit.line(&scene.scene)));
    }
    let [open, factor] = measured.every_pixel.map(|error| 100.0 * error);
    let _ = writeln!(
        html,
        "<p>{} frames of the camera path, each by three settings. By every pixel's workload the model errs by \
         {open:.1} %, after one factor by {factor:.1} %.</p>",
        measured.frames
    );
    if let Some(c) = measured.device_counts {
        let _ = writeln!(
            html,
            "<p>The device's own counts over those of sampling every pixel: {:.3} nodes and {:.3} triangles \
             of primary rays, {:.3} nodes and {:.3} triangles of the others.</p>",
            c.primary_nodes, c.primary_triangles, c.secondary_nodes, c.secondary_triangles
        );
    }
    let table = sampling_table(&scene.scene, measured);
    html.push_str("<div class=\"plots\">\n");
    let of_sampling = sampling_plot(scene, measured, "scatter of predictions, %", |p| p.scatter)?;
    let caption = "Processor time a frame against what sampling adds to the error of predictions.";
    figure(html, files, &of_sampling, caption, &table)?;
    let whole = sampling_plot(scene, measured, "error of predictions after one factor, %", |p| {
        p.one_factor
    })?;
    let caption = "The same against the error of predictions with one factor fitted to the path: where lines \
         stand upright, finer sampling buys nothing.";
    figure(html, files, &whole, caption, &table)?;
    html.push_str("</div>\n");
    add_table(html, files, &table)?;
    html.push_str(
        "<p>If threads of a warp wait for the one whose ray takes longest: errors after one factor by the share of \
         that divergence that costs time, 0 in the paper. Other parameters are as fitted, which favours the share \
         that was.</p>\n",
    );
    add_table(html, files, &divergence_table(&scene.scene, measured))
}

fn sampling_plot(
    scene: &SceneStudy,
    measured: &sampling::Measured,
    axis: &str,
    error: fn(&sampling::Point) -> f64,
) -> Result<String> {
    let labels: Vec<String> = measured
        .points
        .iter()
        .map(|p| format!("{}{}", if p.is_recommended { "→ " } else { "" }, p.label()))
        .collect();
    let costs: Vec<(f64, f64)> = measured.points.iter().map(|p| (error(p), p.frame_ms)).collect();
    let dots: Vec<Dot<'_>> = measured
        .points
        .iter()
        .zip(&labels)
        .zip(pareto_front(&costs))
        .map(|((p, label), on_front)| Dot {
            family: &p.family,
            label,
            x: 100.0 * error(p),
            y: p.frame_ms,
            on_front,
            named: on_front || p.is_default || p.is_recommended,
        })
        .collect();
    let look = Look { axes: (axis, "sampling, processor ms a frame"), least: None, loose: &[] };
    plot(&dots, &look, &format!("Processor time of sampling against error in {}", scene.scene))
}

fn add_occlusion(
    html: &mut String,
    files: &mut Vec<crate::report::page::Csv>,
    scene: &SceneStudy,
    measured: &occlusion::Measured,
    out: &Path,
) -> Result<()> {
    let frames: Vec<String> = measured.frames.iter().map(ToString::to_string).collect();
    let _ = writeln!(
        html,
        "<h3>Ambient occlusion and shadows</h3>\n<p>Frames {}.{}</p>",
        frames.join(", "),
        measured.rounding.map_or_else(String::new, |flip| format!(
            " At the default, device and processor differ by FLIP {flip:.5}: rounding."
        ))
    );
    let table = occlusion_table(&scene.scene, measured);
    html.push_str("<div class=\"plots\">\n");
    for (axis, caption, error) in [
        (
            "mean FLIP",
            "Time of a frame against its error.",
            (|p| p.flip) as fn(&occlusion::Point) -> f64,
        ),
        (
            "mean FLIP of noise",
            "The same against the noise alone, by each setting's own radius and shadows.",
            |p| p.noise,
        ),
    ] {
        let labels: Vec<String> = measured.points.iter().map(occlusion::Point::label).collect();
        let costs: Vec<(f64, f64)> = measured.points.iter().map(|p| (error(p), p.ms)).collect();
        let dots: Vec<Dot<'_>> = measured
            .points
            .iter()
            .zip(&labels)
            .zip(pareto_front(&costs))
            .map(|((p, label), on_front)| Dot {
                family: p.knob,
                label,
                x: error(p),
                y: p.ms,
                on_front,
                named: !p.is_default || p.knob == "directions",
            })
            .collect();
        let look = Look { axes: (axis, "frame, ms"), least: Some(NO_ERROR), loose: &[] };
        let description = format!("Time of a frame of {} against its error", scene.scene);
        figure(html, files, &plot(&dots, &look, &description)?, caption, &table)?;
    }
    html.push_str("</div>\n");
    add_table(html, files, &table)?;
    let (frame, [x, y, width, height]) = measured.worst;
    let _ = writeln!(
        html,
        "<h3>Where the default is worst</h3>\n<p>Frame {frame}, the {width} × {height} pixels at ({x}, {y}).</p>\n\
         <div class=\"crops\">"
    );
    for (what, file) in &measured.pictures {
        let _ = writeln!(
            html,
            "<figure><img alt=\"{0}\" src=\"{1}\"><figcaption>{0}</figcaption></figure>",
            escape(what),
            picture_data(&out.join(file))?
        );
    }
    html.push_str("</div>\n");
    Ok(())
}

/// All ways of sampling.
pub(super) fn sampling_table(scene: &str, measured: &sampling::Measured) -> Table {
    let mut table = Table::new(format!("model-sampling-{}", slug(scene)))
        .column("pattern", Best::Neither)
        .column("samples", Best::Neither)
        .column("", Best::Neither)
        .column_with_digits("sampling\nms", Best::Low, 3)
        .column_with_digits("a frame\nms", Best::Low, 3)
        .column_with_digits("open loop\n%", Best::Low, 1)
        .column_with_digits("one factor\n%", Best::Low, 2)
        .column_with_digits("bias\n%", Best::Neither, 2)
        .column_with_digits("scatter\n%", Best::Low, 2);
    for name in ["p_t", "p_i", "t_v", "a_t", "a_w·t_v", "m", "s_t"] {
        table = table.column_with_digits(format!("{name}\n%"), Best::Low, 1);
    }
    for p in &measured.points {
        let marks = [(p.is_default, "*"), (p.is_recommended, "→")];
        let marks: String = marks.into_iter().filter(|(is, _)| *is).map(|(_, mark)| mark).collect();
        let [width, height] = p.size;
        let c = p.counters;
        let mut row: Vec<Cell> = vec![
            p.family.clone().into(),
            format!("{width}×{height}").into(),
            marks.into(),
            p.sampling_ms.into(),
            p.frame_ms.into(),
        ];
        let shares = [p.open_loop, p.one_factor, p.bias, p.scatter];
        let counters = [c.p_t, c.p_i, c.t_v, c.a_t, c.a_w, c.m, c.s_t];
        row.extend(shares.into_iter().chain(counters).map(|share| Cell::from(100.0 * share)));
        table.push(row);
    }
    table
}

/// What divergence is worth in the model.
pub(super) fn divergence_table(scene: &str, measured: &sampling::Measured) -> Table {
    let mut table = Table::new(format!("model-divergence-{}", slug(scene)))
        .column_with_digits("share of\ndivergence", Best::Neither, 1)
        .column_with_digits("every pixel\n%", Best::Low, 2)
        .column_with_digits("default\n%", Best::Low, 2)
        .column_with_digits("blocks\n%", Best::Low, 2);
    for d in &measured.divergences {
        let errors = [d.every_pixel, d.default, d.blocks].map(|error| Cell::from(100.0 * error));
        table.push([vec![d.share.into()], errors.to_vec()].concat());
    }
    table
}

/// All settings of ambient occlusion and shadows.
pub(super) fn occlusion_table(scene: &str, measured: &occlusion::Measured) -> Table {
    let mut table = Table::new(format!("model-occlusion-{}", slug(scene)))
        .column("knob", Best::Neither)
        .column("setting", Best::Neither)
        .column("", Best::Neither)
        .column_with_digits("FLIP", Best::Low, 4)
        .column_with_digits("noise", Best::Low, 4)
        .column_with_digits("PSNR\ndB", Best::High, 1)
        .column_with_digits("worst\ntile", Best::Low, 3)
        .column_with_digits("frame\nms", Best::Low, 2)
        .column_with_digits("÷ default", Best::Low, 2);
    for p in &measured.points {
        table.push(vec![
            p.knob.into(),
            p.value.clone().into(),
            if p.is_default { "*" } else { "" }.into(),
            p.flip.into(),
            p.noise.into(),
            p.psnr.into(),
            p.tile.into(),
            p.ms.into(),
            p.relative.into(),
        ]);
    }
    table
}
