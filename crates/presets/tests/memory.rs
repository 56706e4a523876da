//! The bound on memory, measured with a counting allocator.

use niwaki_hard_cases::counting;

use niwaki_core::{Builder, TriangleMesh};
use niwaki_presets::Preset;

#[global_allocator]
static ALLOCATOR: counting::Counting = counting::Counting;

#[test]
fn peak_memory_stays_within_the_bound() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    for count in [0, 1, 1000, 60_000] {
        // Small triangles, and some as large as the scene.
        let mut triangles = niwaki_hard_cases::soup(count, 0.01, 1);
        triangles.extend(niwaki_hard_cases::soup(count / 60, 0.7, 2));
        let mesh = TriangleMesh::from_triangles(&triangles).unwrap();
        for preset in Preset::ALL {
            let (bvh, peak) = pool.install(|| counting::peak(|| preset.build_mesh(&mesh).unwrap()));
            let bound = pool.install(|| preset.memory_bound(mesh.len()));
            assert!(peak <= bound, "{preset}, {count}: {peak} bytes at once, {bound} promised");
            assert!(bvh.bytes() <= peak, "{preset}, {count}: the allocator did not count");
        }
    }
}
