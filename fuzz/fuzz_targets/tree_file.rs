//! [`niwaki_checks::fuzz::TREE_FILE`] by libFuzzer.
#![no_main]

niwaki_fuzz::target!(TREE_FILE);
