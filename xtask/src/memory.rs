//! A global allocator that can count, so that the peak memory of a build is a measured number.
//!
//! Counting is off while anything is timed: then an allocation costs one relaxed load more.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicBool, AtomicIsize, Ordering::Relaxed};

/// The system's allocator, with counters beside it.
struct Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

static ENABLED: AtomicBool = AtomicBool::new(false);
static LIVE: AtomicIsize = AtomicIsize::new(0);
static PEAK: AtomicIsize = AtomicIsize::new(0);

#[inline]
fn grow(bytes: usize) {
    if ENABLED.load(Relaxed) {
        // Sizes of allocations never exceed isize::MAX.
        let bytes = bytes.cast_signed();
        PEAK.fetch_max(LIVE.fetch_add(bytes, Relaxed) + bytes, Relaxed);
    }
}

#[inline]
fn shrink(bytes: usize) {
    if ENABLED.load(Relaxed) {
        LIVE.fetch_sub(bytes.cast_signed(), Relaxed);
    }
}

// SAFETY: every call is forwarded unchanged to the system's allocator, which fulfils the
// contract; the counters do not touch the memory.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        grow(layout.size());
        // SAFETY: the caller's promise about `layout` is the one that `System` asks for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        grow(layout.size());
        // SAFETY: as in `alloc`.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, ptr: *mut u8, layout: Layout) {
        shrink(layout.size());
        // SAFETY: `ptr` came from `System` with this layout, as all blocks here do.
        unsafe { System.dealloc(ptr, layout) }
    }

    unsafe fn realloc(&self, ptr: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        // The old block may live until its bytes are copied, so both count for a moment.
        grow(new_size);
        shrink(layout.size());
        // SAFETY: as in `dealloc`; the caller vouches for `new_size`.
        unsafe { System.realloc(ptr, layout, new_size) }
    }
}

/// Runs `work` and returns its result with the most bytes that were allocated at once beyond
/// those before it. Whatever other threads allocate meanwhile counts too, so nothing else should
/// run; calls must not overlap.
pub(crate) fn peak_of<T>(work: impl FnOnce() -> T) -> (T, usize) {
    LIVE.store(0, Relaxed);
    PEAK.store(0, Relaxed);
    ENABLED.store(true, Relaxed);
    let result = work();
    ENABLED.store(false, Relaxed);
    (result, PEAK.load(Relaxed).max(0).unsigned_abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_peak_counts_what_lived_at_once() {
        const MIB: usize = 1 << 20;
        let (kept, peak) = peak_of(|| {
            let kept = vec![1u8; 8 * MIB];
            for _ in 0..10 {
                drop(std::hint::black_box(vec![1u8; 16 * MIB]));
            }
            kept
        });
        assert_eq!(kept.len(), 8 * MIB);
        // Other tests of this program run beside this one and may allocate a little.
        assert!((24 * MIB..40 * MIB).contains(&peak), "{peak}");
    }
}
