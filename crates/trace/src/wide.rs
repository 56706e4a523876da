//! The wide tree with its triangles.

#[cfg(target_arch = "x86_64")]
use crate::kernels::{avx2, avx2_4, avx512, avx512_16, sse42};
use crate::{
    Counts, HitQueries, Kernel, Mode, SceneError, Walk,
    flat::{NEVER_HIT, closing, is_flat},
    kernels::{batches, scalar},
    query::{
        hits::Traverse,
        visitor::{Closest, Counted, First, Visitor},
    },
    scale::SceneScale,
    setup::RaySetup,
    triangle::words,
};
use niwaki_core::{Bvh, Hit, Intersector, Ray, TriangleMesh, memory::prefer_large_pages};
use niwaki_wide::{Bvh8, Child, CollapseSettings, WideBvh, WideNode};
use rayon::prelude::*;
use std::sync::Arc;

/// A wide tree with its triangles, laid out for SIMD, traced by the fastest [`Kernel`] that the
/// processor has for its width unless [`WideScene::with_kernel`] chooses another.
///
/// `W` is 4, 8 or 16. Plain `WideScene` is 8 wide; [`WideScene::build_from`] makes the others, and
/// [`crate::AutoScene`] the one that is fastest on this processor.
///
/// Owns a copy of all that it needs; clones share it.
#[derive(Clone, Debug)]
pub struct WideScene<const W: usize = 8> {
    /// Shared by clones, so that one scene can be traced by several kernels.
    layout: Arc<Layout<W>>,
    kernel: Kernel,
}

/// What the kernels read, with nodes of either kind.
#[derive(Debug)]
pub(crate) struct Layout<const W: usize, N = WideNode<W>> {
    pub(crate) nodes: Vec<N>,
    pub(crate) mode: Mode,
    /// Per leaf of n triangles nine rows of n words: v0 x, y, z, e1 x, y, z, e2 x, y, z in the fast
    /// mode, v0, v1 and v2 in the watertight one, which needs corners that neighbours share. A leaf
    /// whose first reference is `i` begins at word `9·i`. Whole vectors are read, so lanes past
    /// the n-th see other rows and leaves: nothing but coordinates is here, as ids would look
    /// like denormals, which make arithmetic slow.
    pub(crate) triangles: Vec<f32>,
    /// Ids in the order of the leaves.
    pub(crate) prim_ids: Vec<u32>,
    pub(crate) scale: SceneScale,
    pub(crate) stack_bound: usize,
}

impl<const W: usize> Layout<W> {
    /// Lays the triangles of a collapsed tree out, scaled as its nodes.
    pub(crate) fn new(
        mode: Mode,
        bvh: WideBvh<W>,
        mesh: &TriangleMesh,
    ) -> Result<Self, SceneError> {
        let scale = SceneScale::of(&bvh.bounds());
        let stack_bound = bvh.stack_bound();
        let (mut nodes, prim_ids) = bvh.into_parts();
        // Vectors may read past the end of the last leaf.
        let mut triangles = vec![0.0; WORDS * prim_ids.len() + W];
        prefer_large_pages(&triangles);
        let source = Source { mode, prim_ids: &prim_ids, mesh, scale };
        let flat = source.fill_all(&mut triangles, &nodes, &[])?;
        if !flat.is_empty() {
            let kept = closing(&flat, mesh);
            if !kept.is_empty() {
                source.fill_all(&mut triangles, &nodes, &kept)?;
            }
        }
        if scale.factor != 1.0 {
            nodes.par_iter_mut().with_min_len(NODE_CHUNK).for_each(|node| {
                for plane in node.bounds.as_flattened_mut() {
                    *plane *= scale.factor;
                }
            });
        }
        Ok(Self { nodes, mode, triangles, prim_ids, scale, stack_bound })
    }
}

impl<const W: usize, N> Layout<W, N> {
    /// Bytes that nodes, triangles and ids take.
    pub(crate) const fn bytes(&self) -> usize {
        size_of::<N>() * self.nodes.len()
            + size_of::<f32>() * (self.triangles.len() + self.prim_ids.len())
    }

