//! Large pages for large arrays.

/// Asks the system to back an array that has not been touched yet with large pages.
///
/// Incoherent rays, and builders that gather primitives, jump all over a scene. With pages of
/// 4 KiB, the translation of most addresses of a large scene is not at hand, which costs as much
/// as a cache miss; and each page costs a call of the system when it is touched first. It is a
/// wish: where there are no large pages, nothing changes.
#[inline]
pub fn prefer_large_pages<T>(array: &[T]) {
    #[cfg(target_os = "linux")]
    {
        use std::ffi::{c_int, c_void};
        unsafe extern "C" {
            fn madvise(address: *mut c_void, length: usize, advice: c_int) -> c_int;
        }
        const HUGE_PAGE: usize = 2 << 20;
        const MADV_HUGEPAGE: c_int = 14;
        let start = (array.as_ptr() as usize).next_multiple_of(HUGE_PAGE);
        let end = (array.as_ptr() as usize + size_of_val(array)) & !(HUGE_PAGE - 1);
        if start < end {
            // SAFETY: the range lies within the array; the advice changes no content, and its
            // failure is no error.
            unsafe { madvise(start as *mut c_void, end - start, MADV_HUGEPAGE) };
        }
    }
    #[cfg(not(target_os = "linux"))]
    let _ = array;
}
