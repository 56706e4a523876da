//! What a frame of [`niwaki_hybrid`] will take, before it is drawn, so that a controller of
//! [`niwaki_frame_control`] can turn its settings.
//!
//! ```
//! use niwaki_hybrid_model::{ViewSampler, ViewSampling};
//! use niwaki_core::{Builder, PrimRef};
//! use std::sync::Arc;
//! # use niwaki_trace::QuantisedScene;
//! # use niwaki_build_binned::Binned;
//!
//! let scene = Arc::new(niwaki_scene::generate::generate("gallery", 2_000, 1).ok_or("no such scene")?);
//! let bvh = Binned::default().build(&scene.mesh.prim_refs())?;
//! let traced = Arc::new(QuantisedScene::<8>::new(&bvh, &scene.mesh)?);
//! let settings = niwaki_hybrid::Settings::default();
//! let sampler = ViewSampler::new(&scene, traced, &settings, ViewSampling::default())?;
//! let work = sampler.sample(&scene.cameras[0]);
//! println!("{:.2} rays a pixel go on from surfaces", work.rays_up_to(settings.max_depth));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | item | what it is |
//! |---|---|
//! | [`ViewSampler`], [`ViewWork`] | the rays of a view by depth, from a small Whitted rendering on the CPU; what of it is near; what the effect plan runs |
//! | [`HybridModel`], [`DrawnFrame`] | milliseconds of each part of a frame, linear in that work, fitted to frames that were drawn |
//! | [`settings`] | the hybrid renderer's settings for a rung of a ladder of [`niwaki_frame_control`] |
//!
//! A rasteriser's time follows from no count of instructions of a kernel, so the analytical model of
//! `niwaki-gpu-model` does not apply as it stands. Each part is fitted by itself to its own
//! time on the GPU, from counts that mean something for that part, with coefficients that are
//! never negative: a model of few numbers, which a handful of frames determine.
//!
//! After P. Ganestam and M. Doggett, *Auto-tuning interactive ray tracing using an analytical GPU
//! architecture model* (2012), section 4: sample the view at low resolution, predict, choose.

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod error;
mod model;
mod sampler;
mod work;

pub use error::HybridModelError;
pub use model::{DrawnFrame, HybridModel, Part, Prediction};
pub use sampler::{ViewSampler, ViewSampling};
pub use work::{PlannedWork, ViewWork};

use niwaki_frame_control::RenderSettings;
use niwaki_hybrid::{NearRegion, Settings, Shadows};

/// The settings of a rung: `base` with the rung's depth, near region, shadows and ambient occlusion.
/// The rung's render scale is the size of the image, which the caller gives to
/// [`draw`](niwaki_hybrid::HybridRenderer::draw). `diagonal` is that of the scene's bounds.
#[must_use]
pub fn settings(base: &Settings, rung: &RenderSettings, diagonal: f32) -> Settings {
    #[expect(clippy::cast_possible_truncation, reason = "shares from 0 to 1")]
    let [near, radius] = [rung.near_region, rung.ao_radius].map(|x| x as f32);
    Settings {
        near_region: NearRegion::HalfSize(near * diagonal),
        max_depth: u32::from(rung.reflection_depth),
        shadows: if rung.shadows { base.shadows } else { Shadows::None },
        occlusion_rays: u32::from(rung.ao_rays),
        occlusion_radius: radius,
        ..base.clone()
    }
}
