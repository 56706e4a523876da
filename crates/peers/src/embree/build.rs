//! Binary trees from Embree's builders, by `rtcBuildBVH`.

use super::{
    Embree, Quality,
    device::Device,
    ffi::{Handle, RtcBounds, RtcBuildArguments, RtcBuildPrimitive},
};
use crate::{
    PeerBuild, PeerError,
    flatten::{Read, flatten},
};
use niwaki_core::{Aabb, Bvh, PrimRef, SahConstants, TriangleMesh, glam::Vec3, scene_bounds};
use std::{
    ffi::{c_uint, c_void},
    mem::offset_of,
    ptr, slice,
    time::Instant,
};

/// The most primitives of one leaf (`RTC_BUILD_MAX_PRIMITIVES_PER_LEAF`).
const MAX_LEAF: u32 = 32;

/// Settings of [`Embree::build_bvh_with`]; the defaults are those of `rtcDefaultBuildArguments`
/// except for the depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmbreeBvhSettings {
    /// Which builder; default [`Quality::Medium`].
    pub quality: Quality,
    /// Costs of a traversal step and of a triangle; [`SahConstants::leaf`] has no counterpart.
    /// Default 1 and 1. Embree stops splitting where a leaf costs less.
    pub costs: SahConstants,
    /// Triangles are counted in blocks of this size, rounded up, for leaf costs; default 1.
    pub sah_block_size: u32,
    /// No leaf has fewer unless it must; default 1.
    pub min_leaf_size: u32,
    /// No leaf has more, 1 to 32; default 32.
    pub max_leaf_size: u32,
    /// Levels below the root after which Embree gives up, 9 to 1000, default 72. From 8 levels
    /// before on it halves lists without looking at costs. Embree's own default of 32 is meant for
    /// wider trees; on evenly tessellated scenes it makes little difference (Sponza: 0.01 %).
    pub max_depth: u32,
    /// For [`Quality::High`]: room for references after spatial splits, as a multiple of the
    /// number of primitives, at least 1; default 2, as Embree's manual suggests.
    pub split_factor: f32,
}

impl EmbreeBvhSettings {
    /// The defaults for one quality.
    #[must_use]
    pub const fn quality(quality: Quality) -> Self {
        Self {
            quality,
            costs: SahConstants::THESIS_V,
            sah_block_size: 1,
            min_leaf_size: 1,
            max_leaf_size: MAX_LEAF,
            max_depth: 72,
            split_factor: 2.0,
        }
    }

    fn check(&self) -> Result<(), PeerError> {
        let bad = |setting, value: String, remedy| {
            Err(niwaki_core::BuildError::BadSetting { setting, value, remedy }.into())
        };
        if !(1..=MAX_LEAF).contains(&self.max_leaf_size) {
            return bad("max_leaf_size", self.max_leaf_size.to_string(), "use 1 to 32");
        }
        if !(1..=self.max_leaf_size).contains(&self.min_leaf_size) {
            return bad("min_leaf_size", self.min_leaf_size.to_string(), "use 1 to max_leaf_size");
        }
        if self.sah_block_size == 0 {
            return bad("sah_block_size", "0".to_owned(), "use 1 or more");
        }
        if !(9..=1000).contains(&self.max_depth) {
            return bad("max_depth", self.max_depth.to_string(), "use 9 to 1000");
        }
        if !(1.0..=100.0).contains(&self.split_factor) {
            return bad("split_factor", self.split_factor.to_string(), "use 1 to 100");
        }
        Ok(())
    }
}

impl Default for EmbreeBvhSettings {
    fn default() -> Self {
        Self::quality(Quality::Medium)
    }
}

impl Embree {
    /// A binary tree over a mesh by one of Embree's builders, with the default settings. Trees of
    /// [`Quality::High`] have spatial splits and may name a triangle more than once.
    ///
    /// # Errors
    /// As [`Embree::build_bvh_with`].
    pub fn build_bvh(&self, quality: Quality, mesh: &TriangleMesh) -> Result<PeerBuild, PeerError> {
        self.build_bvh_with(&EmbreeBvhSettings::quality(quality), mesh)
    }

