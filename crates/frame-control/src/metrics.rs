//! How well frames were kept on target.

use serde::{Deserialize, Serialize};

use crate::Status;

/// A frame as decided and as measured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameRecord {
    /// Number of the frame.
    pub frame: u64,
    /// Rung that it was drawn with.
    pub rung: usize,
    /// The predictor's own time in milliseconds, where there is one.
    pub model_ms: Option<f64>,
    /// The corrected time that was expected, in milliseconds, where any was.
    pub predicted_ms: Option<f64>,
    /// The time that it took, in milliseconds, above 0.
    pub measured_ms: f64,
    /// The target in milliseconds, above 0.
    pub target_ms: f64,
    /// What the controller said.
    pub status: Status,
}

impl FrameRecord {
    /// How far the frame is off its target, as a share of the target; positive is late.
    pub fn off_target(&self) -> f64 {
        self.measured_ms / self.target_ms - 1.0
    }
}

/// A run in numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Frames.
    pub frames: usize,
    /// Mean of |model − measured| / measured, over frames that have a model time (the thesis's
    /// "average model to execution time error").
    pub model_error: Option<f64>,
    /// The same for the corrected time.
    pub corrected_error: Option<f64>,
    /// Mean of |measured − target| / target.
    pub target_error: f64,
    /// Largest |measured − target| / target.
    pub worst: f64,
    /// Share of the frames within 5 % of the target.
    pub on_target: f64,
    /// Mean rung: the quality delivered.
    pub mean_rung: f64,
    /// Frames whose rung turned back: up after down or down after up, from one frame to the next.
    pub flicker: usize,
}

impl Summary {
    /// Sums frames up. None without frames.
    pub fn of(records: &[FrameRecord]) -> Option<Self> {
        if records.is_empty() {
            return None;
        }
        let mean_over = |value: &dyn Fn(&FrameRecord) -> f64| {
            records.iter().map(value).sum::<f64>() / records.len() as f64
        };
        Some(Self {
            frames: records.len(),
            model_error: prediction_error(records, |record| record.model_ms),
            corrected_error: prediction_error(records, |record| record.predicted_ms),
            target_error: mean_over(&|record| record.off_target().abs()),
            worst: records.iter().map(|record| record.off_target().abs()).fold(0.0, f64::max),
            on_target: mean_over(&|record| f64::from(u8::from(record.off_target().abs() <= 0.05))),
            mean_rung: mean_over(&|record| record.rung as f64),
            flicker: flicker(records),
        })
    }
}

/// Mean relative error of a prediction over the frames that have one; none where none has.
fn prediction_error(
    records: &[FrameRecord],
    prediction: impl Fn(&FrameRecord) -> Option<f64>,
) -> Option<f64> {
    let errors = records.iter().filter_map(|record| {
        prediction(record).map(|time| (time - record.measured_ms).abs() / record.measured_ms)
    });
    let (count, sum) = errors.fold((0_u32, 0.0), |(count, sum), error| (count + 1, sum + error));
    (count > 0).then(|| sum / f64::from(count))
}

/// Frames that are further off their target than `tolerance`, a share of the target.
pub fn frames_off(records: &[FrameRecord], tolerance: f64) -> usize {
    records.iter().filter(|record| record.off_target().abs() > tolerance).count()
}

/// Frames whose rung turned back.
fn flicker(records: &[FrameRecord]) -> usize {
    records
        .windows(3)
        .filter(|three| {
            let first = three[1].rung.cmp(&three[0].rung);
            let second = three[2].rung.cmp(&three[1].rung);
            first != core::cmp::Ordering::Equal && second == first.reverse()
        })
        .count()
}
