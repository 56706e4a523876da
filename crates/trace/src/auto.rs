//! The scene whose width the processor decides.

use crate::{
    Counts, HitQueries, Kernel, Mode, SceneError, WideScene,
    query::{hits::Traverse, visitor::Visitor},
    setup::RaySetup,
};
use niwaki_core::{Bvh, Hit, Intersector, Ray, TriangleMesh};
use niwaki_wide::{CollapseSettings, WideBvh};

/// A [`WideScene`] of the width that is fastest on this processor, with its fastest kernel: what to
/// use unless a certain width is wanted.
///
/// | processor | width | kernel |
/// |---|---|---|
/// | x86-64 with AVX-512 | 16 | [`Kernel::Avx512`] |
/// | x86-64 with AVX2 | 8 | [`Kernel::Avx2`] |
/// | x86-64 with SSE4.2 | 4 | [`Kernel::Sse42`] |
/// | any other | 8 | [`Kernel::Scalar`] |
///
/// Which width is chosen decides memory and time, not answers: they are those of every
/// [`WideScene`] in the same [`Mode`]. A ray pays a jump more than with a scene of a known width;
/// where even that counts, the variants give the scenes away.
///
/// ```
/// use niwaki_core::{Bvh, BvhNode, Intersector, Ray, TriangleMesh, glam::Vec3};
/// use niwaki_trace::{AutoScene, Kernel, Mode};
///
/// let mesh = TriangleMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]])?;
/// let bvh = Bvh { nodes: vec![BvhNode::leaf(mesh.bounds(), 0, 1)], prim_ids: vec![0] };
/// let scene = AutoScene::new(&bvh, &mesh)?;
/// assert_eq!((scene.kernel(), scene.width()), (Kernel::best(), Kernel::best().best_width()));
/// assert!(scene.any_hit(&Ray::new(Vec3::new(0.25, 0.5, -2.0), Vec3::Z)));
///
/// // Another kernel, at the width that suits it.
/// let scalar = AutoScene::for_kernel(Kernel::Scalar, Mode::Fast, &bvh, &mesh)?;
/// assert_eq!(scalar.width(), 8);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum AutoScene {
    /// Four children a node.
    Four(WideScene<4>),
    /// Eight children a node.
    Eight(WideScene<8>),
    /// Sixteen children a node.
    Sixteen(WideScene<16>),
}

/// The same expression with the scene of whichever width.
macro_rules! of_any_width {
    ($self:expr, $scene:ident => $body:expr) => {
        match $self {
            AutoScene::Four($scene) => $body,
            AutoScene::Eight($scene) => $body,
            AutoScene::Sixteen($scene) => $body,
        }
    };
}

impl AutoScene {
    /// Collapses a tree with default settings and lays its triangles out, on the current rayon
    /// pool. The result does not depend on the number of threads.
    ///
    /// # Errors
    /// [`SceneError`]: the tree is malformed, too large, or not of this mesh.
    pub fn new(bvh: &Bvh, mesh: &TriangleMesh) -> Result<Self, SceneError> {
        Self::new_in(Mode::default(), bvh, mesh)
    }

    /// [`AutoScene::new`] in another mode than [`Mode::Watertight`], the default.
    ///
    /// # Errors
    /// As [`AutoScene::new`].
    pub fn new_in(mode: Mode, bvh: &Bvh, mesh: &TriangleMesh) -> Result<Self, SceneError> {
        Self::for_kernel(Kernel::best(), mode, bvh, mesh)
    }

    /// Traced by a kernel of the caller's choice, at the width that suits it best
    /// ([`Kernel::best_width`]).
    ///
    /// # Errors
    /// [`SceneError::KernelUnavailable`] if the processor cannot run it; and as
    /// [`AutoScene::new`].
    pub fn for_kernel(
        kernel: Kernel,
        mode: Mode,
        bvh: &Bvh,
        mesh: &TriangleMesh,
    ) -> Result<Self, SceneError> {
        if !kernel.is_available() {
            return Err(SceneError::KernelUnavailable(kernel));
        }
        match kernel.best_width() {
            16 => build(mode, bvh, mesh)?.with_kernel(kernel).map(Self::Sixteen),
            8 => build(mode, bvh, mesh)?.with_kernel(kernel).map(Self::Eight),
            _ => build(mode, bvh, mesh)?.with_kernel(kernel).map(Self::Four),
        }
    }

