//! obvhs against exact answers.

mod common;

use common::{Random, check_rays, check_void_rays, degenerate, rays, shrinking, soup};
use niwaki_core::{Bvh, Hit, Intersector, Ray, Triangle, TriangleMesh, glam::Vec3};
use niwaki_metrics::{ValidateOptions, validate, validate_with};
use niwaki_peers::{ObvhsKernel, ObvhsPreset, ObvhsScene, PeerError};
use proptest::prelude::*;

fn check_tree(preset: ObvhsPreset, bvh: &Bvh, mesh: &TriangleMesh) {
    let checked = if preset.splits() {
        // obvhs clips in f32, to nearest.
        validate_with(bvh, mesh, &ValidateOptions::rounded_clipping())
    } else {
        assert_eq!(bvh.prim_ids.len(), mesh.len(), "{preset:?}");
        validate(bvh, mesh)
    };
    assert_eq!(checked, Ok(()), "{preset:?} over {} triangles", mesh.len());
}

#[test]
fn own_kernels_give_the_exact_answer() {
    for (mesh, seed) in [(soup(300, 0.4, 1), 2), (soup(2000, 0.05, 3), 4)] {
        for preset in ObvhsPreset::ALL {
            for kernel in ObvhsKernel::ALL {
                let name = format!("{} {}", preset.name(), kernel.name());
                let scene = ObvhsScene::new(&mesh, preset, kernel).unwrap();
                check_rays(&name, &scene, &mesh, &rays(400, seed));
                check_void_rays(&name, &scene);
                assert!(scene.bytes() > mesh.len() * size_of::<[f32; 9]>(), "{name}");
                assert!(scene.build_time().as_nanos() > 0);
            }
        }
    }
}

#[test]
fn trees_are_sound_and_cover_the_mesh() {
    for mesh in [soup(1, 1.0, 1), soup(2, 1.0, 1), soup(3000, 0.1, 5), soup(2000, 1.0, 6)] {
        for preset in ObvhsPreset::ALL {
            let built = preset.build(&mesh).unwrap();
            check_tree(preset, &built.bvh, &mesh);
        }
    }
}

#[test]
fn slow_presets_split_long_triangles() {
    let mesh = soup(1500, 1.5, 7);
    for preset in ObvhsPreset::ALL {
        let references = preset.build(&mesh).unwrap().bvh.prim_ids.len();
        assert_eq!(references > mesh.len(), preset.splits(), "{preset:?}: {references}");
    }
}

#[test]
fn nothing_builds_and_is_missed() {
    let mesh = TriangleMesh::default();
    for preset in ObvhsPreset::ALL {
        assert_eq!(preset.build(&mesh).unwrap().bvh, Bvh::default());
        for kernel in ObvhsKernel::ALL {
            let scene = ObvhsScene::new(&mesh, preset, kernel).unwrap();
            let ray = Ray::new(Vec3::ZERO, Vec3::X);
            assert_eq!(scene.closest_hit(&ray), Hit::MISS);
            assert!(!scene.any_hit(&ray));
        }
    }
}

#[test]
fn degenerate_triangles_are_kept_and_harm_nobody() {
    let mesh = degenerate();
    let equal = TriangleMesh::from_triangles(&[mesh.triangle(3); 3000]).unwrap();
    for preset in ObvhsPreset::ALL {
        for mesh in [&mesh, &equal, &shrinking(100)] {
            check_tree(preset, &preset.build(mesh).unwrap().bvh, mesh);
        }
        let scene = ObvhsScene::new(&mesh, preset, ObvhsKernel::Bvh2).unwrap();
        let hit = scene.closest_hit(&Ray::new(Vec3::new(0.25, 0.25, -1.0), Vec3::Z));
        assert_eq!((hit.prim_id, hit.t), (4, 1.25), "{preset:?}");
    }
}

#[test]
fn trees_that_the_wide_kernel_cannot_traverse_are_refused() {
    let triangle = soup(1, 1.0, 1).triangle(0);
    let middle = (triangle.v0 + triangle.v1 + triangle.v2) / 3.0;
    for count in [1_usize, 3, 60, 1000] {
        let mesh = TriangleMesh::from_triangles(&vec![triangle; count]).unwrap();
        for preset in [ObvhsPreset::Fastest, ObvhsPreset::Medium] {
            match ObvhsScene::new(&mesh, preset, ObvhsKernel::CwBvh) {
                Ok(scene) => {
                    assert!(scene.any_hit(&Ray::new(middle - Vec3::Z, Vec3::Z)));
                }
                Err(PeerError::TooDeep { depth, max: 31 }) => {
                    assert!(depth > 31 && depth <= count, "{depth}");
                }
                Err(error) => panic!("{count} equal triangles, {preset:?}: {error}"),
            }
        }
    }
}

#[test]
fn a_hit_at_the_end_of_the_range_counts() {
    let mesh = soup(1, 1.0, 1);
    let t = mesh.triangle(0);
    let middle = (t.v0 + t.v1 + t.v2) / 3.0;
    let ray = Ray::new(middle - Vec3::Z, Vec3::Z);
    for kernel in ObvhsKernel::ALL {
        let scene = ObvhsScene::new(&mesh, ObvhsPreset::Medium, kernel).unwrap();
        let hit = scene.closest_hit(&ray);
        assert!(hit.is_hit());
        assert!(scene.any_hit(&ray.with_range(0.0, hit.t)));
        assert!(!scene.any_hit(&ray.with_range(0.0, hit.t.next_down())));
    }
}

#[test]
fn the_current_pool_builds_and_its_size_changes_nothing() {
    let mesh = soup(5000, 0.1, 8);
    for preset in [ObvhsPreset::Fastest, ObvhsPreset::Medium] {
        let [one, three] = [1, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| preset.build(&mesh).unwrap().bvh)
        });
        check_tree(preset, &three, &mesh);
        assert_eq!(one.prim_ids.len(), three.prim_ids.len());
    }
}

#[test]
fn names_are_read_back_and_others_explained() {
    for (preset, &name) in ObvhsPreset::ALL.into_iter().zip(ObvhsPreset::NAMES) {
        assert_eq!(preset.name(), name);
        assert_eq!(name.parse(), Ok(preset));
    }
    let error = "ultra".parse::<ObvhsPreset>().unwrap_err();
    assert!(matches!(error, PeerError::UnknownName { .. }));
    let text = error.to_string();
    assert!(text.contains("ultra") && text.contains("very_slow"), "{text}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Coordinates from a coarse grid make equal, flat and zero-area triangles common.
    #[test]
    fn any_small_mesh_gives_a_sound_tree(
        count in 0_usize..60, grid in 1_u8..6, seed in any::<u64>(),
    ) {
        let mut random = Random(seed);
        let mut corner = || (random.point() * f32::from(grid)).floor();
        let triangles: Vec<Triangle> = (0..count)
            .map(|_| Triangle::new(corner(), corner(), corner()))
            .collect();
        let mesh = TriangleMesh::from_triangles(&triangles).unwrap();
        for preset in ObvhsPreset::ALL {
            check_tree(preset, &preset.build(&mesh).unwrap().bvh, &mesh);
        }
    }
}
