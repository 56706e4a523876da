//! The log of frames that a renderer writes while power is recorded.

use crate::{Clock, PowerError};
use serde::{Deserialize, Serialize};
use std::io::{BufRead, Write};

/// The version of both file formats.
pub const FRAME_LOG_VERSION: u32 = 1;

/// The time of one pass within a frame.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PassTime {
    /// Name of the pass, such as `z_prepass`.
    pub name: String,
    /// How long it took on the device, in nanoseconds.
    pub ns: u64,
}

/// One frame: what was rendered, and when.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct FrameRecord {
    /// Number of the frame within its animation, from 0.
    pub frame: u64,
    /// When work on the frame began, in nanoseconds of the log's clock.
    pub start_ns: i64,
    /// When its work was done; idle time until the next frame is not part of it.
    pub end_ns: i64,
    /// Short name of the algorithm, such as `FR`, `DR` or `SM`.
    pub algorithm: String,
    /// Number of lights.
    pub lights: u32,
    /// Width of the image in pixels.
    pub width: u32,
    /// Height of the image in pixels.
    pub height: u32,
    /// Whether a mark was given to the meter at `start_ns`.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub marker: bool,
    /// Times of passes, in the order of execution; may be empty.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub passes: Vec<PassTime>,
}

impl FrameRecord {
    /// Pixels of the image.
    #[must_use]
    pub fn pixels(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }
}

/// The head of a log.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct FrameLogHeader {
    /// What times count from.
    pub clock: Clock,
    /// Name of the device that rendered.
    pub device: String,
    /// Name of the scene and camera path.
    pub scene: String,
}

/// A log of frames, in order of `start_ns`.
///
/// Two file formats hold the same: JSON lines, of which the first is the head with a member
/// `niwaki_frame_log` (the version) and each other one a [`FrameRecord`]; and CSV with the columns
/// `frame,start_ns,end_ns,algorithm,lights,width,height,marker` and a column `pass:NAME` (nanoseconds)
/// for each pass, after lines `# clock: monotonic`, `# device: NAME` and `# scene: NAME`.
///
/// ```
/// use niwaki_power::{Clock, FrameLog, FrameLogHeader, FrameRecord};
///
/// let mut log = FrameLog {
///     header: FrameLogHeader { clock: Clock::Monotonic, ..FrameLogHeader::default() },
///     frames: Vec::new(),
/// };
/// log.frames.push(FrameRecord {
///     start_ns: 1_000,
///     end_ns: 9_000_000,
///     algorithm: "DR".into(),
///     width: 2560,
///     height: 1440,
///     ..FrameRecord::default()
/// });
/// let mut file = Vec::new();
/// log.write_json_lines(&mut file)?;
/// assert_eq!(FrameLog::read(&file[..])?, log);
/// # Ok::<(), niwaki_power::PowerError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FrameLog {
    /// The head.
    pub header: FrameLogHeader,
    /// The frames.
    pub frames: Vec<FrameRecord>,
}

#[derive(Serialize, Deserialize)]
struct HeaderLine {
    niwaki_frame_log: u32,
    #[serde(flatten)]
    header: FrameLogHeader,
}

const COLUMNS: [&str; 8] =
    ["frame", "start_ns", "end_ns", "algorithm", "lights", "width", "height", "marker"];

impl FrameLog {
    /// Reads either format; the first byte tells which.
    ///
    /// # Errors
    /// [`PowerError::Log`] names the first line that cannot be read, is out of order or ends before it
    /// starts; [`PowerError::Stream`] for the reader's own errors.
    pub fn read(mut input: impl BufRead) -> Result<Self, PowerError> {
        let is_json = input.fill_buf()?.first() == Some(&b'{');
        let (log, first) =
            if is_json { (Self::read_json_lines(input)?, 2) } else { Self::read_csv(input)? };
        let mut before = i64::MIN;
        for (index, frame) in log.frames.iter().enumerate() {
            let reason = if frame.start_ns < before {
                "the frame starts before the one above it"
            } else if frame.end_ns < frame.start_ns {
                "the frame ends before it starts"
            } else {
                before = frame.start_ns;
                continue;
            };
            let line = index as u64 + first;
            return Err(PowerError::Log { line, reason: reason.into() });
        }
        Ok(log)
    }

    fn read_json_lines(input: impl BufRead) -> Result<Self, PowerError> {
        let mut log = Self::default();
        for (line, text) in (1u64..).zip(input.lines()) {
            let text = text?;
            let bad =
                |error: serde_json::Error| PowerError::Log { line, reason: error.to_string() };
            if line == 1 {
                let head: HeaderLine = serde_json::from_str(&text).map_err(bad)?;
                if head.niwaki_frame_log != FRAME_LOG_VERSION {
                    let reason = format!("version {} is not known", head.niwaki_frame_log);
                    return Err(PowerError::Log { line, reason });
                }
                log.header = head.header;
            } else if !text.trim().is_empty() {
                log.frames.push(serde_json::from_str(&text).map_err(bad)?);
            }
        }
        Ok(log)
    }

