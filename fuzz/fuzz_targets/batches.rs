//! [`niwaki_checks::fuzz::BATCHES`] by libFuzzer.
#![no_main]

niwaki_fuzz::target!(BATCHES);
