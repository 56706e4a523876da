//! Where power comes from: meters of this machine, or the trace of an instrument beside it.

use anyhow::{Context, Result, bail};
use niwaki_power::{
    Block, JoinedMeter, Meter, NvmlMeter, PowerError, RaplMeter, ReadOptions, Recorder,
    RecorderOptions, RecorderStopper, TraceInfo, TraceReader, Unit, find_meters, now_ns,
    open_trace,
};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// What `--source` says.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) enum PowerSource {
    /// The meter of the device that renders, if there is one.
    #[default]
    Auto,
    /// None.
    Nothing,
    /// The processor's counters, below this folder if one is named.
    Rapl(Option<PathBuf>),
    /// NVIDIA's library, the device of this number.
    Nvml(u32),
    /// The trace that an instrument writes meanwhile.
    File(PathBuf),
}

impl FromStr for PowerSource {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, rest) =
            text.split_once(':').map_or((text, None), |(name, rest)| (name, Some(rest)));
        match (name, rest) {
            ("auto", None) => Ok(Self::Auto),
            ("none", None) => Ok(Self::Nothing),
            ("rapl", folder) => Ok(Self::Rapl(folder.map(PathBuf::from))),
            ("nvml", None) => Ok(Self::Nvml(0)),
            ("nvml", Some(number)) => {
                number.parse().map(Self::Nvml).map_err(|_| format!("{number:?} numbers no device"))
            }
            ("csv", Some(file)) if !file.is_empty() => Ok(Self::File(file.into())),
            _ => {
                Err("wanted is auto, none, rapl, rapl:FOLDER, nvml, nvml:NUMBER or csv:FILE".into())
            }
        }
    }
}

/// The kinds of devices whose power a processor's counters hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A software driver, or graphics within the processor.
    Processor,
    /// A card.
    Card,
    /// Unknown.
    Other,
}

/// A source that is there.
pub(crate) enum Opened {
    /// None; why.
    Nothing(String),
    /// Meters, and what has to be said of them.
    Meters(Vec<Box<dyn Meter>>, Vec<String>),
    /// A trace that is being written.
    File(PathBuf),
}

/// The meters of this machine, all that there are; an error if there are none.
fn all_meters() -> Result<Vec<Box<dyn Meter>>> {
    let (meters, missing) = find_meters();
    for error in &missing {
        eprintln!("not recorded: {error}");
    }
    if meters.is_empty() {
        bail!(
            "this machine has no meter that can be read; record with an instrument of your own and \
             give its trace to: cargo xtask power analyze"
        );
    }
    Ok(meters)
}

/// The processor's counters, below a folder if one is named.
fn rapl(folder: Option<&Path>) -> Result<RaplMeter, PowerError> {
    folder.map_or_else(RaplMeter::open, RaplMeter::open_at)
}

impl PowerSource {
    /// The meters for recording whatever runs: all of this machine for `auto`.
    pub(crate) fn meters(&self) -> Result<Vec<Box<dyn Meter>>> {
        match self {
            Self::Auto => all_meters(),
            Self::Rapl(folder) => Ok(vec![Box::new(rapl(folder.as_deref())?)]),
            Self::Nvml(number) => Ok(vec![Box::new(NvmlMeter::open(*number)?)]),
            Self::Nothing => bail!("--source none: then there is nothing to record"),
            Self::File(path) => bail!(
                "--source: a trace that an instrument writes is analysed afterwards: cargo xtask power \
                 analyze {}",
                path.display()
            ),
        }
    }

    /// Opens it for the device of this name. What was asked for by name has to be there; `auto` takes
    /// only what measures this device.
    pub(crate) fn open(&self, device: &str, kind: Kind) -> Result<Opened> {
        let meters = |meter: Box<dyn Meter>, notes| Ok(Opened::Meters(vec![meter], notes));
        match self {
            Self::Nothing => Ok(Opened::Nothing("none was wanted".into())),
            Self::Rapl(folder) => meters(Box::new(rapl(folder.as_deref())?), rapl_notes(kind)),
            Self::Nvml(number) => {
                let meter = NvmlMeter::open(*number)?;
                let notes = if is_meter_of(&meter, device) {
                    Vec::new()
                } else {
                    vec![format!("{} is not {device}, which renders", meter.info().sensor.name)]
                };
                meters(Box::new(meter), notes)
            }
            Self::File(path) => {
                open_trace(path, &ReadOptions::default()).with_context(|| {
                    format!(
                        "--source: the trace {} cannot be read; start the instrument, which has to \
                         write it meanwhile, before the study",
                        path.display()
                    )
                })?;
                Ok(Opened::File(path.clone()))
            }
            Self::Auto => {
                let mut reasons = Vec::new();
                match NvmlMeter::open(0) {
                    Ok(meter) if is_meter_of(&meter, device) => {
                        return meters(Box::new(meter), Vec::new());
                    }
                    Ok(meter) => reasons.push(format!(
                        "{} is not the device that renders",
                        meter.info().sensor.name
                    )),
                    Err(error) => reasons.push(error.to_string()),
                }
                match RaplMeter::open() {
                    Ok(meter) if kind == Kind::Processor => {
                        return meters(Box::new(meter), rapl_notes(kind));
                    }
                    Ok(_) => {
                        reasons.push("RAPL measures the processor, which does not render".into());
                    }
                    Err(error) => reasons.push(error.to_string()),
                }
                Ok(Opened::Nothing(reasons.join("; ")))
            }
        }
    }
}

