//! Embree's own trees and kernels.

use super::{
    Embree, Quality,
    device::Device,
    ffi::{self, Handle, Queries, RtcBounds, RtcHit, RtcIntersectContext, RtcRay, RtcRayHit},
};
use crate::{PeerError, ray::is_traceable};
use niwaki_core::{Aabb, Hit, Intersector, Ray, TriangleMesh, glam::Vec3};
use std::{
    ptr,
    sync::Arc,
    time::{Duration, Instant},
};

/// A committed Embree scene of one triangle mesh.
///
/// What differs from this workspace's kernels: Embree's default kernels accept `t` strictly above
/// `t_min` (robust ones from `t_min` on); it drops triangles with a coordinate beyond 1.844e18
/// while building; and neither kind of kernel is watertight, though robust ones miss less. Rays
/// that [`Ray`] documents as hitting nothing (NaN, zero direction, `t_max < t_min`) are answered
/// here without asking Embree, which leaves them undefined.
#[derive(Debug)]
pub struct EmbreeScene {
    scene: Handle,
    commit_time: Duration,
    bytes: usize,
    // Embree reads these as long as the scene lives.
    _positions: Box<[f32]>,
    _indices: Box<[[u32; 3]]>,
    device: Arc<Device>,
}

// SAFETY: a committed scene is only queried, which Embree allows from any number of threads; it
// does not care which thread releases it.
unsafe impl Send for EmbreeScene {}
// SAFETY: as above.
unsafe impl Sync for EmbreeScene {}

impl EmbreeScene {
    /// Builds Embree's tree over the mesh, from copies of its vertices and indices. `robust`
    /// chooses Embree's slower kernels with error-bounded box tests and Plücker triangle tests.
    ///
    /// # Errors
    /// [`PeerError::Embree`] if Embree fails, for instance out of memory.
    pub fn new(
        embree: &Embree,
        mesh: &TriangleMesh,
        quality: Quality,
        robust: bool,
    ) -> Result<Self, PeerError> {
        let device = Arc::clone(&embree.device);
        let api = device.api;
        // Embree loads vertices 16 bytes at a time, so the last one needs 4 more bytes behind it
        // (manual of rtcSetSharedGeometryBuffer).
        let positions: Box<[f32]> =
            mesh.positions().iter().flat_map(|p| p.to_array()).chain([0.0]).collect();
        let indices: Box<[[u32; 3]]> = mesh.indices().into();
        let before = embree.memory();
        // SAFETY: live handles throughout; the buffers have the strides and counts that are given,
        // indices are in range (a mesh is valid), and both buffers move into `Self`, which
        // releases the scene before it drops them.
        unsafe {
            let scene = (api.new_scene)(device.handle);
            device.check("rtcNewScene")?;
            let mut result = Self {
                scene,
                commit_time: Duration::ZERO,
                bytes: 0,
                _positions: positions,
                _indices: indices,
                device,
            };
            let device = &result.device;
            (api.set_scene_build_quality)(scene, quality.code());
            let flags = if robust { ffi::SCENE_FLAG_ROBUST } else { ffi::SCENE_FLAG_NONE };
            (api.set_scene_flags)(scene, flags);
            let geometry = (api.new_geometry)(device.handle, ffi::GEOMETRY_TYPE_TRIANGLE);
            (api.set_geometry_build_quality)(geometry, quality.code());
            (api.set_shared_geometry_buffer)(
                geometry,
                ffi::BUFFER_TYPE_VERTEX,
                0,
                ffi::FORMAT_FLOAT3,
                result._positions.as_ptr().cast(),
                0,
                12,
                mesh.positions().len(),
            );
            (api.set_shared_geometry_buffer)(
                geometry,
                ffi::BUFFER_TYPE_INDEX,
                0,
                ffi::FORMAT_UINT3,
                result._indices.as_ptr().cast(),
                0,
                12,
                mesh.len(),
            );
            (api.attach_geometry)(scene, geometry);
            // The scene holds the geometry from here on.
            (api.release_geometry)(geometry);
            device.check("set-up of the geometry")?;
            let start = Instant::now();
            (api.commit_geometry)(geometry);
            (api.commit_scene)(scene);
            let commit_time = start.elapsed();
            device.check("rtcCommitScene")?;
            result.commit_time = commit_time;
            result.bytes = embree.memory().saturating_sub(before);
            Ok(result)
        }
    }

