//! The report as one HTML file that needs nothing else.

use super::against;
use super::break_even::lower_envelope;
use super::model::{Group, groups};
use super::page::{self, Csv, add_table, csv_link, figure, picture_data};
use super::plots::{self, Totals};
use super::table::{Best, Table, escape};
use super::tables;
use crate::results::{Results, SceneInfo};
use anyhow::Result;
use std::fmt::Write as _;

const HOW_TO_READ: &str = include_str!("how_to_read.html");

/// The page, and the CSV behind each of its tables and plots.
pub(crate) fn page(results: &Results) -> Result<(String, Vec<Csv>)> {
    let groups = groups(results);
    let mut files = Vec::new();
    let mut html = page::head("Niwaki bench");
    for (number, run) in results.runs.iter().enumerate() {
        let name = (results.runs.len() > 1).then_some(number);
        html.push_str(&page::run_header(run, name));
    }
    page::failures(&mut html, &results.failures);
    contents(&mut html, results, !against::tables(&groups).is_empty());

    html.push_str("<h2 id=\"summary\">Summary</h2>\n");
    html.push_str(
        "<p>Geometric means of ratios over scenes (and over ray sets, for <em>trace</em>). \
         Builds and costs: lower is better; trace speeds: higher is better. \
         <em>Embree M</em> is its MEDIUM quality.</p>\n",
    );
    for (title, table) in tables::summaries(&groups) {
        let _ = writeln!(html, "<h3>{}</h3>", escape(&title));
        add_table(&mut html, &mut files, &table)?;
    }
    add_against(&mut html, &mut files, &groups)?;
    html.push_str(HOW_TO_READ);

    let mut shown: Option<(&str, usize)> = None;
    for group in &groups {
        if shown != Some((group.scene, group.triangles)) {
            shown = Some((group.scene, group.triangles));
            let known = |s: &&SceneInfo| s.name == group.scene && s.triangles == group.triangles;
            scene_header(&mut html, group, results.scenes.iter().find(known))?;
        }
        add_group(&mut html, &mut files, group, results.runs.len() > 1)?;
    }
    html.push_str("<h2 id=\"rows\">All rows</h2>\n<p>");
    for (name, csv) in tables::raw(results)? {
        let _ = write!(html, "{} ", csv_link(&name, &csv));
        files.push((name, csv));
    }
    html.push_str("</p>\n");
    html.push_str(page::FOOT);
    Ok((html, files))
}

fn scene_id(name: &str, triangles: usize) -> String {
    format!("scene-{}-{triangles}", tables::slug(name))
}

fn contents(html: &mut String, results: &Results, with_embree: bool) {
    html.push_str("<nav><a href=\"#summary\">Summary</a>");
    if with_embree {
        html.push_str(" <a href=\"#embree\">Against Embree</a>");
    }
    html.push_str(" <a href=\"#how\">How to read</a>");
    for scene in &results.scenes {
        let id = scene_id(&scene.name, scene.triangles);
        let _ = write!(html, " <a href=\"#{id}\">{}</a>", escape(&scene.name));
    }
    html.push_str(" <a href=\"#rows\">All rows</a></nav>\n");
}

