//! How many rays a file has, and where they begin: `--example bounds -- FILE`, or a file made here.

use niwaki_core::{Aabb, glam::Vec3};
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let rays = match std::env::args().nth(1) {
        Some(file) => niwaki_ray_file::load(&PathBuf::from(file))?,
        None => {
            let text: String = (0..100)
                .map(|i| format!("{i},{},0,0,0,{}\n", i % 7, -1.5 * f64::from(i)))
                .collect();
            niwaki_ray_file::read_csv(format!("ox,oy,oz,dx,dy,dz\n{text}").as_bytes())?
        }
    };
    let bounds = rays.iter().fold(Aabb::EMPTY, |bounds, ray| {
        let origin: Vec3 = ray.origin;
        bounds.union(Aabb::new(origin, origin))
    });
    println!("{} rays from {} to {}", rays.len(), bounds.min, bounds.max);
    Ok(())
}
