//! `tune.json`, `tune.html` and `csv/*.csv`.

use super::args::Renderer;
use super::fit::Fit;
use super::plots::{Curve, frames};
use super::rows::{Flight, Study, Tour};
use crate::report::page::{self, FOOT, add_table, figure, head, run_header};
use crate::report::table::{Best, Table, escape};
use crate::report::write_page;
use anyhow::Result;
use niwaki_frame_control::RenderSettings;
use std::fmt::Write as _;
use std::path::Path;

const HOW_TO_READ: &str = "<h2>How to read</h2>\n<ul>\n\
    <li><em>model error</em>: mean of |model − measured| / measured, the paper's; <em>corrected</em>: \
    the same of the time that the controller expected; <em>as measured</em>: the model error without the \
    fit to frames, by what micro-benchmarks measured. <em>on target</em>: frames within 5 % of it. \
    Controllers learn in the first ten frames, which do not count.</li>\n\
    <li><em>rung</em>: the mean place on the ladder, the quality that was delivered; <em>turned back</em>: \
    frames whose quality went up after down or down after up.</li>\n\
    <li>τ: Kendall's rank correlation of predicted and measured times over the rungs of the ladder in \
    one view: 1 if the model orders all settings as the device does.</li>\n\
    <li>Simulated devices draw the same frames by a law of their own (caches, divergence, tails, \
    overhead, heat, noise), of which the model knows nothing; their times are no measurements.</li>\n</ul>\n";

/// Writes everything into a folder.
pub(super) fn save(study: &Study, out: &Path) -> Result<()> {
    let mut html = head("Frames that keep their time");
    let mut files = Vec::new();
    html.push_str(&run_header(&study.run, None));
    page::failures(&mut html, &study.failures);
    for (number, tour) in study.tours.iter().enumerate() {
        add_tour(&mut html, &mut files, tour, number)?;
    }
    html.push_str(HOW_TO_READ);
    html.push_str(FOOT);
    write_page(&html, files, out, "tune.html")?;
    let path = out.join("tune.json");
    crate::results::write_json(&path, study)
}

fn add_tour(
    html: &mut String,
    files: &mut Vec<(String, String)>,
    tour: &Tour,
    number: usize,
) -> Result<()> {
    let _ = writeln!(html, "<h2>{}</h2>", escape(&tour.title()));
    let simulated = if tour.is_simulated { " The device is simulated." } else { "" };
    let _ = writeln!(
        html,
        "<p>{} triangles, a tree {} levels deep, {}×{} pixels, {:.2} ms wanted. The model's device: {}. \
         Sampling a view took {:.2} ms, a prediction {:.2} µs.{simulated}</p>",
        tour.triangles,
        tour.depth,
        tour.width,
        tour.height,
        tour.target_ms,
        escape(&tour.model),
        tour.sampling_ms,
        tour.prediction_us,
    );
    if let Some(noise) = tour.noise() {
        let _ = writeln!(
            html,
            "<p>The first frame, drawn again beside every frame with the settings that were chosen by hand, is off its \
             median by {:.1} % on average: as much is off for no fault of a controller.</p>",
            100.0 * noise
        );
    }
    add_table(html, files, &summary(tour, number))?;
    if let Some(fit) = &tour.fit {
        let _ = writeln!(html, "<p>{}</p>", escape(&fit.line(&tour.scene)));
        add_table(html, files, &parameters(fit, number))?;
    }
    let data = records(tour, number);
    let best = ["both", "feedforward", "feedback", "regression", "none"];
    let shown = best.iter().find_map(|name| tour.flights.iter().find(|f| f.controller == *name));
    if let Some(flight) = shown {
        let of =
            |value: fn(&niwaki_frame_control::FrameRecord) -> Option<f64>| -> Vec<Option<f64>> {
                flight.records.iter().map(value).collect()
            };
        let curves = [
            Curve { name: "measured", values: of(|r| Some(r.measured_ms)) },
            Curve { name: "model", values: of(|r| r.model_ms) },
            Curve { name: "corrected", values: of(|r| r.predicted_ms) },
        ];
        let svg =
            frames(&curves, "milliseconds", (Some(tour.target_ms), f64::INFINITY), "Frame times")?;
        let caption = format!(
            "Frame times under <em>{}</em>: measured, by the model, and by the model as corrected; \
             dashed the target (after Figure 5 of the paper).",
            flight.controller
        );
        figure(html, files, &svg, &caption, &data)?;
    }
    let (quality, what, caption): (fn(&RenderSettings, usize) -> f64, _, _) = match tour.renderer {
        Renderer::Tracer => (
            |s, _| f64::from(s.ao_rays),
            "directions of ambient occlusion",
            "Directions of ambient occlusion that each controller chose (Figure 8, top).",
        ),
        Renderer::Hybrid => (
            |_, rung| rung as f64,
            "rung of the ladder",
            "The rung that each controller chose; what the rungs are is in the table of rungs.",
        ),
    };
    let chosen = |flight: &Flight| -> Vec<Option<f64>> {
        let of = |rung: usize| tour.rungs.get(rung).map(|s| quality(s, rung));
        flight.records.iter().map(|r| of(r.rung)).collect()
    };
    let curves: Vec<Curve<'_>> = tour
        .flights
        .iter()
        .map(|flight| Curve { name: &flight.controller, values: chosen(flight) })
        .collect();
    let svg = frames(&curves, what, (None, f64::INFINITY), "Quality")?;
    figure(html, files, &svg, caption, &data)?;
    if tour.renderer == Renderer::Hybrid {
        add_table(html, files, &rungs(tour, number))?;
    }
    let off = |flight: &Flight| -> Vec<Option<f64>> {
        flight.records.iter().map(|r| Some(100.0 * r.off_target().abs())).collect()
    };
    let curves: Vec<Curve<'_>> = tour
        .flights
        .iter()
        .map(|flight| Curve { name: &flight.controller, values: off(flight) })
        .collect();
    let svg = frames(&curves, "% off the target", (Some(5.0), 50.0), "Distance from the target")?;
    let caption = "How far frames are from the target, 50 % and more at the upper edge (after Figure 8, below); \
         dashed 5 %.";
    figure(html, files, &svg, caption, &data)?;
    if !tour.ranks.is_empty() {
        add_table(html, files, &ranks(tour, number))?;
    }
    Ok(())
}

