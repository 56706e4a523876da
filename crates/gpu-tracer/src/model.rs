//! How long a frame will take: the instructions of its kernels, and the analytical model of
//! `niwaki-gpu-model` on them.

use crate::{Kernel, settings::module};
use niwaki_gpu_model::{
    Device, FrameModel, FramePrediction, KernelCounts, ModelError, RaySettings, Workload,
    calibrate::Calibrated,
    counts::{self, CountError, Counted, Place},
};
use niwaki_shaders::{Options, ShaderError};
use niwaki_trace::Mode;
use niwaki_trace_vulkan::TreeLayout;

/// Why kernels cannot be counted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TracerCountError {
    /// A kernel does not compile. Remedy: report it; the modules are those of `niwaki-shaders`.
    #[error(transparent)]
    Shader(#[from] ShaderError),
    /// A kernel is not what it was. Remedy: report it.
    #[error(transparent)]
    Count(#[from] CountError),
}

/// Instructions of the kernels of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TracerCounts {
    /// Of a pixel, both kernels together: a traversal step and an intersection are the means of both. What is
    /// constant is without the loop over directions.
    pub pixel: KernelCounts,
    /// Compute instructions of each direction of ambient occlusion, besides traversal.
    pub compute_per_direction: f64,
}

/// Bindings of `tracing.wgsl` in which nodes and triangles lie, and of `frame.wgsl` in which lights do.
const NODES: [Place; 4] = places(6);
const TRIANGLES: [Place; 4] = places(10);
const LIGHTS: Place = Place { group: 0, binding: 20 };

const fn places(first: u32) -> [Place; 4] {
    let mut places = [Place { group: 0, binding: first }; 4];
    let mut i = 1;
    while i < 4 {
        places[i].binding = places[i - 1].binding + 1;
        i += 1;
    }
    places
}

impl TracerCounts {
    /// Of kernels over a layout in a mode. `is_fused` says whether the device's multiply-add rounds once
    /// (`Tracer::is_fused`), as it does on GPUs; those of software drivers take more instructions.
    ///
    /// Rare paths do not count.
    ///
    /// # Errors
    /// [`TracerCountError`], which does not happen with the modules that come with `niwaki-shaders`.
    pub fn new(layout: TreeLayout, mode: Mode, is_fused: bool) -> Result<Self, TracerCountError> {
        let module = module(layout);
        let count = |kernel: Kernel| -> Result<Counted, TracerCountError> {
            let flag = |is: bool| f64::from(u8::from(is));
            let constants = [
                ("FUSED", flag(is_fused)),
                ("RARE", 0.0),
                ("MODE", flag(mode == Mode::Watertight)),
                ("ANY", flag(kernel == Kernel::Shade)),
            ];
            let options = Options { constants: &constants, ..Options::default() };
            let shader = niwaki_shaders::compile(module, kernel.entry(), &options)?;
            Ok(counts::count(&shader.words, kernel.entry())?)
        };
        let (primary, shade) = (count(Kernel::Primary)?, count(Kernel::Shade)?);
        let compute_per_direction = per_direction(&shade);
        let [p, s] = [primary, shade].map(|kernel| kernel.ray_tracing(&NODES, &TRIANGLES));
        let (p, s) = (p?, s?);
        let mean = |of: fn(&KernelCounts) -> f64| 0.5 * (of(&p) + of(&s));
        let sum = |of: fn(&KernelCounts) -> f64| of(&p) + of(&s);
        Ok(Self {
            pixel: KernelCounts {
                compute_per_traversal: mean(|k| k.compute_per_traversal),
                compute_per_intersection: mean(|k| k.compute_per_intersection),
                compute_constant: sum(|k| k.compute_constant) - compute_per_direction,
                memory_per_traversal: mean(|k| k.memory_per_traversal),
                memory_per_intersection: mean(|k| k.memory_per_intersection),
                memory_constant: sum(|k| k.memory_constant),
                bytes_per_memory_instruction: mean(|k| k.bytes_per_memory_instruction),
            },
            compute_per_direction,
        })
    }

    /// Of a pixel with so many directions.
    #[must_use]
    pub fn with_directions(&self, directions: f64) -> KernelCounts {
        KernelCounts {
            compute_constant: self.pixel.compute_constant + directions * self.compute_per_direction,
            ..self.pixel
        }
    }
}

/// What a turn of the loop over directions does besides traversal: the loop is the one at the outside that does not
/// load lights.
fn per_direction(shade: &Counted) -> f64 {
    let outermost = shade.loops.iter().skip(1).filter(|one| one.parent == Some(0));
    let others = outermost.filter(|one| !one.buffers.contains_key(&LIGHTS));
    others.map(|one| one.own.arithmetic() as f64).sum()
}

/// How long frames of [`crate::FrameTracer`] take on a device.
#[derive(Clone, Debug, PartialEq)]
pub struct TracerModel {
    model: FrameModel,
    counts: TracerCounts,
}

impl TracerModel {
    /// Of frames of so many pixels.
    #[must_use]
    pub fn new(device: Device, counts: TracerCounts, pixels: u64) -> Self {
        Self { model: FrameModel::new(device, counts.pixel, pixels), counts }
    }

    /// A prediction and all that led to it. `scale` multiplies width and height of the frame. Takes about a
    /// microsecond.
    ///
    /// # Errors
    /// [`ModelError`] if a number is not one that a workload or settings can have.
    pub fn predict(
        &self,
        settings: &RaySettings,
        workload: &Workload,
        scale: f64,
    ) -> Result<FramePrediction, ModelError> {
        // Pixels without a surface have no directions.
        let [_, waiting] = self.model.constants.waiting(workload);
        let directions = settings.ao_rays * workload.visible_triangles * waiting;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "saturates; a number of pixels"
        )]
        let pixels = (self.model.pixels as f64 * scale * scale).round() as u64;
        let model = FrameModel {
            counts: self.counts.with_directions(directions),
            pixels,
            ..self.model.clone()
        };
        model.predict(workload, settings)
    }

    /// [`TracerModel::predict`] in milliseconds.
    ///
    /// # Errors
    /// As [`TracerModel::predict`].
    pub fn milliseconds(
        &self,
        settings: &RaySettings,
        workload: &Workload,
        scale: f64,
    ) -> Result<f64, ModelError> {
        Ok(1e3 * self.predict(settings, workload, scale)?.seconds)
    }
}

/// Fits to frames of full size.
impl Calibrated for TracerModel {
    fn frame_model(&self) -> &FrameModel {
        &self.model
    }

    fn frame_model_mut(&mut self) -> &mut FrameModel {
        &mut self.model
    }

    fn seconds(&self, workload: &Workload, settings: &RaySettings) -> Result<f64, ModelError> {
        Ok(self.predict(settings, workload, 1.0)?.seconds)
    }
}
