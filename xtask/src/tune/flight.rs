//! A camera path drawn by several controllers in turns, whatever draws it.

use super::pilots::{Features, Model, Pilot, Start};
use super::plant::Plant;
use super::rows::{Flight, Rank};
use super::stage::Stage;
use anyhow::{Context, Result, bail};
use niwaki_frame_control::{FrameRecord, Ladder, RenderSettings, kendall_tau_b};
use niwaki_gpu_model::Workload;
use niwaki_gpu_model::workload::BackgroundSampler;
use std::time::{Duration, Instant};

/// Frames in which controllers learn, and frames after a turn that are looked at.
pub(super) const FIRST: usize = 10;

/// What is known of a view once it was sampled.
pub(super) struct Known<W> {
    pub(super) frame: u64,
    pub(super) work: W,
    pub(super) took: Duration,
}

/// A camera path that can be drawn with settings, and whose views can be sampled.
pub(super) trait Craft {
    /// What sampling a view tells.
    type Work: Clone + 'static;
    /// Frames of the path.
    fn frames(&self) -> usize;
    /// Milliseconds of a frame drawn for a controller.
    fn draw(&mut self, controller: usize, frame: usize, s: &RenderSettings) -> Result<f64>;
    /// Milliseconds of frames that nothing remembers, drawn in rounds.
    fn probe_all(&mut self, frames: &[(usize, &RenderSettings)]) -> Result<Vec<f64>>;
    /// Milliseconds of one.
    fn probe(&mut self, frame: usize, s: &RenderSettings) -> Result<f64> {
        Ok(self.probe_all(&[(frame, s)])?[0])
    }
    /// Samples a view now.
    fn work(&self, frame: usize) -> Self::Work;
    /// Has a view sampled while others are drawn.
    fn submit(&self, frame: usize);
    /// The last view that was sampled so; `None` if there is none yet.
    fn newest(&self) -> Option<Known<Self::Work>>;
    /// False if there will be no newer one.
    fn is_sampling(&self) -> bool;
    /// Frames from a frame's decision to the first that knows its time.
    fn delay(&self) -> usize;
    /// Whether time goes on while a view is sampled.
    fn is_live(&self) -> bool;
    /// Whether higher rungs take longer.
    fn is_chain(&self) -> bool;
}

/// The ray tracer of the paper's application, on a device or a simulated one.
pub(super) struct Tracing {
    plant: Plant,
    pub(super) stage: Stage,
    sampler: BackgroundSampler,
}

impl Tracing {
    pub(super) fn new(plant: Plant, stage: Stage) -> Result<Self> {
        let sampler = BackgroundSampler::spawn(stage.sampled.clone(), stage.sampling.clone())
            .context("cannot start the sampler")?;
        Ok(Self { plant, stage, sampler })
    }
}

impl Craft for Tracing {
    type Work = Workload;

    fn frames(&self) -> usize {
        self.stage.cameras.len()
    }

    fn draw(&mut self, controller: usize, frame: usize, s: &RenderSettings) -> Result<f64> {
        self.plant.draw(&self.stage, controller, frame, s)
    }

    fn probe_all(&mut self, frames: &[(usize, &RenderSettings)]) -> Result<Vec<f64>> {
        self.plant.probe_all(&self.stage, frames)
    }

    fn work(&self, frame: usize) -> Workload {
        self.stage.workload(&self.stage.sampling, &self.stage.cameras[frame])
    }

    fn submit(&self, frame: usize) {
        self.sampler.submit(frame as u64, self.stage.view(&self.stage.cameras[frame]));
    }

    fn newest(&self) -> Option<Known<Workload>> {
        let sampled = self.sampler.newest()?;
        Some(Known { frame: sampled.frame, work: sampled.answer, took: sampled.took })
    }

    fn is_sampling(&self) -> bool {
        self.sampler.is_running()
    }

    fn delay(&self) -> usize {
        self.plant.delay()
    }

    fn is_live(&self) -> bool {
        matches!(self.plant, Plant::Vulkan { .. })
    }

    fn is_chain(&self) -> bool {
        true
    }
}

/// What controllers are to do.
pub(super) struct Orders<'a, W> {
    pub(super) ladder: &'a Ladder<RenderSettings>,
    pub(super) model: Model<W>,
    pub(super) features: Features<W>,
    pub(super) controllers: &'a [String],
    /// Milliseconds; `None` for those of the first frame with 16 directions of ambient occlusion.
    pub(super) target_ms: Option<f64>,
    /// Draws of a frame, of which the fastest counts; simulated devices draw it once.
    pub(super) draws: u16,
    /// Views in which settings are ranked.
    pub(super) rank: usize,
}