    /// The same scene, of the same width, traced by another kernel.
    ///
    /// # Errors
    /// [`SceneError::KernelUnavailable`] if the processor cannot run it, or if there is no such
    /// kernel for the width.
    pub fn with_kernel(self, kernel: Kernel) -> Result<Self, SceneError> {
        match self {
            Self::Four(scene) => scene.with_kernel(kernel).map(Self::Four),
            Self::Eight(scene) => scene.with_kernel(kernel).map(Self::Eight),
            Self::Sixteen(scene) => scene.with_kernel(kernel).map(Self::Sixteen),
        }
    }

    /// Children a node: 4, 8 or 16.
    #[must_use]
    pub const fn width(&self) -> usize {
        match self {
            Self::Four(_) => 4,
            Self::Eight(_) => 8,
            Self::Sixteen(_) => 16,
        }
    }

    /// What it promises.
    #[must_use]
    pub fn mode(&self) -> Mode {
        of_any_width!(self, scene => scene.mode())
    }

    /// The kernel that answers rays.
    #[must_use]
    pub const fn kernel(&self) -> Kernel {
        of_any_width!(self, scene => scene.kernel())
    }

    /// Bytes that nodes, triangles and ids take.
    #[must_use]
    pub fn bytes(&self) -> usize {
        of_any_width!(self, scene => scene.bytes())
    }

    /// [`Intersector::closest_hit`] by the scalar kernel, with the work it took, which depends on
    /// the width.
    #[must_use]
    pub fn closest_hit_counted(&self, ray: &Ray) -> (Hit, Counts) {
        of_any_width!(self, scene => scene.closest_hit_counted(ray))
    }

    /// [`Intersector::any_hit`] by the scalar kernel, with the work it took, which depends on the
    /// width.
    #[must_use]
    pub fn any_hit_counted(&self, ray: &Ray) -> (bool, Counts) {
        of_any_width!(self, scene => scene.any_hit_counted(ray))
    }
}

fn build<const W: usize>(
    mode: Mode,
    bvh: &Bvh,
    mesh: &TriangleMesh,
) -> Result<WideScene<W>, SceneError> {
    WideScene::build_in(mode, WideBvh::collapse(bvh, &CollapseSettings::default())?, mesh)
}

impl From<WideScene<4>> for AutoScene {
    fn from(scene: WideScene<4>) -> Self {
        Self::Four(scene)
    }
}

impl From<WideScene<8>> for AutoScene {
    fn from(scene: WideScene<8>) -> Self {
        Self::Eight(scene)
    }
}

impl From<WideScene<16>> for AutoScene {
    fn from(scene: WideScene<16>) -> Self {
        Self::Sixteen(scene)
    }
}

impl Intersector for AutoScene {
    fn closest_hit(&self, ray: &Ray) -> Hit {
        of_any_width!(self, scene => scene.closest_hit(ray))
    }

    fn any_hit(&self, ray: &Ray) -> bool {
        of_any_width!(self, scene => scene.any_hit(ray))
    }

    fn closest_hits(&self, rays: &[Ray], hits: &mut [Hit]) {
        of_any_width!(self, scene => scene.closest_hits(rays, hits));
    }

    fn any_hits(&self, rays: &[Ray], occluded: &mut [bool]) {
        of_any_width!(self, scene => scene.any_hits(rays, occluded));
    }
}

impl Traverse for AutoScene {
    fn visit<V: Visitor>(
        &self,
        ray: &Ray,
        visitor: impl FnOnce(RaySetup) -> V,
    ) -> Option<V::Answer> {
        of_any_width!(self, scene => scene.visit(ray, visitor))
    }

    fn visit_until_limit<V: Visitor>(
        &self,
        ray: &Ray,
        visitor: impl FnOnce(RaySetup) -> V,
    ) -> Option<V::Answer> {
        of_any_width!(self, scene => scene.visit_until_limit(ray, visitor))
    }
}

impl HitQueries for AutoScene {}
