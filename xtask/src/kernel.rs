//! Our traversal kernels by name, and wide trees of any width for them to trace.

use anyhow::{Result, bail};
use clap::ValueEnum;
use niwaki_core::{Bvh, Hit, Intersector, Ray, TriangleMesh};
use niwaki_trace::{Counts, Kernel, Mode, QuantisedScene, SceneError, WideScene};
use niwaki_wide::{Bvh4, Bvh8, Bvh16, CollapseSettings};

/// Children a node that a tree can have.
pub(crate) const WIDTHS: [usize; 3] = [4, 8, 16];
/// The width that names leave out.
pub(crate) const USUAL_WIDTH: usize = 8;
/// Rays of each call of a kernel with `_batch` in its name.
pub(crate) const BATCH: usize = 1024;

/// A kernel in a mode over trees of a width with nodes of full precision or quantised ones, asked
/// for one ray at a time or for batches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TraceKernel {
    pub(crate) kernel: Kernel,
    pub(crate) mode: Mode,
    /// One of [`WIDTHS`] that the kernel traces.
    pub(crate) width: usize,
    pub(crate) quantised: bool,
    /// Asked through `closest_hits` and `any_hits` with [`BATCH`] rays each, not ray by ray.
    pub(crate) batch: bool,
}

/// What selects the best kernel over quantised nodes.
const QUANTISED: &str = "quantised";

impl TraceKernel {
    const fn new(kernel: Kernel, mode: Mode) -> Self {
        Self { kernel, mode, width: USUAL_WIDTH, quantised: false, batch: false }
    }

    /// All that this processor can run over 8-wide trees, one ray at a time, the one over quantised
    /// nodes, as these differ in the test of boxes alone, and the best at its own width; by mode.
    pub(crate) fn available() -> Vec<Self> {
        let mut kernels: Vec<Self> = Vec::new();
        for mode in Mode::ALL {
            let full = WideScene::<8>::kernels().into_iter().map(|kernel| Self::new(kernel, mode));
            for kernel in full.chain([Self::quantised_in(mode), Self::best_in(mode)]) {
                if !kernels.contains(&kernel) {
                    kernels.push(kernel);
                }
            }
        }
        kernels
    }

    /// SIMD kernels over trees of 4 and 16 children a node that [`TraceKernel::available`] leaves
    /// out; the scalar one is the same code for all.
    pub(crate) fn of_other_widths() -> Vec<Self> {
        let known = Self::available();
        Self::all()
            .filter(|kernel| kernel.kernel.is_available() && kernel.kernel != Kernel::Scalar)
            .filter(|kernel| !kernel.quantised && !known.contains(kernel))
            .collect()
    }

    /// The fastest of each width and kind of nodes in each mode, one ray at a time.
    pub(crate) fn best_of_each_width() -> Vec<Self> {
        let mut best: Vec<Self> = Vec::new();
        // Slower ones come first.
        for kernel in Self::all().filter(|kernel| kernel.kernel.is_available()) {
            let same = |k: &&mut Self| k.layout() == kernel.layout();
            match best.iter_mut().find(same) {
                Some(known) => *known = kernel,
                None => best.push(kernel),
            }
        }
        best
    }

    /// The fastest in a mode, over trees of the width that suits it: what
    /// [`niwaki_trace::AutoScene`] takes.
    pub(crate) fn best_in(mode: Mode) -> Self {
        let kernel = Kernel::best();
        Self { width: kernel.best_width(), ..Self::new(kernel, mode) }
    }

    /// The fastest over quantised nodes, of which 8 are the usual number.
    fn quantised_in(mode: Mode) -> Self {
        let kernel = QuantisedScene::<8>::kernels().pop().unwrap_or(Kernel::Scalar);
        Self { quantised: true, ..Self::new(kernel, mode) }
    }

    /// The fastest in the default mode.
    pub(crate) fn best() -> Self {
        Self::best_in(Mode::default())
    }

    /// What kernels that can share a tree and its triangles have in common.
    pub(crate) const fn layout(self) -> (Mode, usize, bool) {
        (self.mode, self.width, self.quantised)
    }

