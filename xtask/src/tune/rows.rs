//! What `tune.json` holds.

use super::args::Renderer;
use super::fit::Fit;
use crate::results::{Failure, Run};
use niwaki_frame_control::{FrameRecord, RenderSettings, Summary};
use serde::{Deserialize, Serialize};

/// Everything of a run.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Study {
    /// Version of the layout.
    pub(super) schema: u32,
    pub(super) run: Run,
    pub(super) tours: Vec<Tour>,
    pub(super) failures: Vec<Failure>,
}

/// A scene on a device.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Tour {
    pub(super) scene: String,
    pub(super) triangles: usize,
    /// Depth of the tree.
    pub(super) depth: usize,
    pub(super) renderer: Renderer,
    pub(super) device: String,
    pub(super) is_simulated: bool,
    /// The table that the model used: its name and where its numbers are from.
    pub(super) model: String,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) target_ms: f64,
    /// The ladder.
    pub(super) rungs: Vec<RenderSettings>,
    pub(super) flights: Vec<Flight>,
    /// How the model was fitted to frames that were drawn before.
    pub(super) fit: Option<Fit>,
    /// Milliseconds that sampling a view took, median.
    pub(super) sampling_ms: f64,
    /// Frames whose workload was not yet there: that of an earlier view was used.
    pub(super) late_samples: usize,
    /// Milliseconds of the first frame at the rung chosen by hand, drawn again beside each frame; none of
    /// simulated devices.
    #[serde(default)]
    pub(super) again_ms: Vec<f64>,
    /// Microseconds of a prediction.
    pub(super) prediction_us: f64,
    pub(super) ranks: Vec<Rank>,
}

/// A controller along the path.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Flight {
    pub(super) controller: String,
    pub(super) records: Vec<FrameRecord>,
    /// Of all frames but the first ten, in which controllers learn.
    pub(super) summary: Option<Summary>,
    /// Frames of the ten after a turn that are off by more than a tenth.
    pub(super) off_after_turn: Option<usize>,
    /// Mean error of the model in the frames of the summary, had it the parameters that were measured.
    pub(super) unfitted_error: Option<f64>,
}

/// How well the model orders settings in a view.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Rank {
    pub(super) frame: u32,
    /// Kendall's τ-b of predicted and measured times over the rungs.
    pub(super) tau: Option<f64>,
    /// Rung, predicted and measured milliseconds.
    pub(super) rungs: Vec<(usize, f64, f64)>,
}

impl Tour {
    /// What the tables call it.
    pub(super) fn title(&self) -> String {
        let hybrid = if self.renderer == Renderer::Hybrid { " by the hybrid renderer" } else { "" };
        format!("{}{hybrid} on {}", self.scene, self.device)
    }

    /// The mean distance of the same frame's times from their median, over it: what is off for no fault
    /// of a controller.
    pub(super) fn noise(&self) -> Option<f64> {
        let mut sorted = self.again_ms.clone();
        sorted.sort_by(f64::total_cmp);
        let median = sorted.get(sorted.len() / 2).copied().filter(|median| *median > 0.0)?;
        let off: f64 = sorted.iter().map(|time| (time - median).abs()).sum();
        Some(off / sorted.len() as f64 / median)
    }
}
