//! Every triangle tested.

use crate::{
    flat::{closing, is_flat},
    mode::Mode,
    scale::SceneScale,
    setup::RaySetup,
    triangle::{Fast, TriangleTest, no_hit, settle, words},
    watertight::Sheared,
};
use niwaki_core::{Hit, Intersector, Ray, TriangleMesh, glam::Vec3};

/// Every triangle tested for every ray: what kernels are compared with. What depends on the mesh
/// alone, its scale and the triangles that nothing hits, is found once.
///
/// Takes time linear in the mesh for each ray, and agrees with kernels to the last bit of `t`, `u`
/// and `v`; among hits at equal `t` the smallest `prim_id` wins. In [`Mode::Watertight`] every
/// kernel gives its answer for every ray that has no hit within rounding of its `t_min`; in the fast
/// mode they may differ wherever rounding puts a hit outside its own box.
#[derive(Clone, Debug)]
pub struct BruteForce<'a> {
    mode: Mode,
    mesh: &'a TriangleMesh,
    scale: SceneScale,
    /// Triangles without area that close no seam, in ascending order.
    never_hit: Vec<u32>,
}

impl<'a> BruteForce<'a> {
    /// Prepares a mesh.
    #[must_use]
    pub fn new(mode: Mode, mesh: &'a TriangleMesh) -> Self {
        let scale = SceneScale::of(&mesh.bounds());
        let mut never_hit: Vec<u32> =
            (0..).zip(mesh.triangles()).filter(|(_, t)| is_flat(t)).map(|(id, _)| id).collect();
        if !never_hit.is_empty() {
            let closing = closing(&never_hit, mesh);
            never_hit.retain(|id| closing.binary_search(id).is_err());
        }
        Self { mode, mesh, scale, never_hit }
    }

    /// Which triangle test it does.
    #[must_use]
    pub const fn mode(&self) -> Mode {
        self.mode
    }

    /// All hits, sorted by `t`, then by `prim_id`.
    #[must_use]
    pub fn all_hits(&self, ray: &Ray) -> Vec<Hit> {
        match self.mode {
            Mode::Fast => self.every::<Fast>(ray),
            Mode::Watertight => self.every::<Sheared>(ray),
        }
    }

    fn every<T: TriangleTest>(&self, ray: &Ray) -> Vec<Hit> {
        let Some(setup) = RaySetup::new(ray, self.scale) else { return Vec::new() };
        let test = T::new(&setup);
        let mut hits = Vec::new();
        for (id, words) in self.triangles() {
            let mut hit = no_hit(setup.t_max);
            test.intersect(words, id, setup.t_min, &mut hit);
            if hit.is_hit() {
                hits.push(setup.finish(hit));
            }
        }
        hits.sort_by(|a, b| a.t.partial_cmp(&b.t).unwrap_or(std::cmp::Ordering::Equal));
        hits
    }

    /// What can be hit, as the tests want it.
    #[inline(always)]
    fn triangles(&self) -> impl Iterator<Item = (u32, [Vec3; 3])> {
        let can_be_hit = |id: &u32| self.never_hit.binary_search(id).is_err();
        (0..)
            .zip(self.mesh.triangles())
            .filter(move |(id, _)| can_be_hit(id))
            .map(|(id, triangle)| (id, words(self.mode, &self.scale.triangle(triangle))))
    }

    fn closest<T: TriangleTest>(&self, ray: &Ray) -> Hit {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("fma") {
            // SAFETY: the processor has the instructions, as just checked.
            return unsafe { self.closest_fma::<T>(ray) };
        }
        self.closest_of_all::<T>(ray)
    }

    /// The same code with hardware multiply-adds, whose results are the same by definition.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "fma")]
    fn closest_fma<T: TriangleTest>(&self, ray: &Ray) -> Hit {
        self.closest_of_all::<T>(ray)
    }

    #[inline(always)]
    fn closest_of_all<T: TriangleTest>(&self, ray: &Ray) -> Hit {
        let Some(setup) = RaySetup::new(ray, self.scale) else { return Hit::MISS };
        let test = T::new(&setup);
        let mut hit = no_hit(setup.t_max);
        for (id, words) in self.triangles() {
            test.intersect(words, id, setup.t_min, &mut hit);
        }
        setup.finish(settle(hit))
    }
}

impl Intersector for BruteForce<'_> {
    fn closest_hit(&self, ray: &Ray) -> Hit {
        match self.mode {
            Mode::Fast => self.closest::<Fast>(ray),
            Mode::Watertight => self.closest::<Sheared>(ray),
        }
    }

    fn any_hit(&self, ray: &Ray) -> bool {
        self.closest_hit(ray).is_hit()
    }
}

/// The closest hit by testing every triangle, in [`Mode::Watertight`]: [`BruteForce`] for one ray.
#[must_use]
pub fn brute_force(mesh: &TriangleMesh, ray: &Ray) -> Hit {
    brute_force_in(Mode::default(), mesh, ray)
}

/// [`brute_force`] in a mode.
#[must_use]
pub fn brute_force_in(mode: Mode, mesh: &TriangleMesh, ray: &Ray) -> Hit {
    BruteForce::new(mode, mesh).closest_hit(ray)
}

/// All hits by testing every triangle, in [`Mode::Watertight`], sorted by `t`, then by `prim_id`.
#[must_use]
pub fn brute_force_all(mesh: &TriangleMesh, ray: &Ray) -> Vec<Hit> {
    BruteForce::new(Mode::default(), mesh).all_hits(ray)
}

/// True if [`brute_force`] hits.
#[must_use]
pub fn brute_force_any(mesh: &TriangleMesh, ray: &Ray) -> bool {
    brute_force(mesh, ray).is_hit()
}
