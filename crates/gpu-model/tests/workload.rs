//! The sampled workload: against its definition, at the edges, and on its thread.

use niwaki_build_binned::Binned;
use niwaki_core::{Builder, Bvh, BvhNode, Hit, Ray, TriangleMesh, glam::Vec3};
use niwaki_gpu_model::{
    Workload,
    workload::{
        Background, BackgroundSampler, CountingKernel, LightSample, Pattern, SampledScene,
        Sampling, View,
    },
};
use niwaki_trace::{BinaryScene, Counts, Walk, WideScene};
use std::sync::{
    Arc, Mutex,
    atomic::{AtomicU32, Ordering},
    mpsc::{Receiver, SyncSender, sync_channel},
};

const PATTERNS: [Pattern; 4] =
    [Pattern::Regular, Pattern::Jittered, Pattern::LowDiscrepancy, Pattern::Blocks];

/// A floor of small triangles with boxes on it.
fn city() -> (TriangleMesh, Bvh) {
    let mut random = fastrand::Rng::with_seed(7);
    let (mut corners, mut indices) = (Vec::new(), Vec::new());
    let mut quad = |a: Vec3, u: Vec3, v: Vec3| {
        let first = u32::try_from(corners.len()).unwrap();
        corners.extend([a, a + u, a + u + v, a + v]);
        indices.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    };
    for x in 0..60_u16 {
        for z in 0..60_u16 {
            let at = Vec3::new(f32::from(x), 0.0, f32::from(z));
            quad(at, Vec3::X, Vec3::Z);
            if random.f32() < 0.2 {
                let height = 0.5 + 4.0 * random.f32();
                let (w, d) = (Vec3::X * 0.7, Vec3::Z * 0.7);
                let up = Vec3::Y * height;
                quad(at + up, w, d);
                quad(at, w, up);
                quad(at + d, w, up);
                quad(at, d, up);
                quad(at + w, d, up);
            }
        }
    }
    let mesh = TriangleMesh::new(corners, indices).unwrap();
    let bvh = Binned::default().build_mesh(&mesh).unwrap();
    (mesh, bvh)
}

fn view() -> View {
    View::look_at(Vec3::new(-5.0, 8.0, -5.0), Vec3::new(30.0, 0.0, 30.0), Vec3::Y, 1.0, 16.0 / 9.0)
}

/// One triangle in front of everything, in one leaf.
fn wall() -> (TriangleMesh, BinaryScene) {
    let corners = vec![Vec3::new(-9.0, -9.0, 0.0), Vec3::new(9.0, -9.0, 0.0), Vec3::Y * 99.0];
    let mesh = TriangleMesh::new(corners, vec![[0, 1, 2]]).unwrap();
    let bvh = Bvh { nodes: vec![BvhNode::leaf(mesh.bounds(), 0, 1)], prim_ids: vec![0] };
    let scene = BinaryScene::new(&bvh, &mesh).unwrap();
    (mesh, scene)
}

fn toward_wall() -> View {
    View::look_at(Vec3::new(0.0, 1.0, 3.0), Vec3::new(0.0, 1.0, 0.0), Vec3::Y, 0.8, 1.0)
}

