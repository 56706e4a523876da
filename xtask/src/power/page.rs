//! `power.html`, `power.json` and `csv/*.csv`.

use super::plots::{self, Plot};
use super::tables;
use crate::machine;
use crate::report::page::{Csv, FOOT, add_table, csv_link, figure, head, run_header};
use crate::report::table::{Table, escape};
use crate::report::write_page;
use anyhow::{Context, Result};
use niwaki_power::Analysis;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

const HOW_TO_READ: &str = "<h2>How to read</h2>\n<ul>\n\
    <li>Energy per pixel is eq. 2 of paper II: energy from the start of the first frame to the end of the \
    last, over frames and pixels. A frame's time and energy reach from its start to the next frame's; \
    <em>busy</em> is its work alone. The standard deviation is over frames (over windows where the sensor \
    is too slow for frames); the 95 % interval is that of the mean if the same animation is repeated.</li>\n\
    <li>Thin curves are as measured, thick ones after a zero-phase Butterworth filter, which delays \
    nothing.</li>\n\
    <li>Faults are repaired within bounds: what is interpolated, dropped or lost is counted, frames that \
    touch a hole count nowhere, and a clipped frame's energy is a lower bound.</li>\n\
    <li>The published table was measured with other devices, meters and scenes: compare the order of \
    algorithms, not numbers.</li>\n</ul>\n";

/// Writes everything into a folder; `extra` tables come first. Returns the path of the page.
pub(super) fn save(
    analysis: &Analysis,
    name: &str,
    extra: &[(&str, Table)],
    out: &Path,
) -> Result<PathBuf> {
    let mut html = head(&format!("Power: {name}"));
    let mut files: Vec<Csv> = Vec::new();
    html.push_str("<dl class=\"run\">");
    for (what, words) in tables::summary(analysis) {
        let _ = write!(html, "<dt>{what}</dt><dd>{}</dd>", escape(&words));
    }
    html.push_str("</dl>\n");
    let mut run = machine::describe();
    run.arguments = std::env::args().skip(2).collect();
    run.threads = vec![machine::cores()];
    for (title, table) in extra {
        section(&mut html, &mut files, title, table)?;
    }
    let groups = tables::groups(analysis);
    section(&mut html, &mut files, "Algorithms", &groups)?;

    html.push_str("<h2>Table 1: average energy per pixel in nJ [standard deviation]</h2>\n");
    let device =
        if analysis.info.sensor.name.is_empty() { name } else { &analysis.info.sensor.name };
    add_table(&mut html, &mut files, &tables::table_1(analysis, device)?)?;

    along(&mut html, &mut files, analysis)?;
    single_frames(&mut html, &mut files, analysis)?;

    html.push_str("<h2>The whole trace</h2>\n<div class=\"plots one\">\n");
    let plot = plots::overview(analysis)?;
    figure(&mut html, &mut files, &plot.svg, "Power over time.", &plot.data)?;
    html.push_str("</div>\n");
    for (title, table) in [
        ("Idle gaps", tables::gaps(analysis)),
        ("Frames that take longer than those around them by a third", tables::spikes(analysis)),
        ("Changes of power states", tables::states(analysis)),
        ("Faults of the trace", tables::faults(&analysis.quality)),
        ("Rails", tables::rails(&analysis.quality)),
    ] {
        if table.is_empty() {
            let _ = writeln!(html, "<h2>{}</h2>\n<p>None.</p>", escape(title));
        } else {
            section(&mut html, &mut files, title, &table)?;
        }
    }
    html.push_str(HOW_TO_READ);
    // Tens of thousands of rows are for the CSV, not for the page.
    let frames = tables::frames(analysis);
    let csv = frames.to_csv()?;
    let _ = writeln!(html, "<p class=\"csv\">All frames: {}</p>", csv_link(&frames.name, &csv));
    files.push((frames.name.clone(), csv));
    html.push_str(&run_header(&run, None));
    html.push_str(FOOT);
    let page = write_page(&html, files, out, "power.html")?;
    let path = out.join("power.json");
    let mut json = serde_json::to_string(analysis)?;
    json.push('\n');
    std::fs::write(&path, json).with_context(|| format!("cannot write {}", path.display()))?;
    Ok(page)
}

fn section(html: &mut String, files: &mut Vec<Csv>, title: &str, table: &Table) -> Result<()> {
    let _ = writeln!(html, "<h2>{}</h2>", escape(title));
    add_table(html, files, table)
}

