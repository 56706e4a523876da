//! Embree against exact answers. Tests pass, and say so, where Embree is not installed.

mod common;

use common::{Random, check_rays, check_void_rays, degenerate, embrees, rays, shrinking, soup};
use niwaki_core::{
    Aabb, BuildError, Bvh, Hit, Intersector, PrimRef, Ray, Triangle, TriangleMesh, glam::Vec3,
};
use niwaki_metrics::{TreeStats, validate};
use niwaki_peers::{Embree, EmbreeBvhSettings, EmbreeScene, EmbreeSettings, PeerError, Quality};
use proptest::prelude::*;

fn scenes(embree: &Embree, mesh: &TriangleMesh) -> Vec<(String, EmbreeScene)> {
    Quality::ALL
        .into_iter()
        .flat_map(|quality| [false, true].map(|robust| (quality, robust)))
        .map(|(quality, robust)| {
            let name = format!("{} {} robust={robust}", embree.version(), quality.name());
            (name, EmbreeScene::new(embree, mesh, quality, robust).unwrap())
        })
        .collect()
}

#[test]
fn own_kernels_give_the_exact_answer() {
    for embree in embrees() {
        for (mesh, seed) in [(soup(300, 0.4, 1), 2), (soup(2000, 0.05, 3), 4)] {
            for (name, scene) in scenes(&embree, &mesh) {
                check_rays(&name, &scene, &mesh, &rays(400, seed));
                check_void_rays(&name, &scene);
                assert_eq!(scene.bounds(), mesh.bounds(), "{name}");
                assert!(scene.bytes() > mesh.len() * 12, "{name}: {} bytes", scene.bytes());
                assert!(scene.commit_time().as_nanos() > 0);
            }
        }
    }
}

#[test]
fn trees_are_sound_and_cover_the_mesh() {
    for embree in embrees() {
        for mesh in [soup(1, 1.0, 1), soup(2, 1.0, 1), soup(3000, 0.1, 5), soup(2000, 1.0, 6)] {
            for quality in Quality::ALL {
                let built = embree.build_bvh(quality, &mesh).unwrap();
                let what = format!("{} {} {}", embree.version(), quality.name(), mesh.len());
                assert_eq!(validate(&built.bvh, &mesh), Ok(()), "{what}");
                assert_eq!(built.bvh.bounds(), mesh.bounds(), "{what}");
                if quality != Quality::High {
                    assert_eq!(built.bvh.prim_ids.len(), mesh.len(), "{what}");
                }
            }
        }
    }
}

#[test]
fn high_quality_splits_long_triangles() {
    // Long thin triangles across the cube: spatial splits pay.
    let mesh = soup(1500, 1.5, 7);
    for embree in embrees() {
        let sah = |bvh: &Bvh| niwaki_metrics::sah(bvh, &niwaki_core::SahConstants::THESIS_V);
        let medium = embree.build_bvh(Quality::Medium, &mesh).unwrap().bvh;
        let high = embree.build_bvh(Quality::High, &mesh).unwrap().bvh;
        assert!(high.prim_ids.len() > mesh.len(), "{} references", high.prim_ids.len());
        assert!(high.prim_ids.len() <= 2 * mesh.len(), "{} references", high.prim_ids.len());
        assert!(sah(&high) < sah(&medium), "{} against {}", sah(&high), sah(&medium));
        // Without room there are no splits.
        let settings =
            EmbreeBvhSettings { split_factor: 1.0, ..EmbreeBvhSettings::quality(Quality::High) };
        let tight = embree.build_bvh_with(&settings, &mesh).unwrap().bvh;
        assert_eq!(tight.prim_ids.len(), mesh.len());
        // Nor over boxes, whose contents are unknown.
        let boxes = embree
            .build_bvh_over(&EmbreeBvhSettings::quality(Quality::High), &mesh.prim_refs())
            .unwrap();
        assert_eq!(boxes.bvh.prim_ids.len(), mesh.len());
        assert_eq!(validate(&boxes.bvh, &mesh), Ok(()));
    }
}

#[test]
fn leaf_sizes_and_costs_are_obeyed() {
    let mesh = soup(3000, 0.1, 8);
    for embree in embrees() {
        for quality in Quality::ALL {
            let settings =
                EmbreeBvhSettings { max_leaf_size: 3, ..EmbreeBvhSettings::quality(quality) };
            let bvh = embree.build_bvh_with(&settings, &mesh).unwrap().bvh;
            let largest = bvh.nodes.iter().map(|node| node.count).max();
            assert!(largest <= Some(3), "{quality:?}: {largest:?}");
        }
        // Dear traversal makes larger leaves.
        let mut settings = EmbreeBvhSettings::default();
        let cheap = embree.build_bvh_with(&settings, &mesh).unwrap().bvh;
        settings.costs.inner = 20.0;
        let dear = embree.build_bvh_with(&settings, &mesh).unwrap().bvh;
        assert!(
            TreeStats::of(&dear).leaf_nodes < TreeStats::of(&cheap).leaf_nodes,
            "traversal cost is passed on"
        );
    }
}

