//! The tables of a report.

use super::against;
use super::axis::short;
use super::break_even::lower_envelope;
use super::model::{Engine, Group, geometric_mean, groups, is_peers};
use super::table::{Best, Cell, Table};
use crate::results::{BuildRow, Results, Row, Source};

/// A name that can be part of a file name.
pub(crate) fn slug(text: &str) -> String {
    text.chars()
        .map(|c| if c.is_ascii_alphanumeric() || "-_".contains(c) { c } else { '_' })
        .collect()
}

impl Group<'_> {
    /// Begins the names of this group's files.
    pub(crate) fn slug(&self) -> String {
        let run = if self.run == 0 { String::new() } else { format!("-run{}", self.run) };
        format!("{}-{}-{}t{run}", slug(self.scene), self.triangles, self.threads)
    }

    /// The heading.
    pub(crate) fn title(&self) -> String {
        let plural = if self.threads == 1 { "" } else { "s" };
        let triangles = super::table::grouped(self.triangles as f64, 0);
        format!("{} · {triangles} triangles · {} thread{plural}", self.scene, self.threads)
    }
}

fn ratio(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    let (a, b) = (a?, b?);
    (b > 0.0).then_some(a / b)
}

/// What a peer or one of ours takes from the mesh to something traversable by `kernel`.
fn traversable(row: &BuildRow, kernel: &str) -> Option<f64> {
    if is_peers(kernel) { row.ms_commit_median } else { row.ms_wide_median }
}

/// The builds of a group.
pub(crate) fn builds(group: &Group<'_>) -> Table {
    let mut table = Table::new(format!("{}-builds", group.slug()))
        .column("source", Best::Neither)
        .column("builder", Best::Neither)
        .column("build\nms", Best::Low)
        .column("fastest", Best::Low)
        .column_with_digits("÷\nsweep", Best::Low, 3)
        .column("to 8-wide\nms", Best::Low)
        .column("own\ncommit ms", Best::Low)
        .column_with_digits("÷ Embree M\ncommit", Best::Low, 3)
        .column_with_digits("refs\n/tri", Best::Neither, 3)
        .column("nodes", Best::Neither)
        .column_with_digits("bytes\n/tri", Best::Low, 1)
        .column_with_digits("peak\nB/tri", Best::Low, 1)
        .column("SAH", Best::Low)
        .column_with_digits("SAH\n÷ sweep", Best::Low, 3)
        .column("EPO", Best::Low)
        .column("depth", Best::Neither);
    let sweep = group.build(Source::Niwaki, "sweep");
    let embree = group.build(Source::Embree, "medium").and_then(|r| r.ms_commit_median);
    let triangles = group.triangles.max(1) as f64;
    for row in &group.builds {
        table.push(vec![
            row.source.name().into(),
            row.builder.as_str().into(),
            row.ms_median.into(),
            row.ms_min.into(),
            ratio(Some(row.ms_median), sweep.map(|s| s.ms_median)).into(),
            row.ms_wide_median.into(),
            row.ms_commit_median.into(),
            // Of a peer, what it takes itself.
            ratio(row.ms_commit_median.or(row.ms_wide_median), embree).into(),
            (row.references as f64 / triangles).into(),
            row.nodes.into(),
            (row.bytes as f64 / triangles).into(),
            row.peak_bytes.map(|bytes| bytes as f64 / triangles).into(),
            row.sah.into(),
            ratio(row.sah, sweep.and_then(|s| s.sah)).into(),
            row.epo.into(),
            row.depth.into(),
        ]);
    }
    table
}