    /// A binary tree over a mesh by one of Embree's builders. [`PeerBuild::build`] covers the list
    /// of primitives and `rtcBuildBVH`, as `Builder::build_mesh` covers both for our builders.
    ///
    /// [`Quality::High`] clips by a callback into this crate, which is conservative, and takes
    /// about five times as long as Embree's own scenes do (measured on Sponza, one thread): take
    /// its *trees* from here, but its build time from [`crate::EmbreeScene::commit_time`].
    ///
    /// Embree does not promise the same tree for every run and number of threads.
    ///
    /// # Errors
    /// [`PeerError::Input`] for settings out of range, [`PeerError::Embree`] if Embree fails.
    pub fn build_bvh_with(
        &self,
        settings: &EmbreeBvhSettings,
        mesh: &TriangleMesh,
    ) -> Result<PeerBuild, PeerError> {
        settings.check()?;
        let start = Instant::now();
        let prims = mesh.prim_refs();
        self.build(settings, &prims, Some(mesh), start)
    }

    /// A binary tree over boxes. There is nothing to split, so [`Quality::High`] builds as
    /// [`Quality::Medium`] does.
    ///
    /// # Errors
    /// As [`Embree::build_bvh_with`], and [`PeerError::Input`] for bounds that are not finite.
    pub fn build_bvh_over(
        &self,
        settings: &EmbreeBvhSettings,
        prims: &[PrimRef],
    ) -> Result<PeerBuild, PeerError> {
        settings.check()?;
        self.build(settings, prims, None, Instant::now())
    }

    fn build(
        &self,
        settings: &EmbreeBvhSettings,
        prims: &[PrimRef],
        mesh: Option<&TriangleMesh>,
        start: Instant,
    ) -> Result<PeerBuild, PeerError> {
        let bounds = scene_bounds(prims)?.bounds;
        if prims.is_empty() {
            return Ok(PeerBuild::timed(start, Bvh::default));
        }
        let device = &*self.device;
        let capacity = match (settings.quality, mesh) {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "at least 1 and at most 100 times the number of primitives"
            )]
            (Quality::High, Some(_)) => {
                (prims.len() as f64 * f64::from(settings.split_factor)) as usize
            }
            _ => prims.len(),
        };
        let mut list: Vec<RtcBuildPrimitive> = Vec::with_capacity(capacity.max(prims.len()));
        list.extend(prims.iter().map(|p| RtcBuildPrimitive {
            lower: p.min.to_array(),
            geom_id: 0,
            upper: p.max.to_array(),
            prim_id: p.prim_id,
        }));
        let tree = Tree::new(device)?;
        let context = Context { device, mesh };
        let arguments = RtcBuildArguments {
            byte_size: size_of::<RtcBuildArguments>(),
            build_quality: settings.quality.code(),
            build_flags: 0,
            max_branching_factor: 2,
            max_depth: settings.max_depth,
            sah_block_size: settings.sah_block_size,
            min_leaf_size: settings.min_leaf_size,
            max_leaf_size: settings.max_leaf_size,
            traversal_cost: settings.costs.inner,
            intersection_cost: settings.costs.triangle,
            bvh: tree.handle,
            primitives: list.as_mut_ptr(),
            primitive_count: list.len(),
            primitive_array_capacity: list.capacity(),
            create_node: Some(create_node),
            set_node_children: Some(set_node_children),
            set_node_bounds: Some(set_node_bounds),
            create_leaf: Some(create_leaf),
            split_primitive: mesh.map(|_| split_primitive as _),
            build_progress: None,
            user_ptr: (&raw const context).cast_mut().cast(),
        };
        // SAFETY: the arguments point to live data of the stated sizes; the callbacks only read
        // `context`, which is shared with Embree's threads until the call returns.
        let root = unsafe { (device.api.build_bvh)(&raw const arguments) };
        let build = start.elapsed();
        device.check("rtcBuildBVH")?;
        let start = Instant::now();
        let bvh = flatten(root.cast_const(), bounds, |node, ids| {
            // SAFETY: `root` and the children that `set_node_children` stored point to nodes of
            // this tree, which `tree` keeps alive, or are null.
            unsafe { read(node, ids) }
        });
        let bvh = bvh.ok_or_else(|| PeerError::Embree {
            operation: "rtcBuildBVH",
            code: "RTC_ERROR_UNKNOWN".to_owned(),
            message: "the tree has nodes without children".to_owned(),
        })?;
        Ok(PeerBuild { bvh, build, conversion: start.elapsed() })
    }
}

