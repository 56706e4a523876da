//! Our kernels over one tree.

use crate::kernel::TraceKernel;
use niwaki_core::{Bvh, Intersector, TriangleMesh};
use niwaki_trace::{BinaryScene, Kernel, Mode, QuantisedScene, SceneError, WideScene};
use niwaki_wide::{CollapseSettings, WideBvh};

/// Calls `f` with every kernel that this processor can run over the tree, its name and its mode:
/// in each mode the binary reference, then the 8-wide ones, slowest first, and the fastest over
/// quantised nodes.
pub(crate) fn each_kernel(
    bvh: &Bvh,
    mesh: &TriangleMesh,
    mut f: impl FnMut(&str, Mode, &dyn Intersector),
) -> Result<(), SceneError> {
    for mode in Mode::ALL {
        f(&in_mode("binary", mode), mode, &BinaryScene::new_in(mode, bvh, mesh)?);
        let mut wide = WideScene::new_in(mode, bvh, mesh)?;
        for kernel in TraceKernel::available().into_iter().filter(|kernel| kernel.mode == mode) {
            if kernel.quantised {
                let quantised = QuantisedScene::new_in(mode, bvh, mesh)?;
                f(&kernel.name(), mode, &quantised.with_kernel(kernel.kernel)?);
            } else {
                wide = wide.with_kernel(kernel.kernel)?;
                f(&kernel.name(), mode, &wide);
            }
        }
    }
    Ok(())
}

/// [`each_kernel`] for trees of 4 and 16 children a node, SIMD kernels only.
pub(crate) fn each_kernel_of_other_widths(
    bvh: &Bvh,
    mesh: &TriangleMesh,
    mut f: impl FnMut(&str, Mode, &dyn Intersector),
) -> Result<(), SceneError> {
    each_of_width::<4>(bvh, mesh, &mut f)?;
    each_of_width::<16>(bvh, mesh, &mut f)
}

fn each_of_width<const W: usize>(
    bvh: &Bvh,
    mesh: &TriangleMesh,
    f: &mut impl FnMut(&str, Mode, &dyn Intersector),
) -> Result<(), SceneError>
where
    WideScene<W>: Intersector,
{
    for mode in Mode::ALL {
        let wide = WideBvh::<W>::collapse(bvh, &CollapseSettings::default())?;
        let mut scene = WideScene::build_in(mode, wide, mesh)?;
        for kernel in simd::<W>() {
            scene = scene.with_kernel(kernel)?;
            f(&of_width::<W>(kernel, mode), mode, &scene);
        }
    }
    Ok(())
}

/// The names of [`each_kernel`] and [`each_kernel_of_other_widths`], in no particular order.
pub(crate) fn kernel_names(other_widths: bool) -> Vec<String> {
    let mut names: Vec<_> = TraceKernel::available().into_iter().map(TraceKernel::name).collect();
    for mode in Mode::ALL {
        names.push(in_mode("binary", mode));
        if other_widths {
            names.extend(simd::<4>().map(|kernel| of_width::<4>(kernel, mode)));
            names.extend(simd::<16>().map(|kernel| of_width::<16>(kernel, mode)));
        }
    }
    names
}

/// The kernels that need a width of their own; the scalar one is the same code for all.
fn simd<const W: usize>() -> impl Iterator<Item = Kernel>
where
    WideScene<W>: Intersector,
{
    WideScene::<W>::kernels().into_iter().filter(|&kernel| kernel != Kernel::Scalar)
}

fn of_width<const W: usize>(kernel: Kernel, mode: Mode) -> String {
    in_mode(&format!("{kernel}_{W}"), mode)
}

/// As [`TraceKernel::name`] has it.
fn in_mode(name: &str, mode: Mode) -> String {
    if mode == Mode::default() { name.to_owned() } else { format!("{name}_{mode}") }
}
