//! Scenes from OBJ and glTF files and from seeded procedural generators.
//!
//! ```
//! let scene = niwaki_scene::generate::generate("hair", 10_000, 1).ok_or("no such scene")?;
//! assert!((9_500..=10_500).contains(&scene.mesh.len()));
//! println!("{} triangles, {} materials", scene.mesh.len(), scene.materials.len());
//! # Ok::<(), &str>(())
//! ```

mod automatic;
pub mod error;
pub mod generate;
pub mod instanced;
pub mod light;
pub mod load;
pub mod material;
pub mod scene;
pub mod texture;

pub use automatic::{AutomaticView, automatic_camera};
pub use error::LoadError;
pub use instanced::{FlattenError, Instance, InstancedScene, Part};
pub use light::{Camera, Environment, Light, LightKind};
pub use load::{LoadOptions, load, load_instanced};
pub use material::{AlphaMode, Material};
pub use scene::{Dropped, Scene};
pub use texture::{Texture, Wrap};
