//! What frames took: the results file, the table and the plot.

use super::args::RenderArgs;
use crate::{
    machine,
    report::{
        axis::LinearAxis,
        canvas::{LEGEND, PALETTE, chart, draw, failed, legend},
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
            let x = LinearAxis::up_to(self.frames.len() as f64);
            let axes = (x, LinearAxis::up_to(most * 1.05));
            let mut chart = chart(area, axes, ("frame", "ms"), LEGEND)?;
            for (i, frame) in self.frames.iter().enumerate() {
                let mut from = 0.0;
                for (part, colour) in parts.iter().zip(PALETTE.iter().cycle()) {
                    let to = from + frame.ms(part);
                    let corners = [(i as f64, from), (i as f64 + 1.0, to)];
                    let bar = Rectangle::new(corners, colour.filled());
                    chart.draw_series([bar]).map_err(failed)?;
                    from = to;
                }
            }
            // The last part is on top, in the plot and in its legend.
            legend(area, parts.iter().copied().enumerate().rev())
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
