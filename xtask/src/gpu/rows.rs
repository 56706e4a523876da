//! What is measured: the rows of `gpu.json`.

use crate::judge::Tally;
use crate::results::{Failure, Run};
use niwaki_trace_vulkan::{DeviceInfo, GpuError};
use serde::Serialize;

/// Everything that a run measured.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Study {
    /// The version of the file's layout.
    pub(super) schema: u32,
    pub(super) run: Run,
    pub(super) device: DeviceRow,
    pub(super) builds: Vec<BuildRow>,
    pub(super) traces: Vec<TraceRow>,
    pub(super) failures: Vec<Failure>,
}

/// The device.
#[derive(Clone, Debug, Serialize)]
pub(super) struct DeviceRow {
    pub(super) name: String,
    pub(super) driver: String,
    pub(super) kind: String,
    /// Version of Vulkan.
    pub(super) api: String,
    pub(super) subgroup_size: u32,
    pub(super) memory_bytes: u64,
    pub(super) max_binding_bytes: u64,
    /// The driver's own ray tracing.
    pub(super) has_ray_pipeline: bool,
    pub(super) has_ray_query: bool,
    /// Without, times are those of the host, waiting included.
    pub(super) has_timestamps: bool,
}

impl From<&DeviceInfo> for DeviceRow {
    fn from(info: &DeviceInfo) -> Self {
        Self {
            name: info.name.clone(),
            driver: info.driver.clone(),
            kind: format!("{:?}", info.kind).to_lowercase(),
            api: info.api.map(|n| n.to_string()).join("."),
            subgroup_size: info.subgroup_size,
            memory_bytes: info.memory_bytes,
            max_binding_bytes: info.max_binding_bytes,
            has_ray_pipeline: info.has_ray_pipeline,
            has_ray_query: info.has_ray_query,
            has_timestamps: info.timestamp_ns > 0.0,
        }
    }
}

/// A stage of a build.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Stage {
    pub(super) name: String,
    /// Median.
    pub(super) ms: f64,
}

/// A builder on a scene.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct BuildRow {
    pub(super) scene: String,
    pub(super) triangles: usize,
    pub(super) builder: String,
    pub(super) repeats: usize,
    /// From vertices to the finished tree, median.
    pub(super) ms: Option<f64>,
    /// Million triangles a second.
    pub(super) mtriangles_per_s: Option<f64>,
    pub(super) stages: Vec<Stage>,
    /// Bytes of the tree.
    pub(super) bytes: Option<u64>,
    /// Why it was not measured.
    pub(super) note: Option<String>,
}

/// A kernel on a ray set of a scene.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct TraceRow {
    pub(super) scene: String,
    pub(super) triangles: usize,
    pub(super) rays: String,
    /// `closest` or `any`.
    pub(super) query: String,
    /// All of the following in words.
    pub(super) engine: String,
    /// The builder of the tree.
    pub(super) tree: String,
    pub(super) layout: String,
    pub(super) mode: String,
    pub(super) schedule: String,
    /// The driver's own ray tracing.
    pub(super) is_driver: bool,
    pub(super) ray_count: usize,
    pub(super) repeats: usize,
    /// Median.
    pub(super) ms: Option<f64>,
    /// Million rays a second.
    pub(super) mrays_per_s: Option<f64>,
    /// Bytes of nodes and triangles on the device.
    pub(super) bytes: Option<u64>,
    /// How its answers to some of the rays compare with those of the scalar CPU kernel: `ours` is this
    /// row, `peer` the CPU.
    pub(super) checked: Tally,
    /// Why it was not measured.
    pub(super) note: Option<String>,
}

/// Why something could not be measured, in the words of a table.
pub(super) fn note(error: &GpuError) -> String {
    const MIB: u64 = 1 << 20;
    match error {
        GpuError::TooLarge { what, wanted, limit, .. }
            if *wanted >= MIB && what.contains("byte") =>
        {
            let (wanted, limit) = (wanted.div_ceil(MIB), limit / MIB);
            format!("needs bindings of {wanted} MiB, the device has {limit}")
        }
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_too_large_says_what_it_takes() {
        let too_large = |what: &str, wanted| GpuError::TooLarge {
            what: what.to_owned(),
            wanted,
            limit: 128 << 20,
            remedy: "",
        };
        let text = note(&too_large("the size in bytes of a tree", 640_000_000));
        assert_eq!(text, "needs bindings of 611 MiB, the device has 128");
        let text = note(&too_large("the number of rays", 1 << 30));
        assert!(text.contains("rays"), "{text}");
    }
}
