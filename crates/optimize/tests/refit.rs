//! Boxes follow moved triangles.

#[allow(dead_code, reason = "each test file uses some of these")]
mod common;

use common::{same_bytes, single, split_tree};
use niwaki_build_sweep::Sweep;
use niwaki_core::glam::Vec3;
use niwaki_core::{Aabb, Builder, Bvh, SahConstants, TriangleMesh};
use niwaki_hard_cases::{median_tree, sheet, soup_mesh};
use niwaki_metrics::{sah, validate};
use niwaki_optimize::{Budget, OptimizeError, RefitRotations, refit};

/// A sheet that waves.
fn wave(time: f32) -> TriangleMesh {
    sheet(120, |x, y| {
        let height = (x as f32 * 0.13 + time).sin() * (y as f32 * 0.09 - time).cos();
        Vec3::new(x as f32, y as f32, height * 15.0)
    })
}

fn moved(mesh: &TriangleMesh, f: impl Fn(Vec3) -> Vec3) -> TriangleMesh {
    let positions = mesh.positions().iter().map(|p| f(*p)).collect();
    TriangleMesh::new(positions, mesh.indices().to_vec()).unwrap()
}

/// Every box is the union of what is below; links are those of `links`.
fn assert_fits(bvh: &Bvh, links: &Bvh, mesh: &TriangleMesh) {
    assert_eq!(bvh.prim_ids, links.prim_ids);
    for (node, link) in bvh.nodes.iter().zip(&links.nodes) {
        assert_eq!((node.first, node.count), (link.first, link.count));
        let below = if node.is_leaf() {
            bvh.leaf_prims(node)
                .iter()
                .fold(Aabb::EMPTY, |b, &id| b.union(mesh.triangle(id as usize).bounds()))
        } else {
            let [a, b] = node.children();
            bvh.nodes[a].aabb().union(bvh.nodes[b].aabb())
        };
        assert_eq!(node.aabb(), below);
    }
}

#[test]
fn boxes_fit_whatever_the_order_of_nodes() {
    let mesh = wave(0.0);
    let later = wave(1.0);
    // A sweep tree stands in depth-first order, a median tree in breadth-first order.
    for tree in [Sweep::default().build_mesh(&mesh).unwrap(), median_tree(&mesh, 2)] {
        let mut same = tree.clone();
        refit(&mut same, &mesh).unwrap();
        assert_eq!(same, tree, "nothing moved");
        let mut fitted = tree.clone();
        refit(&mut fitted, &later).unwrap();
        assert_fits(&fitted, &tree, &later);
        assert_eq!(validate(&fitted, &later), Ok(()));
    }
}

#[test]
fn hard_meshes_and_split_triangles_stay_valid() {
    for case in niwaki_hard_cases::meshes() {
        let later = moved(&case.mesh, |p| Vec3::new(p.y, -p.z, p.x));
        for tree in [single().build_mesh(&case.mesh).unwrap(), median_tree(&case.mesh, 3)] {
            let mut fitted = tree.clone();
            refit(&mut fitted, &later).unwrap();
            assert_fits(&fitted, &tree, &later);
        }
        if case.mesh.len() < 20_000 {
            let mut tree = split_tree(&case.mesh, &Sweep::default());
            refit(&mut tree, &later).unwrap();
            assert_eq!(validate(&tree, &later), Ok(()), "{}", case.name);
        }
    }
}

#[test]
fn bytes_do_not_depend_on_threads() {
    let (mesh, later) = (wave(0.0), wave(2.0));
    let tree = single().build_mesh(&mesh).unwrap();
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let (mut plain, mut rotated) = (tree.clone(), tree.clone());
            refit(&mut plain, &later).unwrap();
            RefitRotations::default().refit(&mut rotated, &later).unwrap();
            [plain, rotated]
        })
    };
    let expected = run(1);
    for threads in [2, 3, 8] {
        for (a, b) in run(threads).iter().zip(&expected) {
            assert!(same_bytes(a, b), "{threads}");
        }
    }
}

#[test]
fn rotations_keep_animated_trees_better() {
    let start = soup_mesh(4000, 0.02, 3);
    // Points fly apart along directions that have nothing to do with where they are.
    let at = |time: f32| {
        moved(&start, |p| {
            let towards = (p * 40.0).floor().dot(Vec3::new(12.9898, 78.233, 37.719)).sin();
            p + Vec3::new(towards, (towards * 91.7).sin(), (towards * 57.3).cos()) * time
        })
    };
    let mut plain = single().build_mesh(&start).unwrap();
    let mut rotated = plain.clone();
    for frame in 1..=10 {
        let mesh = at(frame as f32 * 0.1);
        refit(&mut plain, &mesh).unwrap();
        let report = RefitRotations::default().refit(&mut rotated, &mesh).unwrap();
        assert!(report.after <= report.before);
        assert_eq!(report.after, sah(&rotated, &SahConstants::default()));
        assert_eq!(validate(&rotated, &mesh), Ok(()));
    }
    let cost = |bvh: &Bvh| sah(bvh, &SahConstants::default());
    assert!(cost(&rotated) < 0.9 * cost(&plain), "{} {}", cost(&rotated), cost(&plain));
}

#[test]
fn what_does_not_fit_is_refused() {
    let mesh = soup_mesh(100, 0.1, 1);
    let tree = single().build_mesh(&mesh).unwrap();
    let fewer = soup_mesh(99, 0.1, 1);
    let mut same = tree.clone();
    let error = refit(&mut same, &fewer).unwrap_err();
    assert_eq!(error, OptimizeError::PrimOutOfRange { prim_id: 99, triangles: 99 });
    assert!(RefitRotations::default().refit(&mut same, &fewer).is_err());
    assert_eq!(same, tree);
    for (node, first) in [(0, 1_000_000), (0, 0), (tree.nodes.len() - 1, 100)] {
        let mut bad = tree.clone();
        bad.nodes[node].first = first;
        let copy = bad.clone();
        let error = refit(&mut bad, &mesh).unwrap_err();
        assert!(matches!(error, OptimizeError::BrokenTree { node: n, .. } if n == node), "{error}");
        assert_eq!(bad, copy);
    }
    let constants = SahConstants { triangle: -1.0, ..SahConstants::default() };
    let bad = RefitRotations { constants, budget: Budget::iterations(1) };
    assert!(matches!(bad.refit(&mut same, &mesh), Err(OptimizeError::BadSetting { .. })));
    refit(&mut Bvh::default(), &TriangleMesh::default()).unwrap();
}
