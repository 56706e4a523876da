//! From samples to power: repair within bounds, calibration, P = Σ U·I.

mod quality;
mod samples;
mod times;

pub use quality::{Fault, FaultCount, Flag, Quality, RailTotal};

use crate::rails::{Wired, WiredKind, wire};
use crate::{Block, PowerError, Rail, TraceInfo, TraceReader};
use times::{Rows, Times};

/// How far repair may go.
#[derive(Clone, Debug, PartialEq)]
pub struct CleanOptions {
    /// Gaps up to this time, in seconds, or up to three rows if that is more, are interpolated; longer
    /// ones are holes. The default is 1 ms.
    pub bridge_s: f64,
    /// Up to so many samples of a column on end that are not numbers are interpolated; more are a hole.
    /// The default is 8.
    pub repair_rows: usize,
    /// A counter of energy that has not moved for so many seconds is taken to have stopped. The default
    /// is 1 s.
    pub counter_s: f64,
}

impl Default for CleanOptions {
    fn default() -> Self {
        Self { bridge_s: 1e-3, repair_rows: 8, counter_s: 1.0 }
    }
}

/// A mark of a trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Mark {
    /// When, in nanoseconds of the trace.
    pub time_ns: i64,
    /// Its character.
    pub label: u8,
}

/// Power over a stretch of time without holes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PowerBlock {
    /// Times, strictly increasing, in nanoseconds of the trace.
    pub times_ns: Vec<i64>,
    /// The power of all rails together at those times, in watts; finite.
    pub watts: Vec<f32>,
    /// Marks.
    pub marks: Vec<Mark>,
    /// Where samples were interpolated or clipped.
    pub flags: Vec<Flag>,
    /// Whether there is a hole between the block before and this one. (The first block has none.)
    pub follows_hole: bool,
}

/// Turns rows into power.
#[derive(Debug)]
pub struct Cleaner {
    rails: Vec<Wired>,
    options: CleanOptions,
    times: Times,
    /// Rows in order whose last samples wait for a good one.
    tail: Rows,
    /// Last good sample of each column.
    last_good: Vec<f64>,
    /// Time and energies at the last row that was let through, for slopes.
    last_energy: Option<(i64, Vec<f64>)>,
    next_follows_hole: bool,
    has_rows: bool,
    watts: Vec<f64>,
    rail_sums: Vec<f64>,
    good_rows: f64,
    changes: samples::Changes,
    extremes: Vec<samples::Extreme>,
    quality: Quality,
}

impl Cleaner {
    /// A cleaner of rows with the columns of a trace.
    ///
    /// # Errors
    /// [`PowerError::Rails`] if rails and columns do not fit, [`PowerError::Setting`] for options that
    /// are negative or not numbers.
    pub fn new(
        info: &TraceInfo,
        rails: &[Rail],
        options: &CleanOptions,
    ) -> Result<Self, PowerError> {
        let is_valid = |x: f64| x.is_finite() && x >= 0.0;
        if !is_valid(options.bridge_s) || !is_valid(options.counter_s) {
            return Err(PowerError::Setting("times of repair must not be negative".into()));
        }
        if info.rate_hz.is_some_and(|rate| !rate.is_finite() || rate <= 0.0) {
            return Err(PowerError::Header("the rate must be a positive number".into()));
        }
        let wired = wire(rails, &info.columns)?;
        let totals =
            rails.iter().map(|r| RailTotal { name: r.name.clone(), ..RailTotal::default() });
        Ok(Self {
            times: Times::new(info.rate_hz, options.bridge_s * 1e9),
            tail: Rows { block: Block::with_columns(info.columns.len()), ..Rows::default() },
            last_good: vec![f64::NAN; info.columns.len()],
            last_energy: None,
            next_follows_hole: false,
            has_rows: false,
            watts: Vec::new(),
            rail_sums: vec![0.0; wired.len()],
            good_rows: 0.0,
            changes: samples::Changes::default(),
            extremes: vec![samples::Extreme::default(); wired.len()],
            quality: Quality { rails: totals.collect(), ..Quality::default() },
            options: options.clone(),
            rails: wired,
        })
    }

    /// Takes rows; adds the stretches of power that are complete to `out`.
    pub fn push(&mut self, block: Block, out: &mut Vec<PowerBlock>) {
        self.quality.rows += block.len() as u64;
        self.quality.samples += (block.len() * block.channels.len()) as u64;
        self.step(block, false, out);
    }

