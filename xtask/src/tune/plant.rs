//! What frames are drawn by: the Vulkan device, or a simulated one.

use super::stage::Stage;
use anyhow::{Context, Result};
use niwaki_frame_control::{
    RenderSettings,
    sim::{self, Counters, DeviceSpec, Hidden},
};
use niwaki_gpu_model::{Workload, workload::Sampling};
use niwaki_gpu_tracer::{FrameCounts, FrameTracer, TracedScene};
use niwaki_metrics::TreeStats;
use niwaki_render::Image;
use niwaki_trace_vulkan::Device;

/// Draws of a frame whose time is not a controller's, of which the median counts.
const ROUNDS: usize = 3;

/// Does a number of things that take milliseconds, one after another and all of them again; the median
/// of each one's times with what else came of it then.
pub(crate) fn in_rounds<T>(
    count: usize,
    mut draw: impl FnMut(usize) -> Result<(f64, T)>,
) -> Result<Vec<(f64, T)>> {
    let mut all: Vec<Vec<(f64, T)>> = (0..count).map(|_| Vec::with_capacity(ROUNDS)).collect();
    for _ in 0..ROUNDS {
        for (i, drawn) in all.iter_mut().enumerate() {
            drawn.push(draw(i)?);
        }
    }
    let median = |mut drawn: Vec<(f64, T)>| {
        drawn.sort_by(|a, b| a.0.total_cmp(&b.0));
        drawn.swap_remove(ROUNDS / 2)
    };
    Ok(all.into_iter().map(median).collect())
}

/// What frames are drawn by.
pub(crate) enum Plant {
    /// A device of Vulkan's.
    Vulkan { tracer: Box<FrameTracer>, scene: Box<TracedScene> },
    /// A simulated device for each controller, and what each frame's view is in truth.
    Simulated { devices: Vec<sim::Device>, views: Vec<sim::View> },
}

impl Plant {
    pub(crate) fn vulkan(device: &Device, stage: &Stage) -> Result<Self> {
        Ok(Self::Vulkan {
            tracer: Box::new(FrameTracer::new(device)?),
            scene: Box::new(TracedScene::upload(device, &stage.bvh, &stage.scene)?),
        })
    }

    /// As many simulated devices as there are controllers, all alike.
    pub(crate) fn simulated(
        name: &str,
        stage: &Stage,
        controllers: usize,
        seed: u64,
    ) -> Result<Self> {
        let spec = match name {
            "geforce-8800" => DeviceSpec::geforce_8800(),
            "geforce-580" => DeviceSpec::geforce_580(),
            _ => DeviceSpec::radeon_5870(),
        };
        let devices = (0..controllers.max(1)).map(|_| sim::Device::new(spec.clone(), seed));
        let devices = devices.collect::<Result<_, _>>().context("a simulated device")?;
        Ok(Self::Simulated { devices, views: truths(stage) })
    }

    /// Milliseconds of a frame drawn for a controller.
    pub(crate) fn draw(
        &mut self,
        stage: &Stage,
        controller: usize,
        frame: usize,
        settings: &RenderSettings,
    ) -> Result<f64> {
        match self {
            Self::Vulkan { tracer, scene } => {
                let times = tracer.draw(scene, &stage.cameras[frame], &stage.frame(settings))?;
                Ok(1e3 * times.total())
            }
            Self::Simulated { devices, views } => {
                Ok(devices[controller].draw(&views[frame], settings))
            }
        }
    }

    /// Milliseconds of a frame that nothing remembers: the median of some for a real device.
    pub(crate) fn probe(
        &mut self,
        stage: &Stage,
        frame: usize,
        settings: &RenderSettings,
    ) -> Result<f64> {
        Ok(self.probe_all(stage, &[(frame, settings)])?[0])
    }

    /// The same of many frames, each once in each round, so that what disturbs for a while is seen through.
    pub(crate) fn probe_all(
        &mut self,
        stage: &Stage,
        frames: &[(usize, &RenderSettings)],
    ) -> Result<Vec<f64>> {
        if let Self::Simulated { devices, views } = self {
            let ideal =
                |(frame, s): &(usize, &RenderSettings)| devices[0].ideal_ms(&views[*frame], s);
            return Ok(frames.iter().map(ideal).collect());
        }
        let draw = |i: usize| Ok((self.draw(stage, 0, frames[i].0, frames[i].1)?, ()));
        Ok(in_rounds(frames.len(), draw)?.into_iter().map(|(ms, ())| ms).collect())
    }

