//! Batches, in which rays take turns, against the same rays one by one.

mod common;

use common::bits;
use niwaki_core::{Bvh, Hit, Intersector, Ray, TriangleMesh};
use niwaki_hard_cases::{self as hard, median_tree, soup_mesh};
use niwaki_trace::{Mode, WideScene};
use niwaki_wide::{CollapseSettings, WideBvh};

/// Rays of every kind for a mesh, the useless ones among the others.
fn rays(mesh: &TriangleMesh, count: usize) -> Vec<Ray> {
    let bad = hard::bad_rays(mesh);
    let mut rays = hard::rays(mesh, count, 1);
    rays.extend(hard::aimed_at_borders(mesh, count, 2));
    let step = rays.len() / bad.len() + 1;
    for (i, ray) in bad.into_iter().enumerate() {
        rays.insert((i * step).min(rays.len()), ray);
    }
    rays
}

/// Asserts that each slice of some lengths is answered as its rays one by one.
fn check(scene: &dyn Intersector, rays: &[Ray], name: &str) {
    let hits: Vec<Hit> = rays.iter().map(|ray| scene.closest_hit(ray)).collect();
    let flags: Vec<bool> = rays.iter().map(|ray| scene.any_hit(ray)).collect();
    for length in [3, 17, rays.len()] {
        // What was there before must not show.
        let mut batch_hits = vec![Hit { t: 7.0, u: 7.0, v: 7.0, prim_id: 7 }; rays.len()];
        let mut batch_flags = vec![true; rays.len()];
        for (rays, hits) in rays.chunks(length).zip(batch_hits.chunks_mut(length)) {
            scene.closest_hits(rays, hits);
        }
        for (rays, flags) in rays.chunks(length).zip(batch_flags.chunks_mut(length)) {
            scene.any_hits(rays, flags);
        }
        for (i, (alone, batch)) in hits.iter().zip(&batch_hits).enumerate() {
            assert_eq!(bits(alone), bits(batch), "{name}, {length} at once: {:?}", rays[i]);
        }
        for (i, (alone, batch)) in flags.iter().zip(&batch_flags).enumerate() {
            assert_eq!(alone, batch, "{name}, {length} at once: {:?}", rays[i]);
        }
    }
}

fn check_width<const W: usize>(bvh: &Bvh, mesh: &TriangleMesh, rays: &[Ray], name: &str)
where
    WideScene<W>: Intersector,
{
    for mode in Mode::ALL {
        let wide = WideBvh::<W>::collapse(bvh, &CollapseSettings::default()).unwrap();
        let scene = WideScene::build_in(mode, wide, mesh).unwrap();
        for kernel in WideScene::<W>::kernels() {
            let scene = scene.clone().with_kernel(kernel).unwrap();
            check(&scene, rays, &format!("{name}, {mode} {kernel}, {W} wide"));
        }
    }
}

fn check_all(bvh: &Bvh, mesh: &TriangleMesh, count: usize, name: &str) {
    let rays = rays(mesh, count);
    check_width::<4>(bvh, mesh, &rays, name);
    check_width::<8>(bvh, mesh, &rays, name);
    check_width::<16>(bvh, mesh, &rays, name);
}

#[test]
fn rays_that_take_turns_are_answered_as_alone() {
    for (count, size, leaf) in [(1, 1.0, 1), (60, 0.5, 2), (1500, 0.1, 1), (1500, 0.3, 5)] {
        let mesh = soup_mesh(count, size, 3);
        check_all(&median_tree(&mesh, leaf), &mesh, 400, &format!("{count} triangles of {size}"));
    }
}

#[test]
fn split_triangles_are_found_as_alone() {
    let mesh = soup_mesh(300, 0.8, 4);
    check_all(&common::split_tree(&mesh), &mesh, 400, "split");
}

#[test]
fn hard_cases_are_answered_as_alone() {
    for case in hard::meshes() {
        if case.mesh.len() > 5000 {
            continue; // Slow, and no other arithmetic than their small siblings.
        }
        check_all(&median_tree(&case.mesh, 2), &case.mesh, 60, case.name);
    }
}
