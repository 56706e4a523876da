//! A mesh in the driver's acceleration structures.

use super::structure::{Build, Input, Structure, functions};
use crate::{Batch, Buffer, Device, GpuError, Timings, scene::SceneWords};
use ash::vk;
use niwaki_core::{TriangleMesh, to_u32};
use std::sync::Arc;

/// What the driver is asked to build for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum DriverBuild {
    /// Fast tracing, the default: as for geometry that stays.
    #[default]
    FastTrace,
    /// Fast building: as for geometry that changes every frame.
    FastBuild,
}

impl DriverBuild {
    /// Both.
    pub const ALL: [Self; 2] = [Self::FastTrace, Self::FastBuild];

    /// The name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::FastTrace => "driver, fast trace",
            Self::FastBuild => "driver, fast build",
        }
    }

    const fn flags(self) -> vk::BuildAccelerationStructureFlagsKHR {
        match self {
            Self::FastTrace => vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_TRACE,
            Self::FastBuild => vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_BUILD,
        }
    }
}

/// Seconds that a build took on the device; 0 where it has no timestamps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriverTimes {
    /// The structure of the triangles.
    pub bottom: f64,
    /// The structure of the one instance.
    pub top: f64,
}

impl DriverTimes {
    /// Sums the marks of a batch that [`DriverScene::record_build`] was recorded in. Marks of other
    /// commands are left out.
    #[must_use]
    pub fn of(timings: &Timings) -> Self {
        let mut times = Self::default();
        for (label, seconds) in timings.passes() {
            match label {
                "driver bottom" => times.bottom += seconds,
                "driver top" => times.top += seconds,
                _ => {}
            }
        }
        times
    }

    /// Both together.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.bottom + self.top
    }
}

/// A mesh in the driver's own acceleration structures: one of its triangles and one of a single
/// instance, both built on the device. What [`crate::DriverTracer`] traces.
///
/// Vertices are given to the driver as they are: what it makes of coordinates of 1e-30 or 1e30 is its own
/// affair, and so is what happens to rays at edges.
///
/// ```
/// use niwaki_core::{Ray, TriangleMesh, glam::Vec3};
/// use niwaki_trace_vulkan::{Device, DriverBuild, DriverMethod, DriverScene, DriverTracer};
///
/// let Ok(device) = Device::new() else { return Ok(()) }; // no Vulkan here
/// let Some(method) = DriverMethod::ALL.into_iter().find(|m| m.is_offered(device.info())) else {
///     return Ok(()); // no ray tracing in this driver
/// };
/// let mesh = TriangleMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]])?;
/// let scene = DriverScene::build(&device, &mesh, DriverBuild::FastTrace)?;
/// let tracer = DriverTracer::new(&device, method)?;
/// let hits = tracer.closest_hits(&scene, &[Ray::new(Vec3::new(0.2, 0.2, 1.0), Vec3::NEG_Z)])?;
/// assert_eq!((hits[0].t, hits[0].prim_id), (1.0, 0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct DriverScene {
    device: Device,
    preference: DriverBuild,
    pub(super) positions: Buffer,
    pub(super) indices: Buffer,
    vertices: u32,
    triangles: u32,
    instances: Buffer,
    scratch: Buffer,
    scratch_address: u64,
    /// None for an empty mesh.
    bottom: Option<Arc<Structure>>,
    pub(super) top: Arc<Structure>,
    pub(super) words: SceneWords,
    first_build: DriverTimes,
}

