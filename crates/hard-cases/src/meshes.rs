//! Hard geometry.

use fastrand::Rng;
use glam::Vec3;
use niwaki_core::{Aabb, PrimRef, Triangle, TriangleMesh};

/// A mesh that has broken builders or kernels, or was made to.
#[derive(Debug, Clone)]
pub struct Case {
    /// Short name for tables, in `snake_case`.
    pub name: &'static str,
    /// Why it is hard.
    pub why: &'static str,
    /// The triangles, all finite.
    pub mesh: TriangleMesh,
}

fn mesh(triangles: &[Triangle]) -> TriangleMesh {
    TriangleMesh::from_triangles(triangles).expect("the catalogue's triangles are finite")
}

fn tri(v: [[f32; 3]; 3]) -> Triangle {
    Triangle::new(Vec3::from(v[0]), Vec3::from(v[1]), Vec3::from(v[2]))
}

fn point(rng: &mut Rng, size: f32) -> Vec3 {
    Vec3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5) * (2.0 * size)
}

/// `count` triangles around random points of a cube from −1 to 1, their corners up to `size` from
/// the point along each axis.
#[must_use]
pub fn soup(count: usize, size: f32, seed: u64) -> Vec<Triangle> {
    let mut rng = Rng::with_seed(seed);
    (0..count)
        .map(|_| {
            let p = point(&mut rng, 1.0);
            let mut corner = || p + point(&mut rng, size);
            Triangle::new(corner(), corner(), corner())
        })
        .collect()
}

fn map(triangles: &[Triangle], f: impl Fn(Vec3) -> Vec3) -> Vec<Triangle> {
    triangles.iter().map(|t| Triangle::new(f(t.v0), f(t.v1), f(t.v2))).collect()
}

