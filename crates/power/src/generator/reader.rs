//! Samples of a recording, as they are asked for.

use super::Recording;
use super::faults::{CLIPPED_ROWS, Kind};
use super::program::gauss;
use crate::{Block, PowerError, RowMark, TraceInfo, TraceReader};
use fastrand::Rng;

/// Rows of a block.
const ROWS: usize = 1 << 14;
/// How far a step of the clock goes back.
const STEP_NS: i64 = 250_000_000;
/// How far a stray time is off.
const STRAY_NS: i64 = 1_000_000_000;

/// Reads a [`Recording`]. Two readers give the same rows.
#[derive(Debug)]
pub struct RecordingReader {
    recording: Recording,
    random: Rng,
    row: u64,
    segment: usize,
    mark: usize,
    fault: usize,
    /// Power that flows in, behind what is drawn.
    watts: f64,
    /// What steps of the clock took away.
    shift: i64,
    skip: u64,
    not_numbers: (u64, usize),
    clipped: (u64, usize),
    /// A row that was swapped with the one after it.
    held: Option<(i64, Vec<f64>, u8)>,
}

impl RecordingReader {
    pub(super) fn new(recording: Recording) -> Self {
        let seed = recording.options.seed ^ 0x5eed_0f5a_3b1e_5000;
        Self {
            random: Rng::with_seed(seed),
            row: 0,
            segment: 0,
            mark: 0,
            fault: 0,
            watts: recording.options.idle_w,
            shift: 0,
            skip: 0,
            not_numbers: (0, 0),
            clipped: (0, 0),
            held: None,
            recording,
        }
    }

    fn emit(block: &mut Block, (time, values, label): (i64, Vec<f64>, u8)) {
        if label != 0 {
            block.marks.push(RowMark { row: block.len(), label });
        }
        block.times_ns.push(time);
        for (channel, value) in block.channels.iter_mut().zip(values) {
            channel.push(value);
        }
    }

    /// Samples of the rails at this power.
    fn samples(&mut self) -> Vec<f64> {
        let options = &self.recording.options;
        let shares: f64 = options.rails.iter().map(|r| r.share).sum();
        let mut values = Vec::with_capacity(self.recording.info.columns.len());
        for (at, rail) in options.rails.iter().enumerate() {
            let ideal = self.watts * rail.share / shares / rail.volts;
            // A cable and a regulator: two percent less at full load.
            let volts = if rail.has_voltage {
                rail.volts * (1.0 - 0.02 * (ideal / rail.full_scale_a).min(1.0))
            } else {
                rail.volts
            };
            let mut current = self.watts * rail.share / shares / volts;
            current += gauss(&mut self.random) * options.noise * rail.full_scale_a;
            if self.clipped.0 > 0 && self.clipped.1 == at {
                current += 2.0 * rail.full_scale_a;
            }
            let step = 2.0 * rail.full_scale_a / f64::from(options.bits).exp2();
            if options.bits > 0 {
                current = (current / step).round() * step;
            }
            values.push(current.clamp(-rail.full_scale_a, rail.full_scale_a));
            if rail.has_voltage {
                values.push(volts + gauss(&mut self.random) * 0.2 * options.noise * rail.volts);
            }
        }
        if self.not_numbers.0 > 0 {
            self.not_numbers.0 -= 1;
            let column = self.not_numbers.1;
            values[column] = f64::NAN;
        }
        self.clipped.0 = self.clipped.0.saturating_sub(1);
        values
    }

    fn next_row(&mut self, block: &mut Block) {
        let options = &self.recording.options;
        let period = 1e9 / options.rate_hz;
        let time = self.row as f64 * period;
        let segments = &self.recording.segments;
        while segments.get(self.segment + 1).is_some_and(|s| s.start_ns <= time) {
            self.segment += 1;
        }
        // The supply follows with its lag; exactly, for a level that is constant since the last sample
        // or since it changed.
        let segment = segments[self.segment];
        let since = (time - segment.start_ns).min(period);
        let follow =
            if options.lag_s > 0.0 { -(-since * 1e-9 / options.lag_s).exp_m1() } else { 1.0 };
        self.watts += (segment.watts - self.watts) * follow;
        let jitter = if options.sample_jitter_s > 0.0 {
            gauss(&mut self.random) * options.sample_jitter_s * 1e9
        } else {
            0.0
        };
        let mut label = 0;
        while let Some(mark) = self.recording.marks.get(self.mark).filter(|m| m.0 <= time) {
            label = mark.1;
            self.mark += 1;
        }
        let row = self.row;
        self.row += 1;
        if self.skip > 0 {
            self.skip -= 1;
            return;
        }
        let due = self.recording.faults.get(self.fault).filter(|f| f.row <= row).map(|f| f.kind);
        let columns = self.recording.info.columns.len();
        let rails = self.recording.options.rails.len();
        if let Some(kind) = due {
            self.fault += 1;
            match kind {
                Kind::Gap(rows) | Kind::Hole(rows) => {
                    self.skip = rows - 1;
                    return;
                }
                Kind::ClockStep => self.shift -= STEP_NS,
                Kind::NotANumber(rows) => self.not_numbers = (rows, self.random.usize(..columns)),
                Kind::Clipped => self.clipped = (CLIPPED_ROWS, self.random.usize(..rails)),
                Kind::Duplicate | Kind::Swap | Kind::Stray => {}
            }
        }
        let values = self.samples();
        #[expect(clippy::cast_possible_truncation, reason = "a time of the trace")]
        let mut time = (time + jitter).round() as i64 + self.shift;
        time += if due == Some(Kind::Stray) { STRAY_NS } else { 0 };
        let this = (time, values, label);
        if due == Some(Kind::Swap) {
            self.held = Some(this);
            return;
        }
        if due == Some(Kind::Duplicate) {
            Self::emit(block, (this.0, this.1.clone(), 0));
        }
        Self::emit(block, this);
        if let Some(held) = self.held.take() {
            Self::emit(block, held);
        }
    }
}

impl TraceReader for RecordingReader {
    fn info(&self) -> &TraceInfo {
        &self.recording.info
    }

    fn next_block(&mut self) -> Result<Option<Block>, PowerError> {
        let mut block = Block::with_columns(self.recording.info.columns.len());
        while block.len() < ROWS && self.row < self.recording.rows {
            self.next_row(&mut block);
        }
        Ok(if block.is_empty() { None } else { Some(block) })
    }
}