/// What came of a path.
pub(super) struct Flown<W> {
    pub(super) target_ms: f64,
    pub(super) flights: Vec<Flight>,
    /// What controllers knew of each frame.
    pub(super) work: Vec<W>,
    /// Median of what sampling a view took.
    pub(super) sampling_ms: f64,
    /// Views that were not sampled in time.
    pub(super) late_samples: usize,
    /// Milliseconds of one and the same frame, drawn again beside each frame.
    pub(super) again_ms: Vec<f64>,
    /// Microseconds of a prediction.
    pub(super) prediction_us: f64,
    pub(super) ranks: Vec<Rank>,
}

/// Draws all frames, each by all controllers in turns and beside them always the first again, which shows what
/// the machine does to the same work; then times rungs in some views.
pub(super) fn fly<C: Craft>(craft: &mut C, orders: &Orders<'_, C::Work>) -> Result<Flown<C::Work>> {
    let Orders { ladder, model, .. } = orders;
    let workload = craft.work(0);
    let target_ms = match orders.target_ms {
        Some(target) => target,
        None => {
            let usual = ladder.rungs().iter().position(|s| s.ao_rays == 16);
            craft.probe(0, &ladder.rungs()[usual.unwrap_or(ladder.top())])?
        }
    };
    let rung = by_hand(craft, ladder, target_ms)?;
    let prediction_us = prediction_us(model, ladder, &workload);
    let same = &ladder.rungs()[rung];
    let (model, features) = (model.clone(), orders.features);
    let start = Start { ladder, model, features, target_ms, workload, rung };
    let mut pilots: Vec<Pilot<C::Work>> =
        orders.controllers.iter().map(|name| start.pilot(name)).collect::<Result<_>>()?;
    let mut flown = Flown {
        target_ms,
        flights: Vec::with_capacity(pilots.len()),
        work: Vec::with_capacity(craft.frames()),
        sampling_ms: 0.0,
        late_samples: 0,
        again_ms: Vec::new(),
        prediction_us,
        ranks: Vec::new(),
    };
    in_turns(craft, orders, same, &mut pilots, &mut flown)?;
    flown.ranks = rank(craft, orders)?;
    Ok(flown)
}

/// The rung whose time in the first frame is nearest to the target: what a person would choose.
fn by_hand<C: Craft>(
    craft: &mut C,
    ladder: &Ladder<RenderSettings>,
    target_ms: f64,
) -> Result<usize> {
    if !craft.is_chain() {
        let all: Vec<_> = ladder.rungs().iter().map(|settings| (0, settings)).collect();
        let off = craft.probe_all(&all)?.into_iter().map(|ms| (ms - target_ms).abs());
        let best = off.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        return Ok(best.map_or(0, |(rung, _)| rung));
    }
    let mut off =
        |rung: usize| -> Result<f64> { Ok(craft.probe(0, &ladder.rungs()[rung])? - target_ms) };
    let (mut low, mut high) = (0, ladder.top());
    // Halving will do.
    while low < high {
        let middle = (low + high).div_ceil(2);
        if off(middle)? <= 0.0 {
            low = middle;
        } else {
            high = middle - 1;
        }
    }
    let next = (low + 1).min(ladder.top());
    Ok(if off(next)?.abs() < off(low)?.abs() { next } else { low })
}

