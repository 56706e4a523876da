//! Samples that are not numbers, are clipped, or stand still.

use super::quality::{Fault, Flag};
use super::times::{Rows, flag};
use super::{Cleaner, WiredKind};
use crate::Block;

/// What was done about some rows.
#[derive(Debug, Default)]
pub(super) struct Repair {
    /// Rows from here on wait for later ones.
    pub(super) keep: usize,
    /// Rows without power; empty if there are none.
    pub(super) is_bad: Vec<bool>,
    pub(super) flags: Vec<Flag>,
}

/// A run of samples that are not numbers.
struct Run {
    column: usize,
    from: usize,
    to: usize,
    /// Rows of it that were recorded.
    recorded: usize,
    limit: usize,
    is_counter: bool,
}

impl Cleaner {
    pub(super) fn repair(&mut self, rows: &mut Rows, is_last: bool) -> Repair {
        self.still_counters(rows);
        let n = rows.block.len();
        let mut repair = Repair { keep: n, ..Repair::default() };
        let mut runs = self.runs(rows);
        // What reaches the end may be repaired by the rows to come; nothing is decided half.
        if !is_last {
            for run in &runs {
                if run.to == n && run.recorded <= run.limit {
                    repair.keep = repair.keep.min(run.from);
                }
            }
            while let Some(run) = runs.iter().find(|r| r.from < repair.keep && repair.keep < r.to) {
                repair.keep = run.from;
            }
            runs.retain(|run| run.from < repair.keep);
        }
        for run in &runs {
            self.mend(rows, run, &mut repair);
        }
        for row in 0..repair.keep {
            if rows.is_synthetic.is_empty() {
                break;
            }
            if rows.is_synthetic(row) && (row == 0 || !rows.is_synthetic(row - 1)) {
                let to = (row..n).find(|&r| !rows.is_synthetic(r)).unwrap_or(n) - 1;
                let times = &rows.block.times_ns;
                let flag = Flag { fault: Fault::Gap, from_ns: times[row], to_ns: times[to] };
                repair.flags.push(flag);
            }
        }
        self.clipped(rows, &mut repair);
        if repair.keep > 0 {
            for (good, channel) in self.last_good.iter_mut().zip(&rows.block.channels) {
                *good = channel[repair.keep - 1];
            }
        }
        repair
    }

    /// A counter that has not moved says nothing: its samples between two moves are interpolated.
    fn still_counters(&mut self, rows: &mut Rows) {
        for rail in self.rails.iter().filter(|r| matches!(r.kind, WiredKind::Energy)) {
            let mut last = self.last_good[rail.main];
            for row in 0..rows.block.len() {
                let value = &mut rows.block.channels[rail.main][row];
                if *value < last {
                    if let Err(at) = rows.holes.binary_search(&row) {
                        rows.holes.insert(at, row);
                        self.quality.at(Fault::Hole).count += 1;
                        let time = rows.block.times_ns[row];
                        flag(&mut self.quality, Fault::Hole, time, time);
                    }
                    last = *value;
                } else if *value == last {
                    *value = f64::NAN;
                } else if value.is_finite() {
                    last = *value;
                }
            }
        }
    }

    fn runs(&self, rows: &Rows) -> Vec<Run> {
        let mut runs = Vec::new();
        let mut add = |column: usize, limit: usize, is_counter: bool| {
            let channel = &rows.block.channels[column];
            if all_finite(channel) {
                return;
            }
            let mut from = None;
            for row in 0..=channel.len() {
                let is_good = channel.get(row).is_none_or(|x| x.is_finite());
                match (from, is_good) {
                    (None, false) => from = Some(row),
                    (Some(start), true) => {
                        let recorded = (start..row).filter(|&r| !rows.is_synthetic(r)).count();
                        runs.push(Run {
                            column,
                            from: start,
                            to: row,
                            recorded,
                            limit,
                            is_counter,
                        });
                        from = None;
                    }
                    _ => {}
                }
            }
        };
        for rail in &self.rails {
            match rail.kind {
                WiredKind::Energy => {
                    let rows = self.options.counter_s * 1e9 / self.times.period_ns.max(1.0);
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "saturates"
                    )]
                    add(rail.main, (rows as usize).max(4), true);
                }
                WiredKind::Voltage(column, _) => {
                    add(rail.main, self.options.repair_rows, false);
                    add(column, self.options.repair_rows, false);
                }
                _ => add(rail.main, self.options.repair_rows, false),
            }
        }
        runs
    }

    /// Interpolates a run, or gives its rows up.
    fn mend(&mut self, rows: &mut Rows, run: &Run, repair: &mut Repair) {
        let n = rows.block.len();
        let crosses_hole = rows.holes.iter().any(|&hole| (run.from..=run.to).contains(&hole));
        let channel = &mut rows.block.channels[run.column];
        let before = if run.from > 0 { channel[run.from - 1] } else { self.last_good[run.column] };
        let after = channel.get(run.to).copied().unwrap_or(f64::NAN);
        let can_mend =
            run.recorded <= run.limit && !crosses_hole && before.is_finite() && after.is_finite();
        let times = &rows.block.times_ns;
        let (from_ns, to_ns) = (times[run.from], times[run.to - 1]);
        if !run.is_counter && run.recorded > 0 {
            let count = self.quality.at(Fault::NotANumber);
            count.count += run.recorded as u64;
            count.repaired += if can_mend { run.recorded as u64 } else { 0 };
            flag(&mut self.quality, Fault::NotANumber, from_ns, to_ns);
            repair.flags.push(Flag { fault: Fault::NotANumber, from_ns, to_ns });
        }
        if can_mend {
            let steps = (run.to - run.from + 1) as f64;
            for (step, value) in (1..).zip(&mut channel[run.from..run.to]) {
                *value = before + (after - before) * (f64::from(step) / steps);
            }
            return;
        }
        repair.is_bad.resize(n, false);
        let is_new = !repair.is_bad[run.from..run.to].contains(&true);
        repair.is_bad[run.from..run.to].fill(true);
        // A counter's rows before its first and after its last move are no fault.
        if is_new && !(run.is_counter && (!before.is_finite() || run.to == n)) {
            let hole = self.quality.at(Fault::Hole);
            hole.count += 1;
            hole.lost_ns += to_ns - from_ns;
            flag(&mut self.quality, Fault::Hole, from_ns, to_ns);
        }
    }

    fn clipped(&mut self, rows: &Rows, repair: &mut Repair) {
        let times = &rows.block.times_ns;
        for (which, rail) in self.rails.iter().enumerate() {
            let channel = &rows.block.channels[rail.main][..repair.keep];
            if !matches!(rail.kind, WiredKind::Energy) {
                self.extremes[which].add(channel);
            }
            let Some((low, high)) = rail.range else { continue };
            let is_clipped = |x: f64| x <= low || x >= high;
            let count = channel.iter().filter(|x| is_clipped(**x)).count() as u64;
            if count == 0 {
                continue;
            }
            self.quality.rails[which].clipped += count;
            self.quality.at(Fault::Clipped).count += count;
            let mut from = None;
            for row in 0..=channel.len() {
                let is_at_end = channel.get(row).is_some_and(|x| is_clipped(*x));
                match (from, is_at_end) {
                    (None, true) => from = Some(row),
                    (Some(start), false) => {
                        let (from_ns, to_ns) = (times[start], times[row - 1]);
                        flag(&mut self.quality, Fault::Clipped, from_ns, to_ns);
                        repair.flags.push(Flag { fault: Fault::Clipped, from_ns, to_ns });
                        from = None;
                    }
                    _ => {}
                }
            }
        }
    }
}

