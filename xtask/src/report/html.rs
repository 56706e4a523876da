//! The report as one HTML file that needs nothing else.

use super::break_even::lower_envelope;
use super::model::{Group, groups};
use super::plots::{self, Totals};
use super::table::{Best, Table, escape};
use super::tables;
use crate::results::{Results, Run, SceneInfo};
use anyhow::{Context, Result};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use std::fmt::Write as _;
use std::path::Path;

/// A file to be written beside the report: its name without `.csv`, and its text.
pub(crate) type Csv = (String, String);

const STYLE: &str = include_str!("style.css");
const HOW_TO_READ: &str = include_str!("how_to_read.html");

/// The page, and the CSV behind each of its tables and plots.
pub(crate) fn page(results: &Results) -> Result<(String, Vec<Csv>)> {
    let groups = groups(results);
    let mut files = Vec::new();
    let mut html =
        String::from("<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n");
    html.push_str("<meta name=\"viewport\" content=\"width=device-width\">\n");
    html.push_str("<title>Niwaki bench</title>\n<style>\n");
    html.push_str(STYLE);
    html.push_str("</style></head><body><main>\n<h1>Niwaki bench</h1>\n");
    for (number, run) in results.runs.iter().enumerate() {
        let name = (results.runs.len() > 1).then_some(number);
        html.push_str(&run_header(run, name));
    }
    failures(&mut html, results);
    contents(&mut html, results);

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
    html.push_str("</p>\n</main></body></html>\n");
    Ok((html, files))
}

fn run_header(run: &Run, number: Option<usize>) -> String {
    let mut html = String::from("<dl class=\"run\">");
    let mut add = |name: &str, value: &str| {
        if !value.is_empty() {
            let _ = write!(html, "<dt>{name}</dt><dd>{}</dd>", escape(value));
        }
    };
    if let Some(number) = number {
        add("run", &number.to_string());
    }
    let machine = &run.machine;
    add("machine", &format!("{}, {} hardware threads, {}", machine.cpu, machine.cores, machine.os));
    add("instructions", &machine.isa.join(" "));
    let threads: Vec<_> = run.threads.iter().map(ToString::to_string).collect();
    add("threads", &threads.join(", "));
    add("compiler", &format!("{}; {}", run.rustc, run.flags));
    let peers = if run.peers.is_empty() { "none".into() } else { run.peers.join(", ") };
    add("peers", &peers);
    let revision = run.revision.as_deref().map(|r| format!(", revision {r}")).unwrap_or_default();
    add("when", &format!("{}{revision}", run.date));
    add("arguments", &run.arguments.join(" "));
    add("shard", run.shard.as_deref().unwrap_or_default());
    html.push_str("</dl>\n");
    html
}

fn failures(html: &mut String, results: &Results) {
    if results.failures.is_empty() {
        return;
    }
    html.push_str("<h2>What failed</h2>\n<ul class=\"failures\">\n");
    for failure in &results.failures {
        let (scene, error) = (escape(&failure.scene), escape(&failure.error));
        let _ = writeln!(html, "<li><strong>{scene}</strong>: {error}</li>");
    }
    html.push_str("</ul>\n");
}

fn scene_id(name: &str, triangles: usize) -> String {
    format!("scene-{}-{triangles}", tables::slug(name))
}

fn contents(html: &mut String, results: &Results) {
    html.push_str("<nav><a href=\"#summary\">Summary</a> <a href=\"#how\">How to read</a>");
    for scene in &results.scenes {
        let id = scene_id(&scene.name, scene.triangles);
        let _ = write!(html, " <a href=\"#{id}\">{}</a>", escape(&scene.name));
    }
    html.push_str(" <a href=\"#rows\">All rows</a></nav>\n");
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

fn picture_data(path: &Path) -> Result<String> {
    let bytes = std::fs::read(path)
        .with_context(|| format!("cannot read the picture {}", path.display()))?;
    Ok(format!("data:image/png;base64,{}", BASE64.encode(bytes)))
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

fn figure(
    html: &mut String,
    files: &mut Vec<Csv>,
    svg: &str,
    caption: &str,
    data: &Table,
) -> Result<()> {
    let csv = data.to_csv()?;
    let link = csv_link(&data.name, &csv);
    let _ = writeln!(html, "<figure>{svg}<figcaption>{caption} {link}</figcaption></figure>");
    if !files.iter().any(|(name, _)| *name == data.name) {
        files.push((data.name.clone(), csv));
    }
    Ok(())
}

fn add_table(html: &mut String, files: &mut Vec<Csv>, table: &Table) -> Result<()> {
    let csv = table.to_csv()?;
    html.push_str(&table.to_html());
    let _ = writeln!(html, "<p class=\"csv\">{}</p>", csv_link(&table.name, &csv));
    files.push((table.name.clone(), csv));
    Ok(())
}

fn csv_link(name: &str, csv: &str) -> String {
    let data = BASE64.encode(csv);
    format!("<a download=\"{name}.csv\" href=\"data:text/csv;base64,{data}\">{name}.csv</a>")
}
