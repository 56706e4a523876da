//! Builds a tree, saves it, loads it again, traces it, and shows what a damaged file says.

use niwaki_core::{Bvh, Intersector, Ray, glam::Vec3};
use niwaki_hard_cases::{median_tree, soup_mesh};
use niwaki_trace::AutoScene;
use niwaki_tree_file::TreeFile;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mesh = soup_mesh(5_000, 0.1, 1);
    let bvh = median_tree(&mesh, 2); // The builder crates do better.
    let path = std::env::temp_dir().join(format!("niwaki-example-{}.bvh", std::process::id()));
    bvh.save(&path)?;
    let file = std::fs::read(&path)?;
    println!("{} nodes in {} bytes", bvh.nodes.len(), file.len());

    let loaded = Bvh::load(&path)?;
    let scene = AutoScene::new(&loaded, &mesh)?;
    let hit = scene.closest_hit(&Ray::new(Vec3::splat(-2.0), Vec3::ONE));
    println!("a ray through the loaded tree hits triangle {}", hit.prim_id);

    for (what, bytes) in [
        ("text", b"solid cube\n".to_vec()),
        ("cut short", file[..1_000].to_vec()),
        ("one bit changed", {
            let mut file = file.clone();
            file[12_345] ^= 4;
            file
        }),
        ("more at the end", [&file[..], b"more"].concat()),
    ] {
        std::fs::write(&path, bytes)?;
        match Bvh::load(&path) {
            Ok(_) => println!("{what}: loaded"),
            Err(error) => println!("{what}: {error}"),
        }
    }
    std::fs::remove_file(&path)?;
    Ok(())
}