/// The section about Embree, where it was measured.
fn add_against(html: &mut String, files: &mut Vec<Csv>, groups: &[Group<'_>]) -> Result<()> {
    let tables = against::tables(groups);
    if tables.is_empty() {
        return Ok(());
    }
    html.push_str(
        "<h2 id=\"embree\">Against Embree</h2>\n\
         <p>Rays a second through the fastest of our measured trees by one of our kernels, over \
         those of Embree's own kernel through the better of its measured qualities, for each \
         scene; over 1 we are faster. Fast kernels meet Embree's default mode. Watertight ones \
         meet its robust mode if that was measured (<code>--robust</code>), which is not \
         watertight, and its default mode. Embree always answers one ray a call \
         (<code>rtcIntersect1</code>, <code>rtcOccluded1</code>), and so do our kernels unless \
         <code>_batch</code> is in their name: those get 1024 rays a call. <em>mean</em> is \
         geometric.</p>\n",
    );
    for (title, table) in tables {
        let _ = writeln!(html, "<h3>{}</h3>", escape(&title));
        add_table(html, files, &table)?;
    }
    html.push_str("<details><summary>Which trees and speeds these are</summary>\n");
    add_table(html, files, &against::details(groups))?;
    html.push_str("</details>\n");
    Ok(())
}

fn scene_header(html: &mut String, group: &Group<'_>, scene: Option<&SceneInfo>) -> Result<()> {
    let id = scene_id(group.scene, group.triangles);
    let _ = writeln!(html, "<h2 id=\"{id}\">{}</h2>", escape(group.scene));
    let triangles = super::table::grouped(group.triangles as f64, 0);
    let mut line = format!("{triangles} triangles");
    let Some(scene) = scene else {
        let _ = writeln!(html, "<p>{line}.</p>");
        return Ok(());
    };
    if !scene.origin.is_empty() {
        let _ = write!(line, ", {}", scene.origin);
    }
    if let Some(dropped) = &scene.dropped {
        let _ = write!(line, "; the loader left out {dropped}");
    }
    let _ = writeln!(html, "<p>{}.</p>", escape(&line));
    if scene.picture.is_none() && scene.heat_map.is_none() {
        return Ok(());
    }
    let credit = scene.credit.as_deref().map(|c| format!(" {}", escape(c))).unwrap_or_default();
    html.push_str("<div class=\"pictures\">\n");
    if let Some(picture) = &scene.picture {
        let data = picture_data(picture)?;
        let alt = format!("{}, path traced", escape(group.scene));
        let _ = writeln!(
            html,
            "<figure><img alt=\"{alt}\" src=\"{data}\"><figcaption>Path traced.{credit}\
             </figcaption></figure>",
        );
    }
    if let Some(map) = &scene.heat_map {
        let data = picture_data(&map.picture)?;
        let _ = writeln!(
            html,
            "<figure><img alt=\"Traversal cost of {}\" src=\"{data}\"><figcaption>\
             Boxes and triangles tested per camera ray in the tree of {}: mean {:.1}. \
             <span class=\"scale\"><span>0</span><i></i><span>{:.0}</span></span>{credit}\
             </figcaption></figure>",
            escape(group.scene),
            escape(&map.builder),
            map.mean,
            map.top,
        );
    }
    html.push_str("</div>\n");
    Ok(())
}

fn add_group(
    html: &mut String,
    files: &mut Vec<Csv>,
    group: &Group<'_>,
    several_runs: bool,
) -> Result<()> {
    let mut title = group.title();
    if several_runs {
        let _ = write!(title, " · run {}", group.run);
    }
    let _ = writeln!(html, "<h3>{}</h3>", escape(&title));
    let engines = group.costs();
    if !engines.is_empty() {
        let sets = group.ray_sets();
        let mix = match sets.as_slice() {
            [one] => format!("{one} rays"),
            several => format!("mean of {}", several.join(", ")),
        };
        let costs: Vec<_> = engines.iter().map(|(_, cost)| *cost).collect();
        let intervals = lower_envelope(&costs);
        html.push_str("<div class=\"plots\">\n");
        let points = scatter_csv(group);
        let caption = "Down and to the left is better; the dashed line joins what nothing beats \
                       in both. Dots: our kernel (filled: our trees, rings: peers' trees). \
                       Triangles: the peer as it comes.";
        figure(html, files, &plots::scatter(&engines, &mix)?, caption, &points)?;
        let curves = totals_csv(group);
        let caption = "Time to build and then trace that many rays. Bold curves are the lowest \
                       somewhere; dots mark where the best structure changes.";
        let svg = plots::totals(&engines, &intervals, Totals::Absolute)?;
        figure(html, files, &svg, caption, &curves)?;
        let caption = "The same, over the lowest total at that number of rays: 1 is best, 2 \
                       takes twice as long as needed.";
        let svg = plots::totals(&engines, &intervals, Totals::Relative)?;
        figure(html, files, &svg, caption, &curves)?;
        html.push_str("</div>\n");
        html.push_str("<h4>Which is best for how many rays</h4>\n");
        add_table(html, files, &tables::break_even(group))?;
    }
    if !group.builds.is_empty() {
        html.push_str("<h4>Builds</h4>\n");
        add_table(html, files, &tables::builds(group))?;
    }
    if !group.traces.is_empty() {
        html.push_str("<h4>Rays</h4>\n");
        add_table(html, files, &tables::traces(group))?;
    }
    Ok(())
}

fn scatter_csv(group: &Group<'_>) -> Table {
    let mut table = Table::new(format!("{}-scatter", group.slug()))
        .column("structure", Best::Neither)
        .column("kernel", Best::Neither)
        .column("ms_to_traversable", Best::Neither)
        .column("ns_per_ray", Best::Neither);
    for (engine, cost) in group.costs() {
        table.push(vec![
            engine.label().into(),
            engine.kernel.into(),
            cost.once.into(),
            (cost.per_ray * 1e6).into(),
        ]);
    }
    table
}

fn totals_csv(group: &Group<'_>) -> Table {
    let engines = group.costs();
    let mut table = Table::new(format!("{}-totals", group.slug())).column("rays", Best::Neither);
    for (engine, _) in &engines {
        table = table.column(format!("{} ms", engine.label()), Best::Neither);
    }
    let costs: Vec<_> = engines.iter().map(|(_, cost)| *cost).collect();
    let range = plots::ray_range(&costs, &lower_envelope(&costs));
    for rays in plots::ray_counts(range, 61) {
        let totals = costs.iter().map(|cost| cost.total(rays).into());
        table.push(std::iter::once(rays.into()).chain(totals).collect());
    }
    table
}
