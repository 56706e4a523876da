//! A thread that asks a meter at even times.

use super::Meter;
use crate::{Block, CLOCK, PowerError, RowMark, TraceInfo, TraceReader, now_ns};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How a meter is asked.
#[derive(Clone, Debug, PartialEq)]
pub struct RecorderOptions {
    /// Readings a second, 0.01 to 100,000. The default is 1000: an energy counter that is refreshed
    /// every 20 to 100 ms is then seen to move within a millisecond.
    pub rate_hz: f64,
    /// Seconds after which readings are handed on at the latest. The default is 0.1.
    pub block_s: f64,
}

impl Default for RecorderOptions {
    fn default() -> Self {
        Self { rate_hz: 1000.0, block_s: 0.1 }
    }
}

/// A trace that is being recorded.
///
/// Times are those of [`now_ns`], the middle between just before and just after the reading. The thread
/// sleeps until the next even time; a reading that comes late is stamped as late as it was, and one that
/// was missed is a gap.
///
/// ```
/// use niwaki_power::{Column, Meter, PowerError, Recorder, RecorderOptions, TraceInfo, TraceReader, Unit};
///
/// struct Lamp;
///
/// impl Meter for Lamp {
///     fn info(&self) -> TraceInfo {
///         TraceInfo { columns: vec![Column::new("lamp_w", Unit::Watts)], ..TraceInfo::default() }
///     }
///     fn read(&mut self, values: &mut [f64]) -> Result<(), PowerError> {
///         values[0] = 60.0;
///         Ok(())
///     }
/// }
///
/// let mut recorder = Recorder::start(Lamp, &RecorderOptions::default())?;
/// let block = recorder.next_block()?.unwrap();
/// assert!(block.channels[0].iter().all(|w| *w == 60.0));
/// recorder.stop();
/// # Ok::<(), PowerError>(())
/// ```
#[derive(Debug)]
pub struct Recorder {
    info: TraceInfo,
    blocks: Receiver<Result<Block, PowerError>>,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug, Default)]
struct Shared {
    stop: AtomicBool,
    /// A mark for the next reading; 0 for none.
    mark: AtomicU8,
    late: AtomicU64,
}

impl Recorder {
    /// Starts the thread.
    ///
    /// # Errors
    /// [`PowerError::Setting`] for a rate out of range, or the meter's own error if it does not answer.
    pub fn start(
        mut meter: impl Meter + 'static,
        options: &RecorderOptions,
    ) -> Result<Self, PowerError> {
        if !(0.01..=1e5).contains(&options.rate_hz) {
            return Err(PowerError::Setting("a rate of 0.01 to 100,000 readings a second".into()));
        }
        let mut info = meter.info();
        info.clock = CLOCK;
        info.rate_hz = Some(options.rate_hz);
        let columns = info.columns.len();
        // A meter that cannot be read says so now, to who asked for it.
        meter.read(&mut vec![f64::NAN; columns])?;
        let period = Duration::from_secs_f64(1.0 / options.rate_hz);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in range")]
        let rows = (options.block_s * options.rate_hz).clamp(1.0, 1e6) as usize;
        // A reader that is slow for a while must not stop the meter: some minutes of room.
        let (sender, blocks) = sync_channel(4096);
        let shared = Arc::new(Shared::default());
        let thread = {
            let shared = shared.clone();
            std::thread::Builder::new()
                .name("power-meter".into())
                .spawn(move || ask(meter, columns, period, rows, &shared, &sender))?
        };
        Ok(Self { info, blocks, shared, thread: Some(thread) })
    }

    /// Puts a mark with the next reading.
    pub fn mark(&self, label: u8) {
        self.shared.mark.store(label, Ordering::Relaxed);
    }

    /// Readings so far that came more than half a period late.
    #[must_use]
    pub fn late(&self) -> u64 {
        self.shared.late.load(Ordering::Relaxed)
    }

    /// What stops the recording from another thread.
    #[must_use]
    pub fn stopper(&self) -> RecorderStopper {
        RecorderStopper(self.shared.clone())
    }

    /// Ends the recording; what was read until now can still be taken by [`TraceReader::next_block`].
    pub fn stop(&self) {
        self.shared.stop.store(true, Ordering::Relaxed);
    }
}

/// Stops a [`Recorder`] that another thread reads.
#[derive(Clone, Debug)]
pub struct RecorderStopper(Arc<Shared>);

impl RecorderStopper {
    /// As [`Recorder::stop`].
    pub fn stop(&self) {
        self.0.stop.store(true, Ordering::Relaxed);
    }
}

fn ask(
    mut meter: impl Meter,
    columns: usize,
    period: Duration,
    rows: usize,
    shared: &Shared,
    sender: &SyncSender<Result<Block, PowerError>>,
) {
    let mut values = vec![f64::NAN; columns];
    let mut block = Block::with_columns(columns);
    let mut due = Instant::now();
    while !shared.stop.load(Ordering::Relaxed) {
        let now = Instant::now();
        if now < due {
            std::thread::sleep(due - now);
        } else if now > due + period / 2 {
            shared.late.fetch_add(1, Ordering::Relaxed);
            // Readings that were missed are not made up for.
            while due + period < now {
                due += period;
            }
        }
        due += period;
        let before = now_ns();
        if let Err(error) = meter.read(&mut values) {
            // Nobody may be left to tell; the trace has ended either way.
            let _ = sender.send(Ok(block));
            let _ = sender.send(Err(error));
            return;
        }
        let time = before + (now_ns() - before) / 2;
        let label = shared.mark.swap(0, Ordering::Relaxed);
        if label != 0 {
            block.marks.push(RowMark { row: block.len(), label });
        }
        block.times_ns.push(time);
        for (channel, value) in block.channels.iter_mut().zip(&values) {
            channel.push(*value);
        }
        if block.len() >= rows {
            let full = std::mem::replace(&mut block, Block::with_columns(columns));
            if sender.send(Ok(full)).is_err() {
                return;
            }
        }
    }
    let _ = sender.send(Ok(block));
}

impl TraceReader for Recorder {
    fn info(&self) -> &TraceInfo {
        &self.info
    }

    /// Waits for readings; none after [`Recorder::stop`] once all are taken.
    fn next_block(&mut self) -> Result<Option<Block>, PowerError> {
        loop {
            match self.blocks.recv() {
                Ok(Ok(block)) if block.is_empty() => {}
                Ok(Ok(block)) => return Ok(Some(block)),
                Ok(Err(error)) => return Err(error),
                Err(_) => return Ok(None),
            }
        }
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.stop();
        // The thread may wait for room in the channel.
        while self.blocks.try_recv().is_ok() {}
        if let Some(thread) = self.thread.take() {
            while !thread.is_finished() {
                while self.blocks.try_recv().is_ok() {}
                std::thread::sleep(Duration::from_millis(1));
            }
            // A panic of the meter has been printed by its thread.
            let _ = thread.join();
        }
    }
}