    /// `avx512` over 8-wide trees in the default mode, which is the watertight one, one ray at a
    /// time; `avx512_16`, `avx512_quantised`, `avx512_fast`, `avx512_batch` and so on otherwise.
    pub(crate) fn name(self) -> String {
        let mut name = self.kernel.name().to_owned();
        if self.width != USUAL_WIDTH {
            name += &format!("_{}", self.width);
        }
        if self.quantised {
            name += "_quantised";
        }
        if self.mode != Mode::default() {
            name += &format!("_{}", self.mode);
        }
        if self.batch {
            name += "_batch";
        }
        name
    }

    /// Rays of a call.
    pub(crate) const fn rays_per_call(self) -> usize {
        if self.batch { BATCH } else { 1 }
    }

    /// The kernels that a list names, each once: names, `watertight` or `fast` for the processor's
    /// best in that mode, and `quantised` for its best over quantised nodes, alike with `_batch`.
    /// The best in the default mode without a name.
    pub(crate) fn select(names: &[String]) -> Result<Vec<Self>> {
        let mut kernels = Vec::new();
        for name in names {
            let (stem, batch) =
                name.strip_suffix("_batch").map_or((name.as_str(), false), |stem| (stem, true));
            let kernel = match Mode::ALL.into_iter().find(|mode| mode.name() == stem) {
                Some(mode) => Self { batch, ..Self::best_in(mode) },
                None if stem == QUANTISED => Self { batch, ..Self::quantised_in(Mode::default()) },
                None => Self { batch, ..Self::named(stem)? },
            };
            if !kernels.contains(&kernel) {
                kernels.push(kernel);
            }
        }
        if kernels.is_empty() {
            kernels.push(Self::best());
        }
        Ok(kernels)
    }

    /// Every kernel in every mode for every width and kind of nodes that it traces, one ray at a
    /// time.
    fn all() -> impl Iterator<Item = Self> {
        Mode::ALL.into_iter().rev().flat_map(|mode| {
            Kernel::ALL.into_iter().flat_map(move |kernel| {
                let traced = WIDTHS.into_iter().filter(move |&width| kernel.traces(width));
                traced.flat_map(move |width| {
                    let of = move |quantised| Self { width, quantised, ..Self::new(kernel, mode) };
                    [false, true].map(of)
                })
            })
        })
    }

    /// The kernels by the layout that they share.
    pub(crate) fn by_layout(kernels: &[Self]) -> Vec<Vec<Self>> {
        let mut layouts: Vec<Vec<Self>> = Vec::new();
        for &kernel in kernels {
            let same = |layout: &&mut Vec<Self>| layout[0].layout() == kernel.layout();
            match layouts.iter_mut().find(same) {
                Some(layout) => layout.push(kernel),
                None => layouts.push(vec![kernel]),
            }
        }
        layouts
    }

    fn named(name: &str) -> Result<Self> {
        match Self::all().find(|kernel| kernel.name() == name) {
            Some(found) if found.kernel.is_available() => Ok(found),
            Some(_) => bail!("this processor lacks the instructions of the kernel {name}"),
            None => {
                let known: Vec<_> = Self::all().map(Self::name).collect();
                bail!(
                    "`{name}` is no kernel; known are fast, watertight, {QUANTISED}, {}, and each of \
                     them with _batch behind it",
                    known.join(", ")
                )
            }
        }
    }
}

/// How binary trees become wide ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Collapse {
    /// The child with the largest surface is opened until the node is full: as the thesis does.
    Greedy,
    /// At the least expected cost of the whole tree.
    #[default]
    Optimal,
}

impl Collapse {
    /// The settings of `niwaki-wide`.
    pub(crate) fn settings(self) -> CollapseSettings {
        match self {
            Self::Greedy => CollapseSettings::greedy(),
            Self::Optimal => CollapseSettings::optimal(),
        }
    }

    /// The name on the command line and in files.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Greedy => "greedy",
            Self::Optimal => "optimal",
        }
    }
}

/// A wide tree of any of the [`WIDTHS`] and either kind of nodes, with its triangles; clones share
/// them.
#[derive(Clone, Debug)]
pub(crate) enum WideTree {
    Four(WideScene<4>),
    Eight(WideScene<8>),
    Sixteen(WideScene<16>),
    QuantisedFour(QuantisedScene<4>),
    QuantisedEight(QuantisedScene<8>),
    QuantisedSixteen(QuantisedScene<16>),
}