#[test]
fn nothing_builds_and_is_missed() {
    let mesh = TriangleMesh::default();
    for embree in embrees() {
        for (name, scene) in scenes(&embree, &mesh) {
            let ray = Ray::new(Vec3::ZERO, Vec3::X);
            assert_eq!(scene.closest_hit(&ray), Hit::MISS, "{name}");
            assert!(!scene.any_hit(&ray), "{name}");
            assert_eq!(scene.bounds(), Aabb::EMPTY, "{name}");
        }
        for quality in Quality::ALL {
            assert_eq!(embree.build_bvh(quality, &mesh).unwrap().bvh, Bvh::default());
        }
    }
}

#[test]
fn degenerate_triangles_are_kept_and_harm_nobody() {
    let mesh = degenerate();
    let equal = TriangleMesh::from_triangles(&[mesh.triangle(3); 3000]).unwrap();
    for embree in embrees() {
        for mesh in [&mesh, &equal, &shrinking(300)] {
            for quality in Quality::ALL {
                let built = embree.build_bvh(quality, mesh).unwrap();
                let what = format!("{} {}", embree.version(), quality.name());
                assert_eq!(validate(&built.bvh, mesh), Ok(()), "{what}");
            }
        }
        for (name, scene) in scenes(&embree, &mesh) {
            let hit = scene.closest_hit(&Ray::new(Vec3::new(0.25, 0.25, -1.0), Vec3::Z));
            assert_eq!((hit.prim_id, hit.t), (4, 1.25), "{name}");
        }
    }
}

#[test]
fn scenes_outlive_the_handle_and_serve_many_threads() {
    let mesh = soup(500, 0.3, 9);
    let rays = rays(200, 10);
    for embree in embrees() {
        let scene = EmbreeScene::new(&embree, &mesh, Quality::Medium, false).unwrap();
        drop(embree);
        let expected: Vec<Hit> = rays.iter().map(|ray| scene.closest_hit(ray)).collect();
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    let mut hits = vec![Hit::MISS; rays.len()];
                    scene.closest_hits(&rays, &mut hits);
                    assert_eq!(hits, expected);
                });
            }
        });
    }
}

#[test]
fn memory_is_counted_and_given_back() {
    let mesh = soup(20_000, 0.05, 11);
    for embree in embrees() {
        let before = embree.memory();
        embree.reset_peak_memory();
        let scene = EmbreeScene::new(&embree, &mesh, Quality::Medium, false).unwrap();
        assert!(embree.memory() >= before + scene.bytes());
        assert!(embree.peak_memory() >= embree.memory());
        drop(scene);
        assert!(embree.memory() <= before, "{} of {before}", embree.memory());
    }
}

#[test]
fn an_unusable_library_is_named_with_cause_and_remedy() {
    let open = |library: &str| {
        let settings = EmbreeSettings { library: Some(library.into()), ..Default::default() };
        Embree::with_settings(&settings).unwrap_err()
    };
    let error = open("/nowhere/libembree4.so.4");
    assert!(matches!(&error, PeerError::BadLibrary { .. }), "{error:?}");
    let text = error.to_string();
    assert!(text.contains("/nowhere/libembree4.so.4") && text.contains("ci/setup-embree.sh"));
    if cfg!(target_os = "linux") {
        let text = open("libm.so.6").to_string();
        assert!(text.contains("libm.so.6") && text.contains("no function rtcNewDevice"), "{text}");
    }
}

#[test]
fn settings_and_input_out_of_range_are_refused() {
    let mesh = soup(10, 0.3, 12);
    for embree in embrees() {
        let good = EmbreeBvhSettings::default();
        let bad = [
            EmbreeBvhSettings { max_leaf_size: 33, ..good },
            EmbreeBvhSettings { max_leaf_size: 0, ..good },
            EmbreeBvhSettings { min_leaf_size: 0, ..good },
            EmbreeBvhSettings { min_leaf_size: 5, max_leaf_size: 4, ..good },
            EmbreeBvhSettings { sah_block_size: 0, ..good },
            EmbreeBvhSettings { max_depth: 0, ..good },
            EmbreeBvhSettings { split_factor: f32::NAN, ..good },
        ];
        for settings in bad {
            let error = embree.build_bvh_with(&settings, &mesh).unwrap_err();
            assert!(
                matches!(error, PeerError::Input(BuildError::BadSetting { .. })),
                "{settings:?}: {error}"
            );
        }
        let mut prims = mesh.prim_refs();
        prims[7] = PrimRef::new(Aabb::new(Vec3::NAN, Vec3::ONE), 7);
        let error = embree.build_bvh_over(&good, &prims).unwrap_err();
        assert!(
            matches!(error, PeerError::Input(BuildError::NonFiniteBounds { index: 7, .. })),
            "{error}"
        );
        let settings = EmbreeSettings {
            library: Some(embree.library().into()),
            config: "verbose=0\0".to_owned(),
            ..Default::default()
        };
        assert!(matches!(Embree::with_settings(&settings), Err(PeerError::Embree { .. })));
    }
}

