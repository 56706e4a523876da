//! Fitting the model of a device to frames that it drew.

use super::device::ray_settings;
use super::{plant::Plant, stage::Stage};
use anyhow::Result;
use niwaki_frame_control::{Ladder, RenderSettings};
use niwaki_gpu_model::calibrate::{self, Calibrated, Observation, Parameter};
use niwaki_gpu_tracer::TracerModel;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Views that are drawn, in the middle of equal parts of the path.
pub(crate) const VIEWS: usize = 6;
/// Directions of ambient occlusion of the rungs that are drawn, beside shading alone and shadows alone.
const DIRECTIONS: [u16; 4] = [1, 4, 12, 32];

/// What a fit did.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Fit {
    pub(crate) views: usize,
    pub(crate) rungs: usize,
    /// Seconds that drawing them took, and fitting.
    pub(crate) drawing_s: f64,
    pub(crate) fitting_s: f64,
    pub(crate) parameters: Vec<Fitted>,
    /// Mean of |predicted − measured| / measured over these frames: before, after, and of views by fits
    /// that had not seen them.
    pub(crate) error_before: f64,
    pub(crate) error_after: f64,
    pub(crate) error_left_out: f64,
    pub(crate) frames: Vec<Observed>,
}

impl Fit {
    /// What was done and what came of it, in a sentence.
    pub(crate) fn line(&self, scene: &str) -> String {
        let [before, after, left_out] =
            [self.error_before, self.error_after, self.error_left_out].map(|error| 100.0 * error);
        format!(
            "{scene}: fitted to {} frames ({} views × {} settings, drawn in {:.1} s, fitted in {:.1} s): \
             error {before:.1} % as measured, {after:.1} % fitted, {left_out:.1} % in views left out",
            self.frames.len(),
            self.views,
            self.rungs,
            self.drawing_s,
            self.fitting_s,
        )
    }
}

/// A parameter, measured and fitted.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Fitted {
    pub(crate) parameter: String,
    pub(crate) measured: f64,
    pub(crate) fitted: f64,
    /// False if times do not tell it: then it is as measured.
    pub(crate) is_fitted: bool,
}

/// A frame that was drawn for the fit.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Observed {
    pub(crate) frame: usize,
    pub(crate) shadows: bool,
    pub(crate) ao_rays: u16,
    pub(crate) measured_ms: f64,
    pub(crate) before_ms: f64,
    pub(crate) after_ms: f64,
}

/// The frames in the middle of equal parts of the path.
pub(crate) fn spread(frames: usize, views: usize) -> Vec<usize> {
    let views = views.min(frames);
    (0..views).map(|view| (2 * view + 1) * frames / (2 * views)).collect()
}

/// Draws some settings in some views and fits what their times tell.
pub(crate) fn fit(
    plant: &mut Plant,
    stage: &Stage,
    ladder: &Ladder<RenderSettings>,
    model: &TracerModel,
) -> Result<(TracerModel, Fit)> {
    let begun = Instant::now();
    let rungs: Vec<&RenderSettings> = ladder
        .rungs()
        .iter()
        .filter(|s| s.ao_rays == 0 || DIRECTIONS.contains(&s.ao_rays))
        .collect();
    let views = spread(stage.cameras.len(), VIEWS);
    let drawn: Vec<(usize, &RenderSettings)> =
        views.iter().flat_map(|&frame| rungs.iter().map(move |&s| (frame, s))).collect();
    let mut times = plant.probe_all(stage, &drawn)?.into_iter();
    let mut observations = Vec::with_capacity(drawn.len());
    let mut frames = Vec::with_capacity(drawn.len());
    for &frame in &views {
        let workload = stage.workload(&stage.sampling, &stage.cameras[frame]);
        for (settings, measured_ms) in rungs.iter().zip(times.by_ref()) {
            let settings_of_model = ray_settings(settings);
            observations.push(Observation {
                workload,
                settings: settings_of_model,
                seconds: 1e-3 * measured_ms,
            });
            frames.push(Observed {
                frame,
                shadows: settings.shadows,
                ao_rays: settings.ao_rays,
                measured_ms,
                before_ms: 1e3 * model.seconds(&workload, &settings_of_model)?,
                after_ms: 0.0,
            });
        }
    }
    let drawing_s = begun.elapsed().as_secs_f64();
    let begun = Instant::now();
    let choice = calibrate::choose(model, &observations, &Parameter::ALL)?;
    let made = calibrate::calibrate_only(model, &observations, &choice.parameters)?;
    let fitting_s = begun.elapsed().as_secs_f64();
    for (frame, one) in frames.iter_mut().zip(&observations) {
        frame.after_ms = 1e3 * made.model.seconds(&one.workload, &one.settings)?;
    }
    let parameters = Parameter::ALL.map(|parameter| Fitted {
        parameter: parameter.name().to_owned(),
        measured: parameter.value(model.frame_model()),
        fitted: parameter.value(made.model.frame_model()),
        is_fitted: choice.parameters.contains(&parameter),
    });
    let fit = Fit {
        views: views.len(),
        rungs: rungs.len(),
        drawing_s,
        fitting_s,
        parameters: parameters.to_vec(),
        error_before: made.error_before,
        error_after: made.error_after,
        error_left_out: choice.left_out_error,
        frames,
    };
    Ok((made.model, fit))
}
