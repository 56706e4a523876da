//! Draws frames.

use crate::{FrameSettings, Kernel, TracedScene, layout::FrameWords};
use niwaki_core::{glam::Vec3, to_u32};
use niwaki_render::Image;
use niwaki_scene::Camera;
use niwaki_trace::Counts;
use niwaki_trace_vulkan::{Batch, Buffer, Device, GpuError, Query, Tracer};
use std::time::Instant;

/// Directions of ambient occlusion in a dispatch on drivers that end long loops
/// (`DeviceInfo::max_loop_turns`): a direction takes a few hundred turns of a subgroup.
const DIRECTIONS_AT_ONCE: u32 = 32;

/// What a frame took, in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameTimes {
    /// The nearest hits.
    pub primary: f64,
    /// Shading, shadow rays and ambient occlusion.
    pub shade: f64,
    /// False if the device has no clock: then [`FrameTimes::shade`] is what the host waited for both.
    pub by_device: bool,
}

impl FrameTimes {
    /// Both.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.primary + self.shade
    }
}

/// The work of a frame, over all pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameCounts {
    /// Of primary rays.
    pub primary: Counts,
    /// Of shadow rays and ambient occlusion.
    pub shade: Counts,
    /// Pixels that see a surface.
    pub covered: u64,
}

/// What frames are drawn into.
#[derive(Debug)]
struct Target {
    hits: Buffer,
    image: Buffer,
    pixels: u64,
    size: [u32; 2],
}

/// Draws frames on a device.
#[derive(Debug)]
pub struct FrameTracer {
    device: Device,
    tracer: Tracer,
    target: Option<Target>,
    /// Dispatches of a frame at most, and what each is told.
    frames: Vec<Buffer>,
}

impl FrameTracer {
    /// A tracer that has drawn nothing.
    ///
    /// # Errors
    /// As [`Tracer::new`].
    pub fn new(device: &Device) -> Result<Self, GpuError> {
        let tracer = Tracer::new(device)?;
        Ok(Self { device: device.clone(), tracer, target: None, frames: Vec::new() })
    }

    /// Draws a frame and waits for it.
    ///
    /// The first frame of a scene is slower, since kernels are compiled.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] for more pixels than the device can bind or 2³² − 1,
    /// [`GpuError::OutOfMemory`] and [`GpuError::DeviceLost`].
    pub fn draw(
        &mut self,
        scene: &TracedScene,
        camera: &Camera,
        settings: &FrameSettings,
    ) -> Result<FrameTimes, GpuError> {
        self.draw_counting(scene, camera, settings, None)
    }

    /// Draws a frame by kernels that count. Slower, and the same image.
    ///
    /// # Errors
    /// As [`FrameTracer::draw`].
    pub fn count(
        &mut self,
        scene: &TracedScene,
        camera: &Camera,
        settings: &FrameSettings,
    ) -> Result<FrameCounts, GpuError> {
        let pixels = pixels_of(settings)?;
        let bytes = 16 * u64::from(pixels.max(1));
        let work = [self.device.buffer(bytes)?, self.device.buffer(bytes)?];
        self.draw_counting(scene, camera, settings, Some(&work))?;
        let sum = |work: &Buffer| -> Result<Counts, GpuError> {
            let mut sum = Counts::default();
            for [nodes, boxes, leaves, triangles] in work.read::<[u32; 4]>()? {
                sum.nodes += u64::from(nodes);
                sum.boxes += u64::from(boxes);
                sum.leaves += u64::from(leaves);
                sum.triangles += u64::from(triangles);
            }
            Ok(sum)
        };
        let (primary, shade) = (sum(&work[0])?, sum(&work[1])?);
        let hits = self.target.as_ref().map(|target| target.hits.read::<[u32; 4]>()).transpose()?;
        let hits = hits.unwrap_or_default();
        let seen = hits.iter().take(pixels as usize).filter(|hit| hit[3] != u32::MAX);
        Ok(FrameCounts { primary, shade, covered: seen.count() as u64 })
    }