    /// Ends the trace: adds what is left to `out` and says how good it was.
    #[must_use]
    pub fn finish(mut self, broken_lines: u64, out: &mut Vec<PowerBlock>) -> Quality {
        let columns = self.last_good.len();
        self.step(Block::with_columns(columns), true, out);
        let mut quality = self.quality;
        quality.broken_lines = broken_lines;
        quality.period_ns = self.times.period_ns;
        quality.jitter_ns = self.times.jitter_ns();
        quality.refresh_ns = self.changes.median_rows() * self.times.period_ns;
        for (((total, sum), extreme), rail) in
            quality.rails.iter_mut().zip(&self.rail_sums).zip(&self.extremes).zip(&self.rails)
        {
            total.mean_w = if self.good_rows > 0.0 { sum / self.good_rows } else { 0.0 };
            // Where readings stand still between updates, repetition means nothing.
            let is_fast = self.changes.median_rows() <= 1.0;
            let is_open = rail.range.is_none();
            total.suspected_run = extreme.suspected().filter(|_| is_fast && is_open);
        }
        quality
    }

    fn step(&mut self, block: Block, is_last: bool, out: &mut Vec<PowerBlock>) {
        let fresh = self.times.push(block, is_last, &mut self.quality);
        self.changes.add(&fresh.block, self.rails.iter().map(|rail| rail.main));
        let mut rows = std::mem::take(&mut self.tail);
        if rows.block.is_empty() {
            rows = fresh;
        } else {
            let base = rows.block.len();
            if !fresh.is_synthetic.is_empty() || !rows.is_synthetic.is_empty() {
                rows.is_synthetic.resize(base, false);
                rows.is_synthetic.extend_from_slice(&fresh.is_synthetic);
                rows.is_synthetic.resize(base + fresh.block.len(), false);
            }
            rows.block.append(&fresh.block);
            rows.holes.extend(fresh.holes.iter().map(|row| row + base));
        }
        if rows.block.is_empty() {
            return;
        }
        let mut repair = self.repair(&mut rows, is_last);
        if repair.keep < rows.block.len() {
            self.tail = split_off(&mut rows, repair.keep);
            repair.is_bad.truncate(repair.keep);
            if repair.keep == 0 {
                return;
            }
        }
        self.power(&rows);
        self.emit(&rows, repair, out);
    }

    /// Power of each row, into `self.watts`.
    fn power(&mut self, rows: &Rows) {
        let n = rows.block.len();
        let times = &rows.block.times_ns;
        self.watts.clear();
        self.watts.resize(n, 0.0);
        let energies = self.last_energy.take();
        for (which, rail) in self.rails.iter().enumerate() {
            let main = &rows.block.channels[rail.main];
            let (gain, offset) = (rail.calibration.gain, rail.calibration.offset);
            let mut sum = 0.0;
            match rail.kind {
                WiredKind::Power => {
                    for (watts, raw) in self.watts.iter_mut().zip(main) {
                        let power = gain * raw + offset;
                        *watts += power;
                        sum += power;
                    }
                }
                WiredKind::Volts(volts) => {
                    let (gain, offset) = (gain * volts, offset * volts);
                    for (watts, raw) in self.watts.iter_mut().zip(main) {
                        let power = gain * raw + offset;
                        *watts += power;
                        sum += power;
                    }
                }
                WiredKind::Voltage(column, voltage) => {
                    for ((watts, raw), u) in
                        self.watts.iter_mut().zip(main).zip(&rows.block.channels[column])
                    {
                        let power = (gain * raw + offset) * (voltage.gain * u + voltage.offset);
                        *watts += power;
                        sum += power;
                    }
                }
                WiredKind::Energy => {
                    let before = energies.as_ref().filter(|_| rows.holes.first() != Some(&0));
                    for row in 0..n {
                        let starts = row == 0 || rows.holes.binary_search(&row).is_ok();
                        let slope = |from: (i64, f64), to: usize| {
                            (main[to] - from.1) / ((times[to] - from.0) as f64 * 1e-9)
                        };
                        let power = if !starts {
                            slope((times[row - 1], main[row - 1]), row)
                        } else if let Some((time, values)) = before.filter(|_| row == 0) {
                            slope((*time, values[which]), row)
                        } else if row + 1 < n {
                            // Nothing before the first row: the first slope holds there too.
                            slope((times[row], main[row]), row + 1)
                        } else {
                            f64::NAN
                        };
                        self.watts[row] += gain * power;
                        sum += if power.is_finite() { gain * power } else { 0.0 };
                    }
                }
            }
            // Bad rows make the sum not a number; the rows that count are added one by one then.
            self.rail_sums[which] += if sum.is_finite() { sum } else { self.sum_good(rows, which) };
        }
        if self.rails.iter().any(|r| matches!(r.kind, WiredKind::Energy)) {
            let values = self.rails.iter().map(|r| rows.block.channels[r.main][n - 1]).collect();
            self.last_energy = Some((times[n - 1], values));
        }
    }

    fn sum_good(&self, rows: &Rows, which: usize) -> f64 {
        let rail = &self.rails[which];
        let main = &rows.block.channels[rail.main];
        let power = |(row, raw): (usize, &f64)| {
            let value = rail.calibration.apply(*raw);
            match rail.kind {
                WiredKind::Power => value,
                WiredKind::Volts(volts) => value * volts,
                WiredKind::Voltage(at, voltage) => {
                    value * voltage.apply(rows.block.channels[at][row])
                }
                WiredKind::Energy => f64::NAN,
            }
        };
        main.iter().enumerate().map(power).filter(|p| p.is_finite()).sum()
    }

