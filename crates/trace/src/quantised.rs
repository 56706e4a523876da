//! The wide tree with quantised nodes, and its triangles.

#[cfg(target_arch = "x86_64")]
use crate::kernels::{avx2, avx2_4, avx512, avx512_16, sse42};
use crate::{
    Counts, HitQueries, Kernel, Mode, SceneError, Walk, WideScene,
    kernels::scalar,
    query::{
        hits::Traverse,
        visitor::{Closest, Counted, First, Visitor},
    },
    setup::RaySetup,
    wide::{Layout, intersector, scene_methods},
};
use niwaki_core::{Bvh, Hit, Intersector, Ray, TriangleMesh, memory::prefer_large_pages};
use niwaki_wide::{Bvh8, CollapseSettings, QuantisedNode, WideBvh};
use rayon::prelude::*;
use std::sync::Arc;

/// Nodes that a task quantises at least.
const NODE_CHUNK: usize = 512;

/// A [`WideScene`] with nodes of half the size: boxes are rounded outward to a grid of 8 bits an
/// axis ([`QuantisedNode`]).
///
/// Answers, modes and kernels are those of [`WideScene`], as boxes only grow: in watertight mode
/// every hit has the same bits. A ray tests some more boxes and triangles, and the kernel has to
/// unpack what it reads, so this is slower where nodes are in the caches anyway; `docs/wide.md` of
/// the repository has figures for both.
#[derive(Clone, Debug)]
pub struct QuantisedScene<const W: usize = 8> {
    /// Shared by clones.
    layout: Arc<Layout<W, QuantisedNode<W>>>,
    kernel: Kernel,
}

impl QuantisedScene {
    /// Collapses a tree to 8 wide nodes with default settings, quantises them and lays its
    /// triangles out, on the current rayon pool. The result does not depend on the number of
    /// threads.
    ///
    /// # Errors
    /// As [`WideScene::new`].
    pub fn new(bvh: &Bvh, mesh: &TriangleMesh) -> Result<Self, SceneError> {
        Self::new_in(Mode::default(), bvh, mesh)
    }

    /// [`QuantisedScene::new`] in another mode than [`Mode::Watertight`], the default.
    ///
    /// # Errors
    /// As [`WideScene::new`].
    pub fn new_in(mode: Mode, bvh: &Bvh, mesh: &TriangleMesh) -> Result<Self, SceneError> {
        Self::build_in(mode, Bvh8::collapse(bvh, &CollapseSettings::default())?, mesh)
    }
}

impl<const W: usize> QuantisedScene<W> {
    /// Quantises a collapsed tree and lays its triangles out: the second half of
    /// [`QuantisedScene::new`].
    ///
    /// # Errors
    /// [`SceneError::NoSuchTriangle`] if the tree is not of this mesh.
    pub fn build_from(bvh: WideBvh<W>, mesh: &TriangleMesh) -> Result<Self, SceneError> {
        Self::build_in(Mode::default(), bvh, mesh)
    }

    /// [`QuantisedScene::build_from`] in another mode than [`Mode::Watertight`], the default.
    ///
    /// # Errors
    /// As [`QuantisedScene::build_from`].
    pub fn build_in(mode: Mode, bvh: WideBvh<W>, mesh: &TriangleMesh) -> Result<Self, SceneError> {
        let Layout { nodes: full, mode, triangles, prim_ids, scale, stack_bound } =
            Layout::new(mode, bvh, mesh)?;
        let mut nodes = Vec::with_capacity(full.len());
        prefer_large_pages(nodes.spare_capacity_mut());
        full.par_iter()
            .with_min_len(NODE_CHUNK)
            .map(QuantisedNode::from)
            .collect_into_vec(&mut nodes);
        let layout = Layout { nodes, mode, triangles, prim_ids, scale, stack_bound };
        let kernel = Self::kernels().pop().unwrap_or(Kernel::Scalar);
        Ok(Self { layout: Arc::new(layout), kernel })
    }

    /// The kernels for this width that the processor can run, slowest first; never empty.
    #[must_use]
    pub fn kernels() -> Vec<Kernel> {
        WideScene::<W>::kernels()
    }
}

scene_methods!(QuantisedScene);

intersector!(
    QuantisedScene, 4, quantised_fast, quantised_watertight, Avx2 => avx2_4, Sse42 => sse42
);
intersector!(
    QuantisedScene, 8, quantised_fast, quantised_watertight, Avx512 => avx512, Avx2 => avx2
);
intersector!(QuantisedScene, 16, quantised_fast, quantised_watertight, Avx512 => avx512_16);