    /// How long `rtcCommitGeometry` and `rtcCommitScene` took together: everything from indexed
    /// triangles to traversable tree, without copying the caller's buffers.
    #[must_use]
    pub const fn commit_time(&self) -> Duration {
        self.commit_time
    }

    /// Bytes that Embree holds for the tree and its triangles, without vertex and index buffers;
    /// true as long as nothing else used the device during the commit.
    #[must_use]
    pub const fn bytes(&self) -> usize {
        self.bytes
    }

    /// Embree's box around the scene; [`Aabb::EMPTY`] without valid triangles.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        let mut bounds = RtcBounds { lower: [0.0; 3], align0: 0.0, upper: [0.0; 3], align1: 0.0 };
        // SAFETY: a committed scene and a structure to write to.
        unsafe { (self.device.api.get_scene_bounds)(self.scene, &raw mut bounds) };
        let bounds = Aabb::new(Vec3::from_array(bounds.lower), Vec3::from_array(bounds.upper));
        if bounds.is_empty() { Aabb::EMPTY } else { bounds }
    }
}

impl Drop for EmbreeScene {
    fn drop(&mut self) {
        // SAFETY: the only owner of the handle; buffers and device are dropped after this.
        unsafe { (self.device.api.release_scene)(self.scene) };
    }
}

impl Intersector for EmbreeScene {
    #[inline]
    fn closest_hit(&self, ray: &Ray) -> Hit {
        if !is_traceable(ray) {
            return Hit::MISS;
        }
        let mut query = RtcRayHit {
            ray: rtc_ray(ray),
            hit: RtcHit {
                ng: [0.0; 3],
                u: 0.0,
                v: 0.0,
                prim_id: ffi::INVALID_ID,
                geom_id: ffi::INVALID_ID,
                inst_id: ffi::INVALID_ID,
                inst_prim_id: ffi::INVALID_ID,
            },
        };
        // SAFETY: a committed scene, an aligned query of the version's layout or longer, and for
        // Embree 3 an initialised context; for Embree 4 null arguments mean the defaults.
        unsafe {
            match self.device.queries {
                Queries::V4 { intersect1, .. } => {
                    intersect1(self.scene, &raw mut query, ptr::null_mut());
                }
                Queries::V3 { intersect1, .. } => {
                    let mut context = RtcIntersectContext::new();
                    intersect1(self.scene, &raw mut context, &raw mut query);
                }
            }
        }
        if query.hit.geom_id == ffi::INVALID_ID {
            return Hit::MISS;
        }
        Hit { t: query.ray.tfar, u: query.hit.u, v: query.hit.v, prim_id: query.hit.prim_id }
    }

    #[inline]
    fn any_hit(&self, ray: &Ray) -> bool {
        if !is_traceable(ray) {
            return false;
        }
        let mut query = rtc_ray(ray);
        // SAFETY: as in `closest_hit`.
        unsafe {
            match self.device.queries {
                Queries::V4 { occluded1, .. } => {
                    occluded1(self.scene, &raw mut query, ptr::null_mut());
                }
                Queries::V3 { occluded1, .. } => {
                    let mut context = RtcIntersectContext::new();
                    occluded1(self.scene, &raw mut context, &raw mut query);
                }
            }
        }
        // Embree marks an occluded ray by t_far = −∞.
        query.tfar == f32::NEG_INFINITY
    }
}

#[inline]
fn rtc_ray(ray: &Ray) -> RtcRay {
    RtcRay {
        org: ray.origin.to_array(),
        tnear: ray.t_min,
        dir: ray.direction.to_array(),
        time: 0.0,
        tfar: ray.t_max,
        mask: u32::MAX,
        id: 0,
        flags: 0,
    }
}