#[test]
fn device_configuration_reaches_embree() {
    let mesh = soup(30_000, 0.05, 13);
    for embree in embrees() {
        let settings = EmbreeSettings {
            library: Some(embree.library().into()),
            threads: 1,
            config: "max_isa=sse2".to_owned(),
        };
        let narrow = Embree::with_settings(&settings).unwrap();
        let scene = EmbreeScene::new(&narrow, &mesh, Quality::Medium, false).unwrap();
        check_rays("max_isa=sse2", &scene, &mesh, &rays(50, 14));
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // Nodes of four children in place of eight show in the memory.
            let wide = EmbreeScene::new(&embree, &mesh, Quality::Medium, false).unwrap();
            assert_ne!(scene.bytes(), wide.bytes(), "{}", embree.version());
        }
    }
}

#[test]
#[cfg(target_arch = "x86_64")]
fn the_configuration_shows_in_the_vector_width() {
    for embree in embrees() {
        let width = |config: &str| {
            let settings = EmbreeSettings {
                library: Some(embree.library().into()),
                threads: 1,
                config: config.to_owned(),
            };
            Embree::with_settings(&settings).unwrap().vector_width()
        };
        // Distributions may compile Embree without packets or without the wider instructions.
        let Some(most) = width("") else {
            eprintln!("Embree {} was compiled without ray packets", embree.version());
            continue;
        };
        if embree.version().major == 4 && is_x86_feature_detected!("avx512vl") {
            assert_eq!(most, 16, "{}", embree.version());
        }
        for (config, limit) in [("max_isa=avx2", 8), ("max_isa=avx", 8), ("max_isa=sse4.2", 4)] {
            assert_eq!(width(config), Some(limit.min(most)), "{config} of {}", embree.version());
        }
    }
}

/// What [`EmbreeScene`] documents as different from this workspace's kernels.
#[test]
fn limits_are_as_documented() {
    let flat = |size: f32| {
        let t = Triangle::new(Vec3::ZERO, Vec3::X * size, Vec3::Y * size);
        TriangleMesh::from_triangles(&[t]).unwrap()
    };
    for embree in embrees() {
        for (name, scene) in scenes(&embree, &flat(1.0)) {
            let touching = Ray::new(Vec3::new(0.25, 0.25, 0.0), Vec3::Z);
            assert_eq!(scene.any_hit(&touching), name.ends_with("true"), "{name}: t at t_min");
            let at_end = Ray::new(Vec3::new(0.25, 0.25, -1.0), Vec3::Z).with_range(0.0, 1.0);
            assert!(scene.any_hit(&at_end), "{name}: t may equal t_max");
        }
        for (name, scene) in scenes(&embree, &flat(1.8e18)) {
            assert!(!scene.bounds().is_empty(), "{name}");
        }
        for (name, scene) in scenes(&embree, &flat(1.9e18)) {
            assert!(scene.bounds().is_empty(), "{name}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Coordinates from a coarse grid make equal, flat and zero-area triangles common.
    #[test]
    fn any_small_mesh_gives_sound_trees(
        count in 0_usize..60, grid in 1_u8..6, scale in -8_i32..8, seed in any::<u64>(),
    ) {
        let mut random = Random(seed);
        let mut corner = || (random.point() * f32::from(grid)).floor() * 10.0_f32.powi(scale);
        let triangles: Vec<Triangle> = (0..count)
            .map(|_| Triangle::new(corner(), corner(), corner()))
            .collect();
        let mesh = TriangleMesh::from_triangles(&triangles).unwrap();
        EMBREES.with(|embrees| {
            for embree in embrees {
                for quality in Quality::ALL {
                    let built = embree.build_bvh(quality, &mesh).unwrap();
                    assert_eq!(validate(&built.bvh, &mesh), Ok(()));
                }
            }
        });
    }
}

thread_local! {
    /// Loaded once for all cases of the property test.
    static EMBREES: Vec<Embree> = embrees();
}
