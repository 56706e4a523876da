//! A camera path, played while power is recorded.

use crate::machine::Busy;
use crate::power::source::{Blocks, Session};
use anyhow::{Context, Result};
use niwaki_power::{
    Analysis, AnalysisOptions, Block, FrameLog, FrameRecord, TraceInfo, analyze, now_ns,
};
use niwaki_raster::{Animation, Renderer};
use niwaki_scene::CameraPath;
use std::time::{Duration, Instant};

/// Windows that a visit holds at least, and readings of the meter in each: as many as the analysis takes
/// for a window where frames are too short for the meter.
const WINDOWS: f64 = 10.0;
const READINGS: f64 = 20.0;
/// How long frames are drawn to see how often the meter has something new.
const TRIAL: Duration = Duration::from_millis(1500);
/// No visit is made longer than this for the meter's sake.
const MOST_S: f64 = 120.0;

/// Frames that are drawn before those that count, where everything was drawn before.
pub(crate) const WARM_UP: u32 = 2;

/// What is played.
#[derive(Clone, Debug)]
pub(crate) struct Play<'a> {
    pub(crate) path: &'a CameraPath,
    pub(crate) size: [u32; 2],
    pub(crate) frames: u32,
    /// Frames that are drawn before, spread over the path: all of it the first time, as drivers compile
    /// when something comes into view.
    pub(crate) warm_up: u32,
    /// Idle time before and after.
    pub(crate) margin: Duration,
    /// The path is repeated until this time in seconds is over.
    pub(crate) least_s: f64,
}

/// One measurement of a cell.
#[derive(Clone, Debug, Default)]
pub(crate) struct Visit {
    /// All frames, in the order of time; numbers begin anew where the path does.
    pub(crate) frames: Vec<FrameRecord>,
    /// When it began and ended, idle time included.
    pub(crate) span_ns: (i64, i64),
    /// Cores that other programs used meanwhile, where the system tells.
    pub(crate) other_cores: Option<f64>,
    /// What the meter says, or why it says nothing; none without a meter.
    pub(crate) power: Option<Result<Analysis, String>>,
}

/// How a session is used.
pub(crate) struct Metered<'a> {
    pub(crate) session: &'a Session,
    pub(crate) options: &'a AnalysisOptions,
}

/// Seconds that a visit takes at least for a meter, and the time between the meter's readings, found by
/// drawing frames for a while.
pub(crate) fn least_time(
    metered: &Metered<'_>,
    renderer: &mut Renderer,
    play: &Play<'_>,
) -> Result<(f64, f64)> {
    let Metered { session, options } = metered;
    let [width, height] = play.size;
    let from = session.begin();
    let begun = Instant::now();
    while begun.elapsed() < TRIAL {
        renderer.draw(&play.path.at(0.5), width, height)?;
    }
    let blocks = session.since(from)?;
    let options = AnalysisOptions { idle: niwaki_power::IdlePolicy::Keep, ..(*options).clone() };
    let trial = power_of(session.info(), blocks, None, &options)
        .context("nothing can be read off the meter while frames are drawn")?;
    let refresh_s = trial.sensor.refresh_s;
    Ok(((WINDOWS * READINGS * refresh_s).min(MOST_S), refresh_s))
}

/// Plays the path as often as it has to be. The meter's failures are in [`Visit::power`]; frames are kept.
pub(crate) fn visit(
    renderer: &mut Renderer,
    play: &Play<'_>,
    metered: Option<&Metered<'_>>,
) -> Result<Visit> {
    let part = Animation {
        size: play.size,
        frames: play.frames,
        warm_up: 0,
        idle: Duration::ZERO,
        markers: 0,
    };
    Animation { frames: 0, warm_up: play.warm_up, ..part.clone() }.play(
        renderer,
        play.path,
        || {},
    )?;
    let from = metered.map_or_else(now_ns, |m| m.session.begin());
    let busy = Busy::now();
    std::thread::sleep(play.margin);
    let begun = Instant::now();
    let mut log = FrameLog::default();
    loop {
        let more = part.play(renderer, play.path, || {})?;
        log.header = more.header;
        log.frames.extend(more.frames);
        if begun.elapsed().as_secs_f64() >= play.least_s {
            break;
        }
    }
    let other_cores = busy.zip(Busy::now()).and_then(|(before, now)| before.others_until(&now));
    std::thread::sleep(play.margin);
    let to = now_ns();
    let power = metered.map(|Metered { session, options }| {
        let measured = session
            .since(from)
            .and_then(|blocks| power_of(session.info(), blocks, Some(&log), options));
        measured.map_err(|error| format!("{error:#}"))
    });
    Ok(Visit { frames: log.frames, span_ns: (from, to), other_cores, power })
}

/// Analyses blocks in memory.
pub(crate) fn power_of(
    info: &TraceInfo,
    blocks: Vec<Block>,
    log: Option<&FrameLog>,
    options: &AnalysisOptions,
) -> Result<Analysis> {
    // Traces in memory are never read twice.
    let options = AnalysisOptions { keep_bytes: usize::MAX, ..options.clone() };
    let mut blocks = Some(blocks);
    let open = || {
        let blocks = blocks.take().unwrap_or_default();
        Ok(Box::new(Blocks::new(info.clone(), blocks)) as _)
    };
    Ok(analyze(open, log, &options)?)
}
