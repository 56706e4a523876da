//! Pieces that scenes are put together from, evaluated in parallel and joined in order.

use super::{math::whole, shade::shade};
use crate::{
    Animation, Camera, CameraPath, Dropped, Environment, Light, Material, Motion, Object, Scene,
    object::bounds_of,
};
use glam::{DMat3, DVec3, Vec3};
use niwaki_core::{Aabb, TriangleMesh, to_u32};
use rayon::prelude::*;

/// Vertices and triangles of one piece.
#[derive(Default)]
pub(super) struct Patch {
    pub(super) positions: Vec<Vec3>,
    pub(super) indices: Vec<[u32; 3]>,
    /// Unit normals, one a vertex, or none.
    pub(super) normals: Vec<Vec3>,
}

impl Patch {
    /// Adds the quadrilateral a, b, c, d (counterclockwise from outside).
    pub(super) fn quad(&mut self, corners: [DVec3; 4]) {
        let base = to_u32(self.positions.len());
        self.positions.extend(corners.map(|p| p.as_vec3()));
        self.indices.extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
    }

    /// Adds a box of 12 triangles: center, half extents along the columns of `axes`.
    pub(super) fn cuboid(&mut self, center: DVec3, half: DVec3, axes: DMat3) {
        let base = to_u32(self.positions.len());
        for i in 0..8_u32 {
            let sign = |bit: u32| if i & bit == 0 { -1.0 } else { 1.0 };
            let local = half * DVec3::new(sign(1), sign(2), sign(4));
            self.positions.push((center + axes * local).as_vec3());
        }
        const FACES: [[u32; 4]; 6] =
            [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        for [a, b, c, d] in FACES.map(|f| f.map(|i| i + base)) {
            self.indices.extend([[a, b, c], [a, c, d]]);
        }
    }
}

impl Patch {
    /// Adds another patch behind this one.
    pub(super) fn append(&mut self, other: &Self) {
        let base = to_u32(self.positions.len());
        self.positions.extend_from_slice(&other.positions);
        self.indices.extend(other.indices.iter().map(|t| t.map(|i| i + base)));
    }
}

/// A tube through rings, each a center and a direction, of `around` corners that `surface`
/// places; it gets center, direction and how far around (0 to 1).
pub(super) fn rings(
    rings: &[(DVec3, DVec3)],
    around: usize,
    surface: impl Fn(DVec3, DVec3, f64) -> DVec3,
) -> Patch {
    let mut patch = Patch::default();
    for &(center, direction) in rings {
        patch.positions.extend(
            (0..around).map(|i| surface(center, direction, i as f64 / around as f64).as_vec3()),
        );
    }
    for ring in 1..rings.len() {
        let (low, high) = ((ring - 1) * around, ring * around);
        for i in 0..around {
            let next = (i + 1) % around;
            let [a, b, c, d] = [low + i, low + next, high + next, high + i].map(to_u32);
            patch.indices.extend([[a, b, c], [a, c, d]]);
        }
    }
    patch
}

type Emit = Box<dyn Fn() -> Patch + Send + Sync>;

/// Triangles of one material.
struct Piece {
    material: u32,
    /// Index of its object; without, it is one by itself.
    object: Option<usize>,
    /// As for [`shade`].
    crease: Option<f64>,
    emit: Emit,
}

/// The cosine of the angle from which on an edge between two triangles is to be seen as one.
pub(super) const EDGES: f64 = 0.6;
/// No edge is to be seen.
pub(super) const ROUND: f64 = -1.0;

/// Everything that a generator decides before the vertices are computed.
pub(super) struct Plan {
    pieces: Vec<Piece>,
    /// Name and motion of each object.
    objects: Vec<(String, Motion)>,
    /// To which the pieces that follow belong.
    object: Option<usize>,
    /// The cosine of the angle from which on edges of the pieces that follow show as such; `None`
    /// gives them no shading normals, unless other pieces have some.
    pub(super) crease: Option<f64>,
    pub(super) path: Option<CameraPath>,
    /// Seconds of motion.
    pub(super) duration: f64,
    pub(super) materials: Vec<Material>,
    pub(super) cameras: Vec<Camera>,
    pub(super) lights: Vec<Light>,
    pub(super) environment: Environment,
}

/// Which sides of a grid are joined.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Wrap {
    No,
    U,
    Both,
}

impl Plan {
    pub(super) fn new(materials: Vec<Material>, camera: Camera, environment: Environment) -> Self {
        Self {
            pieces: Vec::new(),
            objects: Vec::new(),
            object: None,
            crease: None,
            path: None,
            duration: f64::from(CameraPath::FRAMES) / 30.0,
            materials,
            cameras: vec![camera],
            lights: Vec::new(),
            environment,
        }
    }

    /// Begins an object, to which the pieces that follow belong.
    pub(super) fn object(&mut self, name: &str, motion: Motion) {
        self.object = Some(self.objects.len());
        self.objects.push((name.into(), motion));
    }

    /// Ends the object: each piece that follows is one by itself, named after its material.
    pub(super) const fn end_object(&mut self) {
        self.object = None;
    }

