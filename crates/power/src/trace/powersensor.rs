//! Dumps of PowerSensor3 (van der Vlugt et al., github.com/nlesc-recruit/PowerSensor3).

use super::chunks::{Decoded, LineCount, Lines, Pipeline, RawTime, ReadOptions};
use super::{Block, Column, RowMark, SensorNote, TraceInfo, TraceReader, Unit, number};
use crate::PowerError;
use std::io::Read;

/// The device's timestamp has ten bits of microseconds; a newer one that exceeds them has 32.
const SHORT_WRAP: i64 = 1 << 10;
const LONG_WRAP: i64 = 1 << 32;

/// Host time beyond what the device counted, from which on rows may have been lost.
const LOSS_US: i64 = 5_000;

/// Rows come through USB in bursts: the host waits for milliseconds, then gets many rows at once. If it
/// catches up within so many rows, nothing was lost.
const CATCH_UP_ROWS: usize = 1000;

#[derive(Clone, Copy)]
enum Cell {
    Sample(usize),
    Skip,
}

pub(super) fn open(
    mut input: Box<dyn Read + Send>,
    options: &ReadOptions,
) -> Result<Box<dyn TraceReader>, PowerError> {
    let (head, rest) = super::csv::head(&mut input)?;
    let text = std::str::from_utf8(&head)
        .map_err(|_| PowerError::Header("the header is not text".into()))?;
    let names: Vec<_> = text.split_ascii_whitespace().collect();
    if names.len() < 4 || names[..4] != ["marker", "time", "dt_micro", "device_timestamp"] {
        return Err(PowerError::Header(
            "a dump of PowerSensor3 begins with: marker time dt_micro device_timestamp".into(),
        ));
    }
    let mut columns = Vec::new();
    let cells: Vec<_> = names[4..]
        .iter()
        .map(|name| {
            let (number, unit) = if let Some(number) = name.strip_prefix("current") {
                (number, Unit::Amperes)
            } else if let Some(number) = name.strip_prefix("voltage") {
                (number, Unit::Volts)
            } else {
                return Cell::Skip;
            };
            columns.push(Column::new(format!("pair{number}{}", unit.suffix()), unit));
            Cell::Sample(columns.len() - 1)
        })
        .collect();
    if columns.is_empty() {
        return Err(PowerError::Header("the dump has no pair of sensors".into()));
    }
    let sensor = SensorNote { name: "PowerSensor3".into(), ..SensorNote::default() };
    let count = columns.len();
    let decode = move |piece: &[u8]| Ok(decode(piece, &cells, count));
    Ok(Box::new(Dump {
        info: TraceInfo { columns, sensor, ..TraceInfo::default() },
        pipeline: Pipeline::start(
            Lines::new(input, options.chunk(), rest),
            decode,
            options.threads,
        ),
        count: LineCount::starting_at(1),
        clock: None,
        pending_mark: None,
    }))
}

/// A mark on a line of its own belongs to the row after it; this row number stands for that row when
/// the piece ends first.
fn decode(piece: &[u8], cells: &[Cell], columns: usize) -> Decoded {
    let mut decoded = Decoded { block: Block::with_columns(columns), ..Decoded::default() };
    let mut row = vec![f64::NAN; columns];
    for line in piece.split(|&b| b == b'\n') {
        decoded.lines += 1;
        let line = line.trim_ascii();
        if line.is_empty() {
            continue;
        }
        let label = line[0];
        match parse(line, cells, &mut row) {
            Some(time) => {
                let block = &mut decoded.block;
                let at = block.channels[0].len();
                if label != b'S' && block.marks.last().is_none_or(|mark| mark.row != at) {
                    block.marks.push(RowMark { row: at, label });
                }
                for (channel, &value) in block.channels.iter_mut().zip(&row) {
                    channel.push(value);
                }
                decoded.raw_times.push(time);
            }
            // Lines "M c" of the host's library; those with times are intervals for other tools.
            None if line.len() == 3 && line.starts_with(b"M ") => {
                let at = decoded.block.channels[0].len();
                decoded.block.marks.push(RowMark { row: at, label: line[2] });
            }
            None if line.starts_with(b"M ") && line.ends_with(b"\"") => {}
            None => {
                decoded.bad += 1;
                let reason = "not: marker, time, dt_micro, device_timestamp, samples";
                decoded.first_bad.get_or_insert_with(|| (decoded.lines - 1, reason.into()));
            }
        }
    }
    if piece.ends_with(b"\n") {
        decoded.lines -= 1;
    }
    decoded
}

