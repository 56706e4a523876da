//! [`niwaki_checks::fuzz::RAY_FILE`] by libFuzzer.
#![no_main]

niwaki_fuzz::target!(RAY_FILE);
