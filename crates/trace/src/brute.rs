//! Every triangle tested.

use crate::{
    flat::{closing, is_flat},
    mode::Mode,
    scale::SceneScale,
    setup::RaySetup,
    triangle::{Fast, TriangleTest, no_hit, settle, words},
    watertight::Sheared,
};
use niwaki_core::{Hit, Ray, Triangle, TriangleMesh};

/// The closest hit by testing every triangle, in [`Mode::Watertight`]; among hits at equal `t` the
/// smallest `prim_id`.
///
/// Takes time linear in the mesh, more than once: the bounds decide the scale, and triangles
/// without area that close no seam are left out. Meant for tests and as the
/// reference of kernels, with which it agrees to the last bit of `t`, `u` and `v`.
#[must_use]
pub fn brute_force(mesh: &TriangleMesh, ray: &Ray) -> Hit {
    brute_force_in(Mode::default(), mesh, ray)
}

/// [`brute_force`] in a mode. In [`Mode::Watertight`] every kernel gives this answer for every
/// ray that has no hit within rounding of its `t_min`; in the fast mode they may differ wherever
/// rounding puts a hit outside its own box.
#[must_use]
pub fn brute_force_in(mode: Mode, mesh: &TriangleMesh, ray: &Ray) -> Hit {
    match mode {
        Mode::Fast => test_all::<Fast>(mode, mesh, ray),
        Mode::Watertight => test_all::<Sheared>(mode, mesh, ray),
    }
}

/// Which triangles can be hit.
struct Kept {
    /// There are triangles without area.
    any_flat: bool,
    /// Those that close seams.
    closing: Vec<u32>,
}

impl Kept {
    fn of(mesh: &TriangleMesh) -> Self {
        let flat: Vec<u32> =
            (0..).zip(mesh.triangles()).filter(|(_, t)| is_flat(t)).map(|(id, _)| id).collect();
        Self { any_flat: !flat.is_empty(), closing: closing(&flat, mesh) }
    }

    #[inline]
    fn has(&self, id: u32, triangle: &Triangle) -> bool {
        !self.any_flat || !is_flat(triangle) || self.closing.binary_search(&id).is_ok()
    }
}

fn test_all<T: TriangleTest>(mode: Mode, mesh: &TriangleMesh, ray: &Ray) -> Hit {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("fma") {
        // SAFETY: the processor has the instructions, as just checked.
        return unsafe { test_all_fma::<T>(mode, mesh, ray) };
    }
    test_each::<T>(mode, mesh, ray)
}

/// The same code with hardware multiply-adds, whose results are the same by definition.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "fma")]
fn test_all_fma<T: TriangleTest>(mode: Mode, mesh: &TriangleMesh, ray: &Ray) -> Hit {
    test_each::<T>(mode, mesh, ray)
}

#[inline(always)]
fn test_each<T: TriangleTest>(mode: Mode, mesh: &TriangleMesh, ray: &Ray) -> Hit {
    let scale = SceneScale::of(&mesh.bounds());
    let Some(setup) = RaySetup::new(ray, scale) else { return Hit::MISS };
    let test = T::new(&setup);
    let mut hit = no_hit(setup.t_max);
    let kept = Kept::of(mesh);
    for (id, triangle) in (0..).zip(mesh.triangles()) {
        if kept.has(id, &triangle) {
            test.intersect(words(mode, &scale.triangle(triangle)), id, setup.t_min, &mut hit);
        }
    }
    setup.finish(settle(hit))
}

/// All hits by testing every triangle, in [`Mode::Watertight`], sorted by `t`, then by `prim_id`;
/// see [`brute_force`].
#[must_use]
pub fn brute_force_all(mesh: &TriangleMesh, ray: &Ray) -> Vec<Hit> {
    let scale = SceneScale::of(&mesh.bounds());
    let Some(setup) = RaySetup::new(ray, scale) else { return Vec::new() };
    let test = <Sheared as TriangleTest>::new(&setup);
    let mut hits = Vec::new();
    let kept = Kept::of(mesh);
    for (id, triangle) in (0..).zip(mesh.triangles()) {
        if !kept.has(id, &triangle) {
            continue;
        }
        let mut hit = no_hit(setup.t_max);
        let words = words(Mode::Watertight, &scale.triangle(triangle));
        TriangleTest::intersect(&test, words, id, setup.t_min, &mut hit);
        if hit.is_hit() {
            hits.push(setup.finish(hit));
        }
    }
    hits.sort_by(|a, b| a.t.partial_cmp(&b.t).unwrap_or(std::cmp::Ordering::Equal));
    hits
}

/// True if [`brute_force`] hits.
#[must_use]
pub fn brute_force_any(mesh: &TriangleMesh, ray: &Ray) -> bool {
    brute_force(mesh, ray).is_hit()
}