/// The trace speeds of a group.
pub(crate) fn traces(group: &Group<'_>) -> Table {
    let sets = group.ray_sets();
    let mut table = Table::new(format!("{}-traces", group.slug()))
        .column("source", Best::Neither)
        .column("tree", Best::Neither)
        .column("kernel", Best::Neither);
    let has_batches = group.traces.iter().any(|row| row.rays_per_call > 1);
    if has_batches {
        table = table.column("rays\n/call", Best::Neither);
    }
    let has_embree = group.traces.iter().any(|row| row.kernel == "embree");
    for rays in &sets {
        table = table.column(format!("{rays}\nMray/s"), Best::High).column_with_digits(
            format!("{rays}\n÷ sweep"),
            Best::High,
            3,
        );
        if has_embree {
            table = table.column_with_digits(format!("{rays}\n÷ Embree M"), Best::High, 3);
        }
    }
    let has_bytes = group.traces.iter().any(|row| row.bytes.is_some());
    if has_bytes {
        table = table.column_with_digits("bytes\n/tri", Best::Low, 1);
    }
    let has_counts = group.traces.iter().any(|row| row.boxes_per_ray.is_some());
    if has_counts {
        table = table.column_with_digits("boxes\n/ray", Best::Low, 1).column_with_digits(
            "triangles\n/ray",
            Best::Low,
            1,
        );
    }
    for engine in group.engines() {
        let mut row: Vec<Cell> =
            vec![engine.source.name().into(), engine.builder.into(), engine.kernel.into()];
        if has_batches {
            let first = sets.iter().find_map(|rays| group.trace(engine, rays));
            row.push(first.map(|row| row.rays_per_call).into());
        }
        for rays in &sets {
            let rate = group.rate(engine, rays);
            row.push(rate.into());
            row.push(ratio(rate, sweep_rate(group, engine, rays)).into());
            if has_embree {
                row.push(ratio(rate, group.rate(EMBREE, rays)).into());
            }
        }
        if has_bytes {
            let first = sets.iter().find_map(|rays| group.trace(engine, rays));
            let bytes = first.and_then(|row| row.bytes);
            row.push(bytes.map(|bytes| bytes as f64 / group.triangles.max(1) as f64).into());
        }
        if has_counts {
            let mean = |count: fn(&crate::results::TraceRow) -> Option<f64>| {
                let counts: Vec<f64> = sets
                    .iter()
                    .filter_map(|rays| group.trace(engine, rays).and_then(count))
                    .collect();
                (!counts.is_empty()).then(|| counts.iter().sum::<f64>() / counts.len() as f64)
            };
            row.push(mean(|r| r.boxes_per_ray).into());
            row.push(mean(|r| r.triangles_per_ray).into());
        }
        table.push(row);
    }
    table
}

/// Embree MEDIUM as it comes.
const EMBREE: Engine<'static> =
    Engine { source: Source::Embree, builder: "medium", kernel: "embree" };

/// The speed of our sweep tree under the engine's kernel, or under our fastest for a peer.
fn sweep_rate(group: &Group<'_>, engine: Engine<'_>, rays: &str) -> Option<f64> {
    let kernel = if engine.is_peers_own() { group.our_kernel()? } else { engine.kernel };
    group.rate(Engine { source: Source::Niwaki, builder: "sweep", kernel }, rays)
}

/// Which builder has the lowest total time for how many rays; first among ours, then among all.
pub(crate) fn break_even(group: &Group<'_>) -> Table {
    let mut table = Table::new(format!("{}-break-even", group.slug()))
        .column("among", Best::Neither)
        .column("rays from", Best::Neither)
        .column("to", Best::Neither)
        .column("best", Best::Neither)
        .column("ms once", Best::Neither)
        .column("ns per ray", Best::Neither);
    let all = group.costs();
    let ours: Vec<_> = all.iter().filter(|(e, _)| e.source == Source::Niwaki).copied().collect();
    for (among, engines) in [("niwaki", &ours), ("all", &all)] {
        if among == "all" && ours.len() == all.len() {
            continue;
        }
        let costs: Vec<_> = engines.iter().map(|(_, cost)| *cost).collect();
        for interval in lower_envelope(&costs) {
            let (engine, cost) = &engines[interval.best];
            let to = if interval.to.is_finite() { short(interval.to) } else { "∞".into() };
            table.push(vec![
                among.into(),
                short(interval.from).into(),
                to.into(),
                engine.label().into(),
                cost.once.into(),
                (cost.per_ray * 1e6).into(),
            ]);
        }
    }
    table
}