/// Owns an `RTCBVH`, in whose memory the nodes are.
struct Tree<'a> {
    handle: Handle,
    device: &'a Device,
}

impl<'a> Tree<'a> {
    fn new(device: &'a Device) -> Result<Self, PeerError> {
        // SAFETY: a live device.
        let handle = unsafe { (device.api.new_bvh)(device.handle) };
        device.check("rtcNewBVH")?;
        Ok(Self { handle, device })
    }
}

impl Drop for Tree<'_> {
    fn drop(&mut self) {
        // SAFETY: the only owner of the handle; no node is used after this.
        unsafe { (self.device.api.release_bvh)(self.handle) };
    }
}

/// What the callbacks know.
struct Context<'a> {
    device: &'a Device,
    mesh: Option<&'a TriangleMesh>,
}

/// A node in Embree's memory. Leaves hold `count` ids right behind this header.
#[repr(C)]
struct Header {
    /// Number of ids; 0 for an [`Inner`].
    count: u32,
}

#[repr(C)]
struct Inner {
    header: Header,
    bounds: [Aabb; 2],
    children: [*const Header; 2],
}

const LEAF_IDS: usize = size_of::<Header>();

/// Memory from Embree's allocator for this thread; null if there is none left, which Embree has
/// then noted as an error.
unsafe fn allocate(allocator: Handle, user: *mut c_void, bytes: usize) -> *mut c_void {
    // SAFETY: `user` is the context of the running build and the allocator that of this thread.
    unsafe {
        let context = &*user.cast::<Context<'_>>();
        (context.device.api.thread_local_alloc)(allocator, bytes, align_of::<Inner>())
    }
}

// The callbacks below are `extern "C"`, from which Rust does not unwind: a panic would end the
// process. None of them panics; they index nothing and allocate nothing of Rust's.

unsafe extern "C" fn create_node(
    allocator: Handle,
    _child_count: c_uint,
    user: *mut c_void,
) -> *mut c_void {
    // SAFETY: Embree passes its allocator and our context; a null result is not written to, and
    // another has room for an aligned `Inner`.
    unsafe {
        let node = allocate(allocator, user, size_of::<Inner>()).cast::<Inner>();
        if !node.is_null() {
            node.write(Inner {
                header: Header { count: 0 },
                bounds: [Aabb::EMPTY; 2],
                children: [ptr::null(); 2],
            });
        }
        node.cast()
    }
}

unsafe extern "C" fn set_node_children(
    node: *mut c_void,
    children: *const *mut c_void,
    count: c_uint,
    _user: *mut c_void,
) {
    if node.is_null() {
        return;
    }
    // SAFETY: `node` is from `create_node`, and Embree passes `count` children. No other thread
    // uses the node now.
    unsafe {
        for i in 0..(count as usize).min(2) {
            (&raw mut (*node.cast::<Inner>()).children)
                .cast::<*const Header>()
                .add(i)
                .write((*children.add(i)).cast_const().cast());
        }
    }
}