/// The same expression with the scene of whichever width.
macro_rules! of_any_width {
    ($tree:expr, $scene:ident => $do:expr) => {
        match $tree {
            WideTree::Four($scene) => $do,
            WideTree::Eight($scene) => $do,
            WideTree::Sixteen($scene) => $do,
            WideTree::QuantisedFour($scene) => $do,
            WideTree::QuantisedEight($scene) => $do,
            WideTree::QuantisedSixteen($scene) => $do,
        }
    };
}

impl WideTree {
    /// Collapses a tree for a kernel, and lays its triangles out for its mode, on the current
    /// rayon pool.
    pub(crate) fn new(
        kernel: TraceKernel,
        collapse: Collapse,
        bvh: &Bvh,
        mesh: &TriangleMesh,
    ) -> Result<Self, SceneError> {
        let (mode, settings) = (kernel.mode, collapse.settings());
        let four = || Bvh4::collapse(bvh, &settings);
        let eight = || Bvh8::collapse(bvh, &settings);
        let sixteen = || Bvh16::collapse(bvh, &settings);
        let tree = match (kernel.width, kernel.quantised) {
            (4, false) => Self::Four(WideScene::build_in(mode, four()?, mesh)?),
            (4, true) => Self::QuantisedFour(QuantisedScene::build_in(mode, four()?, mesh)?),
            (16, false) => Self::Sixteen(WideScene::build_in(mode, sixteen()?, mesh)?),
            (16, true) => Self::QuantisedSixteen(QuantisedScene::build_in(mode, sixteen()?, mesh)?),
            (_, false) => Self::Eight(WideScene::build_in(mode, eight()?, mesh)?),
            (_, true) => Self::QuantisedEight(QuantisedScene::build_in(mode, eight()?, mesh)?),
        };
        tree.with_kernel(kernel.kernel)
    }

    /// The same tree traced by another kernel.
    pub(crate) fn with_kernel(self, kernel: Kernel) -> Result<Self, SceneError> {
        Ok(match self {
            Self::Four(scene) => Self::Four(scene.with_kernel(kernel)?),
            Self::Eight(scene) => Self::Eight(scene.with_kernel(kernel)?),
            Self::Sixteen(scene) => Self::Sixteen(scene.with_kernel(kernel)?),
            Self::QuantisedFour(scene) => Self::QuantisedFour(scene.with_kernel(kernel)?),
            Self::QuantisedEight(scene) => Self::QuantisedEight(scene.with_kernel(kernel)?),
            Self::QuantisedSixteen(scene) => Self::QuantisedSixteen(scene.with_kernel(kernel)?),
        })
    }

    /// What answers rays.
    pub(crate) fn intersector(&self) -> &dyn Intersector {
        of_any_width!(self, scene => scene)
    }

    /// Bytes of nodes and triangles.
    pub(crate) fn bytes(&self) -> usize {
        of_any_width!(self, scene => scene.bytes())
    }

    /// The closest hits of some rays: one call of `closest_hit` a ray, in a loop that is compiled
    /// for the width and holds no virtual call; or one call of `closest_hits` for all as a batch.
    pub(crate) fn trace_closest(&self, batch: bool, rays: &[Ray], hits: &mut [Hit]) {
        of_any_width!(self, scene => if batch {
            scene.closest_hits(rays, hits);
        } else {
            each_closest(scene, rays, hits);
        });
    }

    /// [`WideTree::trace_closest`] for any hit.
    pub(crate) fn trace_any(&self, batch: bool, rays: &[Ray], flags: &mut [bool]) {
        of_any_width!(self, scene => if batch {
            scene.any_hits(rays, flags);
        } else {
            each_any(scene, rays, flags);
        });
    }

    /// The work of a ray, by the scalar kernel.
    pub(crate) fn counts(&self, any_hit: bool, ray: &Ray) -> Counts {
        of_any_width!(self, scene => if any_hit {
            scene.any_hit_counted(ray).1
        } else {
            scene.closest_hit_counted(ray).1
        })
    }
}