    /// Adds a piece that `emit` computes; it must be a pure function.
    pub(super) fn piece(
        &mut self,
        material: u32,
        emit: impl Fn() -> Patch + Send + Sync + 'static,
    ) {
        self.pieces.push(Piece {
            material,
            object: self.object,
            crease: self.crease,
            emit: Box::new(emit),
        });
    }

    /// Adds `nu` × `nv` cells of two triangles over the unit square mapped by `f`; returns how
    /// many triangles these are. Joined sides share their vertices.
    pub(super) fn grid(
        &mut self,
        material: u32,
        [nu, nv]: [usize; 2],
        wrap: Wrap,
        f: impl Fn(f64, f64) -> DVec3 + Send + Sync + 'static,
    ) -> usize {
        self.piece(material, move || grid(nu, nv, wrap, &f));
        2 * nu * nv
    }

    /// Computes all pieces on the current rayon pool and joins them in the order they were added.
    pub(super) fn into_scene(self, name: &str) -> Scene {
        let shaded = self.pieces.iter().any(|piece| piece.crease.is_some());
        let emit = |piece: &Piece| {
            let mut patch = (piece.emit)();
            if shaded {
                shade(&mut patch, piece.crease.unwrap_or(EDGES));
            }
            patch
        };
        let patches: Vec<Patch> = self.pieces.par_iter().map(emit).collect();
        let vertices = patches.iter().map(|p| p.positions.len()).sum();
        let mut positions = Vec::with_capacity(vertices);
        let mut normals = Vec::with_capacity(if shaded { vertices } else { 0 });
        let triangles = patches.iter().map(|p| p.indices.len()).sum();
        let mut indices = Vec::with_capacity(triangles);
        let mut material_ids = Vec::with_capacity(triangles);
        let mut objects: Vec<Object> = Vec::with_capacity(self.objects.len());
        let mut motions = Vec::with_capacity(self.objects.len());
        let mut last = None;
        for (patch, piece) in patches.into_iter().zip(&self.pieces) {
            let (triangle, base) = (to_u32(indices.len()), to_u32(positions.len()));
            positions.extend_from_slice(&patch.positions);
            normals.extend_from_slice(&patch.normals);
            indices.extend(patch.indices.iter().map(|t| t.map(|i| i + base)));
            material_ids.resize(indices.len(), piece.material);
            if last.replace(piece.object) != Some(piece.object) || piece.object.is_none() {
                let known = piece.object.and_then(|i| self.objects.get(i)).cloned();
                let (name, motion) = known.unwrap_or_else(|| {
                    (self.materials[piece.material as usize].name.clone(), Motion::default())
                });
                objects.push(Object {
                    name,
                    triangles: triangle..triangle,
                    vertices: base..base,
                    bounds: Aabb::EMPTY,
                    dynamic: !motion.is_rest(),
                });
                motions.push(motion);
            }
            if let Some(object) = objects.last_mut() {
                object.triangles.end = to_u32(indices.len());
                object.vertices.end = to_u32(positions.len());
            }
        }
        let mesh = TriangleMesh::new(positions, indices)
            .expect("generators stay within moderate coordinates and number their own vertices");
        for object in &mut objects {
            object.bounds = bounds_of(&mesh, object.triangles.clone());
        }
        let moves = motions.iter().any(|motion| !motion.is_rest());
        let mut scene = Scene {
            name: name.into(),
            mesh,
            normals,
            uvs: Vec::new(),
            material_ids,
            materials: self.materials,
            textures: Vec::new(),
            objects,
            cameras: self.cameras,
            path: self.path,
            animation: moves.then_some(Animation {
                motions,
                duration: self.duration,
                ..Animation::default()
            }),
            lights: self.lights,
            environment: self.environment,
            dropped: Dropped::default(),
        };
        scene.derive_thickness();
        scene
    }
}

