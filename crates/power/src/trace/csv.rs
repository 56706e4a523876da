//! CSV with columns named by their units.

use super::chunks::{Decoded, LineCount, Lines, Pipeline, ReadOptions};
use super::{Block, Column, RowMark, TraceInfo, TraceReader, Unit, number};
use crate::{Clock, PowerError};
use std::io::Read;

/// What to do with the cells of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cell {
    /// Powers of ten from the unit to nanoseconds.
    Time(u32),
    Sample(usize),
    Mark,
    Skip,
}

struct Layout {
    separator: u8,
    cells: Vec<Cell>,
    columns: usize,
    /// Cells up to the last that is used.
    needed: usize,
}

pub(super) fn open(
    mut input: Box<dyn Read + Send>,
    options: &ReadOptions,
) -> Result<Box<dyn TraceReader>, PowerError> {
    let (head, rest) = head(&mut input)?;
    let (info, layout, lines) = parse_head(&head)?;
    let cutter = Lines::new(input, options.chunk(), rest);
    let pipeline = Pipeline::start(cutter, move |piece| Ok(layout.decode(piece)), options.threads);
    let count = LineCount::starting_at(lines);
    Ok(Box::new(CsvTrace { info, pipeline, count, last_mark: 0 }))
}

/// Splits a stream after its header: comments, and one more line. Returns also what was read beyond.
pub(super) fn head(input: &mut impl Read) -> Result<(Vec<u8>, Vec<u8>), PowerError> {
    let mut bytes = Vec::new();
    let mut start = 0;
    loop {
        while let Some(length) = bytes[start..].iter().position(|&b| b == b'\n') {
            let is_comment = matches!(bytes[start], b'#' | b'\n' | b'\r');
            start += length + 1;
            if !is_comment {
                let rest = bytes.split_off(start);
                return Ok((bytes, rest));
            }
        }
        if bytes.len() > 1 << 20 {
            return Err(PowerError::Header("the first line is longer than 1 MiB".into()));
        }
        if input.by_ref().take(64 << 10).read_to_end(&mut bytes)? == 0 {
            return Ok((bytes, Vec::new()));
        }
    }
}

fn parse_head(head: &[u8]) -> Result<(TraceInfo, Layout, u64), PowerError> {
    let text = std::str::from_utf8(head)
        .map_err(|_| PowerError::Header("the header is not text".into()))?;
    let mut info = TraceInfo::default();
    let mut header = "";
    let mut lines = 0;
    for line in text.lines() {
        lines += 1;
        let Some(comment) = line.strip_prefix('#') else {
            header = line;
            continue;
        };
        let Some((name, value)) = comment.split_once(':') else { continue };
        let value = value.trim();
        let number = value.parse::<f64>().ok().filter(|x| x.is_finite() && *x > 0.0);
        match name.trim() {
            "rate_hz" => info.rate_hz = number,
            "clock" => {
                info.clock = serde_json::from_value(value.into()).unwrap_or(Clock::Device);
            }
            "sensor" => info.sensor.name = value.into(),
            "sensor_refresh_s" => info.sensor.refresh_s = number,
            "sensor_coverage" => info.sensor.coverage = number,
            "sensor_source" => info.sensor.source = value.into(),
            _ => {}
        }
    }
    let separator = [b',', b';', b'\t', b' '].into_iter().find(|&s| header.contains(s as char));
    let separator = separator.unwrap_or(b',');
    let mut cells = Vec::new();
    for name in header.split(separator as char) {
        let name = name.trim().trim_matches('"');
        let time = match name.to_ascii_lowercase().as_str() {
            "time_s" => Some(9),
            "time_ms" => Some(6),
            "time_us" => Some(3),
            "time_ns" => Some(0),
            _ => None,
        };
        let is_second = |what: fn(&Cell) -> bool| cells.iter().any(what);
        cells.push(if let Some(shift) = time {
            if is_second(|c| matches!(c, Cell::Time(_))) {
                return Err(PowerError::Header("there are two columns of time".into()));
            }
            Cell::Time(shift)
        } else if name.eq_ignore_ascii_case("mark") || name.eq_ignore_ascii_case("marker") {
            if is_second(|c| *c == Cell::Mark) {
                return Err(PowerError::Header("there are two columns of marks".into()));
            }
            Cell::Mark
        } else if let Some(unit) = Unit::of_column(name) {
            info.columns.push(Column::new(name, unit));
            Cell::Sample(info.columns.len() - 1)
        } else {
            Cell::Skip
        });
    }
    if !cells.iter().any(|c| matches!(c, Cell::Time(_))) {
        return Err(PowerError::Header(
            "there is no column of time: name it time_s, time_ms, time_us or time_ns".into(),
        ));
    }
    if info.columns.is_empty() {
        return Err(PowerError::Header(
            "there are no samples: end names of columns with _a (amperes), _v (volts), _w (watts) \
             or _j (joules)"
                .into(),
        ));
    }
    let needed = cells.iter().rposition(|c| *c != Cell::Skip).map_or(0, |at| at + 1);
    let columns = info.columns.len();
    Ok((info, Layout { separator, cells, columns, needed }, lines))
}