#[test]
fn sums_are_those_of_the_rays() {
    let (mesh, bvh) = city();
    let scene = BinaryScene::new(&bvh, &mesh).unwrap();
    let sampling = Sampling {
        pattern: Pattern::Regular,
        width: 16,
        height: 9,
        lights: vec![LightSample::Directional(Vec3::NEG_Y)],
        ..Sampling::default()
    };
    let workload = sampling.sample(&scene, &mesh, &view());
    let (mut counts, mut hits) = (Counts::default(), 0_u32);
    for y in 0..9_u16 {
        for x in 0..16_u16 {
            let ray = view().ray((f32::from(x) + 0.5) / 16.0, (f32::from(y) + 0.5) / 9.0);
            let (hit, own) = scene.closest_hit_counted(&ray);
            counts += own;
            hits += u32::from(hit.is_hit());
        }
    }
    let pixels = 144.0;
    assert_eq!(workload.samples, 144);
    assert_eq!(workload.primary_traversals, counts.nodes as f64 / pixels);
    assert_eq!(workload.primary_intersections, counts.triangles as f64 / pixels);
    assert_eq!(workload.visible_triangles, f64::from(hits) / pixels);
    assert!(workload.ao_traversals > 0.0 && workload.ao_intersections > 0.0);
    // Walls take no ray of a light from above.
    assert!(workload.shadow_traversals > 0.0);
    assert!(workload.shadow_rays > 0.0 && workload.shadow_rays < workload.visible_triangles);
    assert!(workload.check().is_ok() && !workload.is_empty());
}

/// A ray from a wall must leave it: endless AO rays from a convex surface hit nothing and test
/// nothing but what they start from.
#[test]
fn ao_rays_of_a_wall_meet_nothing() {
    let (mesh, scene) = wall();
    for scale in [1e-6, 1.0, 1e6] {
        let corners = mesh.positions().iter().map(|&v| v * scale + Vec3::splat(scale * 3.0));
        let mesh = TriangleMesh::new(corners.collect(), vec![[0, 1, 2]]).unwrap();
        let bvh = Bvh { nodes: vec![BvhNode::leaf(mesh.bounds(), 0, 1)], prim_ids: vec![0] };
        let kernel =
            Recorder { scene: BinaryScene::new(&bvh, &mesh).unwrap(), hits: Mutex::default() };
        let from = Vec3::new(3.0, 4.0, 6.0) * scale;
        let view = View::look_at(from, from - Vec3::Z * scale, Vec3::Y, 0.8, 1.0);
        let workload = Sampling { ao_rays: 4, ..Sampling::default() }.sample(&kernel, &mesh, &view);
        assert_eq!(workload.visible_triangles, 1.0, "{scale}");
        let hits = kernel.hits.lock().unwrap();
        assert_eq!((hits.len(), hits.iter().filter(|&&hit| hit).count()), (4 * 576, 0), "{scale}");
    }
    // One leaf for all: every ray ends where the first did.
    let workload = Sampling::default().sample(&scene, &mesh, &toward_wall());
    assert_eq!(workload.coalescing, 1.0);
    assert_eq!(workload.primary_intersections, 1.0);
}

struct Recorder {
    scene: BinaryScene,
    hits: Mutex<Vec<bool>>,
}

impl CountingKernel for Recorder {
    fn closest(&self, ray: &Ray) -> (Hit, Walk) {
        CountingKernel::closest(&self.scene, ray)
    }
    fn any(&self, ray: &Ray) -> (bool, Counts) {
        let answer = CountingKernel::any(&self.scene, ray);
        self.hits.lock().unwrap().push(answer.0);
        answer
    }
}

#[test]
fn views_of_nothing_are_empty_and_no_nan() {
    let (mesh, bvh) = city();
    let scene = BinaryScene::new(&bvh, &mesh).unwrap();
    let away =
        View::look_at(Vec3::new(-5.0, 8.0, -5.0), Vec3::new(-40.0, 90.0, -40.0), Vec3::Y, 0.5, 1.0);
    let nothing = TriangleMesh::default();
    let empty = BinaryScene::new(&Bvh::default(), &nothing).unwrap();
    for pattern in PATTERNS {
        let sampling =
            Sampling { pattern, lights: vec![LightSample::Point(Vec3::Y)], ..Sampling::default() };
        for workload in
            [sampling.sample(&scene, &mesh, &away), sampling.sample(&empty, &nothing, &away)]
        {
            assert!(workload.is_empty() && workload.check().is_ok(), "{workload:?}");
            let zeros = [
                workload.ao_traversals,
                workload.ao_intersections,
                workload.shadow_traversals,
                workload.shadow_intersections,
                workload.visible_triangles,
            ];
            assert_eq!(zeros, [0.0; 5]);
        }
    }
    // Settings of nothing, and views that are no views.
    let none = Sampling {
        width: 0,
        height: 0,
        region: 0,
        ao_rays: 0,
        frame: [0, 0],
        ..Sampling::default()
    };
    for pattern in PATTERNS {
        let workload = Sampling { pattern, ..none.clone() }.sample(&scene, &mesh, &view());
        assert!(workload.check().is_ok() && workload.samples == 1);
    }
    let nan = View { position: Vec3::NAN, ..view() };
    assert!(Sampling::default().sample(&scene, &mesh, &nan).is_empty());
}