    /// Cuts rows at holes and bad rows.
    fn emit(&mut self, rows: &Rows, repair: samples::Repair, out: &mut Vec<PowerBlock>) {
        let times = &rows.block.times_ns;
        let n = times.len();
        let is_bad = |row: usize| {
            repair.is_bad.get(row).copied().unwrap_or(false) || !is_power(self.watts[row])
        };
        let has_bad = !repair.is_bad.is_empty() || !self.watts.iter().all(|w| is_power(*w));
        let mut holes = rows.holes.iter().copied().peekable();
        let mut marks = rows.block.marks.iter().peekable();
        let mut flags = Some(repair.flags);
        let mut row = 0;
        while row < n {
            if holes.next_if(|&hole| hole == row).is_some() {
                self.next_follows_hole = self.has_rows;
            }
            if has_bad && is_bad(row) {
                self.next_follows_hole = self.has_rows;
                row += 1;
                continue;
            }
            let limit = holes.peek().copied().unwrap_or(n);
            let end =
                if has_bad { (row..limit).find(|&r| is_bad(r)).unwrap_or(limit) } else { limit };
            let mut power = PowerBlock {
                times_ns: times[row..end].to_vec(),
                #[expect(clippy::cast_possible_truncation, reason = "24 bits exceed any sensor's")]
                watts: self.watts[row..end].iter().map(|w| *w as f32).collect(),
                marks: Vec::new(),
                // Flags know their times; they go with the first block of these rows.
                flags: flags.take().unwrap_or_default(),
                follows_hole: self.next_follows_hole,
            };
            while let Some(mark) = marks.next_if(|mark| mark.row < end) {
                power.marks.push(Mark { time_ns: times[mark.row], label: mark.label });
            }
            if !self.has_rows {
                self.quality.span_ns.0 = times[row];
            }
            self.quality.span_ns.1 = times[end - 1];
            self.good_rows += (end - row) as f64;
            self.has_rows = true;
            self.next_follows_hole = false;
            out.push(power);
            row = end;
        }
    }
}

/// Whether a number can be a power. What lies beyond is a broken reading, and its sums would leave the
/// range of `f32`.
fn is_power(watts: f64) -> bool {
    watts.abs() <= 1e30
}

/// Splits rows off the end.
fn split_off(rows: &mut Rows, at: usize) -> Rows {
    let block = Block {
        times_ns: rows.block.times_ns.split_off(at),
        channels: rows.block.channels.iter_mut().map(|c| c.split_off(at)).collect(),
        marks: {
            let first = rows.block.marks.partition_point(|m| m.row < at);
            let mut marks = rows.block.marks.split_off(first);
            marks.iter_mut().for_each(|m| m.row -= at);
            marks
        },
    };
    let first = rows.holes.partition_point(|&row| row < at);
    let mut holes = rows.holes.split_off(first);
    holes.iter_mut().for_each(|row| *row -= at);
    let is_synthetic =
        if rows.is_synthetic.len() > at { rows.is_synthetic.split_off(at) } else { Vec::new() };
    Rows { block, is_synthetic, holes }
}

/// A source of power.
pub trait PowerStream {
    /// The next stretch of power; none at the end.
    ///
    /// # Errors
    /// Those of the source.
    fn next_power(&mut self) -> Result<Option<PowerBlock>, PowerError>;
}

/// Cleans what a reader reads.
#[derive(Debug)]
pub struct CleanStream<R> {
    reader: R,
    cleaner: Option<Cleaner>,
    ready: Vec<PowerBlock>,
    quality: Quality,
}

impl<R: TraceReader> CleanStream<R> {
    /// A stream of the power of rails; see [`Cleaner::new`].
    ///
    /// # Errors
    /// As [`Cleaner::new`].
    pub fn new(reader: R, rails: &[Rail], options: &CleanOptions) -> Result<Self, PowerError> {
        let cleaner = Cleaner::new(reader.info(), rails, options)?;
        Ok(Self { reader, cleaner: Some(cleaner), ready: Vec::new(), quality: Quality::default() })
    }

    /// How good the trace was, once it has ended.
    #[must_use]
    pub fn into_quality(self) -> Quality {
        self.quality
    }
}

impl<R: TraceReader> PowerStream for CleanStream<R> {
    fn next_power(&mut self) -> Result<Option<PowerBlock>, PowerError> {
        while self.ready.is_empty() {
            let Some(mut cleaner) = self.cleaner.take() else { return Ok(None) };
            if let Some(block) = self.reader.next_block()? {
                cleaner.push(block, &mut self.ready);
                self.cleaner = Some(cleaner);
            } else {
                self.quality = cleaner.finish(self.reader.broken_lines(), &mut self.ready);
            }
            self.ready.reverse();
        }
        Ok(self.ready.pop())
    }
}