fn is_meter_of(meter: &NvmlMeter, device: &str) -> bool {
    let name = meter.info().sensor.name;
    let title = name.trim_start_matches("NVML: ").trim_start_matches("NVIDIA ");
    !title.is_empty() && device.contains(title)
}

fn rapl_notes(kind: Kind) -> Vec<String> {
    let words = match kind {
        Kind::Processor => {
            "RAPL measures the whole processor: what else runs on it, and the program's own work, is \
             in the energy"
        }
        _ => "RAPL measures the processor, not the device that renders: energy is the host's share",
    };
    vec![words.into()]
}

/// A meter that is recorded in the background, from which stretches of time are taken.
pub(crate) struct Session {
    info: TraceInfo,
    /// The time between rows that are made even; none if the meter is no counter.
    even_ns: Option<i64>,
    notes: Vec<String>,
    stopper: RecorderStopper,
    recorded: Arc<Mutex<Recorded>>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct Recorded {
    blocks: Vec<Block>,
    /// Why no more will come.
    ended: Option<String>,
}

impl Session {
    /// Starts recording.
    pub(crate) fn start(
        meters: Vec<Box<dyn Meter>>,
        notes: Vec<String>,
        rate_hz: f64,
    ) -> Result<Self, PowerError> {
        // Short blocks, as each stretch waits for its last reading.
        let options = RecorderOptions { rate_hz, block_s: 0.02 };
        let mut recorder = Recorder::start(JoinedMeter(meters), &options)?;
        let info = recorder.info().clone();
        let is_counter = info.columns.iter().any(|column| column.unit == Unit::Joules);
        #[expect(clippy::cast_possible_truncation, reason = "the recorder has checked the rate")]
        let even_ns = is_counter.then_some((1e9 / rate_hz) as i64);
        let stopper = recorder.stopper();
        let recorded = Arc::new(Mutex::new(Recorded::default()));
        let shared = recorded.clone();
        let thread = std::thread::Builder::new().name("power-session".into()).spawn(move || {
            let ended = loop {
                match recorder.next_block() {
                    Ok(Some(block)) => lock(&shared).blocks.push(block),
                    Ok(None) => break "the recording was stopped".to_owned(),
                    Err(error) => break error.to_string(),
                }
            };
            lock(&shared).ended = Some(ended);
        })?;
        Ok(Self { info, even_ns, notes, stopper, recorded, thread: Some(thread) })
    }

    pub(crate) const fn info(&self) -> &TraceInfo {
        &self.info
    }

    pub(crate) fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Forgets what was recorded until now, and returns the time.
    pub(crate) fn begin(&self) -> i64 {
        lock(&self.recorded).blocks.clear();
        now_ns()
    }

