//! The controllers that are compared.

use anyhow::Result;
use niwaki_frame_control::{
    Config, Controller, FixedRung, FrameController, FrozenWorkload, Ladder, RegressionConfig,
    RegressionController, RenderSettings,
};
use niwaki_gpu_model::Workload;
use std::sync::Arc;

/// Milliseconds of settings in a view, by what is known of the view.
pub(crate) type Model<W> = Arc<dyn Fn(&RenderSettings, &W) -> f64 + Send + Sync>;

/// What a time is a sum of.
pub(super) type Features<W> = fn(&RenderSettings, &W) -> [f64; 8];

/// A controller and its name.
pub(super) struct Pilot<W> {
    pub(super) name: String,
    pub(super) controller: Box<dyn Controller<W>>,
}

/// What all controllers start from.
pub(super) struct Start<'a, W> {
    pub(super) ladder: &'a Ladder<RenderSettings>,
    pub(super) model: Model<W>,
    pub(super) features: Features<W>,
    pub(super) target_ms: f64,
    /// The first frame's workload, and the rung that meets the target best in it.
    pub(super) workload: W,
    pub(super) rung: usize,
}

impl<W: Clone + 'static> Start<'_, W> {
    pub(super) fn pilot(&self, name: &str) -> Result<Pilot<W>> {
        let ladder = self.ladder.clone();
        let model = self.model.clone();
        let predict = move |s: &RenderSettings, w: &W| model(s, w);
        let target = self.target_ms;
        let controller: Box<dyn Controller<W>> = match name {
            "none" => Box::new(FixedRung::new(&ladder, self.rung)?),
            "feedback" => {
                let predictor =
                    FrozenWorkload { predictor: predict, workload: self.workload.clone() };
                let config = Config::feedback();
                Box::new(FrameController::new(ladder, predictor, target, config)?)
            }
            "feedforward" => {
                Box::new(FrameController::new(ladder, predict, target, Config::feedforward())?)
            }
            "regression" => {
                let config = RegressionConfig::default();
                Box::new(RegressionController::new(
                    ladder,
                    self.features,
                    target,
                    self.rung,
                    config,
                )?)
            }
            _ => Box::new(FrameController::new(ladder, predict, target, Config::default())?),
        };
        Ok(Pilot { name: name.to_owned(), controller })
    }
}

/// What a time of the ray tracer is a sum of, by the counters: a constant, primary rays, shadow rays, ambient occlusion.
pub(super) fn features(s: &RenderSettings, w: &Workload) -> [f64; 8] {
    let (rays, shadows) = (f64::from(s.ao_rays), f64::from(u8::from(s.shadows)));
    [
        1.0,
        w.primary_traversals,
        w.primary_intersections,
        shadows * (w.shadow_traversals + w.shadow_intersections),
        rays * w.ao_traversals,
        rays * w.visible_triangles * w.ao_intersections,
        0.0,
        0.0,
    ]
}
