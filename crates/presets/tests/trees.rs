//! Trees of all presets: valid on hard input, the same bytes on any number of threads.

use niwaki_core::glam::Vec3;
use niwaki_core::{BuildError, Builder, Bvh, SahConstants, Triangle, TriangleMesh};
use niwaki_metrics::{sah, validate};
use niwaki_presets::Preset;
use proptest::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Larger cases of the catalogue are built on two pools instead of four.
const MODERATE: usize = 20_000;

fn pools() -> Vec<ThreadPool> {
    let pool = |threads| ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    [1, 2, 3, 8].map(pool).into()
}

fn bytes(bvh: &Bvh) -> (&[u8], &[u8]) {
    (bytemuck::cast_slice(&bvh.nodes), bytemuck::cast_slice(&bvh.prim_ids))
}

/// The tree of a preset, the same on all pools.
fn same_everywhere(preset: Preset, mesh: &TriangleMesh, pools: &[ThreadPool], name: &str) -> Bvh {
    let mut trees = pools.iter().map(|pool| {
        let built = pool.install(|| preset.build_mesh(mesh));
        built.unwrap_or_else(|error| panic!("{preset} on {name}: {error}"))
    });
    let first = trees.next().unwrap();
    for other in trees {
        assert!(bytes(&first) == bytes(&other), "{preset} on {name}: threads show");
    }
    first
}

/// Small triangles, and some that are as large as the scene.
fn uneven(count: usize, seed: u64) -> TriangleMesh {
    let mut triangles = niwaki_hard_cases::soup(count, 0.02, seed);
    triangles.extend(niwaki_hard_cases::soup(count / 50, 0.7, seed + 1));
    TriangleMesh::from_triangles(&triangles).unwrap()
}

#[test]
fn hard_meshes_give_valid_trees_on_any_number_of_threads() {
    let pools = pools();
    for case in niwaki_hard_cases::meshes() {
        let pools = if case.mesh.len() > MODERATE { &pools[1..3] } else { &pools[..] };
        for preset in Preset::ALL {
            let bvh = same_everywhere(preset, &case.mesh, pools, case.name);
            assert_eq!(validate(&bvh, &case.mesh), Ok(()), "{preset} on {}", case.name);
        }
    }
}

#[test]
fn parallel_stages_do_not_show_threads() {
    // More triangles than any part of a preset leaves to one thread.
    let (mesh, pools) = (uneven(70_000, 1), pools());
    for preset in [Preset::Fastest, Preset::Fast, Preset::Balanced, Preset::High] {
        let bvh = same_everywhere(preset, &mesh, &pools, "uneven");
        assert_eq!(validate(&bvh, &mesh), Ok(()), "{preset}");
    }
    let mesh = uneven(20_000, 2);
    same_everywhere(Preset::Best, &mesh, &pools, "uneven");
}

#[test]
fn better_presets_give_trees_of_lower_cost() {
    let mesh = uneven(20_000, 3);
    let cost = |preset: Preset| sah(&preset.build_mesh(&mesh).unwrap(), &SahConstants::default());
    let costs = Preset::ALL.map(cost);
    assert!(costs.is_sorted_by(|worse, better| better < worse), "{costs:?}");
}

#[test]
fn a_preset_is_the_builder_it_stands_for() {
    let mesh = uneven(2000, 4);
    let prims = mesh.prim_refs();
    for preset in Preset::ALL {
        let builder = preset.builder();
        assert_eq!(preset.build_mesh(&mesh), builder.build_mesh(&mesh));
        assert_eq!(preset.build(&prims), builder.build(&prims));
        assert_eq!(preset.memory_bound(5000), builder.memory_bound(5000));
        assert_eq!(Preset::by_name(Builder::name(&preset)), Some(preset));
    }
    assert_eq!(Preset::by_name("bonsai_p"), None);
}

#[test]
fn references_that_are_not_finite_are_refused_by_index() {
    let mut prims = uneven(500, 5).prim_refs();
    prims[123].max.y = f32::INFINITY;
    for preset in Preset::ALL {
        let error = preset.build(&prims).unwrap_err();
        assert!(
            matches!(error, BuildError::NonFiniteBounds { index: 123, .. }),
            "{preset}: {error}"
        );
    }
}

fn triangles() -> impl Strategy<Value = Vec<Triangle>> {
    let coordinate = prop_oneof![-1.0_f32..1.0, Just(0.0), -1e-20_f32..1e-20, -1e20_f32..1e20];
    let corner = prop::array::uniform3(coordinate).prop_map(Vec3::from);
    let triangle = prop::array::uniform3(corner).prop_map(|[v0, v1, v2]| Triangle { v0, v1, v2 });
    prop::collection::vec(triangle, 0..200)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_finite_triangles_give_valid_trees(triangles in triangles()) {
        let mesh = TriangleMesh::from_triangles(&triangles).unwrap();
        for preset in Preset::ALL {
            let bvh = preset.build_mesh(&mesh).unwrap();
            prop_assert_eq!(validate(&bvh, &mesh), Ok(()), "{}", preset);
        }
    }
}