impl DriverScene {
    /// Uploads a mesh, builds both structures and waits for them.
    ///
    /// # Errors
    /// [`GpuError::NotOffered`] on a device without acceleration structures, [`GpuError::TooLarge`]
    /// for more triangles than a structure holds, [`GpuError::OutOfMemory`] and
    /// [`GpuError::DeviceLost`].
    pub fn build(
        device: &Device,
        mesh: &TriangleMesh,
        preference: DriverBuild,
    ) -> Result<Self, GpuError> {
        let limits = functions(&device.inner)?.limits;
        if mesh.len() as u64 > limits.max_triangles {
            return Err(GpuError::TooLarge {
                what: "the number of triangles of an acceleration structure".to_owned(),
                wanted: mesh.len() as u64,
                limit: limits.max_triangles,
                remedy: "split the scene, or use our own traversal (Tracer)",
            });
        }
        let input = vk::BufferUsageFlags::ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_KHR;
        let positions = device.addressed(size_of_val(mesh.positions()) as u64, input)?;
        positions.write(0, mesh.positions())?;
        let indices = device.addressed(size_of_val(mesh.indices()) as u64, input)?;
        indices.write(0, mesh.indices())?;
        let (vertices, triangles) = (to_u32(mesh.positions().len()), to_u32(mesh.len()));
        let flags = preference.flags();
        let of_triangles = Input::Triangles { positions: &positions, vertices, indices: &indices };
        let mut scratch_bytes = 0;
        let mut bottom = None;
        if triangles > 0 {
            let build = Build { input: of_triangles, count: triangles, flags };
            let (structure, scratch) = build.allocate(device)?;
            scratch_bytes = scratch;
            bottom = Some(Arc::new(structure));
        }
        let instances = device.addressed(64, input)?;
        if let Some(bottom) = &bottom {
            instances.write(0, &instance(bottom.address()?))?;
        }
        let count = u32::from(bottom.is_some());
        let build = Build { input: Input::Instances(&instances), count, flags };
        let (top, scratch) = build.allocate(device)?;
        scratch_bytes = scratch_bytes.max(scratch);
        // The address, not the place in the buffer, has to be a multiple.
        let alignment = limits.scratch_alignment;
        let scratch = device.addressed(scratch_bytes + alignment, vk::BufferUsageFlags::empty())?;
        let scratch_address = scratch.address().next_multiple_of(alignment);
        let mut scene = Self {
            device: device.clone(),
            preference,
            positions,
            indices,
            vertices,
            triangles,
            instances,
            scratch,
            scratch_address,
            bottom,
            top: Arc::new(top),
            words: SceneWords::unscaled(mesh.bounds(), count),
            first_build: DriverTimes::default(),
        };
        scene.first_build = scene.rebuild()?;
        Ok(scene)
    }

    /// Records that both structures are built again from the same vertices, with marks around each.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`].
    pub fn record_build(&self, batch: &mut Batch) -> Result<(), GpuError> {
        let scratch = (&self.scratch, self.scratch_address);
        let flags = self.preference.flags();
        batch.mark("driver begin")?;
        if let Some(bottom) = &self.bottom {
            let input = Input::Triangles {
                positions: &self.positions,
                vertices: self.vertices,
                indices: &self.indices,
            };
            Build { input, count: self.triangles, flags }.record(batch, bottom, scratch)?;
            batch.mark("driver bottom")?;
        }
        let count = u32::from(self.bottom.is_some());
        let build = Build { input: Input::Instances(&self.instances), count, flags };
        build.record(batch, &self.top, scratch)?;
        batch.mark("driver top")?;
        if let Some(bottom) = &self.bottom {
            batch.keep_other(bottom.clone());
        }
        Ok(())
    }

    /// Builds both structures again and waits for them: the time that a frame with other vertices
    /// would take.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`] and [`GpuError::DeviceLost`].
    pub fn rebuild(&self) -> Result<DriverTimes, GpuError> {
        let mut batch = self.device.batch()?;
        self.record_build(&mut batch)?;
        Ok(DriverTimes::of(&batch.submit()?))
    }

    /// What the first build took, in which drivers may compile shaders of their own.
    #[must_use]
    pub const fn first_build(&self) -> DriverTimes {
        self.first_build
    }

    /// What it was built for.
    #[must_use]
    pub const fn preference(&self) -> DriverBuild {
        self.preference
    }

    /// Triangles of the mesh.
    #[must_use]
    pub const fn triangles(&self) -> u32 {
        self.triangles
    }

    /// Bytes of both structures, as built (not compacted), without the vertices.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.top.bytes() + self.bottom.as_ref().map_or(0, |bottom| bottom.bytes())
    }

    /// Bytes that builds need besides; they are kept.
    #[must_use]
    pub const fn scratch_bytes(&self) -> u64 {
        self.scratch.size()
    }

    /// What batches have to keep when rays are traced.
    pub(super) fn keep(&self, batch: &mut Batch) {
        batch.keep_other(self.top.clone());
        if let Some(bottom) = &self.bottom {
            batch.keep_other(bottom.clone());
        }
    }
}

/// `VkAccelerationStructureInstanceKHR` in words: where it stands, seen by all rays from both sides.
fn instance(address: u64) -> [u32; 16] {
    const MASK: u32 = 0xff << 24;
    let one = 1_f32.to_bits();
    let flags = vk::GeometryInstanceFlagsKHR::TRIANGLE_FACING_CULL_DISABLE
        | vk::GeometryInstanceFlagsKHR::FORCE_OPAQUE;
    #[expect(clippy::cast_possible_truncation, reason = "the lower half, then the upper")]
    let [low, high] = [address as u32, (address >> 32) as u32];
    let mut words = [0; 16];
    // Three rows of four: the identity.
    (words[0], words[5], words[10]) = (one, one, one);
    words[12] = MASK;
    words[13] = flags.as_raw() << 24;
    (words[14], words[15]) = (low, high);
    words
}
