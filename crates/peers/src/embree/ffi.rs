//! The part of Embree's C interface that this crate uses, in Rust, for Embree 3 and 4.
//!
//! Written from the documented interface (Embree 3.13 and 4.4 headers `rtcore_*.h`). Names follow
//! C so that the headers can be read beside them. Where the two versions lay out a structure
//! differently, the longer one is used here: a library of the shorter version writes a prefix.

use super::error::LoadFailure;
use libloading::Library;
use std::ffi::{c_char, c_int, c_uint, c_void};

/// Opaque handles are plain pointers.
pub(crate) type Handle = *mut c_void;

pub(crate) const INVALID_ID: u32 = u32::MAX;

// RTCDeviceProperty
pub(crate) const PROPERTY_VERSION_MAJOR: c_int = 1;
pub(crate) const PROPERTY_VERSION_MINOR: c_int = 2;
pub(crate) const PROPERTY_VERSION_PATCH: c_int = 3;
pub(crate) const PROPERTY_NATIVE_RAY4_SUPPORTED: c_int = 32;
pub(crate) const PROPERTY_NATIVE_RAY8_SUPPORTED: c_int = 33;
pub(crate) const PROPERTY_NATIVE_RAY16_SUPPORTED: c_int = 34;
// RTCGeometryType, RTCBufferType, RTCFormat
pub(crate) const GEOMETRY_TYPE_TRIANGLE: c_int = 0;
pub(crate) const BUFFER_TYPE_INDEX: c_int = 0;
pub(crate) const BUFFER_TYPE_VERTEX: c_int = 1;
pub(crate) const FORMAT_UINT3: c_int = 0x5003;
pub(crate) const FORMAT_FLOAT3: c_int = 0x9003;
// RTCSceneFlags
pub(crate) const SCENE_FLAG_NONE: c_int = 0;
pub(crate) const SCENE_FLAG_ROBUST: c_int = 1 << 2;

/// `RTCRay`.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub(crate) struct RtcRay {
    pub(crate) org: [f32; 3],
    pub(crate) tnear: f32,
    pub(crate) dir: [f32; 3],
    pub(crate) time: f32,
    pub(crate) tfar: f32,
    pub(crate) mask: u32,
    pub(crate) id: u32,
    pub(crate) flags: u32,
}

/// `RTCHit`. Embree 3, and 4 before 4.3, end after `inst_id` and padding, at 32 bytes.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub(crate) struct RtcHit {
    pub(crate) ng: [f32; 3],
    pub(crate) u: f32,
    pub(crate) v: f32,
    pub(crate) prim_id: u32,
    pub(crate) geom_id: u32,
    pub(crate) inst_id: u32,
    /// Written by Embree 4.3 and later, built with instance arrays.
    pub(crate) inst_prim_id: u32,
}

/// `RTCRayHit`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(crate) struct RtcRayHit {
    pub(crate) ray: RtcRay,
    pub(crate) hit: RtcHit,
}

/// `RTCIntersectContext` of Embree 3, with one instance level and without minimum curve widths:
/// the configuration that Embree is released with.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(crate) struct RtcIntersectContext {
    pub(crate) flags: c_uint,
    pub(crate) filter: *const c_void,
    pub(crate) inst_id: u32,
}

impl RtcIntersectContext {
    /// What `rtcInitIntersectContext` gives: tuned for incoherent rays, no filter.
    pub(crate) const fn new() -> Self {
        Self { flags: 0, filter: std::ptr::null(), inst_id: INVALID_ID }
    }
}

/// `RTCBounds`.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub(crate) struct RtcBounds {
    pub(crate) lower: [f32; 3],
    pub(crate) align0: f32,
    pub(crate) upper: [f32; 3],
    pub(crate) align1: f32,
}

/// `RTCBuildPrimitive`: as our `PrimRef`, with the two ids swapped. The upper five bits of
/// `geom_id` are Embree's while it splits.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct RtcBuildPrimitive {
    pub(crate) lower: [f32; 3],
    pub(crate) geom_id: u32,
    pub(crate) upper: [f32; 3],
    pub(crate) prim_id: u32,
}

pub(crate) type CreateNode = unsafe extern "C" fn(Handle, c_uint, *mut c_void) -> *mut c_void;
pub(crate) type SetNodeChildren =
    unsafe extern "C" fn(*mut c_void, *const *mut c_void, c_uint, *mut c_void);
pub(crate) type SetNodeBounds =
    unsafe extern "C" fn(*mut c_void, *const *const RtcBounds, c_uint, *mut c_void);
pub(crate) type CreateLeaf =
    unsafe extern "C" fn(Handle, *const RtcBuildPrimitive, usize, *mut c_void) -> *mut c_void;