/// Geometric means of ratios over the scenes of each number of threads: one titled table each.
pub(crate) fn summaries(groups: &[Group<'_>]) -> Vec<(String, Table)> {
    const LARGE: usize = 200_000;
    let mut threads: Vec<usize> = groups.iter().map(|g| g.threads).collect();
    threads.sort_unstable();
    threads.dedup();
    let mut tables = Vec::new();
    for threads in threads {
        let plural = if threads == 1 { "" } else { "s" };
        let of_threads: Vec<_> = groups.iter().filter(|g| g.threads == threads).collect();
        let large: Vec<_> = of_threads.iter().filter(|g| g.triangles > LARGE).copied().collect();
        let title = format!("{threads} thread{plural}, {}", scenes(of_threads.len()));
        tables.push((title, summary(&format!("summary-{threads}t"), &of_threads)));
        if !large.is_empty() && large.len() < of_threads.len() {
            let title = format!(
                "{threads} thread{plural}, the {} of more than 200,000 triangles",
                scenes(large.len())
            );
            tables.push((title, summary(&format!("summary-{threads}t-large"), &large)));
        }
    }
    tables.retain(|(_, table)| !table.is_empty());
    tables
}

fn scenes(count: usize) -> String {
    if count == 1 { "1 scene".into() } else { format!("{count} scenes") }
}

fn summary(name: &str, groups: &[&Group<'_>]) -> Table {
    let mut engines: Vec<Engine<'_>> = Vec::new();
    let mut sets: Vec<&str> = Vec::new();
    for group in groups {
        let main = group.our_kernel();
        for engine in group.engines() {
            let shown = engine.is_peers_own() || Some(engine.kernel) == main;
            if shown && !engines.contains(&engine) {
                engines.push(engine);
            }
        }
        // Builders of a run that traced nothing appear too.
        for row in &group.builds {
            let known = |e: &Engine<'_>| e.source == row.source && e.builder == row.builder;
            if !engines.iter().any(known) {
                let kernel = main.unwrap_or("");
                engines.push(Engine { source: row.source, builder: &row.builder, kernel });
            }
        }
        for rays in group.ray_sets() {
            if !sets.contains(&rays) {
                sets.push(rays);
            }
        }
    }
    let has_embree = engines.contains(&EMBREE);
    let mut table = Table::new(name)
        .column("structure", Best::Neither)
        .column_with_digits("build\n÷ sweep", Best::Low, 3)
        .column_with_digits("SAH\n÷ sweep", Best::Low, 3)
        .column_with_digits("traversable\n÷ sweep", Best::Low, 3);
    if has_embree {
        table = table.column_with_digits("÷ Embree M\ncommit", Best::Low, 3);
    }
    table = table.column_with_digits("trace\n÷ sweep", Best::High, 3);
    if has_embree {
        table = table
            .column_with_digits("trace ÷ Em-\nbree M tree", Best::High, 3)
            .column_with_digits("trace ÷\nEmbree M", Best::High, 3);
        for rays in &sets {
            table = table.column_with_digits(format!("{rays}\n÷ Embree M"), Best::High, 3);
        }
    } else {
        for rays in &sets {
            table = table.column_with_digits(format!("{rays}\n÷ sweep"), Best::High, 3);
        }
    }
    for engine in engines {
        // The mean over the scenes that have both sides of the ratio.
        let mean = |of: &dyn Fn(&Group<'_>, &BuildRow) -> Option<f64>| {
            geometric_mean(
                groups.iter().filter_map(|g| of(g, g.build(engine.source, engine.builder)?)),
            )
        };
        let trace = |sets: &[&str], to: &dyn Fn(&Group<'_>, &str) -> Option<f64>| {
            geometric_mean(groups.iter().flat_map(|g| {
                sets.iter().filter_map(|rays| ratio(g.rate(engine, rays), to(g, rays)))
            }))
        };
        let sweep = |g: &Group<'_>| g.build(Source::Niwaki, "sweep").cloned();
        let mut row: Vec<Cell> = vec![engine.label().into()];
        let own = engine.is_peers_own();
        row.push(if own {
            Cell::Missing
        } else {
            mean(&|g, r| ratio(Some(r.ms_median), sweep(g).map(|s| s.ms_median))).into()
        });
        row.push(if own {
            Cell::Missing
        } else {
            mean(&|g, r| ratio(r.sah, sweep(g).and_then(|s| s.sah))).into()
        });
        let to_traversable = |g: &Group<'_>, r: &BuildRow| {
            ratio(traversable(r, engine.kernel), sweep(g).and_then(|s| s.ms_wide_median))
        };
        row.push(mean(&to_traversable).into());
        let embree = |g: &Group<'_>| g.build(Source::Embree, "medium")?.ms_commit_median;
        if has_embree {
            row.push(mean(&|g, r| ratio(traversable(r, engine.kernel), embree(g))).into());
        }
        let to_sweep = |g: &Group<'_>, rays: &str| sweep_rate(g, engine, rays);
        row.push(trace(&sets, &to_sweep).into());
        if has_embree {
            let to_tree = |g: &Group<'_>, rays: &str| {
                let kernel = g.our_kernel()?;
                g.rate(Engine { kernel, ..EMBREE }, rays)
            };
            let to_embree = |g: &Group<'_>, rays: &str| g.rate(EMBREE, rays);
            row.push(trace(&sets, &to_tree).into());
            row.push(trace(&sets, &to_embree).into());
            row.extend(sets.iter().map(|rays| trace(&[rays], &to_embree).into()));
        } else {
            row.extend(sets.iter().map(|rays| trace(&[rays], &to_sweep).into()));
        }
        table.push(row);
    }
    table
}

