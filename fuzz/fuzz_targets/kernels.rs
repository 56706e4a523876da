//! [`niwaki_checks::fuzz::KERNELS`] by libFuzzer.
#![no_main]

niwaki_fuzz::target!(KERNELS);