unsafe extern "C" fn set_node_bounds(
    node: *mut c_void,
    bounds: *const *const RtcBounds,
    count: c_uint,
    _user: *mut c_void,
) {
    if node.is_null() {
        return;
    }
    // SAFETY: as in `set_node_children`.
    unsafe {
        for i in 0..(count as usize).min(2) {
            let RtcBounds { lower, upper, .. } = **bounds.add(i);
            (&raw mut (*node.cast::<Inner>()).bounds)
                .cast::<Aabb>()
                .add(i)
                .write(Aabb::new(Vec3::from_array(lower), Vec3::from_array(upper)));
        }
    }
}

unsafe extern "C" fn create_leaf(
    allocator: Handle,
    prims: *const RtcBuildPrimitive,
    count: usize,
    user: *mut c_void,
) -> *mut c_void {
    // A count of 0 would mark an inner node; reading refuses null.
    let Some(len) = u32::try_from(count).ok().filter(|&len| len > 0) else {
        return ptr::null_mut();
    };
    // SAFETY: Embree passes `count` primitives; the memory has room for the header and as many
    // ids, whose alignment is that of the header.
    unsafe {
        let leaf = allocate(allocator, user, LEAF_IDS + count * size_of::<u32>());
        if !leaf.is_null() {
            leaf.cast::<Header>().write(Header { count: len });
            let ids = leaf.byte_add(LEAF_IDS).cast::<u32>();
            for i in 0..count {
                ids.add(i).write((*prims.add(i)).prim_id);
            }
        }
        leaf
    }
}

unsafe extern "C" fn split_primitive(
    primitive: *const RtcBuildPrimitive,
    dimension: c_uint,
    position: f32,
    left: *mut RtcBounds,
    right: *mut RtcBounds,
    user: *mut c_void,
) {
    // SAFETY: Embree passes a primitive of ours and two boxes to write.
    unsafe {
        let RtcBuildPrimitive { lower, upper, prim_id, .. } = *primitive;
        let bounds = Aabb::new(Vec3::from_array(lower), Vec3::from_array(upper));
        let mesh = (*user.cast::<Context<'_>>()).mesh;
        let (low, high) = match mesh {
            Some(mesh) if (prim_id as usize) < mesh.len() && dimension < 3 => {
                mesh.triangle(prim_id as usize).split(&bounds, dimension as usize, position)
            }
            // Not reached: only meshes come with this callback, and ids are theirs.
            _ => (bounds, bounds),
        };
        write_bounds(left, &low);
        write_bounds(right, &high);
    }
}

/// Writes the six coordinates only: Embree keeps ids in the padding.
unsafe fn write_bounds(target: *mut RtcBounds, bounds: &Aabb) {
    // SAFETY: the caller passes a box that may be written.
    unsafe {
        target.byte_add(offset_of!(RtcBounds, lower)).cast::<[f32; 3]>().write(bounds.min.into());
        target.byte_add(offset_of!(RtcBounds, upper)).cast::<[f32; 3]>().write(bounds.max.into());
    }
}

/// Reads a node for [`flatten`].
///
/// # Safety
/// `node` must be null or from a callback above, with memory that still lives.
unsafe fn read(node: *const c_void, ids: &mut Vec<u32>) -> Read<*const c_void> {
    if node.is_null() {
        return Read::Missing;
    }
    // SAFETY: both kinds of node begin with the header.
    unsafe {
        let count = (*node.cast::<Header>()).count as usize;
        if count > 0 {
            ids.extend_from_slice(slice::from_raw_parts(
                node.byte_add(LEAF_IDS).cast::<u32>(),
                count,
            ));
            return Read::Leaf;
        }
        let inner = &*node.cast::<Inner>();
        Read::Inner([
            (inner.children[0].cast(), inner.bounds[0]),
            (inner.children[1].cast(), inner.bounds[1]),
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_empty_leaf_reads_as_missing() {
        // SAFETY: without primitives neither the allocator, the list nor the context is used, and
        // what comes back is null.
        let read = unsafe {
            let leaf = create_leaf(ptr::null_mut(), ptr::null(), 0, ptr::null_mut());
            assert!(leaf.is_null());
            read(leaf, &mut Vec::new())
        };
        assert!(matches!(read, Read::Missing));
    }
}