    /// The device's own counts of a frame's work; none of simulated devices.
    pub(crate) fn counts(
        &mut self,
        stage: &Stage,
        frame: usize,
        settings: &RenderSettings,
    ) -> Result<Option<FrameCounts>> {
        match self {
            Self::Vulkan { tracer, scene } => {
                Ok(Some(tracer.count(scene, &stage.cameras[frame], &stage.frame(settings))?))
            }
            Self::Simulated { .. } => Ok(None),
        }
    }

    /// The frame that was drawn last; none of simulated devices.
    pub(crate) fn image(&self) -> Result<Option<Image>> {
        match self {
            Self::Vulkan { tracer, .. } => Ok(Some(tracer.image()?)),
            Self::Simulated { .. } => Ok(None),
        }
    }

    /// Frames from a frame's decision to the first that knows its time.
    pub(crate) const fn delay(&self) -> usize {
        match self {
            Self::Vulkan { .. } => 1,
            Self::Simulated { .. } => 2,
        }
    }
}

/// Columns and rows of pixels that are looked at for the truth about a view.
const FINE: [u16; 2] = [96, 54];
/// Bytes that a traversal step and a triangle read.
const NODE_BYTES: f64 = 96.0;
const TRIANGLE_BYTES: f64 = 48.0;

/// Each frame's view in truth: counters of many more samples than controllers get, and what no counter
/// tells.
fn truths(stage: &Stage) -> Vec<sim::View> {
    let [columns, rows] = FINE.map(u32::from);
    let fine = Sampling { width: columns, height: rows, ..stage.sampling.clone() };
    let depth = TreeStats::of(&stage.bvh).depth_max as f64;
    let truth = |camera: &niwaki_scene::Camera| {
        let workload = stage.workload(&fine, camera);
        let walks = stage.walks(camera, FINE);
        let work: Vec<f64> =
            walks.iter().map(|&(nodes, triangles)| (nodes + triangles) as f64).collect();
        let mean = work.iter().sum::<f64>() / work.len().max(1) as f64;
        let variance =
            work.iter().map(|w| (w - mean) * (w - mean)).sum::<f64>() / work.len().max(1) as f64;
        // Neighbours share the upper levels of a path; what is left is their own, up to the whole tree.
        let own = 1.0 - workload.coalescing;
        let pixels = f64::from(stage.size[0]) * f64::from(stage.size[1]);
        let a_pixel = NODE_BYTES * workload.primary_traversals
            + TRIANGLE_BYTES * workload.primary_intersections;
        let whole =
            32.0 * stage.bvh.nodes.len() as f64 + TRIANGLE_BYTES * stage.bvh.prim_ids.len() as f64;
        let hidden = Hidden {
            working_set: (0.25 * own * pixels * a_pixel).clamp(1.0, whole),
            spread: if mean > 0.0 { variance.sqrt() / mean } else { 0.0 },
            depth: depth * workload.visible_triangles.clamp(0.2, 1.0),
        };
        sim::View { counters: counters(stage, &workload), hidden }
    };
    stage.cameras.iter().map(truth).collect()
}

/// A workload by the names of the simulator.
fn counters(stage: &Stage, w: &Workload) -> Counters {
    Counters {
        pixels: f64::from(stage.size[0]) * f64::from(stage.size[1]),
        primary_traversals: w.primary_traversals,
        primary_intersections: w.primary_intersections,
        shadow_traversals: w.shadow_traversals,
        shadow_intersections: w.shadow_intersections,
        visible: w.visible_triangles,
        ao_traversals: w.ao_traversals,
        ao_intersections: w.ao_intersections,
        coalescing: w.coalescing,
        mirrors: 0.0,
        ao_radius: f64::from(stage.sampling.ao_radius / stage.diagonal.max(f32::MIN_POSITIVE)),
    }
}
