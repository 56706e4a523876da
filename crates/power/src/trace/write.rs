//! Writing traces.

use super::{Block, TraceInfo, Unit, binary};
use crate::PowerError;
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;
use std::io::Write;
use std::path::Path;

/// A file format that can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TraceFormat {
    /// CSV, as [`crate::open_trace`] describes it.
    Csv,
    /// The compact binary form, a third of the size of CSV and several times as fast to read.
    Binary,
    /// A dump as PowerSensor3's host library writes it, for columns in pairs of a current and a voltage.
    PowerSensor3,
}

impl TraceFormat {
    /// The format that a file's name ends with: `.csv`, `.dump` or `.txt` (PowerSensor3), else binary.
    #[must_use]
    pub fn of_path(path: &Path) -> Self {
        let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
        match ending.to_str() {
            Some("csv") => Self::Csv,
            Some("dump" | "txt") => Self::PowerSensor3,
            _ => Self::Binary,
        }
    }
}

/// Writes blocks to a file as they come. Give it a [`std::io::BufWriter`].
#[derive(Debug)]
pub struct TraceWriter<W> {
    output: W,
    format: TraceFormat,
    units: Vec<Unit>,
    line: String,
    first_ns: Option<i64>,
    last_ns: i64,
}

impl<W: Write> TraceWriter<W> {
    /// Writes the head of the file.
    ///
    /// # Errors
    /// [`PowerError::Stream`] if writing fails; [`PowerError::Header`] if there are no columns, a
    /// column's name does not end with its unit or contains a separator (CSV), or columns are not pairs
    /// of a current and a voltage (PowerSensor3).
    pub fn new(mut output: W, format: TraceFormat, info: &TraceInfo) -> Result<Self, PowerError> {
        let units: Vec<_> = info.columns.iter().map(|c| c.unit).collect();
        let bad = |reason: String| Err(PowerError::Header(reason));
        if units.is_empty() {
            return bad("a trace needs columns".into());
        }
        match format {
            TraceFormat::Binary => binary::write_head(&mut output, info)?,
            TraceFormat::Csv => {
                for column in &info.columns {
                    if Unit::of_column(&column.name) != Some(column.unit)
                        || column.name.contains([',', '\n', '\r', '"'])
                    {
                        let ending = column.unit.suffix();
                        return bad(format!("{:?} has to end with {ending}", column.name));
                    }
                }
                output.write_all(csv_head(info).as_bytes())?;
            }
            TraceFormat::PowerSensor3 => {
                if units.chunks(2).any(|pair| pair != [Unit::Amperes, Unit::Volts]) {
                    return bad("a dump has pairs of a current and a voltage only".into());
                }
                output.write_all(b"marker time dt_micro device_timestamp")?;
                for pair in 0..units.len() / 2 {
                    write!(output, " current{pair} voltage{pair} power{pair}")?;
                }
                output.write_all(b" power_total\n")?;
            }
        }
        let line = String::new();
        Ok(Self { output, format, units, line, first_ns: None, last_ns: 0 })
    }

    /// Writes rows.
    ///
    /// # Errors
    /// [`PowerError::Stream`] if writing fails, [`PowerError::Setting`] if the block has another number
    /// of columns or is larger than 256 MiB.
    pub fn write(&mut self, block: &Block) -> Result<(), PowerError> {
        if block.channels.len() != self.units.len() {
            return Err(PowerError::Setting("the block has other columns than the trace".into()));
        }
        if self.format == TraceFormat::Binary {
            return binary::write_block(&mut self.output, &self.units, block);
        }
        let mut marks = block.marks.iter().peekable();
        for (row, &time) in block.times_ns.iter().enumerate() {
            let mut label = None;
            while let Some(mark) = marks.next_if(|mark| mark.row <= row) {
                label = Some(mark.label as char);
            }
            self.line.clear();
            // Writing into a string cannot fail.
            let _ = if self.format == TraceFormat::Csv {
                self.csv(time, label, block, row)
            } else {
                self.dump(time, label, block, row)
            };
            self.output.write_all(self.line.as_bytes())?;
        }
        Ok(())
    }

