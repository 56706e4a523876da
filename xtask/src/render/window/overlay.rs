//! What stands over the picture: times, settings, the plan, help.

use super::{
    keys::HELP,
    text::{Corner, Ink, Lines, Page},
};
use crate::render::{frames::Part, steer::Controls};

/// What is written.
pub(super) struct Report<'a> {
    /// Device, scene, size.
    pub(super) title: &'a [String],
    /// Parts of the frame in the order in which they ran.
    pub(super) parts: &'a [Part],
    /// What was counted, by name.
    pub(super) counts: &'a [(&'static str, u64)],
    /// Time, speed, path.
    pub(super) notes: &'a [String],
    /// The plan of the frame.
    pub(super) plan: &'a str,
    /// What just happened.
    pub(super) message: Option<&'a str>,
}

/// Cells of the longest bar.
const BAR: u32 = 10;

/// Lays it out on a window of so many pixels; `zoom` is how many pixels one of the font takes.
pub(super) fn page(window: [u32; 2], zoom: u32, controls: &Controls, report: &Report<'_>) -> Page {
    let mut page = Page::default();
    if controls.times {
        // Side by side, since below each other they would need a high window.
        page.put(&times(report), Corner::TopLeft, window, zoom);
        page.put(&settings(controls, report), Corner::TopRight, window, zoom);
    }
    if controls.plan {
        let mut lines = Lines::default();
        for line in report.plan.lines() {
            lines.line().write(line, Ink::Plain);
        }
        page.put(&lines, Corner::BottomLeft, window, zoom);
    }
    let mut corner = Lines::default();
    if let Some(message) = report.message {
        corner.line().write(message, Ink::Warn);
    }
    if controls.help {
        page.put(&help(), Corner::Middle, window, zoom);
    } else {
        corner.line().write("F1 or H: keys", Ink::Faint);
    }
    if !corner.is_empty() {
        page.put(&corner, Corner::BottomRight, window, zoom);
    }
    page
}

fn times(report: &Report<'_>) -> Lines {
    let mut lines = Lines::default();
    for line in report.title {
        lines.line().write(line, Ink::Plain);
    }
    let total: f64 = report.parts.iter().map(|part| part.ms).sum();
    let rate = if total > 0.0 { 1e3 / total } else { 0.0 };
    lines.line().write(&format!("{total:.2} ms a frame, {rate:.1} a second"), Ink::Plain);
    lines.line();
    let longest = report.parts.iter().map(|part| part.ms).fold(1e-9, f64::max);
    for part in report.parts {
        lines
            .line()
            .write(&format!("{:<20}", part.name), Ink::Faint)
            .write(&format!("{:>10.3} ", part.ms), Ink::Plain)
            .bar(part.ms / longest, BAR);
    }
    lines.line();
    for (name, count) in report.counts.iter().filter(|(_, count)| *count > 0) {
        let number = format!("{count:>10}");
        lines.line().write(&format!("{name:<26}"), Ink::Faint).write(&number, Ink::Plain);
    }
    lines
}

fn settings(controls: &Controls, report: &Report<'_>) -> Lines {
    let mut lines = Lines::default();
    for [keys, name, value] in controls.lines() {
        lines
            .line()
            .write(&format!("{name:<10}"), Ink::Faint)
            .write(&format!("{value:<27}"), Ink::Plain)
            .write(&keys, Ink::Faint);
    }
    lines.line();
    for line in report.notes {
        lines.line().write(line, Ink::Plain);
    }
    lines
}

fn help() -> Lines {
    let mut lines = Lines::default();
    for (group, keys) in HELP {
        lines.line().write(group, Ink::Warn);
        for line in *keys {
            let keys = format!("  {:<14}", line.keys);
            lines.line().write(&keys, Ink::Plain).write(line.what, Ink::Faint);
        }
    }
    lines
}
