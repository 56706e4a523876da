//! Kernels on small meshes and rays of any bits.

use super::{bytes::Bytes, world};
use crate::{builders, exact_answers};
use niwaki_core::{AreaScale, Bvh, Hit, Intersector, Ray, TriangleMesh, glam::Vec3};
use niwaki_exact::{Anchor, SettleOptions, Verdict, settle_any_with, settle_with};
use niwaki_hard_cases::median_tree;
use niwaki_trace::{BinaryScene, BruteForce, HitQueries, Mode, WideScene};
use niwaki_wide::{CollapseSettings, WideBvh};

/// A small mesh, a tree over it and rays.
pub(crate) struct World {
    pub(crate) mesh: TriangleMesh,
    pub(crate) bvh: Bvh,
    pub(crate) rays: Vec<Ray>,
}

impl World {
    /// The tree is of a builder that the first byte chooses, or has leaves of one or many
    /// triangles.
    pub(crate) fn of(bytes: &mut Bytes<'_>) -> Self {
        let choice = bytes.byte();
        let mesh = world::mesh(bytes);
        let mut builders = builders();
        let bvh = match usize::from(choice) % (builders.len() + 2) {
            0 => median_tree(&mesh, 1),
            1 => median_tree(&mesh, 20),
            i => builders.swap_remove(i - 2).build_mesh(&mesh).expect("the mesh is finite"),
        };
        let rays = world::rays(&mesh, bytes);
        Self { mesh, bvh, rays }
    }

    /// Every scene in a mode, by name: binary, and each width by each kernel.
    pub(crate) fn each_scene(&self, mode: Mode, mut f: impl FnMut(&str, &dyn Queries)) {
        let binary = BinaryScene::new_in(mode, &self.bvh, &self.mesh);
        f(&format!("binary, {mode}"), &binary.expect("the tree is of the mesh"));
        self.each_kernel::<4>(mode, &mut f);
        self.each_kernel::<8>(mode, &mut f);
        self.each_kernel::<16>(mode, &mut f);
    }

    fn each_kernel<const W: usize>(&self, mode: Mode, f: &mut impl FnMut(&str, &dyn Queries))
    where
        WideScene<W>: HitQueries,
    {
        let wide = WideBvh::<W>::collapse(&self.bvh, &CollapseSettings::default());
        let wide = wide.expect("the tree is sound");
        let scene = WideScene::build_in(mode, wide, &self.mesh).expect("the tree is of the mesh");
        for kernel in WideScene::<W>::kernels() {
            let scene = scene.clone().with_kernel(kernel).expect("it is available");
            f(&format!("{kernel}, {W} wide, {mode}"), &scene);
        }
    }
}

/// [`HitQueries`] as an object.
pub(crate) trait Queries: Intersector {
    fn all(&self, ray: &Ray) -> Vec<Hit>;
}

impl<S: HitQueries> Queries for S {
    fn all(&self, ray: &Ray) -> Vec<Hit> {
        let mut hits = Vec::new();
        self.all_hits(ray, &mut hits);
        hits
    }
}

/// `t`, `u`, `v` and the id; −0.0 and 0.0 are the same distance.
pub(crate) fn bits(hit: &Hit) -> [u32; 4] {
    [(hit.t + 0.0).to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.prim_id]
}

/// Every scene against brute force, and that against the exact answer, by the rules of
/// `cargo xtask verify`.
pub(crate) fn check(data: &[u8]) {
    let world = World::of(&mut Bytes::new(data));
    let World { mesh, rays, .. } = &world;
    let (exact_rays, exact_hits) = exact_answers(mesh, rays);
    for mode in Mode::ALL {
        let reference = BruteForce::new(mode, mesh);
        for (ray, exact) in exact_rays.iter().zip(&exact_hits) {
            let brute = reference.closest_hit(ray);
            if !is_beyond_fast(mode, ray, mesh, [&brute, exact]) {
                settled(mode, &format!("brute force, {mode}"), ray, mesh, &brute, exact, "exact");
            }
        }
        let brutes: Vec<Hit> = rays.iter().map(|ray| reference.closest_hit(ray)).collect();
        world.each_scene(mode, |name, scene| {
            for (ray, brute) in rays.iter().zip(&brutes) {
                let hit = scene.closest_hit(ray);
                assert!(is_sound(&hit, ray, mesh), "{name}: {hit:?} of {ray:?}");
                if !is_beyond_fast(mode, ray, mesh, [&hit, brute]) {
                    settled(mode, name, ray, mesh, &hit, brute, "brute force");
                }
                let any = scene.any_hit(ray);
                assert_eq!(any, hit.is_hit(), "{name}: any hit differs from closest of {ray:?}");
                let all = scene.all(ray);
                assert!(all.is_sorted_by(|a, b| a.t <= b.t), "{name}: {all:?} of {ray:?}");
                assert!(all.iter().all(|hit| is_sound(hit, ray, mesh)), "{name}: {all:?}");
                assert_eq!(all.is_empty(), !any, "{name}: all hits of {ray:?}");
                assert!(!any || all.contains(&hit), "{name}: {all:?} lacks {hit:?} of {ray:?}");
                if is_plain(mode, ray) {
                    assert_eq!(bits(&hit), bits(brute), "{name}: not brute force's, {ray:?}");
                    let expected = reference.all_hits(ray);
                    let same = all.iter().map(bits).eq(expected.iter().map(bits));
                    assert!(same, "{name}: {all:?} are not {expected:?} of {ray:?}");
                }
            }
        });
    }
}