/// Whether all are numbers, without a branch for each.
fn all_finite(values: &[f64]) -> bool {
    const EXPONENT: u64 = 0x7ff0_0000_0000_0000;
    let is_bad = |x: &f64| x.to_bits() & EXPONENT == EXPONENT;
    values.chunks(1024).all(|chunk| !chunk.iter().fold(false, |any, x| any | is_bad(x)))
}

/// Lengths of runs of rows in which no sensor changes.
#[derive(Debug)]
pub(super) struct Changes {
    last: Vec<f64>,
    run: usize,
    /// Runs of each length; the last entry has all that are longer.
    lengths: Vec<u64>,
    seen: u64,
}

impl Default for Changes {
    fn default() -> Self {
        Self { last: Vec::new(), run: 0, lengths: vec![0; 1 << 14], seen: 0 }
    }
}

impl Changes {
    /// Rows after which a sensor that changes with every row needs no further look.
    const ENOUGH: u64 = 1 << 20;

    pub(super) fn add(&mut self, block: &Block, columns: impl Iterator<Item = usize> + Clone) {
        let Some(end) = block.len().checked_sub(1) else { return };
        if self.seen > Self::ENOUGH && self.median_rows() <= 1.0 {
            return;
        }
        self.seen += block.len() as u64;
        let start = self.last.is_empty();
        if start {
            self.last = columns.clone().map(|c| block.channels[c][0]).collect();
        }
        for row in usize::from(start)..=end {
            self.run += 1;
            let mut has_changed = false;
            for (last, column) in self.last.iter_mut().zip(columns.clone()) {
                let value = block.channels[column][row];
                has_changed |= value != *last && value.is_finite();
                *last = if value.is_finite() { value } else { *last };
            }
            if has_changed {
                let length = self.run.min(self.lengths.len() - 1);
                self.lengths[length] += 1;
                self.run = 0;
            }
        }
    }

    /// The median length of such runs; 1 if there were too few to tell.
    pub(super) fn median_rows(&self) -> f64 {
        let all: u64 = self.lengths.iter().sum();
        let mut below = 0;
        let middle = self.lengths.iter().position(|&count| {
            below += count;
            2 * below >= all
        });
        if all < 2 { 1.0 } else { middle.unwrap_or(1).max(1) as f64 }
    }
}

/// How often the largest sample is repeated on end.
#[derive(Clone, Debug)]
pub(super) struct Extreme {
    most: f64,
    run: u64,
    longest: u64,
    is_still: bool,
}

impl Default for Extreme {
    fn default() -> Self {
        Self { most: f64::NEG_INFINITY, run: 0, longest: 0, is_still: true }
    }
}

impl Extreme {
    fn add(&mut self, values: &[f64]) {
        let block = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if block < self.most {
            self.is_still = false;
            self.run = 0;
            return;
        }
        if block > self.most {
            self.is_still &= self.most == f64::NEG_INFINITY;
            (self.most, self.run, self.longest) = (block, 0, 0);
        }
        for value in values {
            self.run = if *value == block { self.run + 1 } else { 0 };
            self.is_still &= *value == block;
            self.longest = self.longest.max(self.run);
        }
    }

    /// The longest run, if a sensor with noise would hardly show it below the end of its range.
    pub(super) fn suspected(&self) -> Option<u64> {
        (self.longest >= 8 && !self.is_still).then_some(self.longest)
    }
}