/// A closed star-shaped surface around the origin: a subdivided octahedron with shared vertices
/// pushed to random distances of about `size`, then moved by `offset`. Every ray from the inside
/// must hit it. Has 8·4^`levels` triangles.
#[must_use]
pub fn closed_star(levels: u32, size: f32, offset: Vec3, seed: u64) -> TriangleMesh {
    // A geodesic grid: each face of the octahedron as rows of points, shared along the edges by
    // looking points up by their exact integer position.
    let n = 1_i32 << levels;
    let mut rng = Rng::with_seed(seed);
    let mut positions = Vec::new();
    let mut known = std::collections::HashMap::new();
    let mut vertex = |p: [i32; 3]| {
        *known.entry(p).or_insert_with(|| {
            let direction = Vec3::from(p.map(|c| c as f32)).normalize();
            positions.push(direction * (size * (0.7 + 0.6 * rng.f32())) + offset);
            niwaki_core::to_u32(positions.len() - 1)
        })
    };
    let mut indices = Vec::new();
    for octant in 0..8 {
        let sign = |axis: i32| if octant >> axis & 1 == 0 { 1 } else { -1 };
        let mut at = |i: i32, j: i32| vertex([sign(0) * i, sign(1) * j, sign(2) * (n - i - j)]);
        for i in 0..n {
            for j in 0..n - i {
                indices.push([at(i, j), at(i + 1, j), at(i, j + 1)]);
                if i + j + 1 < n {
                    indices.push([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
                }
            }
        }
    }
    TriangleMesh::new(positions, indices).expect("finite and in range")
}

/// Boxes that shrink by half towards a corner, so that greedy splits peel them off one by one:
/// a tree some 110 levels deep for 10,000 triangles, where a balanced one has 14. Not as deep as
/// there are primitives: the exponent range of `f32` ends such a run at some 120 boxes, so runs of
/// 100 are laid one behind the other.
#[must_use]
pub fn deep_chain(count: usize) -> Vec<Triangle> {
    (0..count)
        .map(|i| {
            let run = (i / 100) as f32;
            let size = 0.5_f32.powf((i % 100) as f32);
            let corner = Vec3::new(run * 4.0, 0.0, 0.0);
            Triangle::new(
                corner,
                corner + Vec3::new(size, 0.0, 0.0),
                corner + Vec3::new(size, size, size),
            )
        })
        .collect()
}

/// References that a builder must refuse, each with the index of the first bad one.
#[must_use]
pub fn bad_prim_refs() -> Vec<(Vec<PrimRef>, usize)> {
    let good = PrimRef::new(Aabb::new(Vec3::ZERO, Vec3::ONE), 0);
    let with = |index: usize, change: &dyn Fn(&mut PrimRef)| {
        let mut prims = vec![good; 1000];
        for (i, p) in prims.iter_mut().enumerate() {
            p.prim_id = niwaki_core::to_u32(i);
        }
        change(&mut prims[index]);
        (prims, index)
    };
    vec![
        with(0, &|p| p.min.x = f32::NAN),
        with(999, &|p| p.max.y = f32::NAN),
        with(500, &|p| p.max.z = f32::INFINITY),
        with(17, &|p| p.min = Vec3::NEG_INFINITY),
        with(3, &|p| (p.min, p.max) = (Aabb::EMPTY.min, Aabb::EMPTY.max)),
        with(4, &|p| p.min.x = 2.0),
    ]
}

/// The whole catalogue; the largest case has 100,000 triangles.
#[must_use]
pub fn meshes() -> Vec<Case> {
    let mut cases = Vec::new();
    let mut add = |name, why, triangles: &[Triangle]| {
        cases.push(Case { name, why, mesh: mesh(triangles) });
    };
    let one = tri([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let cloud = soup(2_000, 0.05, 1);

    add("none", "no triangles", &[]);
    add("one", "one triangle", &[one]);
    add("two_equal", "two equal triangles", &[one, one]);
    add("equal_100k", "100,000 equal triangles: no plane separates them", &vec![one; 100_000]);
    let concentric: Vec<_> = (0..100_000)
        .map(|i| {
            // Exact binary fractions, so that all centroids are exactly zero.
            let r = (i + 1) as f32;
            tri([[-r, -r, -r], [r, r, r], [r, -r, r]])
        })
        .collect();
    add(
        "concentric_100k",
        "one centroid, different bounds: midpoint splits never end",
        &concentric,
    );

    add("points", "triangles that are points", &map(&cloud, |_| Vec3::ONE)[..500]);
    let points: Vec<_> = cloud.iter().map(|t| Triangle::new(t.v0, t.v0, t.v0)).collect();
    add("scattered_points", "zero-area triangles at different places", &points);
    let collinear: Vec<_> = cloud.iter().map(|t| Triangle::new(t.v0, t.v1, t.v1)).collect();
    add("collinear", "zero-area triangles with extent", &collinear);
    let nearly: Vec<_> =
        cloud.iter().map(|t| Triangle::new(t.v0, t.v1, t.v0 + (t.v1 - t.v0) * 0.3)).collect();
    add("nearly_collinear", "areas that are nothing but rounding", &nearly);
    add("flat", "all z equal: boxes without volume", &map(&cloud, |v| v.with_z(0.25)));
    add("flat_axis_line", "all on one line", &map(&cloud, |v| Vec3::new(v.x, 0.0, 0.0)));
    let mut rng = Rng::with_seed(2);
    let slivers: Vec<_> = (0..500)
        .map(|_| {
            let p = point(&mut rng, 10.0);
            let along = point(&mut rng, 1.0).normalize() * 1e3;
            Triangle::new(p, p + along, p + point(&mut rng, 1e-6))
        })
        .collect();
    add("slivers", "1e-6 wide, 1e3 long", &slivers);
    let mut diagonals: Vec<_> = soup(1_000, 0.01, 3);
    diagonals.extend((0..50).map(|i| {
        let s = i as f32 * 0.01;
        tri([[-1.0 + s, -1.0, -1.0], [1.0, 1.0 - s, 1.0], [-1.0 + s, -0.999, -1.0]])
    }));
    add("diagonals", "long diagonals across small triangles", &diagonals);

    add("tiny_1e-30", "areas vanish in f32", &map(&cloud, |v| v * 1e-30));
    add("huge_1e30", "areas overflow f32", &map(&cloud, |v| v * 1e30));
    add("denormal", "coordinates below the normal range", &map(&cloud, |v| v * 1e-40));
    add("offset_1e7", "detail of 1 at 1e7", &map(&cloud, |v| v * 4.0 + Vec3::splat(1e7)));
    add(
        "far_offset",
        "a small object far from the origin",
        &map(&cloud, |v| v * 4.0 + Vec3::new(148_376.0, 1_234.0, -223_423.0)),
    );
    let mixed: Vec<_> = (0..13)
        .flat_map(|e| {
            let scale = 10.0_f32.powi(e - 6);
            map(&cloud[..100], |v| v * scale)
        })
        .collect();
    add("mixed_scales", "sizes from 1e-6 to 1e6 around one point", &mixed);
    let signed = map(&cloud, |v| Vec3::new(if v.x < 0.0 { -0.0 } else { 0.0 }, v.y, v.z));
    add("signed_zeros", "x is +0.0 or −0.0", &signed);
    add("shrinking", "boxes halve one after the other: the deepest trees", &deep_chain(10_000));

    add(
        "embree_split_epsilon",
        "coordinates from Embree's split-epsilon regression",
        &[
            tri([
                [-6.400_002_5, 25.6, 34.0],
                [57.600_002, 25.6, 34.0],
                [-6.400_002_5, 57.600_002, 34.0],
            ]),
            tri([
                [57.600_002, 57.600_002, 34.0],
                [57.600_002, 25.6, 34.0],
                [-6.400_002_5, 57.600_002, 34.0],
            ]),
        ],
    );
    let (a, b, c) = (-1_113.454_6, -79.049_614, -56.243_19);
    add(
        "pbrt_collinear",
        "pbrt's collinear triangle, which every ray must miss",
        &[tri([[a, b, c], [a, -87.092_27, c], [a, -79.209_015, c]])],
    );
    add("small_2e-4", "an absolute determinant epsilon loses it", &map(&[one], |v| v * 2e-4));
    let grid: Vec<_> = (0..20)
        .flat_map(|x| (0..20).map(move |y| (x as f32, y as f32)))
        .flat_map(|(x, y)| {
            [
                tri([[x, y, 0.0], [x + 1.0, y, 0.0], [x, y + 1.0, 0.0]]),
                tri([[x + 1.0, y + 1.0, 0.0], [x, y + 1.0, 0.0], [x + 1.0, y, 0.0]]),
            ]
        })
        .collect();
    add("integer_grid", "axis-aligned rays run along shared edges", &grid);

    for (name, size, offset) in [
        ("star", 1.0, Vec3::ZERO),
        ("star_offset", 1.0, Vec3::new(1e3, 7e2, -1.3e3)),
        ("star_1e-6", 1e-6, Vec3::ZERO),
        ("star_1e6", 1e6, Vec3::ZERO),
    ] {
        cases.push(Case {
            name,
            why: "closed: every ray from inside must hit",
            mesh: closed_star(4, size, offset, 7),
        });
    }
    cases
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    #[test]
    fn stars_are_closed() {
        let star = closed_star(3, 2.0, Vec3::splat(5.0), 1);
        assert_eq!(star.len(), 8 * 64);
        // In a closed, consistently wound surface every edge is used once each way; ours is not
        // consistently wound across octants, so count undirected uses.
        let mut uses = HashMap::new();
        for t in star.indices() {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                *uses.entry((a.min(b), a.max(b))).or_insert(0) += 1;
            }
        }
        assert!(uses.values().all(|&n| n == 2));
    }

    #[test]
    fn cases_are_what_they_say() {
        let cases = meshes();
        let find = |name| &cases.iter().find(|c| c.name == name).unwrap().mesh;
        assert!(find("none").is_empty());
        assert!(find("collinear").triangles().all(|t| t.area() == 0.0));
        assert!(find("pbrt_collinear").triangle(0).area() == 0.0);
        let prims = find("concentric_100k").prim_refs();
        assert!(prims.iter().all(|p| p.centroid2() == Vec3::ZERO));
        assert!(find("denormal").positions().iter().any(|p| p.x != 0.0 && !p.x.is_normal()));
        for (prims, index) in bad_prim_refs() {
            let error = niwaki_core::scene_bounds(&prims).unwrap_err();
            assert!(
                matches!(error, niwaki_core::BuildError::NonFiniteBounds { index: i, .. } if i == index)
            );
        }
    }
}
