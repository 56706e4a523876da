//! Tables of what was measured.

use super::rows::{BuildRow, Study, TraceRow};
use crate::report::geometric_mean;
use crate::report::table::{Best, Cell, Table};

const MIB: f64 = (1 << 20) as f64;

/// Every name once, in the order of appearance.
pub(super) fn once<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut seen = Vec::new();
    for name in names {
        if !seen.contains(&name) {
            seen.push(name);
        }
    }
    seen
}

/// All tables with their titles.
pub(super) fn all(study: &Study) -> Vec<(String, Table)> {
    let mut tables = Vec::new();
    if !study.builds.is_empty() {
        tables.push(("Builds".to_owned(), builds(&study.builds)));
        tables.push(("Stages of the linear BVH, ms".to_owned(), stages(&study.builds)));
    }
    for scene in once(study.traces.iter().map(|row| row.scene.as_str())) {
        let rows: Vec<&TraceRow> = study.traces.iter().filter(|row| row.scene == scene).collect();
        tables.push((format!("{scene}: million rays a second"), traces(scene, &rows)));
    }
    tables
}

fn note(note: Option<&String>) -> Cell {
    note.map_or_else(|| "".into(), |note| note.as_str().into())
}

fn builds(rows: &[BuildRow]) -> Table {
    let mut table = Table::new("gpu-builds")
        .column("scene", Best::Neither)
        .column("triangles", Best::Neither)
        .column("builder", Best::Neither)
        .column_with_digits("ms", Best::Neither, 3)
        .column("million\ntriangles/s", Best::Neither)
        .column_with_digits("MiB", Best::Neither, 1)
        .column("", Best::Neither);
    for row in rows {
        table.push(vec![
            row.scene.as_str().into(),
            row.triangles.into(),
            row.builder.as_str().into(),
            row.ms.into(),
            row.mtriangles_per_s.into(),
            row.bytes.map(|bytes| bytes as f64 / MIB).into(),
            note(row.note.as_ref()),
        ]);
    }
    table
}

/// Of our builds on the device.
fn stages(rows: &[BuildRow]) -> Table {
    let ours: Vec<&BuildRow> =
        rows.iter().filter(|row| row.stages.iter().any(|stage| stage.name == "sort")).collect();
    let names = once(ours.iter().flat_map(|row| row.stages.iter().map(|s| s.name.as_str())));
    let mut table = Table::new("gpu-build-stages")
        .column("scene", Best::Neither)
        .column("builder", Best::Neither);
    for name in &names {
        table = table.column_with_digits(*name, Best::Neither, 3);
    }
    for row in &ours {
        let mut cells: Vec<Cell> = vec![row.scene.as_str().into(), row.builder.as_str().into()];
        cells.extend(names.iter().map(|name| {
            let stage = row.stages.iter().find(|stage| stage.name == *name);
            Cell::from(stage.map(|stage| stage.ms))
        }));
        table.push(cells);
    }
    table
}

/// The rate of a kernel on a ray set.
pub(super) fn rate(rows: &[&TraceRow], engine: &str, rays: &str) -> Option<f64> {
    rows.iter().find(|row| row.engine == engine && row.rays == rays)?.mrays_per_s
}

/// The best rate of the driver on a ray set.
fn best_of_driver(rows: &[&TraceRow], rays: &str) -> Option<f64> {
    let of_driver = rows.iter().filter(|row| row.is_driver && row.rays == rays);
    of_driver.filter_map(|row| row.mrays_per_s).reduce(f64::max)
}

fn traces(scene: &str, rows: &[&TraceRow]) -> Table {
    let sets = once(rows.iter().map(|row| row.rays.as_str()));
    let mut table = Table::new(format!("gpu-rays-{}", crate::report::slug(scene)))
        .column("kernel", Best::Neither);
    for set in &sets {
        table = table.column(*set, Best::High);
    }
    table = table
        .column_with_digits("÷ driver", Best::High, 2)
        .column_with_digits("MiB", Best::Neither, 1)
        .column("rays\nchecked", Best::Neither)
        .column("other\nhits", Best::Neither)
        .column("wrong", Best::Neither)
        .column("", Best::Neither);
    for engine in once(rows.iter().map(|row| row.engine.as_str())) {
        let own: Vec<&&TraceRow> = rows.iter().filter(|row| row.engine == engine).collect();
        let rates: Vec<Option<f64>> = sets.iter().map(|set| rate(rows, engine, set)).collect();
        let ratios: Vec<f64> = sets
            .iter()
            .zip(&rates)
            .filter_map(|(set, rate)| Some((*rate)? / best_of_driver(rows, set)?))
            .collect();
        let ratio = if ratios.is_empty() { None } else { geometric_mean(ratios) };
        let sum = |count: fn(&TraceRow) -> u64| {
            let total: u64 = own.iter().map(|row| count(row)).sum();
            Cell::from(total as f64)
        };
        let mut cells: Vec<Cell> = vec![engine.into()];
        cells.extend(rates.into_iter().map(Cell::from));
        cells.push(ratio.into());
        cells.push(own[0].bytes.map(|bytes| bytes as f64 / MIB).into());
        cells.push(sum(|row| row.checked.rays));
        cells.push(sum(|row| row.checked.tie + row.checked.rounding));
        cells.push(sum(|row| row.checked.ours_wrong));
        cells.push(note(own.iter().find_map(|row| row.note.as_ref())));
        table.push(cells);
    }
    table
}

/// All rows of rays, for the CSV.
pub(super) fn raw(rows: &[TraceRow]) -> Table {
    let mut table = Table::new("gpu-rays");
    for name in [
        "scene",
        "triangles",
        "rays",
        "query",
        "kernel",
        "rays of the set",
        "repeats",
        "ms",
        "million rays/s",
        "bytes",
        "checked",
        "ties",
        "rounding",
        "wrong",
        "note",
    ] {
        table = table.column(name, Best::Neither);
    }
    for row in rows {
        table.push(vec![
            row.scene.as_str().into(),
            row.triangles.into(),
            row.rays.as_str().into(),
            row.query.as_str().into(),
            row.engine.as_str().into(),
            row.ray_count.into(),
            row.repeats.into(),
            row.ms.into(),
            row.mrays_per_s.into(),
            row.bytes.map(|bytes| bytes as f64).into(),
            (row.checked.rays as f64).into(),
            (row.checked.tie as f64).into(),
            (row.checked.rounding as f64).into(),
            (row.checked.ours_wrong as f64).into(),
            note(row.note.as_ref()),
        ]);
    }
    table
}
