//! Tables of a study.

use super::rows::{Cell, Key, Study};
use crate::power::published::{self, ALGORITHMS, LIGHTS};
use crate::report::table::{Best, Cell as Entry, Table};
use niwaki_raster::Algorithm;

/// A table with its heading.
pub(super) struct Titled {
    pub(super) title: String,
    pub(super) table: Table,
}

/// All cells.
pub(super) fn cells(study: &Study) -> Table {
    let mut table = Table::new("study-cells")
        .column("scene", Best::Neither)
        .column("size", Best::Neither)
        .column("algorithm", Best::Neither)
        .column("lights", Best::Neither)
        .column("map\nside", Best::Neither)
        .column("frames", Best::Neither)
        .column_with_digits("ms/frame", Best::Neither, 3)
        .column_with_digits("std. dev.\nof the path", Best::Neither, 3)
        .column_with_digits("repetitions\n± %", Best::Neither, 1)
        .column_with_digits("GPU\nms/frame", Best::Neither, 3)
        .column_with_digits("ns/pixel", Best::Neither, 2)
        .column_with_digits("others\ncores", Best::Neither, 2);
    let has_energy = study.cells.iter().any(|c| c.energy.is_some());
    if has_energy {
        table = table
            .column_with_digits("nJ/pixel", Best::Neither, 1)
            .column_with_digits("std. dev.", Best::Neither, 1)
            .column_with_digits("± 95 %", Best::Neither, 2)
            .column_with_digits("mean W", Best::Neither, 2)
            .column_with_digits("busy W", Best::Neither, 2)
            .column_with_digits("idle W", Best::Neither, 2)
            .column("measured", Best::Neither)
            .column("incomplete", Best::Neither);
    }
    for cell in &study.cells {
        let key = &cell.key;
        let spread =
            cell.repeats_ms.iter().map(|ms| (ms / cell.ms - 1.0).abs()).fold(0.0, f64::max);
        let spread = (cell.repeats_ms.len() > 1).then_some(100.0 * spread);
        let mut row = vec![
            Entry::from(key.scene.as_str()),
            key.size().into(),
            key.algorithm.short().into(),
            (key.lights as usize).into(),
            (cell.map_side > 0).then_some(cell.map_side as usize).into(),
            cell.drawn.into(),
            cell.ms.into(),
            cell.deviation_ms.into(),
            spread.into(),
            cell.gpu_ms.into(),
            cell.ns_per_pixel().0.into(),
            cell.other_cores.into(),
        ];
        if has_energy {
            let e = cell.energy.as_ref();
            #[expect(clippy::cast_possible_truncation, reason = "counts of frames")]
            row.extend([
                Entry::from(e.map(|e| e.nj_per_pixel)),
                e.map(|e| e.deviation).into(),
                e.map(|e| e.half_width).into(),
                e.map(|e| e.mean_w).into(),
                e.map(|e| e.busy_w).into(),
                e.and_then(|e| e.idle_w).into(),
                e.map(|e| if e.by_frame { "frame by frame" } else { "in windows" }).into(),
                e.map(|e| e.incomplete as usize).into(),
            ]);
        }
        table.push(row);
    }
    table
}

/// A row of table 1: what stands for each algorithm.
struct Row<'a> {
    name: String,
    cells: [Option<&'a Cell>; 6],
}

/// Rows of this device: the paper's scenes in a row where both are there, then each scene.
fn rows(study: &Study) -> Vec<Row<'_>> {
    let mut lights: Vec<u32> = study
        .cells
        .iter()
        .filter(|c| c.key.algorithm.has_shadows())
        .map(|c| c.key.lights)
        .collect();
    lights.sort_unstable();
    lights.dedup();
    let find = |scene: &str, size: &Key, algorithm: Algorithm| {
        study.cells.iter().find(|cell| {
            let key = &cell.key;
            key.scene == scene
                && (key.width, key.height) == (size.width, size.height)
                && key.algorithm == algorithm
                && key.is_in_table(&lights)
        })
    };
    let mut sizes: Vec<&Key> = Vec::new();
    for cell in &study.cells {
        if !sizes.iter().any(|k| (k.width, k.height) == (cell.key.width, cell.key.height)) {
            sizes.push(&cell.key);
        }
    }
    let mut all = Vec::new();
    for size in sizes {
        let scenes: Vec<&str> = study.scenes.iter().map(|s| s.name.as_str()).collect();
        let of = |primary: &str, shadows: &str| {
            Algorithm::ALL.map(|a| find(if a.has_shadows() { shadows } else { primary }, size, a))
        };
        let paper = ["serpents", "tessellated"];
        let has_both = paper.iter().all(|name| scenes.contains(name));
        if has_both {
            let name = format!("serpents and tessellated, {}", size.size());
            all.push(Row { name, cells: of(paper[0], paper[1]) });
        }
        for scene in scenes {
            let cells = of(scene, scene);
            // The atrium without shadows is all in the row above.
            if !(has_both && scene == paper[0] && cells[3..].iter().all(Option::is_none)) {
                all.push(Row { name: format!("{scene}, {}", size.size()), cells });
            }
        }
    }
    all.retain(|row| row.cells.iter().any(Option::is_some));
    all
}

