//! Instructions of the kernels that trace rays, counted in their SPIR-V: what rays take as a rule.

use niwaki_gpu_model::KernelCounts;
use niwaki_shaders::Options;
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    println!(
        "{:24} {:>18} {:>18} {:>18}",
        "compute + memory", "a traversal", "an intersection", "constant"
    );
    for module in ["trace_binary", "trace_wide"] {
        for (mode, name) in [(0.0, "fast"), (1.0, "watertight")] {
            for (any, query) in [(0.0, "closest"), (1.0, "any")] {
                let constants = [("MODE", mode), ("ANY", any), ("RARE", 0.0)];
                let options = Options { constants: &constants, ..Options::default() };
                let shader = niwaki_shaders::compile(module, "main", &options)?;
                let c = KernelCounts::of_shader(&shader)?;
                let pair = |compute: f64, memory: f64| format!("{compute:.0} + {memory:.0}");
                println!(
                    "{:24} {:>18} {:>18} {:>18}",
                    format!("{module} {name} {query}").replace("trace_", ""),
                    pair(c.compute_per_traversal, c.memory_per_traversal),
                    pair(c.compute_per_intersection, c.memory_per_intersection),
                    pair(c.compute_constant, c.memory_constant),
                );
            }
        }
    }
    Ok(())
}
