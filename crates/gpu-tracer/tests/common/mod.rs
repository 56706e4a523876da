//! What the tests have in common.

use niwaki_build_binned::Binned;
use niwaki_core::{Builder, Bvh};
use niwaki_scene::{Scene, generate::generate};
use niwaki_trace_vulkan::{Device, DeviceOptions, GpuError};

/// A device with validation, or `None` where there is no Vulkan and none is required.
pub(crate) fn device() -> Option<Device> {
    match Device::open(&DeviceOptions::checked()) {
        Ok(device) => Some(device),
        Err(error @ (GpuError::NoLoader(_) | GpuError::NoDevice(_))) => {
            let is_required = std::env::var_os("NIWAKI_REQUIRE_VULKAN").is_some_and(|x| x != "0");
            assert!(!is_required, "NIWAKI_REQUIRE_VULKAN is set: {error}");
            println!("skipped: {error}");
            None
        }
        Err(error) => panic!("{error}"),
    }
}

/// A procedural scene and a tree over it.
pub(crate) fn scene_and_tree(name: &str, triangles: usize) -> (Scene, Bvh) {
    let scene = generate(name, triangles, 1).expect("the name is in the list");
    let refs = scene.mesh.prim_refs();
    let bvh = Binned::default().build(&refs).expect("finite");
    (scene, bvh)
}
