//! The tree over the triangles of the near region.

use crate::{Gpu, HybridError, ObjectFacts, Region};
use niwaki_build_lbvh::Lbvh;
use niwaki_core::{Builder, BvhNode, PrimRef, glam::Vec3};
use niwaki_scene::Scene;
use wgpu::BufferUsages;

/// The tree on the GPU.
pub(crate) struct NearTree {
    pub(crate) nodes: wgpu::Buffer,
    pub(crate) triangles: wgpu::Buffer,
    /// Triangles in it.
    pub(crate) count: u32,
}

/// A box that no ray meets: the root of a tree without triangles.
const NOTHING: BvhNode =
    BvhNode { min: Vec3::splat(1e30), first: 0, max: Vec3::splat(-1e30), count: 1 };

impl NearTree {
    /// A tree without triangles.
    pub(crate) fn empty(gpu: &Gpu) -> Result<Self, HybridError> {
        Ok(Self {
            nodes: gpu.upload("nodes", &[NOTHING], BufferUsages::STORAGE)?,
            triangles: gpu.upload("leaves", &[0_u32], BufferUsages::STORAGE)?,
            count: 0,
        })
    }

    /// Culls the triangles of the objects that meet the region and builds a tree over the rest.
    pub(crate) fn build(
        gpu: &Gpu,
        scene: &Scene,
        time: f64,
        objects: &[ObjectFacts],
        in_region: &[u32],
        region: &Region,
    ) -> Result<Self, HybridError> {
        let (mut positions, mut normals) = (Vec::new(), Vec::new());
        scene.animate(time, &mut positions, &mut normals);
        let near = region.traced_bounds();
        let mut prims = Vec::new();
        for object in in_region.iter().filter_map(|&i| objects.get(i as usize)) {
            for triangle in object.triangles.clone() {
                let corners = scene.mesh.indices()[triangle as usize];
                let bounds = niwaki_core::Aabb::from_points(
                    corners.map(|i| positions.get(i as usize).copied().unwrap_or_default()),
                );
                let meets = near.min.cmple(bounds.max).all() && bounds.min.cmple(near.max).all();
                if meets && bounds.is_finite() {
                    prims.push(PrimRef::new(bounds, triangle));
                }
            }
        }
        if prims.is_empty() {
            return Self::empty(gpu);
        }
        let bvh = Lbvh::default().build(&prims).map_err(|e| HybridError::Gpu(e.to_string()))?;
        Ok(Self {
            nodes: gpu.upload("nodes", &bvh.nodes, BufferUsages::STORAGE)?,
            triangles: gpu.upload("leaves", &bvh.prim_ids, BufferUsages::STORAGE)?,
            count: niwaki_core::to_u32(bvh.prim_ids.len()),
        })
    }
}
