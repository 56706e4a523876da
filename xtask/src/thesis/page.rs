//! The report as one HTML file that needs nothing else.

use super::Report;
use super::measure::SceneResult;
use super::plots::{self, Bar, PairRow};
use super::published::Item;
use super::tables;
use crate::report::page::{Csv, FOOT, add_table, csv_link, failures, figure, head, run_header};
use crate::report::table::escape;
use anyhow::Result;
use std::fmt::Write as _;

const HOW_TO_READ: &str = "<h2 id=\"how\">How to read</h2>
<p>Published values come from Per Ganestam's thesis (Lund University, 2016) and are shown beside
what this machine measured. Build times, frame times, speeds and SAH costs are relative to sweep SAH
in the same table, published to published and measured to measured; never compare milliseconds of
2015's laptop with today's. A dot (·) means that the builder or scene was not measured. Two columns
of ours for one published builder: the first is what orderings are checked with.</p>
<p>An ordering is a pair of builders whose published values differ by at least 2 %. It holds where
the measured values lie the same way, and ties where they differ by less than 2 % (times) or 0.5 %
(costs and counts). <em>Real scenes</em> are the papers' scenes in the same or another version;
stand-ins and scenes of the same kind count only among <em>all measured</em>.</p>
<p>Path-tracing time is the mean time of a ray on a path of one camera ray and four bounces, by our
8-wide kernel over the trees of all builders; for paper V's table 2 by the scalar kernel over binary
trees.</p>
";

/// The page, and the CSV behind each of its tables and plots.
pub(super) fn page(report: &Report) -> Result<(String, Vec<Csv>)> {
    let mut files = Vec::new();
    let mut html = head("Niwaki: the thesis's tables");
    html.push_str(&run_header(&report.run, None));
    failures(&mut html, &report.failures);
    html.push_str("<nav><a href=\"#orderings\">Orderings</a> <a href=\"#how\">How to read</a>");
    for item in Item::ALL {
        let name = item.title().split(':').next().unwrap_or_default();
        let _ = write!(html, " <a href=\"#{}\">{}</a>", item.id(), escape(name));
    }
    html.push_str("</nav>\n<h2>Scenes</h2>\n");
    add_table(&mut html, &mut files, &tables::scenes(&report.published, &report.scenes))?;
    orderings(&mut html, &mut files, report)?;
    html.push_str(HOW_TO_READ);
    for item in Item::ALL {
        let _ = writeln!(html, "<h2 id=\"{}\">{}</h2>", item.id(), escape(item.title()));
        match item {
            Item::IvFigure6 => figure_6(&mut html, &mut files, report)?,
            Item::IvFigure7 => figure_7(&mut html, &mut files, report)?,
            Item::VFigure4 => figure_4(&mut html, &mut files, report)?,
            _ => matrices(&mut html, &mut files, report, item)?,
        }
    }
    html.push_str("<h2>All values</h2>\n<p>");
    let table = tables::comparisons(&report.comparisons);
    let csv = table.to_csv()?;
    let _ = writeln!(html, "{}</p>", csv_link(&table.name, &csv));
    files.push((table.name, csv));
    html.push_str(FOOT);
    Ok((html, files))
}

fn orderings(html: &mut String, files: &mut Vec<Csv>, report: &Report) -> Result<()> {
    html.push_str("<h2 id=\"orderings\">Orderings that hold</h2>\n");
    add_table(html, files, &tables::orderings(&report.pairs))?;
    let reversed = tables::reversed(&report.pairs);
    if reversed.is_empty() {
        html.push_str("<p>No published ordering is reversed.</p>\n");
        return Ok(());
    }
    html.push_str(
        "<details><summary>Those that are reversed: what is published, and what was measured\
         </summary>\n",
    );
    add_table(html, files, &reversed)?;
    html.push_str("</details>\n");
    Ok(())
}

/// The plots of an item side by side, then its tables.
fn matrices(html: &mut String, files: &mut Vec<Csv>, report: &Report, item: Item) -> Result<()> {
    let quantities = || tables::MATRICES.into_iter().filter(|(of, _)| *of == item).map(|(_, q)| q);
    let table = |quantity| tables::matrix(item, quantity, &report.comparisons, &report.pairs);
    let is_measured =
        |quantity: &&str| plots::measured(&report.comparisons, item, quantity).next().is_some();
    let plotted: Vec<_> = quantities().filter(is_measured).collect();
    open_plots(html, plotted.len());
    for quantity in &plotted {
        let heading = tables::heading(item, quantity);
        let what = heading.split(';').next().unwrap_or_default();
        let svg = plots::agreement(&report.comparisons, item, quantity, what)?;
        let caption = "A point a scene and builder; on the dashed diagonal measured equals \
                       published. Filled: the paper's scenes. Rings: stand-ins.";
        figure(html, files, &svg, caption, &table(quantity))?;
    }
    html.push_str("</div>\n");
    for quantity in quantities() {
        let _ = writeln!(html, "<h3>{}</h3>", escape(&tables::heading(item, quantity)));
        if plotted.contains(&quantity) {
            // The plot has the same file.
            html.push_str(&table(quantity).to_html());
        } else {
            add_table(html, files, &table(quantity))?;
        }
    }
    Ok(())
}

