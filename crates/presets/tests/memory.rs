//! `memory_bound` holds, measured by an allocator that counts.

use niwaki_core::{Builder, TriangleMesh};
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

/// Small triangles, and some as large as the scene.
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
            preset.build_mesh(&mesh).unwrap();
            (PEAK.load(SeqCst) - before, preset.memory_bound(mesh.len()))
        });
        assert!(peak <= bound, "{preset}: {peak} bytes at once, {bound} promised");
    }
}