/// All patterns estimate the same sums, which the workload of every pixel of a frame shows.
#[test]
fn patterns_are_near_the_truth() {
    let (mesh, bvh) = city();
    let scene = WideScene::<8>::new(&bvh, &mesh).unwrap();
    let base = Sampling { frame: [320, 180], ..Sampling::default() };
    let truth = Sampling { width: 320, height: 180, pattern: Pattern::Regular, ..base.clone() };
    let truth = truth.sample(&scene, &mesh, &view());
    for pattern in PATTERNS {
        let got = Sampling { pattern, width: 64, height: 36, ..base.clone() }.sample(
            &scene,
            &mesh,
            &view(),
        );
        for (a, b) in [
            (got.primary_traversals, truth.primary_traversals),
            (got.primary_intersections, truth.primary_intersections),
            (got.visible_triangles, truth.visible_triangles),
            (got.ao_traversals, truth.ao_traversals),
            (got.ao_intersections, truth.ao_intersections),
        ] {
            // 2304 rays, in blocks 144 places: 4 and 12 % are three deviations and more.
            let within = if pattern == Pattern::Blocks { 0.2 } else { 0.08 };
            assert!((a - b).abs() <= within * b, "{pattern:?}: {a} is not near {b}");
        }
    }
    // Adjacent pixels coalesce more than those that are 20 pixels apart.
    let with =
        |pattern| Sampling { pattern, ..base.clone() }.sample(&scene, &mesh, &view()).coalescing;
    assert!(with(Pattern::Blocks) > with(Pattern::Regular));
}

#[test]
fn a_seed_is_a_workload() {
    let (mesh, bvh) = city();
    let scene = BinaryScene::new(&bvh, &mesh).unwrap();
    for pattern in PATTERNS {
        let with =
            |seed| Sampling { pattern, seed, ..Sampling::default() }.sample(&scene, &mesh, &view());
        assert_eq!(with(3), with(3));
        assert_ne!(with(3), with(4), "{pattern:?}");
    }
}

#[test]
fn regions_of_one_ray_have_nothing_to_share() {
    let (mesh, scene) = wall();
    let sampling = Sampling { region: 1, pattern: Pattern::Regular, ..Sampling::default() };
    assert_eq!(sampling.sample(&scene, &mesh, &toward_wall()).coalescing, 0.0);
}

#[test]
fn shorter_ao_rays_do_less() {
    let (mesh, bvh) = city();
    let scene = BinaryScene::new(&bvh, &mesh).unwrap();
    let with =
        |ao_radius| Sampling { ao_radius, ..Sampling::default() }.sample(&scene, &mesh, &view());
    assert!(with(0.5).ao_traversals < with(f32::INFINITY).ao_traversals);
}

/// A kernel that waits for leave before each row of rays and tells that it has begun.
struct Gate {
    scene: BinaryScene,
    begun: Mutex<SyncSender<()>>,
    leave: Mutex<Receiver<()>>,
}

/// A kernel that counts its rays.
struct Counting<'a> {
    scene: BinaryScene,
    begun: &'a AtomicU32,
}

