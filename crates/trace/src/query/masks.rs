//! Visibility by bit masks.

use super::hits::HitQueries;
use niwaki_core::{Hit, Ray};

/// A scene with a 32-bit mask for each primitive: a ray meets those with which its own mask has a
/// bit in common, as in Embree and DXR.
///
/// Masks stand beside the scene instead of in it. They are looked up for triangles that a ray hits,
/// which are few, so that [`Ray`] stays 32 bytes, triangles need no more room, scenes without masks
/// pay nothing, and clones of one scene can have different masks, or change them at any time
/// without a new layout.
///
/// ```
/// use niwaki_core::{Bvh, BvhNode, Ray, TriangleMesh, glam::Vec3};
/// use niwaki_trace::{MaskedScene, WideScene};
///
/// const CAMERA: u32 = 1;
/// const SHADOW: u32 = 2;
/// let mesh = TriangleMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]])?;
/// let bvh = Bvh { nodes: vec![BvhNode::leaf(mesh.bounds(), 0, 1)], prim_ids: vec![0] };
/// let scene = MaskedScene::new(WideScene::new(&bvh, &mesh)?, vec![CAMERA]);
/// let ray = Ray::new(Vec3::new(0.2, 0.2, 1.0), -Vec3::Z);
/// assert!(scene.closest_hit(&ray, CAMERA).is_hit());
/// assert!(!scene.any_hit(&ray, SHADOW));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct MaskedScene<S> {
    scene: S,
    masks: Vec<u32>,
}

impl<S: HitQueries> MaskedScene<S> {
    /// One mask for each primitive, by id; primitives past their end have all bits set.
    #[must_use]
    pub const fn new(scene: S, masks: Vec<u32>) -> Self {
        Self { scene, masks }
    }

    /// The scene without its masks.
    #[must_use]
    pub const fn scene(&self) -> &S {
        &self.scene
    }

    /// The masks, to be looked at.
    #[must_use]
    pub fn masks(&self) -> &[u32] {
        &self.masks
    }

    /// The masks, to be changed.
    #[must_use]
    pub fn masks_mut(&mut self) -> &mut [u32] {
        &mut self.masks
    }

    /// True if a ray of this mask meets the primitive.
    #[must_use]
    #[inline]
    pub fn is_visible(&self, prim_id: u32, ray_mask: u32) -> bool {
        self.masks.get(prim_id as usize).unwrap_or(&u32::MAX) & ray_mask != 0
    }

    /// The closest hit among the primitives that a ray of this mask meets, or [`Hit::MISS`].
    #[must_use]
    pub fn closest_hit(&self, ray: &Ray, ray_mask: u32) -> Hit {
        self.scene.closest_hit_filtered(ray, |id, _, _, _| self.is_visible(id, ray_mask))
    }

    /// True if a ray of this mask hits anything that it meets.
    #[must_use]
    pub fn any_hit(&self, ray: &Ray, ray_mask: u32) -> bool {
        self.scene.any_hit_filtered(ray, |id, _, _, _| self.is_visible(id, ray_mask))
    }

    /// All hits among the primitives that a ray of this mask meets; see [`HitQueries::all_hits`].
    pub fn all_hits(&self, ray: &Ray, ray_mask: u32, hits: &mut Vec<Hit>) {
        self.scene.all_hits(ray, hits);
        hits.retain(|hit| self.is_visible(hit.prim_id, ray_mask));
    }
}
