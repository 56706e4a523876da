//! `memory_bound` holds, measured by an allocator that counts.

use niwaki_build_bonsai::Bonsai;
use niwaki_build_sbvh::Sbvh;
use niwaki_core::{Builder, BvhNode, TriangleMesh};
use niwaki_optimize::{Optimizer, Reinsertion};
use niwaki_presets::Preset;
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};

struct Counting;

static NOW: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

// SAFETY: passes everything on to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        PEAK.fetch_max(NOW.fetch_add(layout.size(), SeqCst) + layout.size(), SeqCst);
        // SAFETY: as asked.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        PEAK.fetch_max(NOW.fetch_add(layout.size(), SeqCst) + layout.size(), SeqCst);
        // SAFETY: as asked.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), SeqCst);
        // SAFETY: as asked.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Small triangles, and some as large as the scene, which are split.
fn uneven() -> TriangleMesh {
    let mut triangles = niwaki_hard_cases::soup(60_000, 0.01, 1);
    triangles.extend(niwaki_hard_cases::soup(1000, 0.7, 2));
    TriangleMesh::from_triangles(&triangles).unwrap()
}

#[test]
fn bounds_hold() {
    let mesh = uneven();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    for preset in Preset::ALL {
        let (peak, bound) = pool.install(|| {
            let before = NOW.load(SeqCst);
            PEAK.store(before, SeqCst);
            let bvh = preset.build_mesh(&mesh).unwrap();
            assert!(preset < Preset::Balanced || bvh.prim_ids.len() > mesh.len(), "{preset}");
            (PEAK.load(SeqCst) - before, preset.memory_bound(mesh.len()))
        });
        assert!(peak <= bound, "{preset}: {peak} bytes at once, {bound} promised");
    }
}

/// The measured mesh does not use up the room for splits; the bound has to hold where one does.
#[test]
fn bounds_count_the_references_that_splitting_may_add() {
    let count = 1_000_000;
    let split = Bonsai::bonsai_s().split.unwrap();
    for (preset, most) in [
        (Preset::High, split.max_references(count)),
        (Preset::Best, Sbvh::sweep().reference_bound(count)),
    ] {
        assert!(most > count, "{preset}");
        let nodes = 2 * most - 1;
        let tree = nodes * size_of::<BvhNode>() + most * size_of::<u32>();
        let pass = Reinsertion::default().memory_bound(nodes, most);
        let bound = preset.memory_bound(count);
        assert!(tree + pass <= bound, "{preset}: {bound} bytes for a tree of {most} references");
    }
}
