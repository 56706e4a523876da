//! Scenes from OBJ and glTF files and from seeded procedural generators.
//!
//! ```
//! let scene = niwaki_scene::generate::generate("atrium", 10_000, 1).ok_or("no such scene")?;
//! assert!((9_500..=10_500).contains(&scene.mesh.len()));
//! println!("{} triangles, {} materials", scene.mesh.len(), scene.materials.len());
//! # Ok::<(), &str>(())
//! ```
//!
//! | module | holds |
//! |---|---|
//! | [`load`](mod@load) | files: OBJ, glTF and GLB, also packed with zstd |
//! | [`generate`] | procedural scenes of any size |
//! | [`scene`] | triangles with what a renderer needs, and what a loader left out |
//! | [`instanced`] | meshes stored once and the places where they stand |
//! | [`object`] | what moves, and is culled, as one |
//! | [`animation`] | motion: transforms, waves, key frames and skins, for CPU and GPU |
//! | [`path`](mod@path) | camera paths |
//! | [`material`], [`texture`] | surfaces |
//! | [`light`] | cameras, punctual lights, the environment |
//! | [`facts`] | what a scene contains, for renderers that leave out what nothing calls for |
//! | [`error`] | why a file could not be loaded |
//!
//! There are no feature flags.

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

pub mod animation;
mod automatic;
pub mod error;
pub mod facts;
pub mod generate;
pub mod instanced;
pub mod light;
pub mod load;
pub mod material;
pub mod object;
pub mod path;
pub mod scene;
pub mod texture;

pub use animation::{
    Animation, Hop, Influence, JointPose, Motion, ObjectPose, Rig, Rigid, ScenePose, Wave,
};
pub use automatic::{AutomaticView, automatic_camera, automatic_path};
pub use error::LoadError;
pub use facts::{LightFacts, MaterialClass, MaterialFacts, SceneFacts};
pub use instanced::{FlattenError, Instance, InstancedScene, Part};
pub use light::{Camera, Environment, Light, LightKind};
pub use load::{LoadOptions, load, load_instanced};
pub use material::{AlphaMode, Material};
pub use object::Object;
pub use path::{CameraKey, CameraPath};
pub use scene::{Dropped, Scene};
pub use texture::{Texture, Wrap};
