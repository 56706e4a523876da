//! [`niwaki_checks::fuzz::FORGED_TREE`] by libFuzzer.
#![no_main]

niwaki_fuzz::target!(FORGED_TREE);
