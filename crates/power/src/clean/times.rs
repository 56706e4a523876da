//! Times in order: duplicates, disorder, steps of the clock, gaps.

use super::quality::{Fault, Flag, Quality};
use crate::{Block, RowMark};

/// Rows that are looked ahead at to tell a stray row from a step of the clock.
pub(super) const LOOK_AHEAD: usize = 8;

/// No clock shows later times: the year 2043 in nanoseconds since 1970. What claims to be later is
/// garbage, and must not overflow sums.
const FAR_NS: i64 = 1 << 61;

/// Steps of the clock that are made up for altogether.
const MAX_SHIFT_NS: i64 = 1 << 60;

/// Rows in order, with what is known of them.
#[derive(Debug, Default)]
pub(super) struct Rows {
    pub(super) block: Block,
    /// Rows that were put in for missing ones; empty if there are none.
    pub(super) is_synthetic: Vec<bool>,
    /// Rows before which there is a hole, in order.
    pub(super) holes: Vec<usize>,
}

impl Rows {
    pub(super) fn is_synthetic(&self, row: usize) -> bool {
        self.is_synthetic.get(row).copied().unwrap_or(false)
    }
}

/// Puts rows in order.
#[derive(Debug)]
pub(super) struct Times {
    /// Usual time between rows; 0 until it is known.
    pub(super) period_ns: f64,
    /// A longer time between rows is a gap.
    gap_ns: i64,
    bridge_rows: f64,
    bridge_ns: f64,
    /// Time of the last row that was let through.
    last: Option<i64>,
    /// What steps of the clock took away so far.
    shift: i64,
    /// Rows that wait for those after them.
    carry: Block,
    /// Sums for the standard deviation of steps, about the period.
    steps: (f64, f64, f64),
}

impl Times {
    pub(super) const fn new(rate_hz: Option<f64>, bridge_ns: f64) -> Self {
        let period_ns = match rate_hz {
            Some(rate) => 1e9 / rate,
            None => 0.0,
        };
        let carry = Block { times_ns: Vec::new(), channels: Vec::new(), marks: Vec::new() };
        Self {
            period_ns,
            gap_ns: 0,
            bridge_rows: 0.0,
            bridge_ns,
            last: None,
            shift: 0,
            carry,
            steps: (0.0, 0.0, 0.0),
        }
    }

    pub(super) fn jitter_ns(&self) -> f64 {
        let (n, sum, squares) = self.steps;
        if n < 2.0 { 0.0 } else { ((squares - sum * sum / n) / (n - 1.0)).max(0.0).sqrt() }
    }

    /// The usual step and its spread from the first rows.
    fn settle(&mut self, times: &[i64]) {
        let mut steps: Vec<_> = times
            .windows(2)
            .map(|pair| pair[1].saturating_sub(pair[0]))
            .filter(|&step| step > 0)
            .collect();
        if steps.is_empty() {
            return;
        }
        let middle = |steps: &mut [i64]| {
            let at = steps.len() / 2;
            *steps.select_nth_unstable(at).1 as f64
        };
        let found = middle(&mut steps);
        if self.period_ns == 0.0 {
            self.period_ns = found;
        }
        let period = self.period_ns;
        steps.iter_mut().for_each(|step| *step = abs(*step as f64 - period));
        // Instruments with a clock of their own hardly deviate; those that a thread reads do.
        let spread = middle(&mut steps);
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        {
            self.gap_ns = (1.5 * period).max(period + 12.0 * spread) as i64;
        }
        self.bridge_rows = (self.bridge_ns / period).max(3.0);
    }

    /// Takes rows and returns those that can be told to be in order; `is_last` returns the rest too.
    pub(super) fn push(&mut self, block: Block, is_last: bool, quality: &mut Quality) -> Rows {
        let mut block = block;
        block.times_ns.iter_mut().for_each(|t| *t = (*t).clamp(-FAR_NS, FAR_NS));
        let mut work = std::mem::take(&mut self.carry);
        if work.is_empty() {
            work = block;
        } else {
            work.append(&block);
        }
        if work.is_empty() {
            return Rows { block: work, ..Rows::default() };
        }
        if self.gap_ns == 0 {
            if work.len() < 64 && !is_last {
                self.carry = work;
                return Rows::default();
            }
            self.settle(&work.times_ns[..work.len().min(4096)]);
        }
        if self.is_in_order(&work.times_ns) {
            let before = self.last.unwrap_or(work.times_ns[0] + self.shift);
            if self.shift != 0 {
                work.times_ns.iter_mut().for_each(|t| *t += self.shift);
            }
            self.count_steps(before, &work.times_ns);
            self.last = work.times_ns.last().copied().or(self.last);
            return Rows { block: work, ..Rows::default() };
        }
        self.slow(work, is_last, quality)
    }

