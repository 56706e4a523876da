//! Hands the compiler's version and flags to the program, which prints them beside every timing.

use std::process::Command;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".into());
    let version = Command::new(rustc)
        .arg("--version")
        .output()
        .ok()
        .and_then(|output| String::from_utf8(output.stdout).ok())
        .unwrap_or_default();
    println!("cargo:rustc-env=NIWAKI_RUSTC={}", version.trim());
    // Cargo separates encoded flags by the unit separator.
    let flags = std::env::var("CARGO_ENCODED_RUSTFLAGS").unwrap_or_default().replace('\x1f', " ");
    println!("cargo:rustc-env=NIWAKI_RUSTFLAGS={flags}");
    for (from, to) in [("PROFILE", "NIWAKI_PROFILE"), ("OPT_LEVEL", "NIWAKI_OPT_LEVEL")] {
        println!("cargo:rustc-env={to}={}", std::env::var(from).unwrap_or_default());
    }
}