/// A closed surface from pole to pole: `nu` sides, `nv` steps from `f(0, 0)` to `f(0, 1)`, and
/// 2 · `nu` · (`nv` − 1) triangles. Faces outward if u turns clockwise seen from the upper pole.
pub(super) fn capped([nu, nv]: [usize; 2], f: &(impl Fn(f64, f64) -> DVec3 + Sync)) -> Patch {
    let rings = nv - 1;
    let mut positions = vec![Vec3::ZERO; nu * rings];
    positions.par_chunks_mut(nu).with_min_len(4096_usize.div_ceil(nu)).enumerate().for_each(
        |(j, ring)| {
            for (i, p) in ring.iter_mut().enumerate() {
                *p = f(i as f64 / nu as f64, (j + 1) as f64 / nv as f64).as_vec3();
            }
        },
    );
    let (low, high) = (to_u32(positions.len()), to_u32(positions.len() + 1));
    positions.extend([f(0.0, 0.0), f(0.0, 1.0)].map(|p| p.as_vec3()));
    let mut indices = Vec::with_capacity(2 * nu * rings);
    for j in 0..=rings {
        for i in 0..nu {
            let next = (i + 1) % nu;
            let at = |ring: usize, i: usize| to_u32((ring - 1) * nu + i);
            if j == 0 {
                indices.push([low, at(1, next), at(1, i)]);
            } else if j == rings {
                indices.push([at(j, i), at(j, next), high]);
            } else {
                let [a, b, c, d] = [at(j, i), at(j, next), at(j + 1, next), at(j + 1, i)];
                indices.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    Patch { positions, indices, normals: Vec::new() }
}

/// Sides and steps of [`capped`] with about `triangles` triangles and `aspect` sides a step.
pub(super) fn caps(triangles: usize, aspect: f64, least: [usize; 2]) -> [usize; 2] {
    let [nu, rings] = cells(triangles, aspect, [least[0], least[1] - 1]);
    [nu, rings + 1]
}

/// How many triangles [`capped`] makes.
pub(super) const fn capped_len([nu, nv]: [usize; 2]) -> usize {
    2 * nu * (nv - 1)
}

/// A mapped grid; rows are computed in parallel.
fn grid(nu: usize, nv: usize, wrap: Wrap, f: &(impl Fn(f64, f64) -> DVec3 + Sync)) -> Patch {
    let columns = if wrap == Wrap::No { nu + 1 } else { nu };
    let rows = if wrap == Wrap::Both { nv } else { nv + 1 };
    let mut positions = vec![Vec3::ZERO; columns * rows];
    let rows_at_once = 4096_usize.div_ceil(columns);
    positions.par_chunks_mut(columns).with_min_len(rows_at_once).enumerate().for_each(
        |(j, row)| {
            for (i, p) in row.iter_mut().enumerate() {
                *p = f(i as f64 / nu as f64, j as f64 / nv as f64).as_vec3();
            }
        },
    );
    let mut indices = vec![[0; 3]; 2 * nu * nv];
    indices.par_chunks_mut(2 * nu).with_min_len(rows_at_once).enumerate().for_each(|(j, row)| {
        let (low, high) = (j * columns, (j + 1) % rows * columns);
        for (i, pair) in row.as_chunks_mut::<2>().0.iter_mut().enumerate() {
            let next = (i + 1) % columns;
            let [a, b, c, d] = [low + i, low + next, high + next, high + i].map(to_u32);
            *pair = [[a, b, c], [a, c, d]];
        }
    });
    Patch { positions, indices, normals: Vec::new() }
}

/// Cells of a grid of about `triangles` triangles with `aspect` columns a row, at least `least`.
pub(super) fn cells(triangles: usize, aspect: f64, least: [usize; 2]) -> [usize; 2] {
    let nu = whole((triangles as f64 * 0.5 * aspect).sqrt() + 0.5).max(least[0]);
    let nv = ((triangles + nu) / (2 * nu)).max(least[1]);
    // Rows are few and long: what they leave is made up by the columns.
    let nu = ((triangles + nv) / (2 * nv)).max(least[0]);
    [nu, nv]
}

/// Divides a number of triangles over parts by weight, passing on what rounding leaves, so that
/// the sum keeps to the request.
pub(super) struct Budget {
    triangles: usize,
    weight: f64,
}

impl Budget {
    /// `triangles` for parts whose weights add up to `weight`.
    pub(super) const fn new(triangles: usize, weight: f64) -> Self {
        Self { triangles, weight }
    }

    /// The share of the next part.
    pub(super) fn share(&mut self, weight: f64) -> usize {
        let share = self.triangles as f64 * (weight / self.weight.max(weight)).clamp(0.0, 1.0);
        self.weight = (self.weight - weight).max(0.0);
        whole(share)
    }

    /// How many triangles are not spent.
    pub(super) const fn left(&self) -> usize {
        self.triangles
    }

    /// What the part really took.
    pub(super) const fn spend(&mut self, triangles: usize) {
        self.triangles = self.triangles.saturating_sub(triangles);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_joined_on_both_sides_is_closed() {
        let patch = grid(7, 5, Wrap::Both, &|u, v| DVec3::new(u, v, 0.0));
        assert_eq!((patch.positions.len(), patch.indices.len()), (35, 70));
        let mut edges = std::collections::HashMap::new();
        for t in &patch.indices {
            for k in 0..3 {
                *edges.entry((t[k], t[(k + 1) % 3])).or_insert(0) += 1;
            }
        }
        // Every directed edge once, and its opposite once.
        assert!(edges.iter().all(|(&(a, b), &n)| n == 1 && edges.get(&(b, a)) == Some(&1)));
    }

    #[test]
    fn boxes_are_closed_and_face_outward() {
        let mut patch = Patch::default();
        patch.cuboid(DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0), DMat3::IDENTITY);
        let corner = |i: u32| patch.positions[i as usize];
        let volume: f32 = patch
            .indices
            .iter()
            .map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2]))) / 6.0)
            .sum();
        assert!((volume - 48.0).abs() < 1e-3, "{volume}");
    }

    #[test]
    fn budgets_are_spent() {
        let mut budget = Budget::new(1000, 10.0);
        let mut sum = 0;
        for _ in 0..10 {
            let take = budget.share(1.0) / 7 * 7;
            budget.spend(take);
            sum += take;
        }
        assert!((1000 - sum) < 7, "{sum}");
    }
}