pub(crate) type SplitPrimitive = unsafe extern "C" fn(
    *const RtcBuildPrimitive,
    c_uint,
    f32,
    *mut RtcBounds,
    *mut RtcBounds,
    *mut c_void,
);
pub(crate) type Progress = unsafe extern "C" fn(*mut c_void, f64) -> bool;

/// `RTCBuildArguments`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(crate) struct RtcBuildArguments {
    pub(crate) byte_size: usize,
    pub(crate) build_quality: c_int,
    pub(crate) build_flags: c_int,
    pub(crate) max_branching_factor: c_uint,
    pub(crate) max_depth: c_uint,
    pub(crate) sah_block_size: c_uint,
    pub(crate) min_leaf_size: c_uint,
    pub(crate) max_leaf_size: c_uint,
    pub(crate) traversal_cost: f32,
    pub(crate) intersection_cost: f32,
    pub(crate) bvh: Handle,
    pub(crate) primitives: *mut RtcBuildPrimitive,
    pub(crate) primitive_count: usize,
    pub(crate) primitive_array_capacity: usize,
    pub(crate) create_node: Option<CreateNode>,
    pub(crate) set_node_children: Option<SetNodeChildren>,
    pub(crate) set_node_bounds: Option<SetNodeBounds>,
    pub(crate) create_leaf: Option<CreateLeaf>,
    pub(crate) split_primitive: Option<SplitPrimitive>,
    pub(crate) build_progress: Option<Progress>,
    pub(crate) user_ptr: *mut c_void,
}

pub(crate) type ErrorFunction = unsafe extern "C" fn(*mut c_void, c_int, *const c_char);
pub(crate) type MemoryMonitor = unsafe extern "C" fn(*mut c_void, isize, bool) -> bool;

// Sizes and offsets as a C compiler gives them for the headers on 64-bit platforms.
#[cfg(target_pointer_width = "64")]
const _: () = {
    use std::mem::offset_of;
    assert!(size_of::<RtcRay>() == 48 && align_of::<RtcRay>() == 16);
    assert!(offset_of!(RtcRay, tfar) == 32 && offset_of!(RtcRay, mask) == 36);
    assert!(size_of::<RtcHit>() == 48 && align_of::<RtcHit>() == 16);
    assert!(offset_of!(RtcHit, prim_id) == 20 && offset_of!(RtcHit, inst_id) == 28);
    assert!(size_of::<RtcRayHit>() == 96 && align_of::<RtcRayHit>() == 16);
    assert!(offset_of!(RtcRayHit, hit) == 48);
    assert!(size_of::<RtcIntersectContext>() == 24);
    assert!(offset_of!(RtcIntersectContext, filter) == 8);
    assert!(offset_of!(RtcIntersectContext, inst_id) == 16);
    assert!(size_of::<RtcBounds>() == 32 && align_of::<RtcBounds>() == 16);
    assert!(offset_of!(RtcBounds, upper) == 16);
    assert!(size_of::<RtcBuildPrimitive>() == 32 && align_of::<RtcBuildPrimitive>() == 32);
    assert!(offset_of!(RtcBuildPrimitive, geom_id) == 12);
    assert!(offset_of!(RtcBuildPrimitive, prim_id) == 28);
    assert!(size_of::<RtcBuildArguments>() == 136 && align_of::<RtcBuildArguments>() == 8);
    assert!(offset_of!(RtcBuildArguments, intersection_cost) == 40);
    assert!(offset_of!(RtcBuildArguments, bvh) == 48);
    assert!(offset_of!(RtcBuildArguments, create_node) == 80);
    assert!(offset_of!(RtcBuildArguments, user_ptr) == 128);
};

/// `rtcIntersect1` and `rtcOccluded1` before the version is known; see [`Queries`].
type AnyFunction = unsafe extern "C" fn();

/// Functions whose parameters changed between versions.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Queries {
    V3 {
        intersect1: unsafe extern "C" fn(Handle, *mut RtcIntersectContext, *mut RtcRayHit),
        occluded1: unsafe extern "C" fn(Handle, *mut RtcIntersectContext, *mut RtcRay),
    },
    V4 {
        intersect1: unsafe extern "C" fn(Handle, *mut RtcRayHit, *mut c_void),
        occluded1: unsafe extern "C" fn(Handle, *mut RtcRay, *mut c_void),
    },
}