/// True if the hit of one of the two is of a triangle for which the fast mode promises nothing
/// ([`Mode::Fast`]): products of its lengths, in the units that the scene is scaled to, are denormal,
/// or its determinant is the small difference of large ones: a needle, or a ray next to its plane.
fn is_beyond_fast(mode: Mode, ray: &Ray, mesh: &TriangleMesh, hits: [&Hit; 2]) -> bool {
    let scale = f64::from(AreaScale::of(&mesh.bounds()).get());
    let scaled = |v: Vec3| v.as_dvec3() * scale;
    let mut triangles = hits.into_iter().filter_map(|hit| mesh.indices().get(hit.prim_id as usize));
    mode == Mode::Fast
        && triangles.any(|corners| {
            let [a, b, c] = corners.map(|i| scaled(mesh.positions()[i as usize]));
            let (e1, e2, d) = (b - a, c - a, ray.direction.as_dvec3());
            let (area, det) = (e1.cross(e2).length(), e1.cross(e2).dot(d).abs());
            let product = area * (a - scaled(ray.origin)).length().min(1.0);
            let is_lost = det <= 2.0_f64.powi(-16) * e1.length() * e2.length() * d.length();
            area > 0.0 && (is_lost || product < 2.0_f64.powi(-96))
        })
}

/// True where watertight kernels promise brute force's bits: nothing can be near `t_min`.
fn is_plain(mode: Mode, ray: &Ray) -> bool {
    mode == Mode::Watertight && ray.t_min <= 0.0
}

/// Panics if the exact oracle finds ours wrong, or theirs where that is ours as well.
fn settled(
    mode: Mode,
    name: &str,
    ray: &Ray,
    mesh: &TriangleMesh,
    ours: &Hit,
    theirs: &Hit,
    other: &str,
) {
    if bits(ours) == bits(theirs) {
        return;
    }
    let options = options(mode, mesh, [ours, theirs]);
    let verdict = settle_with(ray, mesh, ours, theirs, &options);
    let what = || format!("{name}: {ours:?}, {other}: {theirs:?}, of {ray:?} in {mesh:?}");
    assert_ne!(verdict.verdict, Verdict::OursWrong, "{} ({verdict:?})", what());
    let verdict = settle_any_with(ray, mesh, ours.is_hit(), theirs.is_hit(), &options);
    assert_ne!(verdict.verdict, Verdict::OursWrong, "any hit, {}", what());
}

/// What counts as rounding: in the fast mode, the edge between the second and the third corner is
/// what the other two and the determinant leave, whose rounding counts for more the shorter it is,
/// and distances are those of the first corner.
fn options(mode: Mode, mesh: &TriangleMesh, hits: [&Hit; 2]) -> SettleOptions {
    let anchor = match mode {
        Mode::Fast => Anchor::First,
        Mode::Watertight => Anchor::Best,
    };
    let mut options = SettleOptions { anchor, ..SettleOptions::default() };
    for corners in hits.into_iter().filter_map(|hit| mesh.indices().get(hit.prim_id as usize)) {
        let [a, b, c] = corners.map(|i| mesh.positions()[i as usize].as_dvec3());
        let largest = a.abs().max(b.abs()).max(c.abs()).max_element();
        let widened = (b - a).length() * (c - a).length() / ((c - b).length() * largest);
        if mode == Mode::Fast && widened > 1.0 {
            options.border_ulps = options.border_ulps.max(8.0 * (1.0 + widened));
        }
    }
    options
}

