//! Batches, masks, and what may cross threads.

mod common;

use common::{bits, random_rays};
use niwaki_core::{Hit, Ray};
use niwaki_hard_cases::{median_tree, soup_mesh};
use niwaki_trace::{
    Batches, BinaryScene, Counts, CustomScene, Kernel, LengthMismatch, MaskedScene, MeshQueries,
    NearestPoint, SceneError, WideScene, brute_force_all,
};

#[test]
fn batches_equal_single_rays_for_any_number_of_threads() {
    let mesh = soup_mesh(400, 0.4, 2);
    let scene = WideScene::new(&median_tree(&mesh, 2), &mesh).unwrap();
    for count in [0, 1, 1023, 1025, 5000] {
        let rays = random_rays(count, 3);
        let expected: Vec<_> = brute_all(&scene, &rays);
        for threads in [1, 2, 5] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut hits = vec![Hit::MISS; count];
            let mut flags = vec![false; count];
            pool.install(|| {
                scene.par_closest_hits(&rays, &mut hits).unwrap();
                scene.par_any_hits(&rays, &mut flags).unwrap();
            });
            assert!(hits.iter().map(bits).eq(expected.iter().map(bits)));
            assert!(flags.iter().copied().eq(expected.iter().map(Hit::is_hit)));
        }
        let mut hits = vec![Hit::MISS; count];
        let mut flags = vec![false; count];
        scene.try_closest_hits(&rays, &mut hits).unwrap();
        scene.try_any_hits(&rays, &mut flags).unwrap();
        assert!(hits.iter().map(bits).eq(expected.iter().map(bits)));
        assert!(flags.iter().copied().eq(expected.iter().map(Hit::is_hit)));
    }
}

fn brute_all(scene: &WideScene, rays: &[Ray]) -> Vec<Hit> {
    use niwaki_core::Intersector as _;
    rays.iter().map(|ray| scene.closest_hit(ray)).collect()
}

#[test]
fn unequal_lengths_are_an_error_and_nothing_is_written() {
    let mesh = soup_mesh(10, 0.9, 2);
    let scene = BinaryScene::new(&median_tree(&mesh, 2), &mesh).unwrap();
    let rays = random_rays(8, 3);
    let sentinel = Hit { t: -7.0, u: 0.0, v: 0.0, prim_id: 77 };
    for answers in [0, 7, 9] {
        let expected = Err(LengthMismatch { rays: 8, answers });
        let (mut hits, mut flags) = (vec![sentinel; answers], vec![true; answers]);
        assert_eq!(scene.try_closest_hits(&rays, &mut hits), expected);
        assert_eq!(scene.par_closest_hits(&rays, &mut hits), expected);
        assert_eq!(scene.try_any_hits(&rays, &mut flags), expected);
        assert_eq!(scene.par_any_hits(&rays, &mut flags), expected);
        assert!(hits.iter().all(|hit| *hit == sentinel) && flags.iter().all(|flag| *flag));
    }
    assert_eq!(
        LengthMismatch { rays: 8, answers: 9 }.to_string(),
        "8 rays, but room for 9 answers"
    );
}

#[test]
fn masks_equal_brute_force_over_the_visible() {
    let mesh = soup_mesh(300, 0.7, 5);
    // Triangles past the masks are visible to every ray that sees anything.
    let masks: Vec<u32> = (0..250).map(|i| [1, 2, 4, 6, 0, u32::MAX, 1 << 31][i % 7]).collect();
    let wide = WideScene::new(&median_tree(&mesh, 2), &mesh).unwrap();
    let mut hidden = 0;
    for kernel in WideScene::<8>::kernels() {
        let scene = wide.clone().with_kernel(kernel).unwrap();
        let mut masked = MaskedScene::new(scene, masks.clone());
        for ray in random_rays(200, 8) {
            let all = brute_force_all(&mesh, &ray);
            for mask in [0, 1, 2, 6, 8, 1 << 31, u32::MAX] {
                let sees = |hit: &&Hit| {
                    masks.get(hit.prim_id as usize).copied().unwrap_or(u32::MAX) & mask != 0
                };
                let visible: Vec<Hit> = all.iter().filter(sees).copied().collect();
                let expected = visible.first().copied().unwrap_or(Hit::MISS);
                assert_eq!(bits(&masked.closest_hit(&ray, mask)), bits(&expected), "{kernel}");
                assert_eq!(masked.any_hit(&ray, mask), expected.is_hit(), "{kernel}");
                let mut hits = Vec::new();
                masked.all_hits(&ray, mask, &mut hits);
                assert_eq!(hits, visible);
                hidden += usize::from(!all.is_empty() && visible.is_empty() && mask != 0);
            }
        }
        masked.masks_mut().fill(0);
        let seen_always = |ray: &Ray| masked.closest_hit(ray, 1);
        assert!(random_rays(200, 8).iter().map(seen_always).all(|hit| hit.prim_id >= 250));
    }
    assert!(hidden > 20, "{hidden} rays see nothing for their masks alone");
}

#[test]
fn everything_is_send_and_sync() {
    const fn check<T: Send + Sync>() {}
    const {
        check::<BinaryScene>();
        check::<WideScene<4>>();
        check::<WideScene<8>>();
        check::<WideScene<16>>();
        check::<MaskedScene<WideScene>>();
        check::<CustomScene<fn(u32, &Ray) -> Option<Hit>>>();
        check::<MeshQueries<'_>>();
        check::<NearestPoint>();
        check::<Kernel>();
        check::<Counts>();
        check::<SceneError>();
        check::<LengthMismatch>();
    }
}
