//! The stack of the SIMD kernels.

use std::mem::MaybeUninit;

/// Entries on the thread's stack; enough for 71 levels of an 8-wide tree.
const ARRAY: usize = 504;
/// Whole vectors are stored, so that some lanes go past the last entry.
const SLACK: usize = 16;

/// Entries without values on the thread's stack.
pub(crate) type Entries = [MaybeUninit<u32>; ARRAY + SLACK];

/// Nothing, in place: a constructor that returned this would copy it.
pub(crate) const UNINIT: Entries = [MaybeUninit::uninit(); ARRAY + SLACK];

/// Entries on the heap, for trees deeper than any reasonable one.
pub(crate) type Heap = Vec<MaybeUninit<u32>>;

/// Room for `bound` entries and one vector more: `array`, or `heap` if that is too small.
#[inline(always)]
pub(crate) fn room(bound: usize, array: &mut Entries, heap: &mut Heap) -> *mut u32 {
    if bound <= ARRAY { array.as_mut_ptr().cast() } else { reserve(bound, heap) }
}

#[cold]
fn reserve(bound: usize, heap: &mut Heap) -> *mut u32 {
    heap.reserve_exact(bound + SLACK);
    heap.as_mut_ptr().cast()
}