/// [`Intersector::closest_hit`] for each ray: never a batch, whatever the scene makes of
/// [`Intersector::closest_hits`].
pub(crate) fn each_closest(scene: &impl Intersector, rays: &[Ray], hits: &mut [Hit]) {
    for (ray, hit) in rays.iter().zip(hits) {
        *hit = scene.closest_hit(ray);
    }
}

/// [`Intersector::any_hit`] for each ray, likewise.
pub(crate) fn each_any(scene: &impl Intersector, rays: &[Ray], flags: &mut [bool]) {
    for (ray, flag) in rays.iter().zip(flags) {
        *flag = scene.any_hit(ray);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use niwaki_core::Builder;

    fn names(list: &[&str]) -> Vec<String> {
        let list: Vec<_> = list.iter().map(ToString::to_string).collect();
        TraceKernel::select(&list).unwrap().into_iter().map(TraceKernel::name).collect()
    }

    #[test]
    fn names_select() {
        let best = TraceKernel::best().name();
        assert_eq!(names(&[]), [best.as_str()]);
        let scene = niwaki_trace::AutoScene::new(&Bvh::default(), &TriangleMesh::default());
        let scene = scene.unwrap();
        assert_eq!((scene.kernel(), scene.width(), scene.mode()), {
            let TraceKernel { kernel, width, mode, .. } = TraceKernel::best();
            (kernel, width, mode)
        });
        assert_eq!(names(&["scalar_fast", "scalar", "scalar"]), ["scalar_fast", "scalar"]);
        assert_eq!(names(&["watertight", "fast"]), [best.clone(), format!("{best}_fast")]);
        assert_eq!(names(&["fast_batch"]), [format!("{best}_fast_batch")]);
        let eight = WideScene::<8>::kernels().pop().unwrap();
        assert_eq!(names(&["quantised"]), [format!("{eight}_quantised")]);
        let all =
            ["scalar_16_fast", "scalar_4", "scalar_4_batch", "scalar_16_quantised_fast_batch"];
        assert_eq!(names(&all), all);
        // The best is over 8-wide trees or is one more.
        let available = TraceKernel::available();
        let eight = WideScene::<8>::kernels().len();
        let wider = usize::from(Kernel::best().best_width() != USUAL_WIDTH);
        assert_eq!(available.len(), 2 * (eight + 1 + wider));
        assert!(available.contains(&TraceKernel::best()));
        assert!(TraceKernel::of_other_widths().iter().all(|kernel| !available.contains(kernel)));
        for bad in ["avx", "scalar_8", "avx2_16", "scalar_batch_fast", "batch"] {
            let error = TraceKernel::select(&[bad.into()]).unwrap_err().to_string();
            assert!(error.contains(bad.trim_end_matches("_batch")), "{error}");
            assert!(error.contains("avx2_4_fast") && error.contains("_batch"), "{error}");
        }
    }

    #[test]
    fn every_kernel_answers_alike_ray_by_ray_and_in_batches() {
        let mesh = niwaki_hard_cases::soup_mesh(300, 0.2, 3);
        let bvh = niwaki_build_sweep::Sweep::default().build_mesh(&mesh).unwrap();
        let rays = niwaki_hard_cases::rays(&mesh, 500, 4);
        let answers = |kernel: TraceKernel, collapse| {
            let tree = WideTree::new(kernel, collapse, &bvh, &mesh).unwrap();
            let mut hits = vec![Hit::MISS; rays.len()];
            let mut flags = vec![false; rays.len()];
            tree.trace_closest(kernel.batch, &rays, &mut hits);
            tree.trace_any(kernel.batch, &rays, &mut flags);
            (hits, flags)
        };
        let expected = answers(TraceKernel::best(), Collapse::Optimal);
        assert!(expected.0.iter().filter(|hit| hit.is_hit()).count() > 50);
        let kernels = TraceKernel::all().filter(|k| k.kernel.is_available());
        for kernel in kernels.filter(|k| k.mode == Mode::default()) {
            for batch in [false, true] {
                for collapse in [Collapse::Greedy, Collapse::Optimal] {
                    let kernel = TraceKernel { batch, ..kernel };
                    assert!(answers(kernel, collapse) == expected, "{}", kernel.name());
                }
            }
        }
    }
}
