//! Tables of an analysis.

use super::published::{self, ALGORITHMS, LIGHTS};
use crate::report::table::{Best, Cell, Table};
use anyhow::Result;
use niwaki_power::{Analysis, Fault, GapPlace, GroupResult, IdlePolicy, Quality, Segmentation};

/// What is said before tables.
pub(super) fn summary(analysis: &Analysis) -> Vec<(&'static str, String)> {
    let q = &analysis.quality;
    let mut lines = vec![
        (
            "sensor",
            format!("{}; {}", or(&analysis.info.sensor.name, "not named"), analysis.sensor.words),
        ),
        (
            "trace",
            format!(
                "{:.3} s, {} rows, {} samples, {:.1} a second (jitter {:.2} µs)",
                q.duration_s(),
                q.rows,
                q.samples,
                1e9 / q.period_ns.max(1e-9),
                1e-3 * q.jitter_ns
            ),
        ),
        (
            "energy",
            format!(
                "{:.3} J over {:.3} s, mean {:.2} W; levels {:.1} W (lowest) to {:.1} W, noise {:.2} W",
                analysis.total_j,
                analysis.measured_s,
                analysis.total_j / analysis.measured_s.max(1e-12),
                analysis.levels.low_w,
                analysis.levels.high_w,
                analysis.levels.noise_w
            ),
        ),
    ];
    let how = match analysis.segmentation {
        Segmentation::Log => "one by one, by the frame log",
        Segmentation::Marks => "from mark to mark",
        Segmentation::LogWindows => "in windows of many frames of the log",
        Segmentation::Windows => "none: windows of time",
    };
    lines.push(("frames", format!("{how}; {} measured", analysis.frames.len())));
    if let Some(clock) = &analysis.clock {
        let mut words = format!(
            "{}: offset {:.6} s ± {:.1} µs, drift {:.3} ± {:.3} ppm; {} matched, deviation {:.1} µs",
            clock.method.name(),
            1e-9 * clock.offset_ns,
            1e-3 * clock.offset_error_ns,
            clock.drift_ppm,
            clock.drift_error_ppm,
            clock.matched,
            1e-3 * clock.residual_ns
        );
        if let Some(similarity) = clock.similarity {
            words += &format!("; pattern found with correlation {similarity:.3}");
        }
        if let Some(next) = clock.runner_up {
            words += &format!(" (next best position {next:.3})");
        }
        if clock.is_ambiguous() {
            words += "; AMBIGUOUS: another position fits nearly as well";
        }
        lines.push(("synchronised by", words));
    }
    let idle = &analysis.idle;
    let policy = match idle.policy {
        IdlePolicy::Keep => "nothing is subtracted: all that flows counts".to_owned(),
        IdlePolicy::Watts(w) => format!("{w} W are subtracted, as given"),
        IdlePolicy::Outside => {
            format!("{:.3} W are subtracted, the mean before and after the frames", idle.watts)
        }
        IdlePolicy::Lowest => format!("{:.3} W are subtracted, the lowest level", idle.watts),
    };
    let outside = idle.outside_w.map(|w| format!(" (outside of frames: {w:.2} W)"));
    lines.push(("idle power", policy + &outside.unwrap_or_default()));
    lines
}

fn or<'a>(text: &'a str, other: &'a str) -> &'a str {
    if text.is_empty() { other } else { text }
}

/// The name of a group.
pub(super) fn name(group: &GroupResult) -> String {
    match (group.algorithm.as_str(), group.lights) {
        ("", _) => "all".into(),
        (algorithm, 0) => algorithm.into(),
        (algorithm, lights) => format!("{algorithm}, {lights} lights"),
    }
}

