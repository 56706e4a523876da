//! [`niwaki_checks::fuzz::OBJ`] by libFuzzer.
#![no_main]

niwaki_fuzz::target!(OBJ);