fn parse(line: &[u8], cells: &[Cell], row: &mut [f64]) -> Option<RawTime> {
    let mut words = line.split(|&b| b == b' ').filter(|w| !w.is_empty());
    if words.next()?.len() != 1 {
        return None;
    }
    let time = RawTime {
        host_ns: number::scaled(words.next()?, 9)?,
        host_step_us: number::scaled(words.next()?, 0)?,
        device_us: number::scaled(words.next()?, 0)?,
    };
    for cell in cells {
        match cell {
            Cell::Sample(column) => row[*column] = number::float(words.next()?),
            // The last cells may be missing where a line was cut off, but only if nothing needs them.
            Cell::Skip => drop(words.next()),
        }
    }
    Some(time)
}

/// Time so far, from differences of the device's timestamp.
struct DeviceClock {
    wrap: i64,
    /// False where the firmware does not send timestamps, so that all are equal.
    is_usable: bool,
    last: RawTime,
    time_us: i64,
}

impl DeviceClock {
    fn new(times: &[RawTime]) -> Self {
        let first = times[0];
        let is_long = times.iter().any(|t| t.device_us >= SHORT_WRAP);
        Self {
            wrap: if is_long { LONG_WRAP } else { SHORT_WRAP },
            is_usable: times.len() < 2 || times.iter().any(|t| t.device_us != first.device_us),
            last: first,
            time_us: first.host_ns / 1000,
        }
    }

    fn step_us(&self, before: RawTime, after: RawTime) -> i64 {
        let step = (after.device_us - before.device_us).rem_euclid(self.wrap);
        // A step beyond half of the long range is one back, such as a row out of order.
        if self.wrap == LONG_WRAP && step > LONG_WRAP / 2 { step - LONG_WRAP } else { step }
    }

    /// Time that ten bits cannot show: whole milliseconds that the host waited before the first of
    /// these rows and did not catch up in those after it.
    fn lost_us(&self, step: i64, rows: &[RawTime]) -> i64 {
        let mut lead = rows[0].host_step_us - step;
        if self.wrap != SHORT_WRAP || lead <= LOSS_US {
            return 0;
        }
        let mut least = lead;
        for pair in rows.windows(2).take(CATCH_UP_ROWS) {
            lead += pair[1].host_step_us - self.step_us(pair[0], pair[1]);
            least = least.min(lead);
        }
        if least > LOSS_US / 2 { (least + SHORT_WRAP / 2) / SHORT_WRAP * SHORT_WRAP } else { 0 }
    }

    /// Times of rows in nanoseconds.
    fn times(&mut self, rows: &[RawTime]) -> Vec<i64> {
        let mut times = Vec::with_capacity(rows.len());
        for (at, &row) in rows.iter().enumerate() {
            if !self.is_usable {
                times.push(row.host_ns);
                continue;
            }
            let step = self.step_us(self.last, row);
            self.time_us += step + self.lost_us(step, &rows[at..]);
            self.last = row;
            times.push(self.time_us * 1000);
        }
        times
    }
}

struct Dump {
    info: TraceInfo,
    pipeline: Pipeline,
    count: LineCount,
    clock: Option<DeviceClock>,
    /// A mark whose row is in the next piece.
    pending_mark: Option<u8>,
}

impl TraceReader for Dump {
    fn info(&self) -> &TraceInfo {
        &self.info
    }

    fn next_block(&mut self) -> Result<Option<Block>, PowerError> {
        while let Some(piece) = self.pipeline.next() {
            let mut piece = piece?;
            self.count.add(&mut piece)?;
            let rows = piece.raw_times.len();
            let mut block = piece.block;
            if rows == 0 {
                self.pending_mark = block.marks.last().map(|m| m.label).or(self.pending_mark);
                continue;
            }
            if let Some(label) = self.pending_mark.take() {
                block.marks.insert(0, RowMark { row: 0, label });
            }
            if let Some(mark) = block.marks.pop_if(|mark| mark.row == rows) {
                self.pending_mark = Some(mark.label);
            }
            let clock = self.clock.get_or_insert_with(|| DeviceClock::new(&piece.raw_times));
            block.times_ns = clock.times(&piece.raw_times);
            return Ok(Some(block));
        }
        Ok(None)
    }

    fn broken_lines(&self) -> u64 {
        self.count.bad()
    }
}
