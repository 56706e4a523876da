//! Measures the Vulkan device at hand and prints, or writes, its table.
//!
//! `measure_device [file.toml]`

use niwaki_gpu_model::microbench::{Settings, measure};
use niwaki_trace_vulkan::Device;
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let gpu = match Device::new() {
        Ok(gpu) => gpu,
        Err(error) => {
            println!("{error}");
            return Ok(());
        }
    };
    let m = measure(&gpu, &Settings::default())?;
    println!("{:22} {:>14} {:>12} {:>9}", "", "ns each", "launch µs", "residual");
    for (name, fit) in [
        ("dependent load", &m.latency),
        ("dependent sum", &m.chain),
        ("multiply-add, a group", &m.issue_alone),
        ("multiply-add, all", &m.issue),
        ("coalesced load", &m.coalesced),
        ("uncoalesced load", &m.uncoalesced),
        ("byte", &m.bandwidth),
    ] {
        println!(
            "{name:22} {:>14.5} {:>12.1} {:>9.3}",
            fit.slope_s * 1e9,
            fit.intercept_s * 1e6,
            fit.residual
        );
    }
    println!(
        "clock {:?}, cores {:?}, residency {:?}\n\n{}",
        m.clock_from,
        m.cores_from,
        m.residency_from,
        m.device.to_toml()
    );
    if let Some(path) = std::env::args().nth(1) {
        m.device.save(&path)?;
        println!("written to {path}");
    }
    Ok(())
}