/// True for a miss, and for a hit in range of a triangle that exists.
fn is_sound(hit: &Hit, ray: &Ray, mesh: &TriangleMesh) -> bool {
    if !hit.is_hit() {
        return *hit == Hit::MISS;
    }
    world::is_legal(ray)
        && (hit.prim_id as usize) < mesh.len()
        && hit.t >= ray.t_min.max(0.0)
        && hit.t <= ray.t_max
        && (0.0..=1.0).contains(&hit.u)
        && (0.0..=1.0).contains(&hit.v)
}

/// A point chosen by three integers.
fn integers([x, y, z]: [i8; 3]) -> Vec<u8> {
    let mut out = vec![0];
    out.extend([x, y, z].iter().flat_map(|value| [0, value.cast_unsigned()]));
    out
}

/// A tree of median splits over corners and triangles, with rays.
pub(crate) fn seed(corners: &[[i8; 3]], triangles: &[[u8; 3]], rays: &[&[u8]]) -> Vec<u8> {
    let count = |n: usize| u8::try_from(n).expect("seeds are small");
    let mut out = vec![0, count(corners.len() - 1), count(triangles.len())];
    out.extend(corners.iter().flat_map(|&p| integers(p)));
    out.extend(triangles.as_flattened());
    out.extend(rays.concat());
    out
}

/// A tetrahedron, a fan, equal triangles, slivers, and numbers of every size; rays at corners,
/// along axes, within ranges, and illegal ones.
pub(crate) fn seeds() -> Vec<Vec<u8>> {
    let at_corner = |from: [i8; 3], corner: u8| [&[1][..], &integers(from), &[corner]].concat();
    let along_axis = |from: [i8; 3], axis: u8| [&[3][..], &integers(from), &[axis]].concat();
    let in_range =
        |from: [i8; 3], axis: u8| [&[15][..], &integers(from), &[axis, 0, 1, 0, 5]].concat();
    // The choice of a float in its lower bits, of a hard number in its upper ones.
    let hard = |i: u8| i << 3 | 2;
    let illegal = [&[0, 0][..], &[hard(12), hard(0), hard(10)], &[0, 1, hard(1), hard(9)]].concat();
    // Between two corners, and next to one.
    let at_edge = [&[2][..], &integers([1, 2, 9]), &[2, 0, 1, 40]].concat();
    let next_to = [&[2][..], &integers([1, 2, 9]), &[3, 2, 0x91]].concat();
    let rays: Vec<Vec<u8>> = vec![
        at_corner([1, 1, 1], 0),
        at_corner([1, 1, 1], 3),
        along_axis([1, 1, 9], 5),
        along_axis([0, 0, -9], 2),
        in_range([1, 1, 9], 5),
        at_edge,
        next_to,
        illegal,
    ];
    let rays: Vec<&[u8]> = rays.iter().map(Vec::as_slice).collect();
    let tetrahedron = [[0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 0, 4]];
    let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    let fan: Vec<[u8; 3]> = (1..12).map(|i| [0, i, i + 1]).collect();
    let circle: Vec<[i8; 3]> = (0..13).map(|i: i8| [i * 3 % 13, i * (i % 5), i % 2]).collect();
    let mut seeds = vec![
        seed(&tetrahedron, &faces, &rays),
        seed(&circle, &fan, &rays),
        seed(&tetrahedron, &[[0, 1, 2]; 40], &rays),
        // Without area, and without triangles.
        seed(&tetrahedron, &[[0, 0, 0], [1, 1, 2], [0, 1, 3]], &rays),
        seed(&tetrahedron, &[], &rays),
        seed(&[[-128, 0, 0], [127, 1, 0], [127, 0, 0], [-128, 1, 1]], &faces, &rays),
    ];
    // One more with every tree.
    for builder in 1..trees() {
        let mut more = seeds[usize::from(builder) % 6].clone();
        more[0] = builder;
        seeds.push(more);
    }
    // Hard numbers as corners: huge, tiny, next to each other.
    for (i, j) in [(8, 9), (4, 5), (6, 7), (13, 14), (15, 0), (13, 2)] {
        let mut bytes = vec![0, 3, 4];
        for corner in [[i, j, 0], [j, i, 2], [0, j, i], [j, j, j]] {
            bytes.push(0);
            bytes.extend(corner.map(hard));
        }
        bytes.extend(faces.as_flattened());
        bytes.extend(rays.concat());
        seeds.push(bytes);
    }
    seeds
}

/// How many trees the first byte chooses among.
fn trees() -> u8 {
    u8::try_from(builders().len() + 2).expect("there are some dozens")
}