/// Figures 4 to 6: frame times and power, primary rendering at the left, shadows at the right.
fn along(html: &mut String, files: &mut Vec<Csv>, analysis: &Analysis) -> Result<()> {
    let mut all: Vec<(Plot, &str)> = Vec::new();
    for (is_power, what) in [(true, "Power"), (false, "Frame times")] {
        for (shadows, part) in [(false, "primary rendering"), (true, "shadow algorithms")] {
            if let Some(plot) = plots::along(analysis, shadows, is_power)? {
                all.push((plot, if is_power { part } else { what }));
            }
        }
    }
    if all.is_empty() {
        return Ok(());
    }
    html.push_str("<h2>Figures 4 to 6: power and frame times along the animation</h2>\n");
    html.push_str("<div class=\"plots\">\n");
    for (plot, what) in &all {
        let caption = if *what == "Frame times" {
            "Frame times.".to_owned()
        } else {
            format!("Mean power of each frame, {what}.")
        };
        figure(html, files, &plot.svg, &caption, &plot.data)?;
    }
    html.push_str("</div>\n");
    Ok(())
}

/// Figures 3, 7 and 8.
fn single_frames(html: &mut String, files: &mut Vec<Csv>, analysis: &Analysis) -> Result<()> {
    let typical = plots::typical(analysis);
    if !typical.is_empty() {
        html.push_str("<h2>Figures 7 and 8: power within a frame</h2>\n<div class=\"plots\">\n");
        for (at, title) in typical {
            let waveform = &analysis.waveforms[at];
            let average = analysis.signatures.iter().find(|s| s.group == waveform.group);
            let file = format!("power-frame-{}", crate::report::slug(&title));
            let plot = plots::waveform(waveform, &title, &file, average)?;
            let caption = "A frame of median time: measured (thin) and filtered (thick); the average of all \
                           frames of the group in orange; dashed, start and end of its work.";
            figure(html, files, &plot.svg, caption, &plot.data)?;
        }
        html.push_str("</div>\n");
    } else if analysis.sensor.is_too_slow {
        html.push_str(
            "<h2>Figures 7 and 8: power within a frame</h2>\n<p>The sensor is too slow for that.</p>\n",
        );
    }
    for (number, waveform) in analysis.delays.iter().enumerate() {
        html.push_str("<h2>Figure 3: a delay between frames</h2>\n<div class=\"plots one\">\n");
        let title = tables::name(&analysis.groups[waveform.group]);
        let file = format!("power-delay-{number}");
        let plot = plots::waveform(waveform, &title, &file, None)?;
        let caption =
            "Eight frames around the longest delay; dashed, start and end of the work of each.";
        figure(html, files, &plot.svg, caption, &plot.data)?;
        html.push_str("</div>\n");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use niwaki_power::generator::{MarkPolicy, Recording, RecordingOptions};
    use niwaki_power::{AnalysisOptions, analyze};

    #[test]
    fn a_page_has_every_figure_that_the_trace_gives() {
        let mut options = RecordingOptions::paper(3, 16);
        options.marks = MarkPolicy::Every(1);
        options.delays = vec![(20, 9e-3)];
        let recording = Recording::new(&options).unwrap();
        let settings =
            AnalysisOptions { rails: Some(recording.rails()), ..AnalysisOptions::default() };
        let out = std::env::temp_dir().join(format!("niwaki-power-page-{}", std::process::id()));
        let all = [
            (
                Some(recording.log()),
                &["Figures 4 to 6", "Figures 7 and 8", "Figure 3", "SM, 6 lights"][..],
            ),
            (None, &["from mark to mark", "1443 [180.0]"][..]),
        ];
        for (log, parts) in all {
            let analysis =
                analyze(|| Ok(Box::new(recording.reader())), log.as_ref(), &settings).unwrap();
            let page = std::fs::read_to_string(save(&analysis, "a <test>", &[], &out).unwrap());
            let page = page.unwrap();
            for part in parts.iter().copied().chain(["a &lt;test&gt;", "<svg ", "Table 1"]) {
                assert!(page.contains(part), "{part}");
            }
        }
        for file in ["power-groups", "power-table-1", "power-frames", "power-overview"] {
            let csv = std::fs::read_to_string(out.join(format!("csv/{file}.csv"))).unwrap();
            assert!(csv.lines().count() >= 2, "{file}");
        }
        let json = std::fs::read_to_string(out.join("power.json")).unwrap();
        assert!(serde_json::from_str::<serde_json::Value>(&json).is_ok());
        std::fs::remove_dir_all(out).unwrap();
    }
}