/// All rows of a kind, with every field, for other programs.
pub(crate) fn raw(results: &Results) -> anyhow::Result<Vec<(String, String)>> {
    let mut files = Vec::new();
    for (name, keep) in [
        ("builds", (|row| matches!(row, Row::Build(_))) as fn(&Row) -> bool),
        ("traces", |row| matches!(row, Row::Trace(_))),
    ] {
        let mut writer = csv::Writer::from_writer(Vec::new());
        let mut header = Vec::new();
        for row in results.rows.iter().filter(|row| keep(row)) {
            // Through JSON, so that the columns are the fields of the results file.
            let serde_json::Value::Object(mut fields) = serde_json::to_value(row)? else {
                continue;
            };
            if let Some(serde_json::Value::Object(constants)) = fields.remove("sah_constants") {
                fields.extend(constants.into_iter().map(|(k, v)| (format!("sah_{k}"), v)));
            }
            if header.is_empty() {
                header = fields.keys().cloned().collect();
                writer.write_record(&header)?;
            }
            writer.write_record(header.iter().map(|key| match &fields[key] {
                serde_json::Value::Null => String::new(),
                serde_json::Value::String(text) => text.clone(),
                other => other.to_string(),
            }))?;
        }
        files.push((name.to_owned(), String::from_utf8(writer.into_inner()?)?));
    }
    Ok(files)
}

fn add(text: &mut String, title: &str, table: &Table) {
    if !table.is_empty() {
        text.push_str(&format!("\n{title}\n{}\n", table.to_text()));
    }
}

