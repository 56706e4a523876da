//! Our kernels over one tree, and the reference without a tree.

use niwaki_core::{Bvh, Hit, Intersector, Ray, TriangleMesh};
use niwaki_trace::{BinaryScene, Kernel, SceneError, WideScene, brute_force, brute_force_any};

/// Every triangle tested for every ray.
pub(crate) struct BruteForce<'a>(pub(crate) &'a TriangleMesh);

impl Intersector for BruteForce<'_> {
    fn closest_hit(&self, ray: &Ray) -> Hit {
        brute_force(self.0, ray)
    }
    fn any_hit(&self, ray: &Ray) -> bool {
        brute_force_any(self.0, ray)
    }
}

/// Kernels of any make with their names.
pub(crate) type Named = Vec<(String, Box<dyn Intersector>)>;

/// Calls `f` with every kernel that this processor can run over the tree: the binary reference,
/// then the 8-wide ones, slowest first.
pub(crate) fn each_kernel(
    bvh: &Bvh,
    mesh: &TriangleMesh,
    mut f: impl FnMut(&str, &dyn Intersector),
) -> Result<(), SceneError> {
    f("binary", &BinaryScene::new(bvh, mesh)?);
    let mut wide = WideScene::new(bvh, mesh)?;
    for kernel in Kernel::available() {
        wide = wide.with_kernel(kernel)?;
        f(kernel.name(), &wide);
    }
    Ok(())
}
