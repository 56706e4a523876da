//! Our kernels over one tree, and the reference without a tree.

use crate::kernel::TraceKernel;
use niwaki_core::{Bvh, Hit, Intersector, Ray, TriangleMesh};
use niwaki_trace::{BinaryScene, Mode, SceneError, WideScene, brute_force_in};

/// Every triangle tested for every ray.
pub(crate) struct BruteForce<'a>(pub(crate) Mode, pub(crate) &'a TriangleMesh);

impl Intersector for BruteForce<'_> {
    fn closest_hit(&self, ray: &Ray) -> Hit {
        brute_force_in(self.0, self.1, ray)
    }
    fn any_hit(&self, ray: &Ray) -> bool {
        self.closest_hit(ray).is_hit()
    }
}

/// Calls `f` with every kernel that this processor can run over the tree, its name and its mode:
/// in each mode the binary reference, then the 8-wide ones, slowest first.
pub(crate) fn each_kernel(
    bvh: &Bvh,
    mesh: &TriangleMesh,
    mut f: impl FnMut(&str, Mode, &dyn Intersector),
) -> Result<(), SceneError> {
    for mode in Mode::ALL {
        let name = if mode == Mode::default() { "binary" } else { "binary_fast" };
        f(name, mode, &BinaryScene::new_in(mode, bvh, mesh)?);
        let mut wide = WideScene::new_in(mode, bvh, mesh)?;
        for kernel in TraceKernel::available().into_iter().filter(|kernel| kernel.mode == mode) {
            wide = wide.with_kernel(kernel.kernel)?;
            f(&kernel.name(), mode, &wide);
        }
    }
    Ok(())
}