    fn is_in_order(&self, times: &[i64]) -> bool {
        let Some(&first) = times.first() else { return true };
        let is_next = |step: i64| step > 0 && step <= self.gap_ns;
        let starts = self.last.is_none_or(|last| is_next(first + self.shift - last));
        starts && times.windows(2).all(|pair| is_next(pair[1].wrapping_sub(pair[0])))
    }

    fn count_steps(&mut self, before: i64, times: &[i64]) {
        // Sums over a block about the usual step, so that nothing cancels.
        let Some(&last) = times.last() else { return };
        let (mut squares, mut previous) = (0.0, before);
        for &time in times {
            let off = (time - previous) as f64 - self.period_ns;
            squares += off * off;
            previous = time;
        }
        let n = times.len() as f64;
        self.steps.0 += n;
        self.steps.1 += (last - before) as f64 - n * self.period_ns;
        self.steps.2 += squares;
    }

    fn slow(&mut self, mut work: Block, is_last: bool, quality: &mut Quality) -> Rows {
        let mut rows = Rows { block: Block::with_columns(work.channels.len()), ..Rows::default() };
        let end = if is_last { work.len() } else { work.len().saturating_sub(LOOK_AHEAD) };
        let marks = std::mem::take(&mut work.marks);
        let mut marks = marks.into_iter().peekable();
        // The label of a mark whose row was dropped, for the next row.
        let mut pending = None;
        for at in 0..end {
            let label = marks.next_if(|mark| mark.row == at).map(|m| m.label).or(pending.take());
            let Some(last) = self.last else {
                self.accept(&mut rows, &work, at, label);
                continue;
            };
            let ahead = at + 1..(at + 1 + LOOK_AHEAD).min(work.len());
            let mut time = work.times_ns[at].saturating_add(self.shift);
            if time.saturating_sub(last) > self.gap_ns {
                let later = &work.times_ns[ahead.clone()];
                let shift = self.shift;
                let before =
                    |t: &i64| t.saturating_add(shift) < time && t.saturating_add(shift) > last;
                let displaced = later.iter().filter(|t| before(t)).count();
                // All that follows goes on where the last row was: this time alone is wrong.
                let is_stray = displaced == later.len()
                    && displaced >= 2
                    && later[0].saturating_add(shift) - last <= self.gap_ns + self.gap_ns;
                if displaced > 0 {
                    quality.at(Fault::OutOfOrder).count +=
                        if is_stray { 1 } else { displaced as u64 };
                    quality.at(Fault::OutOfOrder).repaired += 1;
                    flag(quality, Fault::OutOfOrder, last, last);
                }
                if is_stray {
                    let Some(middle) = self.between(last, later[0].saturating_add(shift)) else {
                        pending = label;
                        continue;
                    };
                    work.times_ns[at] = middle - shift;
                    time = middle;
                } else if displaced > 0 {
                    let reach = later.iter().rposition(before).map_or(at, |r| at + 1 + r);
                    sort_rows(&mut work, at, reach);
                    time = work.times_ns[at] + self.shift;
                }
            }
            if time == last {
                quality.at(Fault::Duplicate).count += 1;
                quality.at(Fault::Duplicate).repaired += 1;
                flag(quality, Fault::Duplicate, last, last);
                pending = label;
                continue;
            }
            if time < last {
                let stays = work.times_ns[ahead.clone()]
                    .iter()
                    .all(|t| t.saturating_add(self.shift) < last);
                let is_bounded = (self.shift + (last - time)).abs() < MAX_SHIFT_NS;
                if !stays || !is_bounded || ahead.len() < LOOK_AHEAD {
                    quality.at(Fault::OutOfOrder).count += 1;
                    quality.at(Fault::OutOfOrder).repaired += 1;
                    flag(quality, Fault::OutOfOrder, last, last);
                    let next = work.times_ns.get(at + 1).map(|t| t.saturating_add(self.shift));
                    let Some(middle) = next.and_then(|next| self.between(last, next)) else {
                        pending = label;
                        continue;
                    };
                    work.times_ns[at] = middle - self.shift;
                } else {
                    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
                    let next = last + (self.period_ns as i64).max(1);
                    self.shift += next - time;
                    quality.at(Fault::ClockStep).count += 1;
                    quality.at(Fault::ClockStep).repaired += 1;
                    flag(quality, Fault::ClockStep, last, next);
                }
            }
            self.accept_after(&mut rows, &work, at, label, last, quality);
        }
        self.carry = tail(&work, end, marks.collect());
        if let Some(label) = pending {
            match self.carry.marks.first() {
                Some(mark) if mark.row == 0 => {}
                _ if self.carry.is_empty() => {}
                _ => self.carry.marks.insert(0, RowMark { row: 0, label }),
            }
        }
        rows
    }