/// Declares [`Api`] and how its functions are found by name.
macro_rules! api {
    ($($field:ident = $symbol:literal : fn($($argument:ty),*) $(-> $result:ty)?;)*) => {
        /// Functions found in a library. They stay callable as long as the process lives, since
        /// the library is never unloaded.
        #[derive(Debug)]
        pub(crate) struct Api {
            $(pub(crate) $field: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
            intersect1: AnyFunction,
            occluded1: AnyFunction,
        }

        impl Api {
            /// Looks up all functions.
            ///
            /// # Safety
            /// The library must be Embree 3 or 4, or lack one of the names.
            pub(crate) unsafe fn find(library: &Library) -> Result<Self, LoadFailure> {
                Ok(Self {
                    // SAFETY: the caller vouches for the library, whose headers give these types.
                    $($field: unsafe { symbol(library, $symbol)? },)*
                    // SAFETY: as above; `queries` gives these their types before they are called.
                    intersect1: unsafe { symbol(library, "rtcIntersect1")? },
                    // SAFETY: as above.
                    occluded1: unsafe { symbol(library, "rtcOccluded1")? },
                })
            }
        }
    };
}

api! {
    new_device = "rtcNewDevice": fn(*const c_char) -> Handle;
    release_device = "rtcReleaseDevice": fn(Handle);
    get_device_property = "rtcGetDeviceProperty": fn(Handle, c_int) -> isize;
    get_device_error = "rtcGetDeviceError": fn(Handle) -> c_int;
    set_device_error_function = "rtcSetDeviceErrorFunction":
        fn(Handle, Option<ErrorFunction>, *mut c_void);
    set_device_memory_monitor = "rtcSetDeviceMemoryMonitorFunction":
        fn(Handle, Option<MemoryMonitor>, *mut c_void);
    new_scene = "rtcNewScene": fn(Handle) -> Handle;
    release_scene = "rtcReleaseScene": fn(Handle);
    set_scene_build_quality = "rtcSetSceneBuildQuality": fn(Handle, c_int);
    set_scene_flags = "rtcSetSceneFlags": fn(Handle, c_int);
    commit_scene = "rtcCommitScene": fn(Handle);
    get_scene_bounds = "rtcGetSceneBounds": fn(Handle, *mut RtcBounds);
    new_geometry = "rtcNewGeometry": fn(Handle, c_int) -> Handle;
    release_geometry = "rtcReleaseGeometry": fn(Handle);
    set_geometry_build_quality = "rtcSetGeometryBuildQuality": fn(Handle, c_int);
    set_shared_geometry_buffer = "rtcSetSharedGeometryBuffer":
        fn(Handle, c_int, c_uint, c_int, *const c_void, usize, usize, usize);
    commit_geometry = "rtcCommitGeometry": fn(Handle);
    attach_geometry = "rtcAttachGeometry": fn(Handle, Handle) -> c_uint;
    new_bvh = "rtcNewBVH": fn(Handle) -> Handle;
    build_bvh = "rtcBuildBVH": fn(*const RtcBuildArguments) -> *mut c_void;
    thread_local_alloc = "rtcThreadLocalAlloc": fn(Handle, usize, usize) -> *mut c_void;
    release_bvh = "rtcReleaseBVH": fn(Handle);
}

impl Api {
    /// The ray queries with the parameters of one major version; `None` for other versions than
    /// 3 and 4.
    ///
    /// # Safety
    /// `major` must be the library's version.
    pub(crate) unsafe fn queries(&self, major: isize) -> Option<Queries> {
        match major {
            // SAFETY: pointers to functions of the same size; the version's header has these
            // parameters.
            3 => Some(unsafe {
                Queries::V3 {
                    intersect1: std::mem::transmute::<
                        AnyFunction,
                        unsafe extern "C" fn(Handle, *mut RtcIntersectContext, *mut RtcRayHit),
                    >(self.intersect1),
                    occluded1: std::mem::transmute::<
                        AnyFunction,
                        unsafe extern "C" fn(Handle, *mut RtcIntersectContext, *mut RtcRay),
                    >(self.occluded1),
                }
            }),
            // SAFETY: as above.
            4 => Some(unsafe {
                Queries::V4 {
                    intersect1: std::mem::transmute::<
                        AnyFunction,
                        unsafe extern "C" fn(Handle, *mut RtcRayHit, *mut c_void),
                    >(self.intersect1),
                    occluded1: std::mem::transmute::<
                        AnyFunction,
                        unsafe extern "C" fn(Handle, *mut RtcRay, *mut c_void),
                    >(self.occluded1),
                }
            }),
            _ => None,
        }
    }
}

/// One function by name.
///
/// # Safety
/// If the library has the name, it must be a function of type `F`.
unsafe fn symbol<F: Copy>(library: &Library, name: &'static str) -> Result<F, LoadFailure> {
    // SAFETY: the caller vouches for the type.
    let found = unsafe { library.get::<F>(name) };
    found.map(|f| *f).map_err(|_| LoadFailure::MissingSymbol(name))
}