/// Begins a grid of plots; a single one need not fill the page.
fn open_plots(html: &mut String, count: usize) {
    html.push_str(if count > 1 {
        "<div class=\"plots\">\n"
    } else {
        "<div class=\"plots one\">\n"
    });
}

fn figure_6(html: &mut String, files: &mut Vec<Csv>, report: &Report) -> Result<()> {
    html.push_str(
        "<p>Each step as a share of the whole build without pruning. The paper draws all steps, but \
         prints only these numbers; the published sum is of its figure 5.</p>\n",
    );
    let Some(result) = report.standing_for("San Miguel") else {
        return not_measured(html, "San Miguel");
    };
    measured_as(html, result, "San Miguel");
    let whole = super::compare::total_ms(result, "bonsai").unwrap_or(f64::NAN);
    let bar = |builder: &str| -> Bar {
        let steps = result.steps.iter().filter(|s| s.builder == builder);
        (builder.to_owned(), steps.map(|s| (s.step.clone(), s.ms / whole)).collect())
    };
    let table = tables::steps(&report.comparisons, result);
    open_plots(html, 1);
    let svg = plots::steps(&[bar("bonsai"), bar("bonsai_p")])?;
    figure(html, files, &svg, "The steps as measured.", &table)?;
    html.push_str("</div>\n");
    html.push_str(&table.to_html());
    Ok(())
}

fn figure_7(html: &mut String, files: &mut Vec<Csv>, report: &Report) -> Result<()> {
    html.push_str(
        "<p>Arithmetic means of figures 5 and 8 over the scenes, relative to sweep.</p>\n",
    );
    let table = tables::averages(&report.comparisons);
    open_plots(html, 3);
    for quantity in ["build", "sah", "performance"] {
        let rows: Vec<_> = report
            .comparisons
            .iter()
            .filter(|c| c.item == Item::IvFigure7 && c.quantity == quantity)
            .map(|c| PairRow {
                label: format!("{} ({})", c.builder, c.ours),
                ours: c.ours.clone(),
                published: c.published_relative,
                measured: c.measured_relative,
            })
            .collect();
        let heading = tables::heading(Item::IvFigure5, quantity);
        let svg = plots::pairs(&rows, &heading)?;
        figure(html, files, &svg, "Rings: published. Dots: measured, all scenes.", &table)?;
    }
    html.push_str("</div>\n");
    html.push_str(&table.to_html());
    Ok(())
}

fn figure_4(html: &mut String, files: &mut Vec<Csv>, report: &Report) -> Result<()> {
    html.push_str(
        "<p>The paper draws its curves without printing values. It says that BINNEDSAH (binned) \
         scales slightly better than BONSAIS (bonsai_s) on twelve cores, that their build times are \
         close, and that a frame takes 105 ms with BONSAIS and 162 ms with BINNEDSAH there. Here, \
         builds on up to as many threads as were asked for; sweep and bonsai_p are added.</p>\n",
    );
    let Some(result) = report.standing_for("Power Plant") else {
        return not_measured(html, "Power Plant");
    };
    measured_as(html, result, "Power Plant");
    let frames = |published: bool| {
        let frame = |builder: &str| {
            let same = |c: &&super::compare::Comparison| {
                c.item == Item::VFigure4
                    && c.quantity == "frame"
                    && c.builder == builder
                    && (published || c.leading)
            };
            let row = report.comparisons.iter().find(same)?;
            if published { Some(row.published) } else { row.measured }
        };
        Some(frame("BONSAIS")? / frame("BINNEDSAH")?)
    };
    if let Some(published) = frames(true) {
        let measured = frames(false).map_or("·".to_owned(), |x| format!("{x:.2}"));
        let _ = writeln!(
            html,
            "<p>Path-tracing time with BONSAIS ÷ with BINNEDSAH: published {published:.2}, measured \
             {measured}.</p>"
        );
    }
    let table = tables::scaling(result);
    open_plots(html, 1);
    let svg = plots::scaling(result)?;
    let caption = "Dashed: twice the threads, twice as fast.";
    figure(html, files, &svg, caption, &table)?;
    html.push_str("</div>\n");
    html.push_str(&table.to_html());
    Ok(())
}

#[expect(clippy::unnecessary_wraps, reason = "ends a function that returns it")]
fn not_measured(html: &mut String, scene: &str) -> Result<()> {
    let _ = writeln!(html, "<p>Nothing was measured in place of {}.</p>", escape(scene));
    Ok(())
}

fn measured_as(html: &mut String, result: &SceneResult, scene: &str) {
    let standing = result.stands_for.iter().find(|(name, _)| name == scene);
    let standing = standing.map(|(_, s)| s.to_string()).unwrap_or_default();
    let triangles = crate::report::table::grouped(result.triangles as f64, 0);
    let _ = writeln!(
        html,
        "<p>{} is measured on {} ({standing}, {triangles} triangles).</p>",
        escape(scene),
        escape(&result.scene)
    );
}
