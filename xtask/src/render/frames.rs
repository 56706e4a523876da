//! What frames took: the results file, the table and the plot.

use super::args::RenderArgs;
use crate::{
    machine,
    report::{
        canvas::{FAINT, GRID, INK, SIZE, draw, failed, text},
        table::{Best, Table},
    },
    results::Run,
    scenes::SceneSpec,
};
use anyhow::{Context, Result};
use niwaki_scene::Scene;
use plotters::prelude::*;
use serde::Serialize;
use std::path::Path;

/// All frames; `frames.json`.
#[derive(Debug, Serialize)]
pub(super) struct Frames {
    schema: u32,
    machine: Run,
    threads: usize,
    scene: String,
    triangles: usize,
    mode: String,
    /// The GPU, where one draws.
    pub(super) device: Option<String>,
    width: u32,
    height: u32,
    pub(super) frames: Vec<Frame>,
}

/// One frame.
#[derive(Debug, Serialize)]
pub(super) struct Frame {
    pub(super) number: u32,
    /// File name of the picture, in the folder of the results.
    pub(super) picture: String,
    /// In the order in which they ran. A part that nothing calls for is not there.
    pub(super) parts: Vec<Part>,
    /// Rays by kind, and whatever else was counted.
    pub(super) counts: Vec<Count>,
}

/// What ran, and for how long.
#[derive(Debug, Serialize)]
pub(super) struct Part {
    pub(super) name: String,
    pub(super) ms: f64,
}

/// What was counted.
#[derive(Debug, Serialize)]
pub(super) struct Count {
    pub(super) name: String,
    pub(super) count: u64,
}

/// Colours of parts, in their order.
const COLOURS: [RGBColor; 8] = [
    RGBColor(62, 122, 230),
    RGBColor(20, 150, 100),
    RGBColor(214, 125, 20),
    RGBColor(196, 68, 60),
    RGBColor(160, 84, 200),
    RGBColor(150, 110, 80),
    RGBColor(16, 158, 178),
    RGBColor(120, 128, 138),
];

/// Width of the legend in pixels.
const LEGEND: u32 = 120;

impl Frames {
    pub(super) fn new(spec: &SceneSpec, scene: &Scene, args: &RenderArgs, threads: usize) -> Self {
        Self {
            schema: 1,
            machine: machine::describe(),
            threads,
            scene: spec.describe(),
            triangles: scene.mesh.len(),
            mode: args.mode.name(),
            device: None,
            width: args.size.width,
            height: args.size.height,
            frames: Vec::new(),
        }
    }

    /// Writes `frames.json`, and `frames.svg` if there are two frames or more.
    pub(super) fn save(&self, folder: &Path) -> Result<()> {
        let path = folder.join("frames.json");
        let json = serde_json::to_string_pretty(self)?;
        std::fs::write(&path, json).with_context(|| format!("cannot write {}", path.display()))?;
        if self.frames.len() > 1 {
            let path = folder.join("frames.svg");
            std::fs::write(&path, self.plot()?)
                .with_context(|| format!("cannot write {}", path.display()))?;
        }
        Ok(())
    }

    /// The names of parts or counts, each once, in the order in which they come.
    fn names<'a>(&'a self, of: impl Fn(&'a Frame) -> Vec<&'a str>) -> Vec<&'a str> {
        let mut names: Vec<&str> = Vec::new();
        for name in self.frames.iter().flat_map(of) {
            if !names.contains(&name) {
                names.push(name);
            }
        }
        names
    }

    fn parts(&self) -> Vec<&str> {
        self.names(|frame| frame.parts.iter().map(|part| part.name.as_str()).collect())
    }

    /// What the frames took and what was counted: medians over all, the least and the most.
    pub(super) fn tables(&self) -> [Table; 2] {
        let times = self.parts().into_iter();
        let times = times.map(|name| (name, self.frames.iter().map(|f| f.ms(name)).collect()));
        let counts = self.names(|f| f.counts.iter().map(|count| count.name.as_str()).collect());
        let counts = counts.into_iter();
        let counts = counts.map(|name| (name, self.frames.iter().map(|f| f.count(name)).collect()));
        [table("times", "ms a frame", times), table("counts", "a frame", counts)]
    }

    /// Times of the parts, on top of each other, frame after frame (thesis, paper III, figure 5).
    fn plot(&self) -> Result<String> {
        let parts = self.parts();
        let most = self.frames.iter().map(Frame::total).fold(0.0, f64::max).max(1e-3);
        let description = format!("Milliseconds of each part of {} frames", self.frames.len());
        draw(&description, |area| {
            let mut chart = ChartBuilder::on(area)
                .margin(8)
                .margin_right(LEGEND)
                .x_label_area_size(46)
                .y_label_area_size(62)
                .build_cartesian_2d(0.0..self.frames.len() as f64, 0.0..most * 1.05)
                .map_err(failed)?;
            chart
                .configure_mesh()
                .disable_x_mesh()
                .max_light_lines(0)
                .bold_line_style(GRID)
                .axis_style(FAINT)
                .x_desc("frame")
                .y_desc("ms")
                .x_label_formatter(&|x| format!("{x:.0}"))
                .label_style(text(12.0, FAINT))
                .axis_desc_style(text(13.0, INK))
                .draw()
                .map_err(failed)?;
            for (i, frame) in self.frames.iter().enumerate() {
                let mut from = 0.0;
                for (part, colour) in parts.iter().zip(COLOURS.iter().cycle()) {
                    let to = from + frame.ms(part);
                    let corners = [(i as f64, from), (i as f64 + 1.0, to)];
                    let bar = Rectangle::new(corners, colour.filled());
                    chart.draw_series([bar]).map_err(failed)?;
                    from = to;
                }
            }
            // The last part is on top, in the plot and in its legend.
            for (row, (part, colour)) in parts
                .iter()
                .zip(COLOURS.iter().cycle())
                .collect::<Vec<_>>()
                .iter()
                .rev()
                .enumerate()
            {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_possible_wrap,
                    reason = "pixels"
                )]
                let (x, y) = ((SIZE.0 - LEGEND) as i32 + 12, 18 + 18 * row as i32);
                let corners = [(x - 4, y - 4), (x + 4, y + 4)];
                area.draw(&Rectangle::new(corners, colour.filled())).map_err(failed)?;
                let name = Text::new((**part).to_owned(), (x + 10, y - 7), text(12.0, INK));
                area.draw(&name).map_err(failed)?;
            }
            Ok(())
        })
    }
}

/// Medians and extremes of numbers by name.
fn table<'a>(name: &str, of: &str, rows: impl Iterator<Item = (&'a str, Vec<f64>)>) -> Table {
    let mut table = Table::new(name)
        .column(of, Best::Neither)
        .column("median", Best::Neither)
        .column("least", Best::Neither)
        .column("most", Best::Neither);
    for (name, mut numbers) in rows {
        numbers.sort_by(f64::total_cmp);
        if let (Some(&least), Some(&most)) = (numbers.first(), numbers.last()) {
            let middle = numbers[numbers.len() / 2];
            table.push(vec![name.into(), middle.into(), least.into(), most.into()]);
        }
    }
    table
}

impl Frame {
    /// Milliseconds of a part, 0 if it did not run.
    fn ms(&self, part: &str) -> f64 {
        self.parts.iter().filter(|p| p.name == part).map(|p| p.ms).sum()
    }

    fn count(&self, name: &str) -> f64 {
        self.counts.iter().filter(|c| c.name == name).map(|c| c.count as f64).sum()
    }

    fn total(&self) -> f64 {
        self.parts.iter().map(|part| part.ms).sum()
    }
}