    /// What was recorded since a time, until now.
    ///
    /// # Errors
    /// If the meter has failed, or does not answer for seconds.
    pub(crate) fn since(&self, from_ns: i64) -> Result<Vec<Block>> {
        let now = now_ns();
        let patience = Instant::now() + Duration::from_secs(5);
        loop {
            let mut recorded = lock(&self.recorded);
            if let Some(reason) = &recorded.ended {
                bail!("the meter has ended: {reason}");
            }
            let last = recorded.blocks.last().and_then(|block| block.times_ns.last());
            if last.is_some_and(|last| *last >= now) {
                let blocks = std::mem::take(&mut recorded.blocks);
                drop(recorded);
                let mut all = Block::with_columns(self.info.columns.len());
                blocks.iter().for_each(|block| all.append(&part(block, from_ns, now)));
                return Ok(vec![match self.even_ns {
                    Some(period) => even(&all, period),
                    None => all,
                }]);
            }
            drop(recorded);
            if Instant::now() > patience {
                bail!("the meter has not answered for 5 s");
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        self.stopper.stop();
        if let Some(thread) = self.thread.take() {
            // A panic of the meter has been printed by its thread.
            let _ = thread.join();
        }
    }
}

fn lock(recorded: &Mutex<Recorded>) -> std::sync::MutexGuard<'_, Recorded> {
    recorded.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The rows of a block within a stretch of time, without marks.
pub(crate) fn part(block: &Block, from_ns: i64, to_ns: i64) -> Block {
    let keep: Vec<usize> =
        (0..block.len()).filter(|&i| (from_ns..=to_ns).contains(&block.times_ns[i])).collect();
    Block {
        times_ns: keep.iter().map(|&i| block.times_ns[i]).collect(),
        channels: block.channels.iter().map(|c| keep.iter().map(|&i| c[i]).collect()).collect(),
        marks: Vec::new(),
    }
}

/// The rows of counters at even times, interpolated. A busy machine asks a meter late, and then soon
/// again; slopes between such readings are no power that flowed, but all energy between two readings of
/// a counter is in their difference, however far apart they are. Longer pauses than [`LONGEST_NS`] stay.
fn even(block: &Block, period_ns: i64) -> Block {
    let mut out = Block::with_columns(block.channels.len());
    let Some(mut due) = block.times_ns.first().copied() else { return out };
    for (at, pair) in block.times_ns.windows(2).enumerate() {
        let (from, to) = (pair[0], pair[1]);
        if to - from > LONGEST_NS {
            due = to;
            continue;
        }
        while due < to {
            let share = (due - from) as f64 / (to - from) as f64;
            out.times_ns.push(due);
            for (to, from) in out.channels.iter_mut().zip(&block.channels) {
                to.push(from[at] + share * (from[at + 1] - from[at]));
            }
            due += period_ns.max(1);
        }
    }
    out
}

/// See [`even`].
const LONGEST_NS: i64 = 500_000_000;

/// Blocks in memory as a trace.
pub(crate) struct Blocks {
    info: TraceInfo,
    blocks: std::vec::IntoIter<Block>,
}

impl Blocks {
    pub(crate) fn new(info: TraceInfo, blocks: Vec<Block>) -> Self {
        Self { info, blocks: blocks.into_iter() }
    }
}

impl TraceReader for Blocks {
    fn info(&self) -> &TraceInfo {
        &self.info
    }

    fn next_block(&mut self) -> Result<Option<Block>, PowerError> {
        Ok(self.blocks.find(|block| !block.is_empty()))
    }
}

/// Opens a trace file, with its name in errors.
pub(crate) fn trace_of(path: &Path) -> Result<Box<dyn TraceReader>, PowerError> {
    open_trace(path, &ReadOptions::default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sources_are_read_and_refused() {
        assert_eq!("auto".parse(), Ok(PowerSource::Auto));
        assert_eq!("none".parse(), Ok(PowerSource::Nothing));
        assert_eq!("rapl".parse(), Ok(PowerSource::Rapl(None)));
        assert_eq!("rapl:/host/sys".parse(), Ok(PowerSource::Rapl(Some("/host/sys".into()))));
        assert_eq!("nvml:1".parse(), Ok(PowerSource::Nvml(1)));
        assert_eq!("csv:a:b.csv".parse(), Ok(PowerSource::File("a:b.csv".into())));
        for text in ["", "csv", "csv:", "nvml:x", "wattmeter", "auto:1"] {
            assert!(text.parse::<PowerSource>().is_err(), "{text}");
        }
    }

    #[test]
    fn counters_that_are_asked_late_are_made_even() {
        let times = [0, 1_000, 4_900, 5_000, 6_000, 600_006_000, 600_007_000];
        let joules = times.map(|t| 2.0 * t as f64);
        let block =
            Block { times_ns: times.into(), channels: vec![joules.into()], marks: Vec::new() };
        let even = even(&block, 1_000);
        let expected = [0, 1_000, 2_000, 3_000, 4_000, 5_000, 600_006_000];
        assert_eq!(even.times_ns, expected);
        assert_eq!(even.channels[0], expected.map(|t| 2.0 * t as f64));
        assert!(super::even(&Block::with_columns(1), 5).is_empty());
    }

    #[test]
    fn what_is_not_there_is_named() {
        for (source, part) in [
            (PowerSource::Rapl(Some("/no/such/folder".into())), "/no/such/folder"),
            (PowerSource::File("no-such-trace.csv".into()), "no-such-trace.csv"),
        ] {
            let error = source.open("a device", Kind::Other).err().map(|e| format!("{e:#}"));
            assert!(error.as_ref().is_some_and(|e| e.contains(part)), "{error:?}");
        }
        assert!(matches!(PowerSource::Nothing.open("", Kind::Other), Ok(Opened::Nothing(_))));
    }
}