    fn csv(
        &mut self,
        time: i64,
        label: Option<char>,
        block: &Block,
        row: usize,
    ) -> std::fmt::Result {
        let sign = if time < 0 { "-" } else { "" };
        let ns = time.unsigned_abs();
        write!(self.line, "{sign}{}.{:09}", ns / 1_000_000_000, ns % 1_000_000_000)?;
        for (channel, unit) in block.channels.iter().zip(&self.units) {
            let value = channel[row];
            if value.is_nan() {
                self.line.push(',');
            } else if *unit == Unit::Joules {
                write!(self.line, ",{value}")?;
            } else {
                self.line.push(',');
                fixed(&mut self.line, value, 5)?;
            }
        }
        self.line.push(',');
        self.line.extend(label);
        self.line.push('\n');
        Ok(())
    }

    fn dump(
        &mut self,
        time: i64,
        label: Option<char>,
        block: &Block,
        row: usize,
    ) -> std::fmt::Result {
        let first = *self.first_ns.get_or_insert(time);
        let step = if row == 0 && time == first { 0 } else { time - self.last_ns };
        self.last_ns = time;
        let label = label.unwrap_or('S');
        let seconds = (time - first) as f64 * 1e-9;
        // Six significant digits, as a C++ stream prints.
        let digits = (5.0 - seconds.max(0.1).log10().floor().max(-1.0)).max(0.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 6")]
        let digits = digits as usize;
        let device = (time - first).div_euclid(1000).rem_euclid(1024);
        write!(self.line, "{label} {seconds:.digits$} {} {device}", step / 1000)?;
        let mut total = 0.0;
        for pair in block.channels.chunks(2) {
            let (current, voltage) = (pair[0][row], pair[1][row]);
            let power = current * voltage;
            total += power;
            for (value, digits) in [(current, 4), (voltage, 3), (power, 3)] {
                self.line.push(' ');
                fixed(&mut self.line, value, digits)?;
            }
        }
        writeln!(self.line, " {total:.3}")
    }

    /// Writes what is buffered and gives the file back.
    ///
    /// # Errors
    /// [`PowerError::Stream`] if writing fails.
    pub fn finish(mut self) -> Result<W, PowerError> {
        self.output.flush()?;
        Ok(self.output)
    }
}

/// A number with so many decimals. Formatting through the standard library, which is right for any
/// number, takes several times as long as all else.
fn fixed(line: &mut String, value: f64, digits: u32) -> std::fmt::Result {
    let scale = 10i64.pow(digits);
    let scaled = value.abs() * scale as f64;
    if scaled.is_nan() || scaled > 1e15 {
        return write!(line, "{value:.*}", digits as usize);
    }
    #[expect(clippy::cast_possible_truncation, reason = "in range")]
    let scaled = scaled.round() as i64;
    let sign = if value < 0.0 && scaled > 0 { "-" } else { "" };
    write!(line, "{sign}{}.{:0digits$}", scaled / scale, scaled % scale, digits = digits as usize)
}

fn csv_head(info: &TraceInfo) -> String {
    let mut head = String::new();
    let mut add = |name: &str, value: Option<String>| {
        if let Some(value) = value.filter(|v| !v.is_empty()) {
            head += &format!("# {name}: {}\n", value.replace(['\n', '\r'], " "));
        }
    };
    let clock = serde_json::to_value(info.clock).ok();
    add("clock", clock.and_then(|c| Some(c.as_str()?.to_owned())));
    add("rate_hz", info.rate_hz.map(|x| x.to_string()));
    add("sensor", Some(info.sensor.name.clone()));
    add("sensor_refresh_s", info.sensor.refresh_s.map(|x| x.to_string()));
    add("sensor_coverage", info.sensor.coverage.map(|x| x.to_string()));
    add("sensor_source", Some(info.sensor.source.clone()));
    head += "time_s";
    for column in &info.columns {
        head.push(',');
        head += &column.name;
    }
    head += ",mark\n";
    head
}
