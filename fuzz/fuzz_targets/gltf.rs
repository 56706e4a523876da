//! [`niwaki_checks::fuzz::GLTF`] by libFuzzer.
#![no_main]

niwaki_fuzz::target!(GLTF);
