//! `gpu.json`, `gpu.html` and `csv/*.csv`.

use super::lanes::{Lane, plot};
use super::rows::{Study, TraceRow};
use super::tables::{all, once, rate, raw};
use crate::report::page::{self, FOOT, add_table, csv_link, figure, head, run_header};
use crate::report::table::escape;
use crate::report::write_page;
use anyhow::Result;
use std::fmt::Write as _;
use std::path::Path;

const HOW_TO_READ: &str = "<h2>How to read</h2>\n<ul>\n\
    <li>Times are the device's own, medians of measurements in turns. A build goes from vertices and \
    indices on the device to a finished tree; trees from the GPU were compared with the CPU's, bit for \
    bit.</li>\n\
    <li><em>÷ driver</em>: the geometric mean over ray sets of a kernel's rate over the best rate of \
    the driver's own ray tracing; over 1 we are faster. A device without ray-tracing cores runs that \
    as a program too.</li>\n\
    <li>Kernels: the tree, its layout (binary nodes of 32 bytes, or eight quantised children in 96), the \
    triangle test, and which thread traces which ray.</li>\n\
    <li><em>other hits</em>: answers that differ from those of the scalar CPU kernel and were settled \
    in exact arithmetic as ties or rounding; <em>wrong</em>: those that it contradicts. A kernel of \
    ours with one is not timed.</li>\n</ul>\n";

/// Writes everything into a folder.
pub(super) fn save(study: &Study, out: &Path) -> Result<()> {
    let mut html = head("On the GPU");
    let mut files = Vec::new();
    let device = &study.device;
    html.push_str("<dl class=\"run\">");
    let mut add = |name: &str, value: &str| {
        let _ = write!(html, "<dt>{name}</dt><dd>{}</dd>", escape(value));
    };
    add("device", &format!("{} ({}), {}", device.name, device.kind, device.driver));
    let mib = |bytes: u64| bytes >> 20;
    let (memory, binding) = (mib(device.memory_bytes), mib(device.max_binding_bytes));
    add(
        "limits",
        &format!(
            "Vulkan {}, {memory} MiB of memory, {binding} MiB a binding, subgroups of {}",
            device.api, device.subgroup_size
        ),
    );
    if !device.has_timestamps {
        add("clock", "the host's, waiting included: the device has no timestamps");
    }
    html.push_str("</dl>\n");
    html.push_str(&run_header(&study.run, None));
    page::failures(&mut html, &study.failures);
    for (title, table) in all(study) {
        let _ = writeln!(html, "<h2>{}</h2>", escape(&title));
        if title == "Builds" {
            let caption =
                "Million triangles a second of each builder; triangles mark the driver's own.";
            figure(&mut html, &mut files, &builds(study)?, caption, &table)?;
        } else if let Some(scene) = scene_of(study, &title) {
            let rows: Vec<_> = study.traces.iter().filter(|row| row.scene == scene).collect();
            let caption = "Million rays a second of each kernel; triangles mark the driver's own.";
            figure(&mut html, &mut files, &rays(&rows)?, caption, &table)?;
        }
        let csv = table.to_csv()?;
        html.push_str(&table.to_html());
        let _ = writeln!(html, "<p class=\"csv\">{}</p>", csv_link(&table.name, &csv));
        if !files.iter().any(|(name, _)| *name == table.name) {
            files.push((table.name.clone(), csv));
        }
    }
    html.push_str(HOW_TO_READ);
    if !study.traces.is_empty() {
        html.push_str("<h2>All rows of rays</h2>\n<details><summary>Show</summary>\n");
        add_table(&mut html, &mut files, &raw(&study.traces))?;
        html.push_str("</details>\n");
    }
    html.push_str(FOOT);
    write_page(&html, files, out, "gpu.html")?;
    let path = out.join("gpu.json");
    crate::results::write_json(&path, study)
}

/// The scene that a table is about.
fn scene_of<'a>(study: &'a Study, title: &str) -> Option<&'a str> {
    let scenes = study.traces.iter().map(|row| row.scene.as_str());
    once(scenes)
        .into_iter()
        .find(|scene| title.strip_prefix(scene).is_some_and(|t| t.starts_with(": ")))
}

/// Rates of builders by scene.
fn builds(study: &Study) -> Result<String> {
    let scenes = once(study.builds.iter().map(|row| row.scene.as_str()));
    let builders = once(study.builds.iter().map(|row| row.builder.as_str()));
    let lanes: Vec<_> = builders
        .into_iter()
        .map(|builder| {
            let of = |scene: &&str| {
                let row = study.builds.iter().find(|r| r.scene == *scene && r.builder == builder);
                row.and_then(|row| row.mtriangles_per_s)
            };
            let is_peer = builder.starts_with("driver");
            Lane { name: builder, values: scenes.iter().map(of).collect(), is_peer }
        })
        .collect();
    plot("Rates of builds", "million triangles a second", &scenes, &lanes)
}

/// Rates of kernels by ray set.
fn rays(rows: &[&TraceRow]) -> Result<String> {
    let sets = once(rows.iter().map(|row| row.rays.as_str()));
    let lanes: Vec<_> = once(rows.iter().map(|row| row.engine.as_str()))
        .into_iter()
        .map(|engine| Lane {
            name: engine,
            values: sets.iter().map(|set| rate(rows, engine, set)).collect(),
            is_peer: rows.iter().any(|row| row.engine == engine && row.is_driver),
        })
        .collect();
    plot("Rates of rays", "million rays a second", &sets, &lanes)
}

#[cfg(test)]
mod tests {
    use super::super::rows::{BuildRow, DeviceRow};
    use super::*;
    use niwaki_trace_vulkan::Device;

    #[test]
    fn what_was_not_measured_is_a_row_too() {
        // Any device will do for the header; without one there is nothing to show.
        let Some(info) = Device::list().ok().and_then(|list| list.into_iter().next()) else {
            return;
        };
        let rows = ["camera", "ao"].map(|rays| TraceRow {
            scene: "city:10k".into(),
            rays: rays.into(),
            engine: "lbvh, wide".into(),
            mrays_per_s: Some(12.5),
            ..TraceRow::default()
        });
        let failed = TraceRow {
            engine: "best, wide".into(),
            note: Some("needs bindings of 611 MiB".into()),
            ..rows[0].clone()
        };
        let failed = TraceRow { mrays_per_s: None, ..failed };
        let study = Study {
            schema: 1,
            run: crate::results::Run::default(),
            device: DeviceRow::from(&info),
            builds: vec![BuildRow {
                scene: "city:10k".into(),
                builder: "lbvh, 63 bits".into(),
                note: Some("needs bindings of 1220 MiB".into()),
                ..BuildRow::default()
            }],
            traces: rows.into_iter().chain([failed]).collect(),
            failures: Vec::new(),
        };
        let out = std::env::temp_dir().join(format!("niwaki-gpu-{}", std::process::id()));
        save(&study, &out).unwrap();
        let html = std::fs::read_to_string(out.join("gpu.html")).unwrap();
        for part in ["1220 MiB", "611 MiB", "12.5", "<svg ", "lbvh, wide"] {
            assert!(html.contains(part), "{part}");
        }
        for file in ["gpu-builds", "gpu-rays", "gpu-rays-city_10k"] {
            let csv = std::fs::read_to_string(out.join(format!("csv/{file}.csv"))).unwrap();
            assert!(csv.lines().count() >= 2, "{file}: {csv}");
        }
        assert!(out.join("gpu.json").is_file());
        std::fs::remove_dir_all(out).unwrap();
    }
}
