//! Watertight mode: no ray leaves a closed surface, and every kernel agrees with brute force.

use fastrand::Rng;
use niwaki_core::{Hit, Intersector, Ray, Triangle, TriangleMesh, glam::Vec3};
use niwaki_hard_cases::{self as hard, closed_star, median_tree, sheet, soup_mesh};
use niwaki_trace::{BinaryScene, Kernel, Mode, WideScene, brute_force_in};
use niwaki_wide::{CollapseSettings, WideBvh};

/// All kernels over a mesh, by name.
fn kernels(mesh: &TriangleMesh, leaf: usize) -> Vec<(String, Box<dyn Intersector>)> {
    let bvh = median_tree(mesh, leaf);
    let mut all: Vec<(String, Box<dyn Intersector>)> = vec![];
    add_width::<4>(&bvh, mesh, &mut all);
    add_width::<8>(&bvh, mesh, &mut all);
    add_width::<16>(&bvh, mesh, &mut all);
    all
}

/// The kernels for a width.
fn add_width<const W: usize>(
    bvh: &niwaki_core::Bvh,
    mesh: &TriangleMesh,
    all: &mut Vec<(String, Box<dyn Intersector>)>,
) where
    WideScene<W>: Intersector + 'static,
{
    let wide = WideBvh::<W>::collapse(bvh, &CollapseSettings::default()).unwrap();
    let scene = WideScene::build_in(Mode::Watertight, wide, mesh).unwrap();
    for kernel in WideScene::<W>::kernels() {
        let name = format!("{kernel}, {W} wide");
        all.push((name, Box::new(scene.clone().with_kernel(kernel).unwrap())));
    }
}

fn bits(hit: &Hit) -> [u32; 4] {
    [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.prim_id]
}

#[test]
fn all_kernels_give_the_bits_of_brute_force_on_every_hard_case() {
    for case in hard::meshes() {
        let mesh = &case.mesh;
        let small = mesh.len() <= 3_000;
        let kernels = kernels(mesh, 2);
        let mut rays = hard::rays(mesh, if small { 30 } else { 1 }, 11);
        rays.extend(hard::aimed_at_borders(mesh, if small { 60 } else { 2 }, 12));
        for ray in &rays {
            let expected = brute_force_in(Mode::Watertight, mesh, ray);
            for (name, kernel) in &kernels {
                let hit = kernel.closest_hit(ray);
                assert_eq!(
                    bits(&hit),
                    bits(&expected),
                    "{} {name}: {hit:?} {expected:?} {ray:?}",
                    case.name
                );
                assert_eq!(kernel.any_hit(ray), hit.is_hit(), "{} {name} {ray:?}", case.name);
            }
        }
    }
}

#[test]
fn stars() {
    for (size, offset) in [(1.0, Vec3::ZERO), (1.0, Vec3::new(1e3,7e2,-1.3e3)), (1e-30, Vec3::ZERO), (1e30,Vec3::ZERO), (100.0, Vec3::splat(1e7)), (1e-6,Vec3::ZERO)] {
        let mesh = closed_star(5, size, offset, 3);
        let mut rng = Rng::with_seed(1);
        let fast = WideScene::new_in(Mode::Fast, &median_tree(&mesh, 2), &mesh).unwrap();
        let tight = WideScene::new(&median_tree(&mesh, 2), &mesh).unwrap();
        let (mut lf, mut lt) = (0, 0);
        for i in 0..200_000 {
            let t = mesh.triangle(rng.usize(0..mesh.len()));
            let target = if i % 2 == 0 { t.v0 } else { t.v0 + (t.v1 - t.v0) * rng.f32() };
            let o = Vec3::new(rng.f32()-0.5, rng.f32()-0.5, rng.f32()-0.5) * size * 0.5 + offset;
            let ray = Ray::new(o, target - o);
            lf += usize::from(!fast.closest_hit(&ray).is_hit());
            lt += usize::from(!tight.closest_hit(&ray).is_hit());
        }
        println!("{size} {offset} fast {lf} tight {lt}");
    }
}