    /// The log, and the number of the line of its first frame.
    fn read_csv(mut input: impl BufRead) -> Result<(Self, u64), PowerError> {
        let mut log = Self::default();
        let mut line = String::new();
        let mut lines = 0u64;
        while input.fill_buf()?.first() == Some(&b'#') {
            line.clear();
            input.read_line(&mut line)?;
            lines += 1;
            if let Some((name, value)) = line.trim_start_matches('#').split_once(':') {
                let value = value.trim();
                match name.trim() {
                    "clock" => {
                        log.header.clock =
                            serde_json::from_value(value.into()).map_err(|error| {
                                PowerError::Log { line: lines, reason: error.to_string() }
                            })?;
                    }
                    "device" => log.header.device = value.into(),
                    "scene" => log.header.scene = value.into(),
                    _ => {}
                }
            }
        }
        let bad = |line: u64, reason: String| PowerError::Log { line, reason };
        let mut rows = csv::ReaderBuilder::new().flexible(true).from_reader(input);
        let columns = rows.headers().map_err(|e| bad(lines + 1, e.to_string()))?.clone();
        let place = |name: &str| columns.iter().position(|c| c.trim() == name);
        for name in ["start_ns", "end_ns"] {
            if place(name).is_none() {
                return Err(bad(lines + 1, format!("there is no column {name}")));
            }
        }
        let places = COLUMNS.map(place);
        let passes: Vec<_> = columns
            .iter()
            .enumerate()
            .filter_map(|(at, name)| Some((at, name.trim().strip_prefix("pass:")?.to_owned())))
            .collect();
        for (index, row) in rows.records().enumerate() {
            let number = lines + 2 + index as u64;
            let row = row.map_err(|e| bad(number, e.to_string()))?;
            let cell = |at: Option<usize>| at.and_then(|at| row.get(at)).unwrap_or("").trim();
            let whole = |which: usize, default: i64| match cell(places[which]) {
                "" => Ok(default),
                text => text.parse::<i64>().map_err(|_| {
                    bad(number, format!("{}: {text:?} is no whole number", COLUMNS[which]))
                }),
            };
            let small = |which: usize, default: i64| {
                u32::try_from(whole(which, default)?)
                    .map_err(|_| bad(number, format!("{} is out of range", COLUMNS[which])))
            };
            for which in [1, 2] {
                if cell(places[which]).is_empty() {
                    return Err(bad(number, format!("{} is missing", COLUMNS[which])));
                }
            }
            let frame = FrameRecord {
                frame: u64::try_from(whole(0, i64::try_from(index).unwrap_or(0))?)
                    .map_err(|_| bad(number, "frame is negative".into()))?,
                start_ns: whole(1, 0)?,
                end_ns: whole(2, 0)?,
                algorithm: cell(places[3]).into(),
                lights: small(4, 0)?,
                width: small(5, 0)?,
                height: small(6, 0)?,
                marker: matches!(cell(places[7]), "1" | "true"),
                passes: passes
                    .iter()
                    .filter(|(at, _)| !cell(Some(*at)).is_empty())
                    .map(|(at, name)| {
                        let ns = cell(Some(*at)).parse().map_err(|_| {
                            bad(number, format!("pass {name}: not a number of nanoseconds"))
                        })?;
                        Ok(PassTime { name: name.clone(), ns })
                    })
                    .collect::<Result<_, PowerError>>()?,
            };
            log.frames.push(frame);
        }
        Ok((log, lines + 2))
    }

    /// Writes JSON lines.
    ///
    /// # Errors
    /// [`PowerError::Stream`] if writing fails.
    pub fn write_json_lines(&self, mut output: impl Write) -> Result<(), PowerError> {
        let head = HeaderLine { niwaki_frame_log: FRAME_LOG_VERSION, header: self.header.clone() };
        let json = |e: serde_json::Error| PowerError::Stream(e.into());
        serde_json::to_writer(&mut output, &head).map_err(json)?;
        for frame in &self.frames {
            output.write_all(b"\n")?;
            serde_json::to_writer(&mut output, frame).map_err(json)?;
        }
        output.write_all(b"\n")?;
        Ok(output.flush()?)
    }

    /// Writes CSV. Passes of the same name within a frame are added up.
    ///
    /// # Errors
    /// [`PowerError::Stream`] if writing fails.
    pub fn write_csv(&self, mut output: impl Write) -> Result<(), PowerError> {
        let mut names: Vec<&str> = Vec::new();
        for pass in self.frames.iter().flat_map(|f| &f.passes) {
            if !names.contains(&pass.name.as_str()) {
                names.push(&pass.name);
            }
        }
        let clock = serde_json::to_value(self.header.clock).unwrap_or_default();
        let line = |text: &str| text.replace(['\n', '\r'], " ");
        writeln!(output, "# clock: {}", clock.as_str().unwrap_or("device"))?;
        writeln!(output, "# device: {}", line(&self.header.device))?;
        writeln!(output, "# scene: {}", line(&self.header.scene))?;
        let mut rows = csv::Writer::from_writer(output);
        let failed = |e: csv::Error| PowerError::Stream(std::io::Error::other(e));
        let columns = COLUMNS.iter().map(|c| (*c).to_owned());
        rows.write_record(columns.chain(names.iter().map(|n| format!("pass:{n}"))))
            .map_err(failed)?;
        for f in &self.frames {
            let mut row = vec![
                f.frame.to_string(),
                f.start_ns.to_string(),
                f.end_ns.to_string(),
                f.algorithm.clone(),
                f.lights.to_string(),
                f.width.to_string(),
                f.height.to_string(),
                u8::from(f.marker).to_string(),
            ];
            row.extend(names.iter().map(|name| {
                let times = f.passes.iter().filter(|p| p.name == *name);
                let sum = times.map(|p| p.ns).reduce(u64::saturating_add);
                sum.map(|ns| ns.to_string()).unwrap_or_default()
            }));
            rows.write_record(&row).map_err(failed)?;
        }
        Ok(rows.flush()?)
    }
}