/// A row a controller.
pub(super) fn summary(tour: &Tour, number: usize) -> Table {
    let mut table = Table::new(format!("tune-{number}"))
        .column("controller", Best::Neither)
        .column_with_digits("as measured\n%", Best::Low, 1)
        .column_with_digits("model error\n%", Best::Low, 1)
        .column_with_digits("corrected\n%", Best::Low, 1)
        .column_with_digits("off target\n%", Best::Low, 1)
        .column_with_digits("on target\n%", Best::High, 1)
        .column_with_digits("worst\n%", Best::Low, 1)
        .column_with_digits("off after\na turn", Best::Low, 0)
        .column_with_digits("rung", Best::Neither, 1)
        .column_with_digits("turned\nback", Best::Low, 0);
    for flight in &tour.flights {
        let s = flight.summary;
        let percent = |x: Option<f64>| x.map(|x| 100.0 * x);
        table.push(vec![
            flight.controller.as_str().into(),
            percent(flight.unfitted_error).into(),
            percent(s.and_then(|s| s.model_error)).into(),
            percent(s.and_then(|s| s.corrected_error)).into(),
            percent(s.map(|s| s.target_error)).into(),
            percent(s.map(|s| s.on_target)).into(),
            percent(s.map(|s| s.worst)).into(),
            flight.off_after_turn.into(),
            s.map(|s| s.mean_rung).into(),
            s.map(|s| s.flicker).into(),
        ]);
    }
    table
}

/// A row a parameter.
pub(super) fn parameters(fit: &Fit, number: usize) -> Table {
    let mut table = Table::new(format!("tune-{number}-fit"))
        .column("parameter", Best::Neither)
        .column("measured", Best::Neither)
        .column("fitted", Best::Neither);
    for row in &fit.parameters {
        let fitted = row.is_fitted.then_some(row.fitted);
        table.push(vec![row.parameter.as_str().into(), row.measured.into(), fitted.into()]);
    }
    table
}

/// A row a view.
pub(super) fn ranks(tour: &Tour, number: usize) -> Table {
    let mut table = Table::new(format!("tune-{number}-ranks"))
        .column_with_digits("frame", Best::Neither, 0)
        .column_with_digits("settings", Best::Neither, 0)
        .column_with_digits("τ", Best::High, 3);
    for rank in &tour.ranks {
        table.push(vec![(rank.frame as usize).into(), rank.rungs.len().into(), rank.tau.into()]);
    }
    table
}

/// A row a rung, and how often each was drawn.
fn rungs(tour: &Tour, number: usize) -> Table {
    let mut table = Table::new(format!("tune-{number}-rungs"))
        .column_with_digits("rung", Best::Neither, 0)
        .column_with_digits("render\nscale", Best::Neither, 1)
        .column("shadows", Best::Neither)
        .column_with_digits("reflection\ndepth", Best::Neither, 0)
        .column_with_digits("near region\n% of the diagonal", Best::Neither, 1)
        .column_with_digits("occlusion\nrays", Best::Neither, 0)
        .column_with_digits("their length\n% of the diagonal", Best::Neither, 1)
        .column_with_digits("frames", Best::Neither, 0);
    for (rung, s) in tour.rungs.iter().enumerate() {
        let records = tour.flights.iter().flat_map(|flight| &flight.records);
        table.push(vec![
            rung.into(),
            s.render_scale.into(),
            if s.shadows { "yes" } else { "no" }.into(),
            usize::from(s.reflection_depth).into(),
            (100.0 * s.near_region).into(),
            usize::from(s.ao_rays).into(),
            (100.0 * s.ao_radius).into(),
            records.filter(|record| record.rung == rung).count().into(),
        ]);
    }
    table
}

/// A row a frame and controller.
fn records(tour: &Tour, number: usize) -> Table {
    let mut table = Table::new(format!("tune-{number}-frames"))
        .column("controller", Best::Neither)
        .column_with_digits("frame", Best::Neither, 0)
        .column_with_digits("rung", Best::Neither, 0)
        .column_with_digits("ao rays", Best::Neither, 0)
        .column("model ms", Best::Neither)
        .column("predicted ms", Best::Neither)
        .column("measured ms", Best::Neither)
        .column("status", Best::Neither);
    for flight in &tour.flights {
        for r in &flight.records {
            let rays = tour.rungs.get(r.rung).map(|s| usize::from(s.ao_rays));
            table.push(vec![
                flight.controller.as_str().into(),
                (r.frame as f64).into(),
                r.rung.into(),
                rays.into(),
                r.model_ms.into(),
                r.predicted_ms.into(),
                r.measured_ms.into(),
                format!("{:?}", r.status).into(),
            ]);
        }
    }
    table
}
