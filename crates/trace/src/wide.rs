//! The 8-wide tree with its triangles.

use crate::{
    Counts, Kernel, SceneError, binary::check_ids, counts::Counter, scalar, scale::SceneScale,
    setup::RaySetup, triangle::EdgeTriangle,
};
use niwaki_core::{Bvh, Hit, Intersector, Ray, TriangleMesh};
use niwaki_wide::{Bvh8, CollapseSettings, Node8};

/// An 8-wide tree with its triangles, laid out for SIMD, traced by the fastest [`Kernel`] that the
/// processor has unless [`WideScene::with_kernel`] chooses another.
///
/// Owns a copy of all that it needs.
#[derive(Clone, Debug)]
pub struct WideScene {
    pub(crate) nodes: Vec<Node8>,
    /// Per leaf of n triangles ten rows of n words: v0 x, y, z, e1 x, y, z, e2 x, y, z, id. A leaf
    /// whose first reference is `i` begins at word `10·i`.
    pub(crate) triangles: Vec<f32>,
    pub(crate) scale: SceneScale,
    pub(crate) stack_bound: usize,
    kernel: Kernel,
}

/// Words that a triangle takes in [`WideScene::triangles`].
pub(crate) const WORDS: usize = 10;

impl WideScene {
    /// Collapses a tree with default settings and lays its triangles out, on the current rayon
    /// pool. The result does not depend on the number of threads.
    ///
    /// # Errors
    /// [`SceneError`]: the tree is malformed, too large, or not of this mesh.
    pub fn new(bvh: &Bvh, mesh: &TriangleMesh) -> Result<Self, SceneError> {
        Self::build_from(Bvh8::collapse(bvh, &CollapseSettings::default())?, mesh)
    }

    /// Lays the triangles of a collapsed tree out: the second half of [`WideScene::new`].
    ///
    /// # Errors
    /// [`SceneError::NoSuchTriangle`] if the tree is not of this mesh.
    pub fn build_from(bvh: Bvh8, mesh: &TriangleMesh) -> Result<Self, SceneError> {
        check_ids(bvh.prim_ids(), mesh)?;
        let scale = SceneScale::of(&bvh.bounds());
        // Vectors may be read past the end of the last leaf.
        let mut triangles = vec![0.0; WORDS * bvh.prim_ids().len() + 16];
        for node in bvh.nodes() {
            for child in node.iter() {
                let niwaki_wide::Child::Leaf { first, count } = child else { continue };
                let (first, n) = (first as usize, count as usize);
                let rows = &mut triangles[WORDS * first..WORDS * (first + n)];
                for (i, &id) in bvh.prim_ids()[first..first + n].iter().enumerate() {
                    let t = EdgeTriangle::new(&scale.triangle(mesh.triangle(id as usize)));
                    for axis in 0..3 {
                        rows[axis * n + i] = t.v0[axis];
                        rows[(3 + axis) * n + i] = t.e1[axis];
                        rows[(6 + axis) * n + i] = t.e2[axis];
                    }
                    rows[9 * n + i] = f32::from_bits(id);
                }
            }
        }
        let stack_bound = bvh.stack_bound();
        let mut nodes = bvh.nodes().to_vec();
        if scale.factor != 1.0 {
            for node in &mut nodes {
                for row in &mut node.bounds {
                    for plane in row {
                        *plane *= scale.factor;
                    }
                }
            }
        }
        Ok(Self { nodes, triangles, scale, stack_bound, kernel: Kernel::best() })
    }

    /// The same scene traced by another kernel.
    ///
    /// # Errors
    /// [`SceneError::KernelUnavailable`] if the processor cannot run it.
    pub fn with_kernel(self, kernel: Kernel) -> Result<Self, SceneError> {
        if kernel.is_available() {
            Ok(Self { kernel, ..self })
        } else {
            Err(SceneError::KernelUnavailable(kernel))
        }
    }

    /// The kernel that answers rays.
    #[must_use]
    pub const fn kernel(&self) -> Kernel {
        self.kernel
    }

    /// Bytes that nodes and triangles take.
    #[must_use]
    pub const fn bytes(&self) -> usize {
        size_of::<Node8>() * self.nodes.len() + size_of::<f32>() * self.triangles.len()
    }

    /// [`Intersector::closest_hit`] by the scalar kernel, with the work it took.
    #[must_use]
    pub fn closest_hit_counted(&self, ray: &Ray) -> (Hit, Counts) {
        let mut counts = Counts::default();
        let hit = self.trace_scalar::<false, _>(ray, &mut counts);
        (hit, counts)
    }

    /// [`Intersector::any_hit`] by the scalar kernel, with the work it took.
    #[must_use]
    pub fn any_hit_counted(&self, ray: &Ray) -> (bool, Counts) {
        let mut counts = Counts::default();
        let hit = self.trace_scalar::<true, _>(ray, &mut counts);
        (hit.is_hit(), counts)
    }

    fn trace_scalar<const ANY: bool, C: Counter>(&self, ray: &Ray, counter: &mut C) -> Hit {
        let Some(setup) = RaySetup::new(ray, self.scale) else { return Hit::MISS };
        if self.nodes.is_empty() {
            return Hit::MISS;
        }
        setup.finish(scalar::trace::<ANY, C>(self, &setup, counter))
    }
}

impl Intersector for WideScene {
    fn closest_hit(&self, ray: &Ray) -> Hit {
        self.trace_scalar::<false, _>(ray, &mut ())
    }

    fn any_hit(&self, ray: &Ray) -> bool {
        self.trace_scalar::<true, _>(ray, &mut ()).is_hit()
    }
}