impl Layout {
    fn decode(&self, piece: &[u8]) -> Decoded {
        let mut decoded =
            Decoded { block: Block::with_columns(self.columns), ..Decoded::default() };
        let guess = piece.len() / (8 * self.needed.max(1)) + 1;
        decoded.block.times_ns.reserve(guess);
        decoded.block.channels.iter_mut().for_each(|c| c.reserve(guess));
        let mut row = vec![f64::NAN; self.columns];
        for line in piece.split(|&b| b == b'\n') {
            decoded.lines += 1;
            let line = line.trim_ascii();
            if line.is_empty() || line[0] == b'#' {
                continue;
            }
            match self.line(line, &mut row) {
                Ok((time, mark)) => {
                    let block = &mut decoded.block;
                    if mark != 0 {
                        block.marks.push(RowMark { row: block.times_ns.len(), label: mark });
                    }
                    block.times_ns.push(time);
                    for (channel, &value) in block.channels.iter_mut().zip(&row) {
                        channel.push(value);
                    }
                }
                Err(reason) => {
                    decoded.bad += 1;
                    decoded.first_bad.get_or_insert_with(|| (decoded.lines - 1, reason));
                }
            }
        }
        // The piece ends with a line break, after which there is no line.
        if piece.ends_with(b"\n") {
            decoded.lines -= 1;
        }
        decoded
    }

    /// The time and the label of the mark, 0 without one; samples go into `row`.
    fn line(&self, line: &[u8], row: &mut [f64]) -> Result<(i64, u8), String> {
        let mut time = None;
        let mut mark = 0;
        let mut rest = Some(line);
        for (at, cell) in self.cells[..self.needed].iter().enumerate() {
            let Some(text) = rest else {
                return Err(format!("{at} of {} cells", self.cells.len()));
            };
            let end = text.iter().position(|&b| b == self.separator);
            let text = match end {
                Some(end) => {
                    rest = Some(&text[end + 1..]);
                    &text[..end]
                }
                None => {
                    rest = None;
                    text
                }
            };
            match cell {
                Cell::Time(shift) => time = number::scaled(text.trim_ascii(), *shift),
                Cell::Sample(column) => row[*column] = number::float(text.trim_ascii()),
                Cell::Mark => {
                    mark = match text.trim_ascii() {
                        [] | b"S" | b"." | b"\"\"" => 0,
                        number if number.iter().all(|b| matches!(b, b'0' | b'.')) => 0,
                        label => label[0],
                    }
                }
                Cell::Skip => {}
            }
        }
        time.map(|time| (time, mark)).ok_or_else(|| "the time is not a number".into())
    }
}

struct CsvTrace {
    info: TraceInfo,
    pipeline: Pipeline,
    count: LineCount,
    /// Label of the row before; a mark that lasts is one mark.
    last_mark: u8,
}

impl TraceReader for CsvTrace {
    fn info(&self) -> &TraceInfo {
        &self.info
    }

    fn next_block(&mut self) -> Result<Option<Block>, PowerError> {
        while let Some(piece) = self.pipeline.next() {
            let mut piece = piece?;
            self.count.add(&mut piece)?;
            let mut block = piece.block;
            let Some(last) = block.len().checked_sub(1) else { continue };
            let mut before = (self.last_mark != 0).then_some((usize::MAX, self.last_mark));
            self.last_mark =
                block.marks.last().map_or(0, |m| if m.row == last { m.label } else { 0 });
            block.marks.retain(|mark| {
                let is_same = before == Some((mark.row.wrapping_sub(1), mark.label));
                before = Some((mark.row, mark.label));
                !is_same
            });
            return Ok(Some(block));
        }
        Ok(None)
    }

    fn broken_lines(&self) -> u64 {
        self.count.bad()
    }
}
