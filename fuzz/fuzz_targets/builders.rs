//! [`niwaki_checks::fuzz::BUILDERS`] by libFuzzer.
#![no_main]

niwaki_fuzz::target!(BUILDERS);