/// One row for each group.
pub(super) fn groups(analysis: &Analysis) -> Table {
    let mut table = Table::new("power-groups")
        .column("algorithm", Best::Neither)
        .column("frames", Best::Neither)
        .column_with_digits("nJ/pixel", Best::Low, 1)
        .column_with_digits("std. dev.", Best::Neither, 1)
        .column_with_digits("± 95 %", Best::Neither, 2)
        .column_with_digits("J/frame", Best::Low, 4)
        .column_with_digits("ms/frame", Best::Low, 3)
        .column_with_digits("mean W", Best::Neither, 2)
        .column_with_digits("busy W", Best::Neither, 2)
        .column_with_digits("idle inside\nms/frame", Best::Neither, 3)
        .column_with_digits("idle between\nms/frame", Best::Neither, 3)
        .column("incomplete", Best::Neither)
        .column("repaired", Best::Neither)
        .column("clipped", Best::Neither);
    for group in &analysis.groups {
        #[expect(clippy::cast_possible_truncation, reason = "counts of frames")]
        let count = |n: u64| Cell::from(n as usize);
        table.push(vec![
            name(group).into(),
            count(group.frames),
            group.energy.mean_nj_per_pixel.into(),
            group.energy.deviation_nj_per_pixel.into(),
            group.energy.half_width_nj_per_pixel.into(),
            group.energy_j.mean.into(),
            (1e3 * group.time_s.mean).into(),
            group.power_w.mean.into(),
            group.busy_w.mean.into(),
            (1e3 * group.idle_inside_s).into(),
            (1e3 * group.idle_between_s).into(),
            count(group.incomplete),
            count(group.repaired),
            count(group.clipped),
        ]);
    }
    table
}

/// The paper's table 1, and this trace in the same columns.
pub(super) fn table_1(analysis: &Analysis, device: &str) -> Result<Table> {
    let published = published::table_1()?;
    let mut table = Table::new("power-table-1").column("device", Best::Neither);
    for algorithm in ALGORITHMS {
        table = table.column(algorithm, Best::Neither);
    }
    let cell = |energy: f64, deviation: f64| -> Cell {
        let digits = if energy < 1000.0 { 1 } else { 0 };
        format!("{energy:.digits$} [{deviation:.1}]").into()
    };
    let mut devices: Vec<&str> = Vec::new();
    for row in &published {
        if !devices.contains(&row.device.as_str()) {
            devices.push(&row.device);
        }
    }
    for of in devices {
        let mut row = vec![Cell::from(format!("{of} (published)"))];
        row.extend(ALGORITHMS.iter().map(|algorithm| {
            let found = published.iter().find(|c| c.device == of && c.algorithm == *algorithm);
            found.map_or(Cell::Missing, |c| cell(c.energy, c.deviation))
        }));
        table.push(row);
    }
    let mut row = vec![Cell::from(format!("{device} (this trace)"))];
    row.extend(ALGORITHMS.iter().map(|algorithm| {
        group_of(analysis, algorithm).map_or(Cell::Missing, |at| {
            let energy = &analysis.groups[at].energy;
            if energy.mean_nj_per_pixel.is_finite() {
                cell(energy.mean_nj_per_pixel, energy.deviation_nj_per_pixel)
            } else {
                Cell::Missing
            }
        })
    }));
    table.push(row);
    Ok(table)
}

/// The group of an algorithm that goes into table 1: that of four lights for shadows, if there are several.
fn group_of(analysis: &Analysis, algorithm: &str) -> Option<usize> {
    let all = || (0..analysis.groups.len()).filter(|&g| analysis.groups[g].algorithm == algorithm);
    all().find(|&g| analysis.groups[g].lights == LIGHTS).or_else(|| all().next())
}

/// Faults by class.
pub(super) fn faults(quality: &Quality) -> Table {
    let mut table = Table::new("power-faults")
        .column("fault", Best::Neither)
        .column("count", Best::Neither)
        .column("rows or samples\nrepaired", Best::Neither)
        .column_with_digits("lost ms", Best::Neither, 3);
    #[expect(clippy::cast_possible_truncation, reason = "counts of rows")]
    let count = |n: u64| Cell::from(n as usize);
    for fault in Fault::ALL {
        let found = quality.count(fault);
        table.push(vec![
            fault.name().into(),
            count(found.count),
            count(found.repaired),
            (1e-6 * found.lost_ns as f64).into(),
        ]);
    }
    let lines = quality.broken_lines;
    table.push(vec!["lines or blocks broken".into(), count(lines), count(0), 0.0.into()]);
    table
}