impl CountingKernel for Counting<'_> {
    fn closest(&self, ray: &Ray) -> (Hit, Walk) {
        self.begun.fetch_add(1, Ordering::Relaxed);
        CountingKernel::closest(&self.scene, ray)
    }
    fn any(&self, ray: &Ray) -> (bool, Counts) {
        CountingKernel::any(&self.scene, ray)
    }
}

impl CountingKernel for Gate {
    fn closest(&self, ray: &Ray) -> (Hit, Walk) {
        let _ = self.begun.lock().unwrap().send(());
        let _ = self.leave.lock().unwrap().recv();
        CountingKernel::closest(&self.scene, ray)
    }
    fn any(&self, ray: &Ray) -> (bool, Counts) {
        CountingKernel::any(&self.scene, ray)
    }
}

fn wait_for(sampler: &BackgroundSampler, frame: u64) -> Workload {
    loop {
        if let Some(sampled) = sampler.newest().filter(|sampled| sampled.frame >= frame) {
            return sampled.answer;
        }
        assert!(sampler.is_running());
        std::thread::yield_now();
    }
}

#[test]
fn the_thread_samples_what_the_caller_would() {
    let (mesh, bvh) = city();
    let scene = BinaryScene::new(&bvh, &mesh).unwrap();
    let sampling = Sampling::default();
    let expected = sampling.sample(&scene, &mesh, &view());
    let scene = SampledScene { kernel: Arc::new(scene), mesh: Arc::new(mesh) };
    let sampler = BackgroundSampler::spawn(scene, sampling).unwrap();
    assert_eq!(sampler.newest(), None);
    sampler.submit(1, view());
    assert_eq!(wait_for(&sampler, 1), expected);
    // Another scene and other settings.
    let (mesh, scene) = wall();
    sampler.set_scene(SampledScene { kernel: Arc::new(scene), mesh: Arc::new(mesh) });
    sampler.set_sampling(Sampling { width: 8, height: 8, ..Sampling::default() });
    sampler.submit(2, toward_wall());
    let workload = wait_for(&sampler, 2);
    assert_eq!((workload.samples, workload.coalescing), (64, 1.0));
}

#[test]
fn submitting_never_waits_and_the_newest_counts() {
    let (mesh, scene) = wall();
    let (begun, has_begun) = sync_channel(1 << 10);
    let (let_go, leave) = sync_channel(1 << 10);
    let gate = Gate { scene, begun: Mutex::new(begun), leave: Mutex::new(leave) };
    let scene = SampledScene { kernel: Arc::new(gate), mesh: Arc::new(mesh) };
    let sampling = Sampling { width: 2, height: 2, ao_rays: 0, ..Sampling::default() };
    let sampler = BackgroundSampler::spawn(scene, sampling).unwrap();
    // Dropped before the sampler, which would else wait for leave when the test fails.
    let let_go = let_go;
    sampler.submit(1, toward_wall());
    has_begun.recv().unwrap();
    // It is in the middle of the first ray, and stays there.
    for frame in 2..100 {
        sampler.submit(frame, toward_wall());
        assert_eq!(sampler.newest(), None);
    }
    for _ in 0..8 {
        let_go.send(()).unwrap();
    }
    wait_for(&sampler, 99);
    // Two views were sampled, of four rays each: the first and the newest.
    assert_eq!(has_begun.try_iter().count(), 7);
}

#[test]
fn sampling_ends_after_a_row() {
    let (mesh, scene) = wall();
    let begun = AtomicU32::new(0);
    let kernel = Counting { scene, begun: &begun };
    let sampling = Sampling { width: 2, height: 8, ao_rays: 0, ..Sampling::default() };
    let mut rows = 3;
    let go_on = || {
        rows -= 1;
        rows >= 0
    };
    assert_eq!(sampling.sample_while(&kernel, &mesh, &toward_wall(), go_on), None);
    assert_eq!(begun.load(Ordering::Relaxed), 3 * 2);
}

