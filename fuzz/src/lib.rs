//! What every fuzz target is made of. What they check lies in `niwaki-checks`, whose tests replay
//! it without libFuzzer; `docs/fuzzing.md` says how to run them.

pub use libfuzzer_sys;
pub use niwaki_checks::fuzz;

/// Counts what loaders take, which `niwaki_checks` holds against a bound.
#[global_allocator]
static ALLOCATOR: niwaki_hard_cases::counting::Counting = niwaki_hard_cases::counting::Counting;

/// Parallel code runs on the calling thread: inputs are small, and waking threads for each takes
/// longer than the work. Checks that need threads have pools of their own.
pub fn set_up() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global();
    if let Err(error) = pool {
        eprintln!("parallel code runs on other threads: {error}");
    }
}

/// The entry points of libFuzzer for a target of `niwaki_checks::fuzz`.
#[macro_export]
macro_rules! target {
    ($name:ident) => {
        $crate::libfuzzer_sys::fuzz_target!(
            init: $crate::set_up(),
            |data: &[u8]| $crate::fuzz::$name.check(data)
        );
    };
}
