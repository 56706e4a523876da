//! The linear BVH, built on the GPU: the tree of `niwaki-build-lbvh`, bit for bit.
//!
//! Stages, each a kernel of `niwaki-shaders` (folder `lbvh`): bounds of primitives and centroids;
//! Morton codes of 30 or 63 bits (Lauterbach et al. 2009, section 3.1); a radix sort, 8 bits a pass,
//! by reduce-then-scan (Merrill and Grimshaw 2011); all inner nodes at once (Karras 2012, section 3);
//! boxes from the leaves up (section 4 there), with leaves merged by the surface area heuristic; and
//! places of nodes by prefix sums. Sizes of all stages are computed on the device, so that the number
//! of primitives may come from another kernel.

mod config;
mod kernels;
mod times;
mod workspace;

#[cfg(test)]
mod tests;
#[cfg(test)]
mod twin;

pub use config::{LbvhConfig, LbvhError};
pub use times::LbvhTimes;
pub use workspace::LbvhWorkspace;

use crate::{Device, DeviceTree, GpuError, GpuScene};
use kernels::Kernels;
use niwaki_core::{Aabb, Bvh, BvhNode, PrimRef, TriangleMesh};
use niwaki_trace::Mode;
use std::sync::Arc;

/// Builds linear BVHs on a device: the trees of `niwaki_build_lbvh::Lbvh` with the same settings, bit
/// for bit, on every device (`docs/gpu-lbvh.md` says why).
///
/// Codes are sorted by a radix sort (Merrill and Grimshaw 2011), inner nodes are found all at once
/// and boxes from the leaves up (Karras 2012, sections 3 and 4), and nodes are placed depth first by
/// prefix sums. Takes time in proportion to the number of primitives.
///
/// ```
/// use niwaki_core::{TriangleMesh, glam::Vec3};
/// use niwaki_trace_vulkan::{Device, GpuLbvh, LbvhConfig};
///
/// let mesh = TriangleMesh::new(
///     vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE],
///     vec![[0, 1, 2], [1, 2, 3]],
/// )?;
/// let Ok(device) = Device::new() else { return Ok(()) }; // no Vulkan here
/// let builder = GpuLbvh::new(&device)?;
/// let bvh = builder.build_mesh(&mesh, &LbvhConfig::default())?;
/// assert_eq!(bvh.prim_ids.len(), 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// For a tree that stays on the device, and is built again every frame, see [`GpuLbvh::workspace`].
#[derive(Clone, Debug)]
pub struct GpuLbvh {
    device: Device,
    kernels: Arc<Kernels>,
}

impl GpuLbvh {
    /// Compiles the kernels.
    ///
    /// # Errors
    /// As [`Device::kernel`].
    pub fn new(device: &Device) -> Result<Self, GpuError> {
        Self::with_max_groups(device, device.info().max_groups[0])
    }

    fn with_max_groups(device: &Device, max_groups: u32) -> Result<Self, GpuError> {
        Ok(Self { device: device.clone(), kernels: Arc::new(Kernels::new(device, max_groups)?) })
    }

    /// Memory for trees of up to `capacity` primitives, built with the same settings again and again:
    /// about 169 bytes a primitive, of which 100 are primitives and tree.
    ///
    /// # Errors
    /// [`LbvhError::Build`] for settings out of range and more primitives than a tree can hold,
    /// [`LbvhError::Gpu`] with [`GpuError::TooLarge`] for more than fit a binding of the device.
    pub fn workspace(
        &self,
        capacity: usize,
        config: &LbvhConfig,
    ) -> Result<LbvhWorkspace, LbvhError> {
        LbvhWorkspace::new(&self.device, self.kernels.clone(), capacity, config)
    }

    /// Builds a tree on the device and reads it back.
    ///
    /// # Errors
    /// [`LbvhError::Build`] as the CPU builder, naming the first bad primitive; [`LbvhError::Gpu`] as
    /// [`GpuLbvh::workspace`].
    pub fn build(&self, prims: &[PrimRef], config: &LbvhConfig) -> Result<Bvh, LbvhError> {
        let workspace = self.workspace(prims.len(), config)?;
        workspace.upload(prims)?;
        workspace.build()?;
        workspace.download()
    }

    /// Builds a tree over a mesh on the device and reads it back. The references to its triangles are
    /// computed there too.
    ///
    /// # Errors
    /// As [`GpuLbvh::build`].
    pub fn build_mesh(&self, mesh: &TriangleMesh, config: &LbvhConfig) -> Result<Bvh, LbvhError> {
        let workspace = self.workspace(mesh.len(), config)?;
        let positions = self.device.upload(mesh.positions())?;
        let indices = self.device.upload(mesh.indices())?;
        workspace.set_count(mesh.len())?;
        let mut batch = self.device.batch()?;
        workspace.record_triangles(&mut batch, &positions, &indices)?;
        workspace.record(&mut batch)?;
        batch.submit()?;
        workspace.download()
    }

    /// Builds a tree over a mesh on the device and leaves it there, ready to be traced (watertight).
    ///
    /// Extents of the mesh should be between 2⁻²⁰ and 2³⁰ units, as [`DeviceTree::bounds`] says; upload
    /// others from the CPU ([`GpuScene::upload`]), which scales them.
    ///
    /// # Errors
    /// As [`GpuLbvh::build`].
    pub fn build_scene(
        &self,
        mesh: &TriangleMesh,
        config: &LbvhConfig,
    ) -> Result<GpuScene, LbvhError> {
        let workspace = self.workspace(mesh.len(), config)?;
        let positions = self.device.upload(mesh.positions())?;
        let indices = self.device.upload(mesh.indices())?;
        workspace.set_count(mesh.len())?;
        let rows = self.device.buffer(48 * mesh.len() as u64)?;
        let parents = self.device.buffer(8 * mesh.len() as u64)?;
        let mut batch = self.device.batch()?;
        workspace.record_triangles(&mut batch, &positions, &indices)?;
        workspace.record(&mut batch)?;
        workspace.record_scene(&mut batch, [&positions, &indices], [&rows, &parents])?;
        batch.submit()?;
        let (_, nodes) = workspace.check()?;
        let nodes = nodes as u64;
        let mut root = [BvhNode::leaf(Aabb::EMPTY, 0, 0)];
        if nodes > 0 {
            workspace.nodes().read_into(&mut root)?;
        }
        let tree = DeviceTree {
            nodes: workspace.nodes().view(0, 32 * nodes)?,
            parents: Some(parents.view(0, 4 * nodes)?),
            triangles: rows,
            mode: Mode::Watertight,
            bounds: root[0].aabb(),
        };
        Ok(GpuScene::adopt(tree)?)
    }
}
