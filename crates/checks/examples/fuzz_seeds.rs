//! Writes the seeds of every fuzz target, one file each: `fuzz_seeds FOLDER` fills
//! `FOLDER/obj`, `FOLDER/gltf` and so on. Without a folder it says how many there are.

use std::{fs, path::Path};

fn main() -> std::io::Result<()> {
    let folder = std::env::args().nth(1);
    for target in &niwaki_checks::fuzz::ALL {
        let seeds = target.seeds();
        println!("{}: {} seeds", target.name, seeds.len());
        let Some(folder) = &folder else { continue };
        let folder = Path::new(folder).join(target.name);
        fs::create_dir_all(&folder)?;
        for (i, seed) in seeds.iter().enumerate() {
            fs::write(folder.join(format!("seed_{i:02}")), seed)?;
        }
    }
    Ok(())
}
