//! `study.html` and `csv/*.csv`.

use super::plots::{self, Along};
use super::rows::{Cell, SceneRow, Study};
use super::tables;
use crate::report::axis::short;
use crate::report::page::{Csv, FOOT, add_table, failures, figure, head, run_header};
use crate::report::slug;
use crate::report::table::{escape, grouped};
use crate::report::write_page;
use anyhow::Result;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Cores that others may use before a run counts as loaded.
const LOADED: f64 = 0.25;

const HOW_TO_READ: &str = "<h2>How to read</h2>\n<ul>\n\
    <li><strong>FR</strong> forward rendering, <strong>ZR</strong> with a Z-prepass, <strong>DR</strong> \
    deferred: 32 spotlights without shadows. <strong>SV</strong> shadow volumes, <strong>SM</strong> shadow \
    maps, <strong>VSM</strong> variance shadow maps: 2 to 8 spotlights with shadows. Sides of shadow maps \
    follow the paper's scale factor.</li>\n\
    <li>A frame's time is from its start to the next one's, by the host's clock; frames are waited for one \
    by one. <em>GPU</em> times are those of the passes by the device's clock. Cells are drawn in turns; \
    <em>ms/frame</em> is the median of the repetitions, and <em>repetitions ±</em> the largest distance of \
    one from it.</li>\n\
    <li>Energy per pixel is eq. 2 of paper II. The standard deviation is over frames, or over windows where \
    the meter is too slow for frames; the 95 % interval is that of the mean over repetitions.</li>\n\
    <li><em>others</em>: cores that other programs kept busy meanwhile. On a software driver, and where the \
    meter is the processor's, they slow frames down and add to the energy.</li>\n\
    <li>Thin curves are as measured, thick ones after a zero-phase Butterworth filter. Along the path of \
    the shadow algorithms, numbers of lights follow each other, as in the paper's figures.</li>\n\
    <li>Published values are of other devices, meters and scenes, and of energy, not time: compare the \
    order and the ratios of algorithms.</li>\n</ul>\n";

/// Writes the page and its files; returns the path of the former.
pub(super) fn save(study: &Study, out: &Path) -> Result<PathBuf> {
    let mut html = head("What frames cost: six algorithms on this device");
    let mut files: Vec<Csv> = Vec::new();
    introduction(&mut html, study);
    html.push_str(&run_header(&study.run, None));
    failures(&mut html, &study.failures);
    if study.cells.is_empty() {
        html.push_str("<p>Nothing is measured yet.</p>\n");
        html.push_str(FOOT);
        return write_page(&html, files, out, "study.html");
    }
    for titled in tables::table_1(study) {
        let _ = writeln!(html, "<h2>{}</h2>", escape(&titled.title));
        add_table(&mut html, &mut files, &titled.table)?;
    }
    html.push_str("<h2>The paper's questions (§2)</h2>\n");
    for answer in &study.answers {
        let _ = writeln!(html, "<h3>{}</h3>", escape(answer.question));
        html.push_str("<ul>\n");
        for words in &answer.words {
            let _ = writeln!(html, "<li>{}</li>", escape(words));
        }
        html.push_str("</ul>\n");
    }
    if let Some(plot) = plots::energy_over_time(&study.cells)? {
        html.push_str("<h2>Energy over time</h2>\n<div class=\"plots one\">\n");
        let caption = "A point each cell; all would be on the dashed line, the mean power, if energy were \
                       proportional to time.";
        figure(&mut html, &mut files, &plot.svg, caption, &plot.data)?;
        html.push_str("</div>\n");
    }
    for scene in &study.scenes {
        of_scene(&mut html, &mut files, study, scene)?;
    }
    html.push_str("<h2>All cells</h2>\n");
    add_table(&mut html, &mut files, &tables::cells(study))?;
    html.push_str(HOW_TO_READ);
    html.push_str(FOOT);
    write_page(&html, files, out, "study.html")
}

fn introduction(html: &mut String, study: &Study) {
    html.push_str("<dl class=\"run\">");
    for (name, words) in facts(study) {
        let _ = write!(html, "<dt>{name}</dt><dd>{}</dd>", escape(&words));
    }
    html.push_str("</dl>\n");
    if study.cells.iter().all(|c| c.energy.is_none()) {
        html.push_str(
            "<p><strong>Times only.</strong> No energy was measured, so what this page says of energy is \
             the published devices' alone.</p>\n",
        );
    }
    if let Some(others) = loaded(study) {
        let _ = writeln!(
            html,
            "<p><strong>Loaded:</strong> other programs kept {others:.1} cores busy meanwhile. Compare \
             ratios, not milliseconds.</p>"
        );
    }
}

