//! Keeps a renderer's frame time: the cost of the *next* frame is predicted from its own view before
//! it is drawn, quality is set to what the target affords, and measured times correct the predictor.
//!
//! ```
//! use niwaki_frame_control::{Config, Controller, FrameController, Ladder, Status};
//!
//! // Rays a pixel, worst first, and a predictor of your own: settings, workload -> milliseconds.
//! let ladder = Ladder::new((1..=64).collect::<Vec<u32>>())?;
//! let model = |rays: &u32, steps_a_ray: &f64| 0.01 * f64::from(*rays) * steps_a_ray;
//! let mut controller = FrameController::new(ladder, model, 16.0, Config::default())?;
//!
//! for frame in 0..20 {
//!     let steps_a_ray = if frame < 10 { 40.0 } else { 80.0 };
//!     let decision = controller.decide(&steps_a_ray);
//!     assert_eq!(decision.status, Status::OnTarget);
//!     let rays = *controller.settings(&decision);
//!     // This device is a quarter slower than the model thinks.
//!     let measured = 1.25 * 0.01 * f64::from(rays) * steps_a_ray;
//!     controller.measure(decision.frame, Some(measured));
//!     assert!(frame == 0 || (measured - 16.0).abs() < 0.5);
//! }
//! # Ok::<(), niwaki_frame_control::Error>(())
//! ```
//!
//! - [`Ladder`]: the ordered scale of quality, of settings of any type; [`RenderSettings`] are those
//!   of the ray tracer of Ganestam and Doggett (2012, *Auto-tuning interactive ray tracing using an
//!   analytical GPU architecture model*) and of the hybrid renderer.
//! - [`InnerLoop`]: searches the ladder by predicted times; [`Correction`]: corrects the predictor;
//!   [`FrameController`]: both together. [`admissible_gain`] says how quick the correction may be.
//! - [`RegressionController`], [`FixedRung`] and [`FrozenWorkload`]: what they are compared with.
//! - [`Summary`], [`frames_off`] and [`kendall_tau_b`]: how well it went; [`sim`]: devices, scenes and
//!   scripts to find out on.

pub use controller::{
    Config, Controller, Decision, FixedRung, FrameController, FrozenWorkload, Predictor,
};
pub use correction::{Correction, CorrectionConfig, Verdict};
pub use error::Error;
pub use history::MAX_DELAY;
pub use kendall::kendall_tau_b;
pub use ladder::Ladder;
pub use least_squares::{Row, least_squares};
pub use metrics::{FrameRecord, Summary, frames_off};
pub use regression::{Regression, RegressionConfig, RegressionController};
pub use search::{
    Aim, Choice, InnerConfig, InnerLoop, MAX_TARGET_MS, MIN_TARGET_MS, Search, Status,
};
pub use settings::RenderSettings;
pub use stability::admissible_gain;

mod controller;
mod correction;
mod error;
mod history;
mod kendall;
mod ladder;
mod least_squares;
mod metrics;
mod regression;
mod search;
mod settings;
pub mod sim;
mod stability;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
