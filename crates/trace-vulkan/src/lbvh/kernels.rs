//! The pipelines of all stages.

use crate::{Device, GpuError, Kernel};

/// The kernels of `niwaki-shaders`, folder `lbvh`, by entry point.
#[derive(Debug)]
pub(super) struct Kernels {
    pub(super) triangles: Kernel,
    pub(super) begin: Kernel,
    pub(super) bounds: Kernel,
    pub(super) settle: Kernel,
    pub(super) morton: Kernel,
    pub(super) count_digits: Kernel,
    pub(super) scan_digits: Kernel,
    pub(super) scatter: Kernel,
    pub(super) hierarchy: Kernel,
    pub(super) bottom_up: Kernel,
    pub(super) collapse: Kernel,
    pub(super) mark: Kernel,
    pub(super) sum_tiles: Kernel,
    pub(super) scan_tiles: Kernel,
    pub(super) scan_places: Kernel,
    pub(super) emit: Kernel,
    pub(super) arrange: Kernel,
}

impl Kernels {
    /// With at most `max_groups` workgroups along an axis; stages with more take several rows.
    pub(super) fn new(device: &Device, max_groups: u32) -> Result<Self, GpuError> {
        let kernel = |module: &str, entry: &str| device.kernel(module, entry, &[]);
        let sizing = [("max_groups", f64::from(max_groups))];
        Ok(Self {
            triangles: kernel("lbvh/triangles", "triangles")?,
            begin: device.kernel("lbvh/bounds", "begin", &sizing)?,
            bounds: kernel("lbvh/bounds", "bounds")?,
            settle: device.kernel("lbvh/bounds", "settle", &sizing)?,
            morton: kernel("lbvh/morton", "morton")?,
            count_digits: kernel("lbvh/sort", "count_digits")?,
            scan_digits: kernel("lbvh/sort", "scan_digits")?,
            scatter: kernel("lbvh/sort", "scatter")?,
            hierarchy: kernel("lbvh/karras", "hierarchy")?,
            bottom_up: kernel("lbvh/boxes", "bottom_up")?,
            collapse: kernel("lbvh/boxes", "collapse")?,
            mark: kernel("lbvh/mark", "mark")?,
            sum_tiles: kernel("lbvh/rank", "sum_tiles")?,
            scan_tiles: kernel("lbvh/rank", "scan_tiles")?,
            scan_places: kernel("lbvh/rank", "scan_places")?,
            emit: kernel("lbvh/emit", "emit")?,
            arrange: kernel("lbvh/scene", "arrange")?,
        })
    }
}