/// Dropped in the middle of a view, the sampler does not see it through.
#[test]
fn dropping_ends_the_view_under_way() {
    const ROWS: u32 = 10_000;
    let (mesh, scene) = wall();
    let (begun, has_begun) = sync_channel(2 * ROWS as usize);
    let (let_go, leave) = sync_channel(0);
    let gate = Gate { scene, begun: Mutex::new(begun), leave: Mutex::new(leave) };
    let scene = SampledScene { kernel: Arc::new(gate), mesh: Arc::new(mesh) };
    let sampling = Sampling { width: 2, height: ROWS, ao_rays: 0, ..Sampling::default() };
    let sampler = BackgroundSampler::spawn(scene, sampling).unwrap();
    sampler.submit(1, toward_wall());
    has_begun.recv().unwrap();
    let dropping = std::thread::spawn(move || drop(sampler));
    // A ray a millisecond at most: all of them would take much longer than any thread waits for its turn.
    while !dropping.is_finished() && let_go.send(()).is_ok() {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    dropping.join().unwrap();
    assert!(has_begun.try_iter().count() < ROWS as usize);
}

/// Dropped in the middle of an answer, it lets it know, and returns when it is over.
#[test]
fn dropping_tells_the_answer_under_way() {
    let (begun, has_begun) = sync_channel(1);
    let (ended, has_ended) = sync_channel(1);
    let worker = Background::spawn("a test's", move |(): &(), go_on| {
        begun.send(()).unwrap();
        while go_on() {
            std::thread::yield_now();
        }
        ended.send(()).unwrap();
        None::<()>
    })
    .unwrap();
    worker.submit(1, ());
    has_begun.recv().unwrap();
    assert!(has_ended.try_recv().is_err());
    drop(worker);
    assert_eq!(has_ended.try_recv(), Ok(()));
}

struct Broken;

impl CountingKernel for Broken {
    fn closest(&self, _: &Ray) -> (Hit, Walk) {
        panic!("a kernel of the test's that breaks")
    }
    fn any(&self, _: &Ray) -> (bool, Counts) {
        (false, Counts::default())
    }
}

#[test]
fn a_kernel_that_panics_ends_the_thread_alone() {
    let scene = SampledScene { kernel: Arc::new(Broken), mesh: Arc::new(TriangleMesh::default()) };
    let sampler = BackgroundSampler::spawn(scene, Sampling::default()).unwrap();
    sampler.submit(1, toward_wall());
    while sampler.is_running() {
        std::thread::yield_now();
    }
    assert_eq!(sampler.newest(), None);
    sampler.submit(2, toward_wall());
}

/// Threads of a warp wait for the ray that takes longest: none do before a wall, and before half a wall
/// half of them do.
#[test]
fn divergence_is_what_the_longest_ray_takes() {
    let (mesh, scene) = wall();
    let sampling = Sampling { pattern: Pattern::Regular, ..Sampling::default() };
    let workload = sampling.sample(&scene, &mesh, &toward_wall());
    assert_eq!((workload.primary_divergence, workload.secondary_divergence), (0.0, 0.0));
    let (mesh, bvh) = city();
    let scene = BinaryScene::new(&bvh, &mesh).unwrap();
    let of = |region, pattern| {
        let sampling = Sampling { region, pattern, width: 64, height: 36, ..Sampling::default() };
        sampling.sample(&scene, &mesh, &view())
    };
    // A ray waits for itself alone.
    let alone = of(1, Pattern::Regular);
    assert_eq!((alone.primary_divergence, alone.secondary_divergence), (0.0, 0.0));
    let (near, far) = (of(4, Pattern::Blocks), of(4, Pattern::Regular));
    assert!(near.primary_divergence > 0.0 && near.secondary_divergence > near.primary_divergence);
    // Pixels that lie further apart have less in common.
    assert!(far.primary_divergence > near.primary_divergence, "{far:?} {near:?}");
}
