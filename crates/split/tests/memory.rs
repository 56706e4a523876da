//! The bounds on memory, measured by an allocator that counts.

use niwaki_hard_cases::counting;

use niwaki_core::glam::Vec3;
use niwaki_core::{Triangle, TriangleMesh};
use niwaki_split::{EarlySplit, EdgeVolume, KarrasAila, PreSplitter, SlackSplit, SplitPartition};

#[global_allocator]
static ALLOCATOR: counting::Counting = counting::Counting;

/// Long triangles that all overlap each other.
fn diagonals(count: u32) -> TriangleMesh {
    let triangles: Vec<Triangle> = (0..count)
        .map(|i| {
            let a = i as f32 * 0.01;
            let across = Vec3::new(2000.0 - a, 2000.0, 2000.0);
            Triangle::new(Vec3::new(a, 0.0, -a), across, Vec3::new(a + 3.0, 1.0, a))
        })
        .collect();
    TriangleMesh::from_triangles(&triangles).unwrap()
}

#[test]
fn peaks_stay_within_the_bounds() {
    let meshes = [
        niwaki_hard_cases::soup_mesh(1000, 0.2, 1),
        niwaki_hard_cases::soup_mesh(70_000, 0.05, 1),
        diagonals(20_000),
        diagonals(70_000),
    ];
    let splitters: [Box<dyn PreSplitter>; 8] = [
        Box::new(SplitPartition::default()),
        Box::new(SplitPartition { max_extra: 0.1, ..SplitPartition::default() }),
        Box::new(SplitPartition { max_extra: 3.0, ..SplitPartition::default() }),
        Box::new(EarlySplit { max_area: 1e-7, max_extra: 0.5 }),
        Box::new(EdgeVolume { max_volume: 1e-9, max_extra: 0.5 }),
        Box::new(KarrasAila::default()),
        Box::new(SlackSplit::default()),
        Box::new(SlackSplit {
            max_ratio: 1.0,
            max_ratio_largest: 1.0,
            min_area: 1e-2,
            planes: 1,
            ..SlackSplit::default()
        }),
    ];
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    for mesh in &meshes {
        for splitter in &splitters {
            // Once for what the pool allocates on first use.
            pool.install(|| splitter.split_mesh(mesh)).unwrap();
            let (result, peak) = counting::peak(|| pool.install(|| splitter.split_mesh(mesh)));
            let bound = pool.install(|| splitter.memory_bound(mesh.len()));
            let count = result.unwrap().len();
            let what = format!("{} of {}: {peak} of {bound}", splitter.suffix(), mesh.len());
            println!("{what}, {count} references");
            assert!(count <= splitter.max_references(mesh.len()), "{what}");
            assert!(peak <= bound, "{what}");
            // A bound far above the use would be true and useless; this one is for the worst.
            if mesh.len() > 65_536 {
                assert!(bound < 8 * peak, "{what}");
            }
        }
    }
}