    /// True if the rays are better answered in turns than one by one.
    #[cfg_attr(not(target_arch = "x86_64"), expect(dead_code, reason = "kernels of x86-64"))]
    pub(crate) fn takes_turns(&self, rays: &[Ray]) -> bool {
        rays.len() >= batches::LEAST
            && !self.nodes.is_empty()
            && self.stack_bound <= batches::DEEPEST
    }
}

/// Words that a triangle takes in [`WideScene::triangles`].
pub(crate) const WORDS: usize = 9;

/// Nodes whose triangles are gathered at once; they fit into the first-level cache.
const GATHER: usize = 32;

/// Nodes whose leaves one task fills.
const NODE_CHUNK: usize = 512;

impl WideScene {
    /// Collapses a tree to 8 wide nodes with default settings and lays its triangles out, on the current rayon
    /// pool. The result does not depend on the number of threads.
    ///
    /// # Errors
    /// [`SceneError`]: the tree is malformed, too large, or not of this mesh.
    pub fn new(bvh: &Bvh, mesh: &TriangleMesh) -> Result<Self, SceneError> {
        Self::new_in(Mode::default(), bvh, mesh)
    }

    /// [`WideScene::new`] in another mode than [`Mode::Watertight`], the default.
    ///
    /// # Errors
    /// As [`WideScene::new`].
    pub fn new_in(mode: Mode, bvh: &Bvh, mesh: &TriangleMesh) -> Result<Self, SceneError> {
        Self::build_in(mode, Bvh8::collapse(bvh, &CollapseSettings::default())?, mesh)
    }
}

impl<const W: usize> WideScene<W> {
    /// Lays the triangles of a collapsed tree out: the second half of [`WideScene::new`].
    ///
    /// # Errors
    /// [`SceneError::NoSuchTriangle`] if the tree is not of this mesh.
    pub fn build_from(bvh: WideBvh<W>, mesh: &TriangleMesh) -> Result<Self, SceneError> {
        Self::build_in(Mode::default(), bvh, mesh)
    }

    /// [`WideScene::build_from`] in another mode than [`Mode::Watertight`], the default.
    ///
    /// # Errors
    /// As [`WideScene::build_from`].
    pub fn build_in(mode: Mode, bvh: WideBvh<W>, mesh: &TriangleMesh) -> Result<Self, SceneError> {
        let layout = Arc::new(Layout::new(mode, bvh, mesh)?);
        let kernel = Self::kernels().pop().unwrap_or(Kernel::Scalar);
        Ok(Self { layout, kernel })
    }

    /// The kernels for this width that the processor can run, slowest first; never empty.
    #[must_use]
    pub fn kernels() -> Vec<Kernel> {
        Kernel::available().into_iter().filter(|kernel| kernel.traces(W)).collect()
    }
}

/// Where the words of leaves come from.
#[derive(Clone, Copy)]
struct Source<'a> {
    mode: Mode,
    prim_ids: &'a [u32],
    mesh: &'a TriangleMesh,
    scale: SceneScale,
}

impl Source<'_> {
    /// Fills the words of all leaves. Triangles without area become such that nothing hits them,
    /// except for those in `kept`, which is sorted; returns the former.
    fn fill_all<const W: usize>(
        self,
        triangles: &mut [f32],
        nodes: &[WideNode<W>],
        kept: &[u32],
    ) -> Result<Vec<u32>, SceneError> {
        // The leaves of consecutive nodes have consecutive references: one share of the words per
        // chunk of nodes.
        let mut rest = triangles;
        let shares: Vec<_> = nodes
            .chunks(NODE_CHUNK)
            .map(|chunk| {
                let prims: usize = chunk.iter().map(|node| node.prim_count as usize).sum();
                let (share, after) = std::mem::take(&mut rest).split_at_mut(WORDS * prims);
                rest = after;
                (chunk, share)
            })
            .collect();
        let flat = shares.into_par_iter().map(|(chunk, share)| fill(self, share, chunk, kept));
        Ok(flat.collect::<Result<Vec<_>, _>>()?.concat())
    }
}

