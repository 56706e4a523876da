//! The device that frames are drawn by, its table, and the model of it.

use super::pilots::Model;
use anyhow::{Context, Result};
use niwaki_frame_control::RenderSettings;
use niwaki_gpu_model::{Device as DeviceTable, KernelCounts, RaySettings, Workload, microbench};
use niwaki_gpu_tracer::{TracerCounts, TracerModel};
use niwaki_trace::Mode;
use niwaki_trace_vulkan::{Device, Tracer, TreeLayout};
use std::path::Path;
use std::sync::Arc;

/// What simulated devices run: a kernel over a binary tree without rare cases. Their law is another, so
/// there is nothing to be counted.
const SMALL_KERNEL: KernelCounts = KernelCounts {
    compute_per_traversal: 38.0,
    compute_per_intersection: 23.0,
    compute_constant: 60.0,
    memory_per_traversal: 5.0,
    memory_per_intersection: 3.0,
    memory_constant: 3.0,
    bytes_per_memory_instruction: 16.0,
};

/// A Vulkan device and its table.
pub(crate) struct Real {
    pub(crate) device: Device,
    pub(crate) table: DeviceTable,
}

impl Real {
    /// Opens the device and measures it, or loads the table `model`. What was measured is written to
    /// `device.toml` in `out`; `quick` measures less.
    pub(crate) fn open(model: Option<&str>, quick: bool, out: &Path) -> Result<Self> {
        let device = Device::new()?;
        let table = match model {
            Some(model) => DeviceTable::load(model)?,
            None => {
                let mut settings = microbench::Settings::default();
                if quick {
                    settings.working_set_bytes = Some(8 << 20);
                    settings.repeats = 2;
                }
                let table = microbench::measure(&device, &settings)
                    .context("cannot measure the device; give its table by --model")?
                    .device;
                std::fs::create_dir_all(out)
                    .with_context(|| format!("cannot make {}", out.display()))?;
                let path = out.join("device.toml");
                std::fs::write(&path, table.to_toml())
                    .with_context(|| format!("cannot write {}", path.display()))?;
                table
            }
        };
        Ok(Self { device, table })
    }
}

/// The model of frames of a size: by the kernels of the Vulkan device, if it is one.
pub(crate) fn tracer_model(
    table: DeviceTable,
    vulkan: Option<&Device>,
    size: [u32; 2],
) -> Result<TracerModel> {
    let counts = match vulkan {
        Some(device) => {
            let is_fused = Tracer::new(device)?.is_fused();
            TracerCounts::new(TreeLayout::Wide, Mode::Watertight, is_fused)?
        }
        None => TracerCounts { pixel: SMALL_KERNEL, compute_per_direction: 0.0 },
    };
    Ok(TracerModel::new(table, counts, u64::from(size[0]) * u64::from(size[1])))
}

/// What the model knows of settings.
pub(crate) fn ray_settings(settings: &RenderSettings) -> RaySettings {
    RaySettings { ao_rays: f64::from(settings.ao_rays), shadows: settings.shadows }
}

/// The model as controllers ask it.
pub(crate) fn asked(model: TracerModel) -> Model<Workload> {
    Arc::new(move |s: &RenderSettings, w: &Workload| {
        model.milliseconds(&ray_settings(s), w, s.render_scale).unwrap_or(f64::NAN)
    })
}