    /// The place of one row between two others that are two steps apart.
    fn between(&self, last: i64, next: i64) -> Option<i64> {
        let step = next.saturating_sub(last);
        let is_two = step as f64 > 1.5 * self.period_ns && step <= self.gap_ns + self.gap_ns;
        is_two.then_some(last + step / 2)
    }

    fn accept(&mut self, rows: &mut Rows, work: &Block, at: usize, label: Option<u8>) {
        let time = work.times_ns[at].saturating_add(self.shift);
        if let Some(label) = label {
            rows.block.marks.push(RowMark { row: rows.block.len(), label });
        }
        rows.block.times_ns.push(time);
        for (to, from) in rows.block.channels.iter_mut().zip(&work.channels) {
            to.push(from[at]);
        }
        if !rows.is_synthetic.is_empty() {
            rows.is_synthetic.push(false);
        }
        self.last = Some(time);
    }

    /// Accepts a row that is later than the last; fills or records what is missing between.
    fn accept_after(
        &mut self,
        rows: &mut Rows,
        work: &Block,
        at: usize,
        label: Option<u8>,
        last: i64,
        quality: &mut Quality,
    ) {
        let time = work.times_ns[at].saturating_add(self.shift);
        let step = time.saturating_sub(last);
        if step <= self.gap_ns {
            let off = step as f64 - self.period_ns;
            self.steps.0 += 1.0;
            self.steps.1 += off;
            self.steps.2 += off * off;
        } else {
            let missing = (step as f64 / self.period_ns).round() - 1.0;
            if missing <= self.bridge_rows {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a few rows, at least one"
                )]
                let missing = missing.max(1.0) as usize;
                rows.is_synthetic.resize(rows.block.len(), false);
                for put_in in 1..=missing {
                    let share = put_in as f64 / (missing + 1) as f64;
                    #[expect(clippy::cast_possible_truncation, reason = "less than the step")]
                    rows.block.times_ns.push(last + (step as f64 * share) as i64);
                    rows.block.channels.iter_mut().for_each(|c| c.push(f64::NAN));
                    rows.is_synthetic.push(true);
                }
                quality.at(Fault::Gap).count += 1;
                quality.at(Fault::Gap).repaired += missing as u64;
                flag(quality, Fault::Gap, last, time);
            } else {
                rows.holes.push(rows.block.len());
                quality.at(Fault::Hole).count += 1;
                quality.at(Fault::Hole).lost_ns += step;
                flag(quality, Fault::Hole, last, time);
            }
        }
        self.accept(rows, work, at, label);
    }
}

/// Remembers where a fault is, as long as there is room.
pub(super) fn flag(quality: &mut Quality, fault: Fault, from_ns: i64, to_ns: i64) {
    if quality.flags.len() < Quality::MAX_FLAGS {
        quality.flags.push(Flag { fault, from_ns, to_ns });
    }
}

fn abs(off: f64) -> i64 {
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    {
        off.abs() as i64
    }
}

/// Sorts a few rows by time.
fn sort_rows(work: &mut Block, from: usize, to: usize) {
    let mut order: Vec<_> = (from..=to).collect();
    order.sort_by_key(|&row| work.times_ns[row]);
    fn permute<T: Copy>(values: &mut [T], from: usize, order: &[usize]) {
        let sorted: Vec<_> = order.iter().map(|&row| values[row]).collect();
        values[from..from + sorted.len()].copy_from_slice(&sorted);
    }
    permute(&mut work.times_ns, from, &order);
    for channel in &mut work.channels {
        permute(channel, from, &order);
    }
}

fn tail(work: &Block, from: usize, marks: Vec<RowMark>) -> Block {
    Block {
        times_ns: work.times_ns[from..].to_vec(),
        channels: work.channels.iter().map(|c| c[from..].to_vec()).collect(),
        marks: marks.into_iter().map(|m| RowMark { row: m.row - from, ..m }).collect(),
    }
}