    fn draw_counting(
        &mut self,
        scene: &TracedScene,
        camera: &Camera,
        settings: &FrameSettings,
        work: Option<&[Buffer; 2]>,
    ) -> Result<FrameTimes, GpuError> {
        let pixels = pixels_of(settings)?;
        self.prepare(settings, u64::from(pixels))?;
        let Some(target) = &self.target else { return Ok(FrameTimes::default()) };
        let words = FrameWords::new(camera, settings, scene.ambient, scene.light_count);
        let at_once = match self.device.info().max_loop_turns {
            Some(_) => DIRECTIONS_AT_ONCE,
            None => u32::MAX,
        };
        let mut dispatches = Vec::new();
        let mut first = 0_u32;
        loop {
            let end = words.ao_rays.min(first.saturating_add(at_once));
            dispatches.push(FrameWords { ao_first: first, ao_end: end, ..words });
            first = end;
            if first == words.ao_rays {
                break;
            }
        }
        while self.frames.len() < dispatches.len() {
            self.frames.push(self.device.upload(&[words])?);
        }
        for (buffer, words) in self.frames.iter().zip(&dispatches) {
            buffer.write(0, std::slice::from_ref(words))?;
        }
        let mut batch = self.device.batch()?;
        batch.mark("start")?;
        let frames = &self.frames[..dispatches.len()];
        let record = |batch: &mut Batch, kernel: Kernel, frame: &Buffer| {
            let query = if kernel == Kernel::Primary { Query::Closest } else { Query::Any };
            let name = (scene.module(), kernel.entry());
            let program = self.tracer.program(&scene.tree, name, query, work.is_some())?;
            let mut own: Vec<(&str, &Buffer)> = vec![
                ("frame", frame),
                ("shapes", &scene.shapes),
                ("material_ids", &scene.material_ids),
                ("materials", &scene.materials),
                ("lights", &scene.lights),
                ("hits", &target.hits),
                ("image", &target.image),
            ];
            if let Some(work) = work {
                own.push(("work", &work[usize::from(kernel == Kernel::Shade)]));
            }
            self.tracer.record_program(batch, &scene.tree, &program, &own, pixels)
        };
        record(&mut batch, Kernel::Primary, &frames[0])?;
        batch.mark("primary")?;
        for frame in frames {
            record(&mut batch, Kernel::Shade, frame)?;
        }
        batch.mark("shade")?;
        let begun = Instant::now();
        let timings = batch.submit()?;
        let waited = begun.elapsed().as_secs_f64();
        let mut times = FrameTimes { primary: 0.0, shade: waited, by_device: false };
        if timings.total().is_some() {
            times.by_device = true;
            for (pass, seconds) in timings.passes() {
                match pass {
                    "primary" => times.primary = seconds,
                    _ => times.shade = seconds,
                }
            }
        }
        Ok(times)
    }

    /// The frame that was drawn last: linear radiance. Empty if there is none.
    ///
    /// # Errors
    /// As [`Buffer::read`].
    pub fn image(&self) -> Result<Image, GpuError> {
        let Some(target) = &self.target else { return Ok(Image::black(0, 0)) };
        let [width, height] = target.size;
        let count = width as usize * height as usize;
        let rows = target.image.read::<[f32; 4]>()?;
        let pixels = rows.iter().take(count).map(|&[r, g, b, _]| Vec3::new(r, g, b)).collect();
        Ok(Image::from_pixels(width, height, pixels).unwrap_or_else(|| Image::black(0, 0)))
    }

    /// Makes room for a frame.
    fn prepare(&mut self, settings: &FrameSettings, pixels: u64) -> Result<(), GpuError> {
        let size = [settings.width, settings.height];
        match &mut self.target {
            Some(target) if target.pixels >= pixels => target.size = size,
            target => {
                // The old one first: both need not fit.
                *target = None;
                let bytes = 16 * pixels.max(1);
                let (hits, image) = (self.device.buffer(bytes)?, self.device.buffer(bytes)?);
                *target = Some(Target { hits, image, pixels, size });
            }
        }
        Ok(())
    }
}

/// The pixels of a frame, as far as invocations can be numbered.
fn pixels_of(settings: &FrameSettings) -> Result<u32, GpuError> {
    let pixels = settings.pixels();
    if pixels >= u64::from(u32::MAX) {
        return Err(GpuError::TooLarge {
            what: "the number of pixels".to_owned(),
            wanted: pixels,
            limit: u64::from(u32::MAX) - 1,
            remedy: "choose a smaller image",
        });
    }
    Ok(to_u32(usize::try_from(pixels).unwrap_or(usize::MAX)))
}
