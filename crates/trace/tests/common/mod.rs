//! All scenes over a mesh, and rays.

use fastrand::Rng;
use niwaki_build_sbvh::Sbvh;
use niwaki_core::{Builder, Bvh, Hit, Ray, TriangleMesh, glam::Vec3};
use niwaki_hard_cases::median_tree;
use niwaki_trace::{AutoScene, BinaryScene, HitQueries, Kernel, QuantisedScene, WideScene};
use niwaki_wide::{CollapseSettings, WideBvh};

/// [`HitQueries`] as an object.
#[allow(dead_code, reason = "not every test uses all")]
pub(crate) trait Queries: Send + Sync {
    fn closest(&self, ray: &Ray) -> Hit;
    fn any(&self, ray: &Ray) -> bool;
    fn closest_filtered(
        &self,
        ray: &Ray,
        filter: &mut dyn FnMut(u32, f32, f32, f32) -> bool,
    ) -> Hit;
    fn any_filtered(&self, ray: &Ray, filter: &mut dyn FnMut(u32, f32, f32, f32) -> bool) -> bool;
    fn nearest(&self, ray: &Ray, most: usize) -> Vec<Hit>;
}

impl<S: HitQueries + Send> Queries for S {
    fn closest(&self, ray: &Ray) -> Hit {
        self.closest_hit(ray)
    }

    fn any(&self, ray: &Ray) -> bool {
        self.any_hit(ray)
    }

    fn closest_filtered(
        &self,
        ray: &Ray,
        filter: &mut dyn FnMut(u32, f32, f32, f32) -> bool,
    ) -> Hit {
        self.closest_hit_filtered(ray, filter)
    }

    fn any_filtered(&self, ray: &Ray, filter: &mut dyn FnMut(u32, f32, f32, f32) -> bool) -> bool {
        self.any_hit_filtered(ray, filter)
    }

    fn nearest(&self, ray: &Ray, most: usize) -> Vec<Hit> {
        let mut hits = vec![Hit::MISS; 3];
        if most == usize::MAX {
            self.all_hits(ray, &mut hits);
        } else {
            self.nearest_hits(ray, most, &mut hits);
        }
        hits
    }
}

/// Every scene type, width and kernel over a tree, by name.
#[allow(dead_code, reason = "not every test uses all")]
pub(crate) fn scenes_of(
    bvh: &Bvh,
    mesh: &TriangleMesh,
    tree: &str,
) -> Vec<(String, Box<dyn Queries>)> {
    let mut all: Vec<(String, Box<dyn Queries>)> =
        vec![(format!("{tree}, binary"), Box::new(BinaryScene::new(bvh, mesh).unwrap()))];
    let auto = AutoScene::new(bvh, mesh).unwrap();
    all.push((format!("{tree}, {} wide by itself", auto.width()), Box::new(auto)));
    add_width::<4>(bvh, mesh, tree, &mut all);
    add_width::<8>(bvh, mesh, tree, &mut all);
    add_width::<16>(bvh, mesh, tree, &mut all);
    all
}

fn add_width<const W: usize>(
    bvh: &Bvh,
    mesh: &TriangleMesh,
    tree: &str,
    all: &mut Vec<(String, Box<dyn Queries>)>,
) where
    WideScene<W>: HitQueries + 'static,
    QuantisedScene<W>: HitQueries + 'static,
{
    let wide = WideBvh::<W>::collapse(bvh, &CollapseSettings::default()).unwrap();
    let quantised = QuantisedScene::build_from(wide.clone(), mesh).unwrap();
    let scene = WideScene::build_from(wide, mesh).unwrap();
    for kernel in Kernel::ALL {
        if let Ok(scene) = scene.clone().with_kernel(kernel) {
            all.push((format!("{tree}, {kernel}, {W} wide"), Box::new(scene)));
        }
        if let Ok(scene) = quantised.clone().with_kernel(kernel) {
            all.push((format!("{tree}, {kernel}, {W} wide, quantised"), Box::new(scene)));
        }
    }
}

/// [`scenes_of`] a tree without and one with split triangles.
#[allow(dead_code, reason = "not every test uses all")]
pub(crate) fn scenes(mesh: &TriangleMesh, leaf: usize) -> Vec<(String, Box<dyn Queries>)> {
    let mut all = scenes_of(&median_tree(mesh, leaf), mesh, "median");
    all.extend(scenes_of(&split_tree(mesh), mesh, "split"));
    all
}

/// A tree that refers to many triangles more than once.
#[allow(dead_code, reason = "not every test uses all")]
pub(crate) fn split_tree(mesh: &TriangleMesh) -> Bvh {
    Sbvh { alpha: 0.0, ..Sbvh::default() }.build_mesh(mesh).unwrap()
}

#[allow(dead_code, reason = "not every test uses all")]
pub(crate) fn bits(hit: &Hit) -> [u32; 4] {
    // −0.0 and 0.0 are the same distance.
    [(hit.t + 0.0).to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.prim_id]
}

#[allow(dead_code, reason = "not every test uses all")]
pub(crate) fn random_rays(count: usize, seed: u64) -> Vec<Ray> {
    let mut rng = Rng::with_seed(seed);
    let mut point = || Vec3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5) * 3.0;
    (0..count).map(|_| Ray::new(point(), point())).collect()
}
