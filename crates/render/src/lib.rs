//! CPU reference integrators, image output with metrics, and ray recording.
//!
//! ```
//! use niwaki_core::{Hit, Intersector, Ray};
//! use niwaki_render::{PathSettings, PathTracer};
//!
//! /// Answers rays by testing nothing: everything is sky.
//! struct Nothing;
//! impl Intersector for Nothing {
//!     fn closest_hit(&self, _: &Ray) -> Hit {
//!         Hit::MISS
//!     }
//!     fn any_hit(&self, _: &Ray) -> bool {
//!         false
//!     }
//! }
//!
//! let scene = niwaki_scene::generate::generate("hair", 1_000, 1).ok_or("no such scene")?;
//! let settings = PathSettings { width: 32, height: 32, samples: 4, ..PathSettings::default() };
//! let image = PathTracer::new(settings).render(&scene, &Nothing);
//! assert_eq!(image.pixels().len(), 32 * 32);
//! # Ok::<(), &str>(())
//! ```
//!
//! | module | holds |
//! |---|---|
//! | [`path`] | the path tracer: next-event estimation, multiple importance sampling, roulette |
//! | [`whitted`], [`shading`] | the Whitted integrator, and its shading model as plain functions |
//! | [`occlusion`] | ambient occlusion |
//! | [`plan`], [`stats`] | which effects run and why; what a rendering took |
//! | [`record`] | rays as the path tracer traces them, and random rays, for measurements |
//! | [`heat_map`] | costs per pixel as colours |
//! | [`image`] | linear images, PNG and EXR files, simple errors |
//! | [`metrics`] | FLIP, HDR-FLIP, PSNR, SSIM |
//! | [`tone`] | exposure and the tone curve of PNG files |
//! | [`view`] | primary rays of a pinhole camera |
//! | [`offset`] | origins that cannot hit the surface they leave |
//! | [`fresnel`] | reflection and refraction |
//!
//! Everything is generic over [`niwaki_core::Intersector`], so the same image or the same rays can
//! come from any tracer. There are no feature flags.

mod albedo;
mod bsdf;
pub mod fresnel;
pub mod heat_map;
pub mod image;
mod lights;
pub mod metrics;
mod microfacet;
pub mod occlusion;
pub mod offset;
pub mod path;
pub mod plan;
mod query;
pub mod record;
mod rng;
mod sampling;
pub mod shading;
pub mod stats;
mod surface;
mod tiles;
pub mod tone;
pub mod view;
pub mod whitted;

pub use heat_map::{HeatMap, traversal_heat_map};
pub use image::{Image, ImageError};
pub use occlusion::{AmbientOcclusion, OcclusionSettings};
pub use path::{PathSettings, PathTracer};
pub use plan::{Decision, Effect, EffectPlan, Planning};
pub use record::{RayKind, RaySets, RecordSettings, random_rays, record_rays};
pub use rng::pcg4d;
pub use stats::RenderStats;
pub use tone::{Exposure, ToneCurve};
pub use view::View;
pub use whitted::{AmbientLight, Whitted, WhittedSettings};