fn in_turns<C: Craft>(
    craft: &mut C,
    orders: &Orders<'_, C::Work>,
    same: &RenderSettings,
    pilots: &mut [Pilot<C::Work>],
    flown: &mut Flown<C::Work>,
) -> Result<()> {
    let ladder = orders.ladder;
    let draws = if craft.is_live() { orders.draws } else { 1 };
    let (delay, frames) = (craft.delay(), craft.frames());
    flown.flights.extend(pilots.iter().map(|pilot| Flight {
        controller: pilot.name.clone(),
        records: Vec::with_capacity(frames),
        summary: None,
        off_after_turn: None,
        unfitted_error: None,
    }));
    let mut numbers: Vec<Vec<u64>> = vec![Vec::new(); pilots.len()];
    let mut took = Vec::with_capacity(frames);
    craft.submit(0);
    // A frame that nobody sees, as applications draw some while they load.
    let first = wait(craft, 0, false)?;
    for (k, pilot) in pilots.iter_mut().enumerate() {
        let decision = pilot.controller.decide(&first.work);
        let rung = decision.rung.min(ladder.top());
        let measured_ms = craft.draw(k, 0, &ladder.rungs()[rung])?;
        pilot.controller.measure(decision.frame, Some(measured_ms));
    }
    for index in 0..frames {
        let known = wait(craft, index as u64, craft.is_live() && index > 0)?;
        flown.late_samples += usize::from(known.frame != index as u64);
        took.push(1e3 * known.took.as_secs_f64());
        if index + 1 < frames {
            craft.submit(index + 1);
        }
        for (k, pilot) in pilots.iter_mut().enumerate() {
            let records = &mut flown.flights[k].records;
            if let Some(known) = index.checked_sub(delay) {
                pilot.controller.measure(numbers[k][known], Some(records[known].measured_ms));
            }
            let decision = pilot.controller.decide(&known.work);
            let rung = decision.rung.min(ladder.top());
            let measured_ms = fastest(craft, draws, (k, index), &ladder.rungs()[rung])?;
            numbers[k].push(decision.frame);
            records.push(FrameRecord {
                frame: index as u64,
                rung,
                model_ms: decision.model_ms,
                predicted_ms: decision.predicted_ms,
                measured_ms,
                target_ms: flown.target_ms,
                status: decision.status,
            });
        }
        flown.work.push(known.work);
        if craft.is_live() {
            flown.again_ms.push(fastest(craft, draws, (0, 0), same)?);
        }
    }
    took.sort_by(f64::total_cmp);
    flown.sampling_ms = took.get(took.len() / 2).copied().unwrap_or_default();
    Ok(())
}

/// Milliseconds of a frame of a controller's, the fewest of some draws.
fn fastest<C: Craft>(
    craft: &mut C,
    draws: u16,
    (controller, frame): (usize, usize),
    settings: &RenderSettings,
) -> Result<f64> {
    let mut least = f64::INFINITY;
    for _ in 0..draws.max(1) {
        least = least.min(craft.draw(controller, frame, settings)?);
    }
    Ok(least)
}

/// What is known of a frame; if it need not be that one, of the newest there is.
fn wait<C: Craft>(craft: &C, frame: u64, newest_will_do: bool) -> Result<Known<C::Work>> {
    loop {
        match craft.newest() {
            Some(known) if known.frame == frame || newest_will_do => return Ok(known),
            _ if !craft.is_sampling() => bail!("the sampler has ended"),
            _ => std::thread::yield_now(),
        }
    }
}

/// Times rungs in some views and compares their order with the model's.
fn rank<C: Craft>(craft: &mut C, orders: &Orders<'_, C::Work>) -> Result<Vec<Rank>> {
    let ladder = orders.ladder;
    let frames = craft.frames();
    let views = orders.rank.min(frames);
    // Every rung of a short ladder, else about this many.
    const RUNGS: usize = 20;
    let rungs: Vec<usize> = (0..=ladder.top()).step_by((ladder.top() / RUNGS).max(1)).collect();
    let mut ranks = Vec::with_capacity(views);
    for view in 0..views {
        let frame = if views == 1 { 0 } else { view * (frames - 1) / (views - 1) };
        let work = craft.work(frame);
        let settings: Vec<_> = rungs.iter().map(|&rung| (frame, &ladder.rungs()[rung])).collect();
        let measured = craft.probe_all(&settings)?;
        let predicted: Vec<f64> = settings.iter().map(|(_, s)| (orders.model)(s, &work)).collect();
        ranks.push(Rank {
            frame: u32::try_from(frame).unwrap_or(u32::MAX),
            tau: kendall_tau_b(&predicted, &measured),
            rungs: rungs
                .iter()
                .zip(predicted)
                .zip(measured)
                .map(|((r, p), m)| (*r, p, m))
                .collect(),
        });
    }
    Ok(ranks)
}

/// Microseconds of a prediction, the mean of some thousand.
fn prediction_us<W>(model: &Model<W>, ladder: &Ladder<RenderSettings>, workload: &W) -> f64 {
    const TIMES: u32 = 4096;
    let begun = Instant::now();
    let mut sum = 0.0;
    for i in 0..TIMES as usize {
        sum += model(&ladder.rungs()[i % ladder.rungs().len()], workload);
    }
    std::hint::black_box(sum);
    1e6 * begun.elapsed().as_secs_f64() / f64::from(TIMES)
}