/// Fills the words of the leaves of consecutive nodes; see [`Source::fill_all`].
fn fill<const W: usize>(
    Source { mode, prim_ids, mesh, scale }: Source<'_>,
    share: &mut [f32],
    nodes: &[WideNode<W>],
    kept: &[u32],
) -> Result<Vec<u32>, SceneError> {
    let mut rest = share;
    let mut gathered = Vec::new();
    let mut flat = Vec::new();
    for group in nodes.chunks(GATHER) {
        // Vertices are all over memory: a loop that does nothing but read them keeps many reads
        // in flight.
        let first = group[0].first_prim as usize;
        let count: usize = group.iter().map(|node| node.prim_count as usize).sum();
        let ids = &prim_ids[first..first + count];
        if let Some(&prim_id) = ids.iter().find(|&&id| id as usize >= mesh.len()) {
            return Err(SceneError::NoSuchTriangle { prim_id, triangles: mesh.len() });
        }
        gathered.clear();
        gathered.extend(ids.iter().map(|&id| {
            let triangle = mesh.triangle(id as usize);
            if is_flat(&triangle) && kept.binary_search(&id).is_err() {
                flat.push(id);
                return NEVER_HIT;
            }
            words(mode, &scale.triangle(triangle))
        }));
        let mut triangles = gathered.as_slice();
        for child in group.iter().flat_map(WideNode::iter) {
            let Child::Leaf { count, .. } = child else { continue };
            let n = count as usize;
            let (rows, after) = rest.split_at_mut(WORDS * n);
            rest = after;
            let (leaf, others) = triangles.split_at(n);
            triangles = others;
            for (i, t) in leaf.iter().enumerate() {
                let words = t.map(|v| v.to_array());
                for (row, &word) in words.as_flattened().iter().enumerate() {
                    rows[row * n + i] = word;
                }
            }
        }
    }
    Ok(flat)
}

/// What scenes have in common that are made of a [`Layout`] and a kernel, whatever their nodes are.
macro_rules! scene_methods {
    ($scene:ident) => {
        impl<const W: usize> $scene<W> {
            /// The same scene traced by another kernel.
            ///
            /// # Errors
            /// [`SceneError::KernelUnavailable`] if the processor cannot run it.
            pub fn with_kernel(self, kernel: Kernel) -> Result<Self, SceneError> {
                if Self::kernels().contains(&kernel) {
                    Ok(Self { kernel, ..self })
                } else {
                    Err(SceneError::KernelUnavailable(kernel))
                }
            }

            /// What it promises.
            #[must_use]
            pub fn mode(&self) -> Mode {
                self.layout.mode
            }

            /// The kernel that answers rays.
            #[must_use]
            pub const fn kernel(&self) -> Kernel {
                self.kernel
            }

            /// Bytes that nodes, triangles and ids take.
            #[must_use]
            pub fn bytes(&self) -> usize {
                self.layout.bytes()
            }

            /// [`Intersector::closest_hit`] by the scalar kernel, with the work it took.
            #[must_use]
            pub fn closest_hit_counted(&self, ray: &Ray) -> (Hit, Counts) {
                let mut counts = Counts::default();
                let Some(setup) = self.setup(ray) else { return (Hit::MISS, counts) };
                let closest = Closest::new(setup.t_max);
                let hit =
                    scalar::trace::<W, false, _, _, _>(&self.layout, &setup, closest, &mut counts);
                (setup.finish(hit), counts)
            }

            /// [`Intersector::closest_hit`] by the scalar kernel, with the work it took and where
            /// it ended.
            #[must_use]
            pub fn closest_hit_walked(&self, ray: &Ray) -> (Hit, Walk) {
                let mut walk = Walk::default();
                let Some(setup) = self.setup(ray) else { return (Hit::MISS, walk) };
                let closest = Closest::new(setup.t_max);
                let hit =
                    scalar::trace::<W, false, _, _, _>(&self.layout, &setup, closest, &mut walk);
                (setup.finish(hit), walk)
            }

            /// [`Intersector::any_hit`] by the scalar kernel, with the work it took.
            #[must_use]
            pub fn any_hit_counted(&self, ray: &Ray) -> (bool, Counts) {
                let mut counts = Counts::default();
                let Some(setup) = self.setup(ray) else { return (false, counts) };
                let first = First::default();
                let is_hit =
                    scalar::trace::<W, true, _, _, _>(&self.layout, &setup, first, &mut counts);
                (is_hit, counts)
            }

            /// What the kernels need of a ray; `None` if there is nothing that it could hit.
            #[inline(always)]
            fn setup(&self, ray: &Ray) -> Option<RaySetup> {
                let setup = RaySetup::new(ray, self.layout.scale)?;
                (!self.layout.nodes.is_empty()).then_some(setup)
            }
        }
    };
}

