//! What a renderer needs to know about a hit: where it is, which way it faces, what it is made of.

use glam::{DVec3, Vec2, Vec3};
use niwaki_core::{Hit, Ray};
use niwaki_scene::{AlphaMode, Material, Scene};

/// A point of the scene's surface, seen from somewhere.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface<'a> {
    /// The point on the triangle.
    pub(crate) point: DVec3,
    /// Largest distance from the point to a corner of its triangle.
    pub(crate) reach: f64,
    /// Unit geometric normal on the viewer's side.
    pub(crate) geometric_normal: Vec3,
    /// Unit shading normal; the viewer is on its side too.
    pub(crate) normal: Vec3,
    /// Texture coordinates.
    pub(crate) uv: Vec2,
    /// Index of the material.
    pub(crate) material_id: usize,
    /// The material.
    pub(crate) material: &'a Material,
    /// True if seen from outside: the side on which vertex normals (or, without, the
    /// counter-clockwise winding) show.
    pub(crate) front: bool,
}

/// The triangle's point with these barycentrics and its normal by winding (zero for a degenerate
/// triangle).
pub(crate) fn locate(scene: &Scene, prim: usize, u: f32, v: f32) -> (DVec3, DVec3, f64) {
    let [a, b, c] = scene.mesh.triangle(prim).vertices().map(|corner| corner.as_dvec3());
    // Kernels may place a hit on an edge a rounding outside.
    let (u, v) = (f64::from(u).max(0.0), f64::from(v).max(0.0));
    let excess = (u + v).max(1.0);
    let (ab, ac) = (b - a, c - a);
    let point = a + ab * (u / excess) + ac * (v / excess);
    let reach = point.distance(a).max(point.distance(b)).max(point.distance(c));
    (point, ab.cross(ac).normalize_or_zero(), reach)
}

/// Texture coordinates at barycentrics; zero without.
pub(crate) fn uv_at(scene: &Scene, prim: usize, u: f32, v: f32) -> Vec2 {
    let corner = |k: usize| {
        scene.mesh.indices().get(prim).and_then(|t| scene.uvs.get(t[k] as usize)).copied()
    };
    match (corner(0), corner(1), corner(2)) {
        (Some(a), Some(b), Some(c)) => a * (1.0 - u - v) + b * u + c * v,
        _ => Vec2::ZERO,
    }
}

/// Index of the material of a triangle; the first one where the scene names none.
pub(crate) fn material_id(scene: &Scene, prim: usize) -> usize {
    let id = scene.material_ids.get(prim).map_or(0, |&id| id as usize);
    if id < scene.materials.len() { id } else { 0 }
}

/// Value of an optional texture at `uv`; ones without.
fn texel(scene: &Scene, texture: Option<usize>, uv: Vec2) -> glam::Vec4 {
    texture.and_then(|t| scene.textures.get(t)).map_or(glam::Vec4::ONE, |t| t.sample(uv))
}

/// NaN becomes 0.
const fn unit(x: f32) -> f32 {
    if x.is_nan() { 0.0 } else { x.clamp(0.0, 1.0) }
}

impl<'a> Surface<'a> {
    /// The surface at `hit`; `None` for a miss or an id that the scene does not have.
    pub(crate) fn at(scene: &'a Scene, ray: &Ray, hit: &Hit) -> Option<Self> {
        let prim = hit.prim_id as usize;
        if !hit.is_hit() || prim >= scene.mesh.len() {
            return None;
        }
        let (point, winding, reach) = locate(scene, prim, hit.u, hit.v);
        let to_viewer = -ray.direction.normalize_or(Vec3::NEG_Z);
        let mut outward = winding.as_vec3();
        if outward == Vec3::ZERO {
            outward = to_viewer;
        }
        let triangle = scene.mesh.indices()[prim];
        let corner = |k: usize| scene.normals.get(triangle[k] as usize).copied();
        let interpolated = match (corner(0), corner(1), corner(2)) {
            (Some(a), Some(b), Some(c)) => {
                (a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v).normalize_or(outward)
            }
            _ => outward,
        };
        if interpolated.dot(outward) < 0.0 {
            outward = -outward;
        }
        let front = outward.dot(to_viewer) >= 0.0;
        let side = if front { 1.0 } else { -1.0 };
        let geometric_normal = outward * side;
        // A shading normal that turns away from the viewer describes nothing visible.
        let shading = interpolated * side;
        let normal = if shading.dot(to_viewer) > 1e-4 { shading } else { geometric_normal };
        let material_id = material_id(scene, prim);
        Some(Self {
            point,
            reach,
            geometric_normal,
            normal,
            uv: uv_at(scene, prim, hit.u, hit.v),
            material_id,
            material: scene.materials.get(material_id)?,
            front,
        })
    }

    /// Base colour, linear RGB in 0 to 1.
    pub(crate) fn base_color(&self, scene: &Scene) -> Vec3 {
        let color = texel(scene, self.material.base_color_texture, self.uv).truncate();
        (self.material.base_color * color).clamp(Vec3::ZERO, Vec3::ONE)
    }

    /// Metallic and perceptual roughness, 0 to 1.
    pub(crate) fn metallic_roughness(&self, scene: &Scene) -> (f32, f32) {
        let t = texel(scene, self.material.metallic_roughness_texture, self.uv);
        let m = self.material;
        (unit(m.metallic * t.z), unit(m.roughness * t.y))
    }

    /// Radiance that the surface gives off.
    pub(crate) fn emission(&self, scene: &Scene) -> Vec3 {
        emission(scene, self.material, self.uv)
    }

    /// Probability that a ray meets the surface.
    pub(crate) fn opacity(&self, scene: &Scene) -> f32 {
        opacity(scene, self.material, self.uv)
    }
}

/// Radiance that a material gives off at `uv`.
pub(crate) fn emission(scene: &Scene, material: &Material, uv: Vec2) -> Vec3 {
    if !material.is_emissive() {
        return Vec3::ZERO;
    }
    (material.emission * texel(scene, material.emission_texture, uv).truncate()).max(Vec3::ZERO)
}

/// Probability that a ray meets a surface of this material at `uv`.
pub(crate) fn opacity(scene: &Scene, material: &Material, uv: Vec2) -> f32 {
    let alpha = || unit(material.alpha * texel(scene, material.base_color_texture, uv).w);
    match material.alpha_mode {
        AlphaMode::Opaque => 1.0,
        AlphaMode::Mask(cutoff) => f32::from(u8::from(alpha() >= cutoff)),
        AlphaMode::Blend => alpha(),
    }
}