fn columns(name: &str, first: &str) -> Table {
    let table = Table::new(name).column(first, Best::Neither);
    ALGORITHMS.iter().fold(table, |table, algorithm| table.column(*algorithm, Best::Neither))
}

fn bracketed(value: f64, deviation: f64) -> Entry {
    if !value.is_finite() {
        return Entry::Missing;
    }
    let digits = match value {
        x if x < 10.0 => 2,
        x if x < 1000.0 => 1,
        _ => 0,
    };
    format!("{value:.digits$} [{deviation:.0$}]", digits.max(1)).into()
}

/// Table 1 by the paper's layout: energy where there is some, time, and both relative to FR and SM, with
/// the published devices.
pub(super) fn table_1(study: &Study) -> Vec<Titled> {
    let rows = rows(study);
    let Ok(published) = published::table_1() else { return Vec::new() };
    let mut devices: Vec<&str> = published.iter().map(|c| c.device.as_str()).collect();
    devices.dedup();
    let cell_of = |device: &str, algorithm: &str| {
        published.iter().find(|c| c.device == device && c.algorithm == algorithm)
    };
    let lights = study
        .cells
        .iter()
        .map(|c| &c.key)
        .find(|k| {
            k.algorithm.has_shadows()
                && rows.iter().any(|r| r.cells.iter().flatten().any(|c| c.key == **k))
        })
        .map_or(LIGHTS, |k| k.lights);
    let mut all = Vec::new();

    let mut energy = columns("study-table-1", "device");
    for device in &devices {
        let mut row = vec![Entry::from(format!("{device} (published, 4 lights)"))];
        row.extend(ALGORITHMS.iter().map(|a| {
            cell_of(device, a).map_or(Entry::Missing, |c| bracketed(c.energy, c.deviation))
        }));
        energy.push(row);
    }
    for row in rows.iter().filter(|r| r.cells.iter().flatten().any(|c| c.energy.is_some())) {
        let mut entries = vec![Entry::from(row.name.as_str())];
        entries.extend(row.cells.iter().map(|cell| {
            let energy = cell.and_then(|c| c.energy.as_ref());
            energy.map_or(Entry::Missing, |e| bracketed(e.nj_per_pixel, e.deviation))
        }));
        energy.push(entries);
    }
    let title = format!(
        "Table 1: average energy per pixel in nJ [standard deviation]; here SV, SM and VSM with {lights} lights"
    );
    all.push(Titled { title, table: energy });

    let mut time = columns("study-table-1-time", "here");
    for row in &rows {
        let mut entries = vec![Entry::from(row.name.as_str())];
        entries.extend(row.cells.iter().map(|cell| {
            cell.map_or(Entry::Missing, |c| {
                let (value, deviation) = c.ns_per_pixel();
                bracketed(value, deviation)
            })
        }));
        time.push(entries);
    }
    let title =
        "The same for time: average nanoseconds per pixel [standard deviation over frames]".into();
    all.push(Titled { title, table: time });

    let mut relative = Table::new("study-table-1-relative").column("", Best::Neither);
    for name in ["FR", "ZR ÷ FR", "DR ÷ FR", "SV ÷ SM", "SM", "VSM ÷ SM"] {
        relative = relative.column_with_digits(name, Best::Neither, 2);
    }
    let mut add = |name: String, values: [Option<f64>; 6]| {
        let base = |at: usize| if at < 3 { values[0] } else { values[4] };
        let mut row = vec![Entry::from(name)];
        row.extend(
            (0..6).map(|at| Entry::from(values[at].zip(base(at)).map(|(x, base)| x / base))),
        );
        if values.iter().any(Option::is_some) {
            relative.push(row);
        }
    };
    for device in &devices {
        let values = ALGORITHMS.map(|a| cell_of(device, a).map(|c| c.energy));
        add(format!("{device}: energy (published)"), values);
    }
    for row in &rows {
        let of = |f: fn(&Cell) -> Option<f64>| row.cells.map(|cell| cell.and_then(f));
        add(format!("{}: energy", row.name), of(|c| c.energy.as_ref().map(|e| e.nj_per_pixel)));
        add(format!("{}: time", row.name), of(|c| Some(c.ms)));
        add(format!("{}: time on the GPU", row.name), of(|c| c.gpu_ms));
    }
    let title =
        "Table 1 relative to FR and to SM, so that its shape can be compared across devices".into();
    all.push(Titled { title, table: relative });
    all
}

/// Times of passes.
pub(super) fn passes(cells: &[&Cell], name: &str) -> Table {
    let mut names: Vec<&str> = Vec::new();
    for pass in cells.iter().flat_map(|c| &c.passes) {
        if !names.contains(&pass.name.as_str()) {
            names.push(&pass.name);
        }
    }
    let mut table = Table::new(name).column("algorithm", Best::Neither);
    for name in &names {
        table =
            table.column_with_digits(format!("{}\nms", name.replace('_', " ")), Best::Neither, 3);
    }
    table = table.column_with_digits("all\nms", Best::Neither, 3);
    for cell in cells {
        let of = |name: &&str| cell.passes.iter().find(|p| p.name == **name).map(|p| p.ms);
        let mut row = vec![Entry::from(cell.key.name())];
        row.extend(names.iter().map(|name| Entry::from(of(name))));
        row.push(cell.gpu_ms.into());
        table.push(row);
    }
    table
}
