//! Runs a controller against a device.

use super::random::Random;
use super::{Counters, Device, Script, View};
use crate::metrics::FrameRecord;
use crate::{Controller, Ladder, RenderSettings};

/// How views are sampled and times come back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Run {
    /// Frames from a frame's decision to the first decision that knows its time, at least 1.
    pub delay: usize,
    /// Share of times that never come.
    pub lost: f64,
    /// Relative deviation of each counter of the low-resolution sampler from the truth.
    pub sampling_noise: f64,
    /// Seed of what is lost and of the sampler.
    pub seed: u64,
}

impl Default for Run {
    /// Each time is known before the next decision, but for one in a hundred that is lost; counters are
    /// good to 0.6 %.
    fn default() -> Self {
        Self { delay: 1, lost: 0.01, sampling_noise: 0.006, seed: 7 }
    }
}

impl Run {
    /// Draws a script's frames with the settings that `controller` decides. The controller sees
    /// sampled counters of each view, never the view itself.
    ///
    /// A rung beyond `ladder` is drawn as its top.
    pub fn frames(
        &self,
        controller: &mut dyn Controller<Counters>,
        ladder: &Ladder<RenderSettings>,
        device: &mut Device,
        script: &Script,
        target_ms: f64,
    ) -> Vec<FrameRecord> {
        let mut random = Random::new(self.seed);
        let mut records: Vec<FrameRecord> = Vec::with_capacity(script.frames());
        let mut numbers = Vec::with_capacity(script.frames());
        for index in 0..script.frames() {
            if let Some(known) = index.checked_sub(self.delay.max(1)) {
                let came = random.uniform() >= self.lost;
                controller.measure(numbers[known], came.then_some(records[known].measured_ms));
            }
            script.strike(index, device);
            let view = script.view(index);
            let decision = controller.decide(&self.sample(&view, &mut random));
            let settings = &ladder.rungs()[decision.rung.min(ladder.top())];
            numbers.push(decision.frame);
            records.push(FrameRecord {
                frame: index as u64,
                rung: decision.rung,
                model_ms: decision.model_ms,
                predicted_ms: decision.predicted_ms,
                measured_ms: device.draw(&view, settings),
                target_ms,
                status: decision.status,
            });
        }
        records
    }

    /// Counters of a view as a low-resolution sampler sees them.
    fn sample(&self, view: &View, random: &mut Random) -> Counters {
        let mut off = || (1.0 + self.sampling_noise * random.normal()).max(0.0);
        let truth = &view.counters;
        Counters {
            primary_traversals: truth.primary_traversals * off(),
            primary_intersections: truth.primary_intersections * off(),
            shadow_traversals: truth.shadow_traversals * off(),
            shadow_intersections: truth.shadow_intersections * off(),
            visible: (truth.visible * off()).min(1.0),
            ao_traversals: truth.ao_traversals * off(),
            ao_intersections: truth.ao_intersections * off(),
            coalescing: (truth.coalescing * off()).min(1.0),
            mirrors: (truth.mirrors * off()).min(1.0),
            ..*truth
        }
    }
}

/// The rung that a person with patience finds for a view: whose time on the idle device comes
/// closest to the target.
pub fn tune_by_hand(
    device: &Device,
    view: &View,
    ladder: &Ladder<RenderSettings>,
    target_ms: f64,
) -> usize {
    let off = |rung: &usize| (device.ideal_ms(view, &ladder.rungs()[*rung]) - target_ms).abs();
    (0..ladder.rungs().len()).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(0)
}
