//! Our kernels over one tree.

use crate::kernel::{Collapse, TraceKernel, WideTree};
use niwaki_core::{Bvh, Intersector, TriangleMesh};
use niwaki_trace::{BinaryScene, Mode, SceneError};

/// Calls `f` with every kernel that this processor can run over the tree, its name and its mode:
/// the binary reference, then those of [`TraceKernel::available`].
pub(crate) fn each_kernel(
    bvh: &Bvh,
    mesh: &TriangleMesh,
    mut f: impl FnMut(&str, Mode, &dyn Intersector),
) -> Result<(), SceneError> {
    for mode in Mode::ALL {
        f(&binary(mode), mode, &BinaryScene::new_in(mode, bvh, mesh)?);
    }
    each_of(&TraceKernel::available(), bvh, mesh, &mut f)
}

/// [`each_kernel`] for those of [`TraceKernel::of_other_widths`].
pub(crate) fn each_kernel_of_other_widths(
    bvh: &Bvh,
    mesh: &TriangleMesh,
    mut f: impl FnMut(&str, Mode, &dyn Intersector),
) -> Result<(), SceneError> {
    each_of(&TraceKernel::of_other_widths(), bvh, mesh, &mut f)
}

fn each_of(
    kernels: &[TraceKernel],
    bvh: &Bvh,
    mesh: &TriangleMesh,
    f: &mut impl FnMut(&str, Mode, &dyn Intersector),
) -> Result<(), SceneError> {
    for layout in TraceKernel::by_layout(kernels) {
        let mut tree = WideTree::new(layout[0], Collapse::default(), bvh, mesh)?;
        for kernel in layout {
            tree = tree.with_kernel(kernel.kernel)?;
            f(&kernel.name(), kernel.mode, tree.intersector());
        }
    }
    Ok(())
}

/// The names of [`each_kernel`] and [`each_kernel_of_other_widths`], in no particular order.
pub(crate) fn kernel_names(other_widths: bool) -> Vec<String> {
    let mut names: Vec<_> = TraceKernel::available().into_iter().map(TraceKernel::name).collect();
    names.extend(Mode::ALL.map(binary));
    if other_widths {
        names.extend(TraceKernel::of_other_widths().into_iter().map(TraceKernel::name));
    }
    names
}

/// As [`TraceKernel::name`] has it.
fn binary(mode: Mode) -> String {
    if mode == Mode::default() { "binary".to_owned() } else { format!("binary_{mode}") }
}