/// The device, its meter and the scenes.
fn facts(study: &Study) -> Vec<(&'static str, String)> {
    let clock = if study.device_times { "times its passes" } else { "has no clock for passes" };
    let mut facts = vec![
        ("device", format!("{}, which {clock}", study.device)),
        ("meter", study.source.name.clone().unwrap_or_else(|| "none".into())),
    ];
    facts.extend(study.source.notes.iter().map(|note| ("", note.clone())));
    if let Some(refresh) = study.source.refresh_s {
        let ms = short(1e3 * refresh);
        facts.push(("", format!("new readings every {ms} ms while frames are drawn")));
    }
    let energies = || study.cells.iter().filter_map(|c| c.energy.as_ref());
    let by_frame = energies().filter(|e| e.by_frame).count();
    if energies().count() > 0 {
        let all = energies().count();
        let words = format!(
            "of {all} cells with energy {by_frame} are measured frame by frame, {} in windows of many \
             frames, which are too short for the meter",
            all - by_frame
        );
        facts.push(("", words));
    }
    let scenes = study.scenes.iter();
    let scenes: Vec<String> = scenes
        .map(|s| format!("{} ({} triangles)", s.name, grouped(s.triangles as f64, 0)))
        .collect();
    facts.push(("scenes", scenes.join(", ")));
    facts
}

/// Cores that others used, if that is worth saying.
pub(super) fn loaded(study: &Study) -> Option<f64> {
    let all: Vec<f64> = study.cells.iter().filter_map(|c| c.other_cores).collect();
    let mean = all.iter().sum::<f64>() / all.len().max(1) as f64;
    (mean > LOADED).then_some(mean)
}

fn of_scene(
    html: &mut String,
    files: &mut Vec<Csv>,
    study: &Study,
    scene: &SceneRow,
) -> Result<()> {
    let mut sizes: Vec<String> = Vec::new();
    let of_scene: Vec<&Cell> = study.cells.iter().filter(|c| c.key.scene == scene.name).collect();
    for cell in &of_scene {
        if !sizes.contains(&cell.key.size()) {
            sizes.push(cell.key.size());
        }
    }
    for size in sizes {
        let cells: Vec<&Cell> = of_scene.iter().filter(|c| c.key.size() == size).copied().collect();
        let name = slug(&format!("{}-{}", scene.name, size.replace('×', "x")));
        let title = format!("{}, {size}", scene.name);
        let _ = writeln!(html, "<h2>{}</h2>\n<div class=\"plots\">", escape(&title));
        // As figures 4 to 6: power above, times below; primary rendering at the left.
        for (what, kind) in [(Along::Power, "power"), (Along::Time, "time")] {
            for (shadows, part) in [(false, "primary"), (true, "shadows")] {
                let group = of_case(&cells, shadows);
                let file = format!("study-{name}-{part}-{kind}");
                let Some(plot) = plots::along(&group, what, &file)? else { continue };
                let words = if what == Along::Time { "Frame times" } else { "Mean power" };
                let mut lights: Vec<String> =
                    group.iter().map(|c| c.key.lights.to_string()).collect();
                lights.dedup();
                lights.sort_by_key(|n| n.parse::<u32>().unwrap_or(0));
                lights.dedup();
                let caption = if shadows {
                    format!("{words} with {} lights, one after the other.", lights.join(", "))
                } else {
                    format!("{words}, primary rendering.")
                };
                figure(html, files, &plot.svg, &caption, &plot.data)?;
            }
        }
        for (shadows, part) in [(false, "primary"), (true, "shadows")] {
            let group = of_case(&cells, shadows);
            if let Some(plot) = plots::passes(&group, &format!("study-{name}-{part}-passes"))? {
                let caption = "Times of passes on the GPU, all lights together, means over frames.";
                figure(html, files, &plot.svg, caption, &plot.data)?;
            }
        }
        html.push_str("</div>\n");
        signatures(html, files, &cells, &name)?;
    }
    Ok(())
}

/// The cells with shadows, or those without.
fn of_case<'a>(cells: &[&'a Cell], shadows: bool) -> Vec<&'a Cell> {
    cells.iter().filter(|c| c.key.algorithm.has_shadows() == shadows).copied().collect()
}

/// Figures 7 and 8: of the shadow algorithms with six lights, or what comes nearest.
fn signatures(html: &mut String, files: &mut Vec<Csv>, cells: &[&Cell], name: &str) -> Result<()> {
    let mut chosen: Vec<&Cell> = Vec::new();
    for cell in cells {
        let off = |c: &Cell| c.key.lights.abs_diff(6);
        let same = chosen.iter_mut().find(|c| c.key.algorithm == cell.key.algorithm);
        match same {
            Some(kept) if cell.key.algorithm.has_shadows() && off(cell) < off(kept) => *kept = cell,
            Some(_) => {}
            None => chosen.push(cell),
        }
    }
    let mut all = Vec::new();
    for cell in chosen {
        let file = format!("study-{name}-frame-{}", slug(&cell.key.name()));
        if let Some(plot) = plots::signature(cell, &file)? {
            all.push((cell.key.name(), plot));
        }
    }
    if all.is_empty() {
        return Ok(());
    }
    html.push_str("<h3>Figures 7 and 8: power within a frame</h3>\n<div class=\"plots\">\n");
    for (title, plot) in all {
        let caption = format!("{}: the average of all frames.", escape(&title));
        figure(html, files, &plot.svg, &caption, &plot.data)?;
    }
    html.push_str("</div>\n");
    Ok(())
}
