//! What has to hold whatever the bytes: one function a fuzz target.
//!
//! A check panics if something is wrong and does nothing otherwise. `fuzz/` at the top of the
//! repository gives these functions to libFuzzer, `tests/replay.rs` gives them their seeds and
//! mutations of them.

mod batches;
mod builders;
mod bytes;
mod files;
mod kernels;
mod rays;
mod scenes;
mod tree_file;
mod world;

use rayon::{ThreadPool, ThreadPoolBuilder};
use std::sync::LazyLock;

/// A fuzz target.
#[derive(Clone, Copy)]
pub struct Target {
    /// Its name in `fuzz/`.
    pub name: &'static str,
    check: fn(&[u8]),
    seeds: fn() -> Vec<Vec<u8>>,
}

/// Every target.
pub const ALL: [Target; 8] =
    [OBJ, GLTF, TREE_FILE, FORGED_TREE, RAY_FILE, BUILDERS, KERNELS, BATCHES];

/// OBJ text, behind its first NUL byte the text of its material library; or, if they begin like
/// that, zstd frames of OBJ text.
pub const OBJ: Target = Target { name: "obj", check: scenes::obj, seeds: scenes::obj_seeds };

/// A glTF document, or a GLB container, or zstd frames of one.
pub const GLTF: Target = Target { name: "gltf", check: scenes::gltf, seeds: scenes::gltf_seeds };

/// A tree file, read as each kind of tree.
pub const TREE_FILE: Target =
    Target { name: "tree_file", check: tree_file::plain, seeds: tree_file::plain_seeds };

/// The payload of a tree file, behind a header that fits it, so that what stands behind the
/// checksums is reached.
pub const FORGED_TREE: Target =
    Target { name: "forged_tree", check: tree_file::forged, seeds: tree_file::forged_seeds };

/// A ray file, read as text and as records.
pub const RAY_FILE: Target = Target { name: "ray_file", check: rays::check, seeds: rays::seeds };

/// Every builder on triangles and boxes of any bits.
pub const BUILDERS: Target =
    Target { name: "builders", check: builders::check, seeds: builders::seeds };

/// Every kernel on small meshes and rays of any bits.
pub const KERNELS: Target =
    Target { name: "kernels", check: kernels::check, seeds: kernels::seeds };

/// Every kernel's batches against its single rays.
pub const BATCHES: Target =
    Target { name: "batches", check: batches::check, seeds: batches::seeds };

impl Target {
    /// Checks one input.
    ///
    /// # Panics
    /// If something is wrong with what handles it: that is the finding.
    pub fn check(&self, data: &[u8]) {
        (self.check)(data);
    }

    /// Inputs to begin with: small, valid, each different.
    #[must_use]
    pub fn seeds(&self) -> Vec<Vec<u8>> {
        (self.seeds)()
    }

    /// The target of a name.
    #[must_use]
    pub fn by_name(name: &str) -> Option<Self> {
        ALL.into_iter().find(|target| target.name == name)
    }
}

/// A pool of one thread, or of three.
fn pool(threads: usize) -> &'static ThreadPool {
    static POOLS: LazyLock<[ThreadPool; 2]> = LazyLock::new(|| {
        [1, 3].map(|threads| {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("threads can be started")
        })
    });
    &POOLS[usize::from(threads > 1)]
}