/// The tables of the groups that some rows belong to.
pub(crate) fn groups_as_text(groups: &[Group<'_>]) -> String {
    let mut text = String::new();
    for group in groups {
        add(&mut text, &group.title(), &builds(group));
        add(&mut text, "rays", &traces(group));
        add(&mut text, "lowest build + trace time", &break_even(group));
    }
    text
}

/// The tables of means, and those against Embree.
pub(crate) fn summary_as_text(results: &Results) -> String {
    let mut text = String::new();
    let groups = groups(results);
    for (title, table) in summaries(&groups) {
        add(&mut text, &format!("Geometric means: {title}"), &table);
    }
    for (title, table) in against::tables(&groups) {
        let title = format!("Our best tree ÷ Embree's better of its qualities: {title}");
        add(&mut text, &title, &table);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::Run;
    use crate::results::tests::{build, trace};

    fn results() -> Results {
        let mut rows = Vec::new();
        for (scene, factor) in [("a", 1.0), ("b", 4.0)] {
            rows.push(Row::Build(build(scene, "sweep", 2, 10.0)));
            rows.push(Row::Build(build(scene, "bonsai", 2, 10.0 * factor)));
            rows.push(Row::Trace(trace(scene, "sweep", 2, 2.0)));
            rows.push(Row::Trace(trace(scene, "bonsai", 2, 1.0)));
            let mut embree = build(scene, "medium", 2, 5.0);
            embree.source = Source::Embree;
            embree.ms_commit_median = Some(8.0);
            rows.push(Row::Build(embree));
            let mut own = trace(scene, "medium", 2, 4.0);
            own.source = Source::Embree;
            own.kernel = "embree".into();
            rows.push(Row::Trace(own));
        }
        Results { runs: vec![Run::default()], rows, ..Results::default() }
    }

    #[test]
    fn summaries_are_geometric_means_of_ratios() {
        let results = results();
        let groups = groups(&results);
        let summaries = summaries(&groups);
        assert_eq!(summaries.len(), 1);
        let csv = summaries[0].1.to_csv().unwrap();
        let line = csv.lines().find(|l| l.starts_with("bonsai,")).unwrap();
        let numbers: Vec<f64> =
            line.split(',').skip(1).map(|c| c.parse().unwrap_or(f64::NAN)).collect();
        // Build 1 and 4 times sweep; SAH equal; to traversable likewise; 20 and 80 ms ÷ 8 ms.
        let expected = [2.0, 1.0, 2.0, 5.0, 0.5];
        for (number, expected) in numbers.iter().zip(expected) {
            assert!((number - expected).abs() < 1e-9, "{line}");
        }
        assert!(numbers[5].is_nan(), "no Embree tree was traced by our kernel: {line}");
        assert!((numbers[6] - 0.25).abs() < 1e-9, "{line}");
    }

    #[test]
    fn the_tables_show_ratios_beside_absolutes() {
        let results = results();
        let groups = groups(&results);
        let csv = builds(&groups[1]).to_csv().unwrap();
        assert!(csv.contains("\nniwaki,bonsai,40,20,4,80,,10,1,999,40,100,50,1,1,20\n"), "{csv}");
        let csv = traces(&groups[1]).to_csv().unwrap();
        assert!(csv.contains("\nniwaki,bonsai,avx2,1,0.5,0.25\n"), "{csv}");
        assert!(csv.contains("\nembree,medium,embree,4,2,1\n"), "{csv}");
    }

    #[test]
    fn break_even_tells_ours_and_all_apart() {
        let results = results();
        let groups = groups(&results);
        let csv = break_even(&groups[0]).to_csv().unwrap();
        assert!(csv.contains("\nniwaki,0,∞,sweep,"), "{csv}");
        assert!(csv.contains("\nall,0,∞,embree:medium,"), "{csv}");
    }

    #[test]
    fn raw_files_have_every_field() {
        let files = raw(&results()).unwrap();
        assert_eq!(files[0].1.lines().count(), 7);
        assert!(files[0].1.contains("sah_inner") && files[1].1.contains("mrays_per_s"));
    }
}