/// Rails.
pub(super) fn rails(quality: &Quality) -> Table {
    let mut table = Table::new("power-rails")
        .column("rail", Best::Neither)
        .column_with_digits("mean W", Best::Neither, 3)
        .column("clipped samples", Best::Neither)
        .column("note", Best::Neither);
    for rail in &quality.rails {
        let note = rail.suspected_run.map_or(String::new(), |run| {
            format!("the largest reading comes {run} times on end: clipped? (declare its range)")
        });
        #[expect(clippy::cast_possible_truncation, reason = "counts of rows")]
        table.push(vec![
            rail.name.as_str().into(),
            rail.mean_w.into(),
            (rail.clipped as usize).into(),
            note.into(),
        ]);
    }
    table
}

/// Idle gaps by group and place.
pub(super) fn gaps(analysis: &Analysis) -> Table {
    let mut table = Table::new("power-gaps")
        .column("algorithm", Best::Neither)
        .column("gaps inside", Best::Neither)
        .column_with_digits("median ms", Best::Neither, 3)
        .column("gaps between", Best::Neither)
        .column_with_digits("median ms ", Best::Neither, 3);
    for (at, group) in analysis.groups.iter().enumerate() {
        let mut row = vec![Cell::from(name(group))];
        for place in [GapPlace::Inside, GapPlace::Between] {
            let mut lengths: Vec<i64> = analysis
                .gaps
                .iter()
                .filter(|gap| gap.group == at && gap.place == place)
                .map(|gap| gap.length_ns)
                .collect();
            lengths.sort_unstable();
            row.push(lengths.len().into());
            row.push(lengths.get(lengths.len() / 2).map(|ns| 1e-6 * *ns as f64).into());
        }
        table.push(row);
    }
    table
}

/// Frames that take long.
pub(super) fn spikes(analysis: &Analysis) -> Table {
    let mut table = Table::new("power-spikes")
        .column("algorithm", Best::Neither)
        .column("frame", Best::Neither)
        .column_with_digits("ms", Best::Neither, 3)
        .column_with_digits("usual ms", Best::Neither, 3)
        .column_with_digits("idle share\nof the excess", Best::Neither, 2)
        .column_with_digits("busy power\n÷ usual", Best::Neither, 3);
    for spike in &analysis.spikes {
        #[expect(clippy::cast_possible_truncation, reason = "numbers of frames")]
        table.push(vec![
            name(&analysis.groups[spike.group]).into(),
            (spike.frame as usize).into(),
            (1e3 * spike.time_s).into(),
            (1e3 * spike.usual_s).into(),
            spike.idle_share.into(),
            spike.busy_ratio.into(),
        ]);
    }
    table
}

/// Changes of power states.
pub(super) fn states(analysis: &Analysis) -> Table {
    let mut table = Table::new("power-states")
        .column("algorithm", Best::Neither)
        .column("from frame", Best::Neither)
        .column_with_digits("busy W before", Best::Neither, 1)
        .column_with_digits("busy W after", Best::Neither, 1);
    for state in &analysis.states {
        #[expect(clippy::cast_possible_truncation, reason = "numbers of frames")]
        table.push(vec![
            name(&analysis.groups[state.group]).into(),
            (state.frame as usize).into(),
            state.from_w.into(),
            state.to_w.into(),
        ]);
    }
    table
}

/// Every frame or window.
pub(super) fn frames(analysis: &Analysis) -> Table {
    let mut table = Table::new("power-frames");
    for column in [
        "algorithm",
        "frame",
        "frames",
        "start s",
        "ms",
        "busy ms",
        "J",
        "mean W",
        "busy W",
        "idle inside ms",
        "idle between ms",
        "repaired",
        "clipped",
        "incomplete",
    ] {
        table = table.column(column, Best::Neither);
    }
    for frame in &analysis.frames {
        #[expect(clippy::cast_possible_truncation, reason = "numbers of frames")]
        table.push(vec![
            name(&analysis.groups[frame.group]).into(),
            (frame.frame as usize).into(),
            (frame.frames as usize).into(),
            (1e-9 * frame.start_ns).into(),
            (1e3 * frame.time_s).into(),
            (1e3 * frame.busy_s).into(),
            frame.energy_j.into(),
            frame.mean_w.into(),
            frame.busy_w.into(),
            (1e3 * frame.idle_inside_s).into(),
            (1e3 * frame.idle_between_s).into(),
            usize::from(frame.is_repaired).into(),
            usize::from(frame.is_clipped).into(),
            usize::from(frame.is_incomplete).into(),
        ]);
    }
    table
}