pub(crate) use scene_methods;

scene_methods!(WideScene);

/// Answers rays to a scene by the kernels of one width: the modules `$fast` and `$watertight` of each
/// `$module`.
macro_rules! intersector {
    ($scene:ident, $width:literal, $fast:ident, $watertight:ident, $($kernel:ident => $module:ident),+) => {
        impl $scene<$width> {
            #[inline(always)]
            fn closest<V: Visitor>(
                &self,
                setup: &RaySetup,
                visitor: impl FnOnce() -> V,
            ) -> V::Answer {
                match (self.kernel, self.layout.mode) {
                    $(
                        // SAFETY: `with_kernel` and `build_in` take available kernels only, and
                        // `setup` made sure that there are nodes.
                        #[cfg(target_arch = "x86_64")]
                        (Kernel::$kernel, Mode::Fast) => unsafe {
                            $module::$fast::closest(&self.layout, setup, visitor)
                        },
                        // SAFETY: as above.
                        #[cfg(target_arch = "x86_64")]
                        (Kernel::$kernel, Mode::Watertight) => unsafe {
                            $module::$watertight::closest(&self.layout, setup, visitor)
                        },
                    )+
                    _ => scalar::trace::<$width, false, _, _, _>(
                        &self.layout, setup, visitor(), &mut (),
                    ),
                }
            }

            #[inline(always)]
            fn any<V: Visitor>(
                &self,
                setup: &RaySetup,
                visitor: impl FnOnce() -> V,
            ) -> V::Answer {
                match (self.kernel, self.layout.mode) {
                    $(
                        // SAFETY: as above.
                        #[cfg(target_arch = "x86_64")]
                        (Kernel::$kernel, Mode::Fast) => unsafe {
                            $module::$fast::any(&self.layout, setup, visitor)
                        },
                        // SAFETY: as above.
                        #[cfg(target_arch = "x86_64")]
                        (Kernel::$kernel, Mode::Watertight) => unsafe {
                            $module::$watertight::any(&self.layout, setup, visitor)
                        },
                    )+
                    _ => scalar::trace::<$width, true, _, _, _>(
                        &self.layout, setup, visitor(), &mut (),
                    ),
                }
            }
        }

        impl $scene<$width> {
            /// [`Intersector::closest_hit`] by the scene's own kernel, with the work it took and where
            /// it ended; the twin by the scalar kernel is
            #[doc = concat!("[`", stringify!($scene), "::closest_hit_walked`].")]
            ///
            /// Kernels with vectors take children that are as far as each other, as boxes around the
            /// ray's origin are, in another order than the scalar kernel does, so that some rays in a
            /// hundred visit a node more or less. Sums over many rays agree to less than a hundredth.
            #[must_use]
            pub fn closest_hit_traced(&self, ray: &Ray) -> (Hit, Walk) {
                let Some(setup) = self.setup(ray) else { return (Hit::MISS, Walk::default()) };
                let visitor = || Counted::<_, _, false>::new(Closest::new(setup.t_max));
                let (hit, walk) = self.closest(&setup, visitor);
                (setup.finish(hit), walk)
            }

            /// [`Intersector::any_hit`] by the scene's own kernel in the order of distances, which is
            /// that of
            #[doc = concat!("[`", stringify!($scene), "::any_hit_counted`],")]
            /// with the work it took; see
            #[doc = concat!("[`", stringify!($scene), "::closest_hit_traced`].")]
            #[must_use]
            pub fn any_hit_traced(&self, ray: &Ray) -> (bool, Counts) {
                let Some(setup) = self.setup(ray) else { return (false, Counts::default()) };
                self.closest(&setup, || Counted::<_, _, true>::new(First::default()))
            }
        }

        impl Intersector for $scene<$width> {
            fn closest_hit(&self, ray: &Ray) -> Hit {
                let Some(setup) = self.setup(ray) else { return Hit::MISS };
                setup.finish(self.closest(&setup, || Closest::new(setup.t_max)))
            }

            fn any_hit(&self, ray: &Ray) -> bool {
                let Some(setup) = self.setup(ray) else { return false };
                self.any(&setup, First::default)
            }

            fn closest_hits(&self, rays: &[Ray], hits: &mut [Hit]) {
                assert_eq!(rays.len(), hits.len(), "one hit slot per ray");
                let many = self.layout.takes_turns(rays);
                match (self.kernel, self.layout.mode) {
                    $(
                        // SAFETY: as above, with nodes.
                        #[cfg(target_arch = "x86_64")]
                        (Kernel::$kernel, Mode::Fast) if many => unsafe {
                            $module::$fast::closest_batch(&self.layout, rays, hits);
                        },
                        // SAFETY: as above, with nodes.
                        #[cfg(target_arch = "x86_64")]
                        (Kernel::$kernel, Mode::Watertight) if many => unsafe {
                            $module::$watertight::closest_batch(&self.layout, rays, hits);
                        },
                    )+
                    _ => {
                        for (ray, hit) in rays.iter().zip(hits) {
                            *hit = self.closest_hit(ray);
                        }
                    }
                }
            }

            fn any_hits(&self, rays: &[Ray], occluded: &mut [bool]) {
                assert_eq!(rays.len(), occluded.len(), "one flag per ray");
                let many = self.layout.takes_turns(rays);
                match (self.kernel, self.layout.mode) {
                    $(
                        // SAFETY: as above, with nodes.
                        #[cfg(target_arch = "x86_64")]
                        (Kernel::$kernel, Mode::Fast) if many => unsafe {
                            $module::$fast::any_batch(&self.layout, rays, occluded);
                        },
                        // SAFETY: as above, with nodes.
                        #[cfg(target_arch = "x86_64")]
                        (Kernel::$kernel, Mode::Watertight) if many => unsafe {
                            $module::$watertight::any_batch(&self.layout, rays, occluded);
                        },
                    )+
                    _ => {
                        for (ray, flag) in rays.iter().zip(occluded) {
                            *flag = self.any_hit(ray);
                        }
                    }
                }
            }
        }

        impl Traverse for $scene<$width> {
            fn visit<V: Visitor>(
                &self,
                ray: &Ray,
                visitor: impl FnOnce(RaySetup) -> V,
            ) -> Option<V::Answer> {
                let setup = self.setup(ray)?;
                Some(self.closest(&setup, || visitor(setup)))
            }

            fn visit_until_limit<V: Visitor>(
                &self,
                ray: &Ray,
                visitor: impl FnOnce(RaySetup) -> V,
            ) -> Option<V::Answer> {
                let setup = self.setup(ray)?;
                Some(self.any(&setup, || visitor(setup)))
            }
        }

        impl HitQueries for $scene<$width> {}
    };
}

pub(crate) use intersector;

intersector!(WideScene, 4, fast, watertight, Avx2 => avx2_4, Sse42 => sse42);
intersector!(WideScene, 8, fast, watertight, Avx512 => avx512, Avx2 => avx2);
intersector!(WideScene, 16, fast, watertight, Avx512 => avx512_16);
