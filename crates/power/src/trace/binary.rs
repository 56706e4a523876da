//! The compact binary form.
//!
//! Little-endian: [`BINARY_MAGIC`], version (`u32`, 1), length of the head (`u32`), the head
//! ([`TraceInfo`] as JSON), then blocks until the end of the file. A block is the length of its contents
//! (`u32`), their CRC-32 (`u32`) and the contents: rows (`u32`), marks (`u32`), form of times (`u32`),
//! time of the first row (`i64`, ns); times by form: 0, one step for all (`u32`, ns); 1, a step for each
//! further row (`u32`); 2, times of further rows (`i64`); channels one after the other, `f32` samples, or
//! `f64` for joules, whose sums outgrow `f32`; marks, each a row (`u32`) and a label (`u32`).

use super::chunks::{Cut, Decoded, Pipeline, ReadOptions};
use super::{Block, RowMark, TraceInfo, TraceReader, Unit};
use crate::PowerError;
use std::io::{Read, Write};

/// The first bytes of a binary trace.
pub const BINARY_MAGIC: [u8; 8] = *b"NIWAKIPT";

const VERSION: u32 = 1;
/// More than any writer puts into a block; a damaged length must not allocate all memory.
const MAX_BLOCK: u32 = 1 << 28;

pub(super) fn open(
    mut input: Box<dyn Read + Send>,
    options: &ReadOptions,
) -> Result<Box<dyn TraceReader>, PowerError> {
    let bad = |reason: &str| PowerError::Header(format!("binary trace: {reason}"));
    let mut words = [0; 8];
    input.read_exact(&mut words).map_err(|_| bad("it ends within its head"))?;
    let (version, length) = words.split_at(4);
    let word = |bytes: &[u8]| bytes.try_into().map_or(0, u32::from_le_bytes);
    if word(version) != VERSION {
        return Err(bad(&format!("version {} is not known", word(version))));
    }
    if word(length) > 1 << 24 {
        return Err(bad("its head is longer than 16 MiB"));
    }
    let mut head = vec![0; word(length) as usize];
    input.read_exact(&mut head).map_err(|_| bad("it ends within its head"))?;
    let info: TraceInfo = serde_json::from_slice(&head).map_err(|error| bad(&error.to_string()))?;
    if info.columns.is_empty() {
        return Err(bad("it has no columns"));
    }
    let units: Vec<_> = info.columns.iter().map(|c| c.unit).collect();
    let decode = move |bytes: &[u8]| decode(bytes, &units);
    let pipeline = Pipeline::start(Blocks { input, block: 0 }, decode, options.threads);
    Ok(Box::new(BinaryTrace { info, pipeline, truncated: 0 }))
}

/// Cuts between blocks. A piece is the number of the block, its CRC and its contents.
struct Blocks {
    input: Box<dyn Read + Send>,
    block: u64,
}

impl Cut for Blocks {
    fn cut(&mut self) -> Result<Option<Vec<u8>>, PowerError> {
        let mut head = Vec::with_capacity(8);
        self.input.by_ref().take(8).read_to_end(&mut head)?;
        if head.is_empty() {
            return Ok(None);
        }
        let mut piece = self.block.to_le_bytes().to_vec();
        if head.len() == 8 {
            let length = u32::from_le_bytes([head[0], head[1], head[2], head[3]]);
            if length > MAX_BLOCK {
                let reason = format!("it claims {length} bytes");
                return Err(PowerError::Damaged { block: self.block, reason });
            }
            piece.extend_from_slice(&head[4..]);
            let found = self.input.by_ref().take(u64::from(length)).read_to_end(&mut piece)?;
            if found < length as usize {
                // The recording was cut off within the block: what is left of it is one broken line.
                piece.truncate(8);
            }
        }
        self.block += 1;
        Ok(Some(piece))
    }
}

struct Contents<'a>(&'a [u8]);

impl<'a> Contents<'a> {
    fn take(&mut self, bytes: usize) -> Result<&'a [u8], String> {
        let (taken, rest) = self.0.split_at_checked(bytes).ok_or("it is too short")?;
        self.0 = rest;
        Ok(taken)
    }

    fn word(&mut self) -> Result<u32, String> {
        Ok(self.words(1)?.next().unwrap_or(0))
    }

    fn words(&mut self, count: usize) -> Result<impl Iterator<Item = u32> + use<'a>, String> {
        let bytes = self.take(count.checked_mul(4).ok_or("it is too long")?)?;
        Ok(bytes.as_chunks::<4>().0.iter().map(|&b| u32::from_le_bytes(b)))
    }

    fn longs(&mut self, count: usize) -> Result<impl Iterator<Item = u64> + use<'a>, String> {
        let bytes = self.take(count.checked_mul(8).ok_or("it is too long")?)?;
        Ok(bytes.as_chunks::<8>().0.iter().map(|&b| u64::from_le_bytes(b)))
    }
}

fn decode(piece: &[u8], units: &[Unit]) -> Result<Decoded, PowerError> {
    let (number, rest) = piece.split_at(8.min(piece.len()));
    let block = number.try_into().map_or(0, u64::from_le_bytes);
    let Some((crc, contents)) = rest.split_at_checked(4) else {
        return Ok(Decoded { bad: 1, ..Decoded::default() });
    };
    let damaged = |reason: String| PowerError::Damaged { block, reason };
    if crc.try_into().map_or(0, u32::from_le_bytes) != crc32fast::hash(contents) {
        return Err(damaged("its checksum does not fit".into()));
    }
    let block = decode_block(Contents(contents), units).map_err(damaged)?;
    Ok(Decoded { block, ..Decoded::default() })
}

fn decode_block(mut from: Contents<'_>, units: &[Unit]) -> Result<Block, String> {
    let (rows, marks, form) = (from.word()? as usize, from.word()? as usize, from.word()?);
    let first = from.longs(1)?.next().unwrap_or(0).cast_signed();
    // Every row takes at least four bytes a channel, so damaged counts cannot allocate much.
    if rows > from.0.len() {
        return Err("it is too short".into());
    }
    let mut times = Vec::with_capacity(rows);
    if rows > 0 {
        times.push(first);
        let mut time = first;
        let mut step = |step: u32| {
            time = time.wrapping_add(i64::from(step));
            times.push(time);
        };
        match form {
            0 => {
                let one = from.word()?;
                (1..rows).for_each(|_| step(one));
            }
            1 => from.words(rows - 1)?.for_each(step),
            2 => times.extend(from.longs(rows - 1)?.map(u64::cast_signed)),
            _ => return Err(format!("form {form} of times is not known")),
        }
    }
    let channels = units
        .iter()
        .map(|unit| {
            Ok(if *unit == Unit::Joules {
                from.longs(rows)?.map(f64::from_bits).collect()
            } else {
                from.words(rows)?.map(|bits| f64::from(f32::from_bits(bits))).collect()
            })
        })
        .collect::<Result<_, String>>()?;
    let mut found = Vec::new();
    for _ in 0..marks {
        let (row, label) = (from.word()? as usize, from.word()?);
        match u8::try_from(label) {
            Ok(label) if row < rows => found.push(RowMark { row, label }),
            _ => return Err("a mark is out of range".into()),
        }
    }
    Ok(Block { times_ns: times, channels, marks: found })
}

struct BinaryTrace {
    info: TraceInfo,
    pipeline: Pipeline,
    truncated: u64,
}

impl TraceReader for BinaryTrace {
    fn info(&self) -> &TraceInfo {
        &self.info
    }

    fn next_block(&mut self) -> Result<Option<Block>, PowerError> {
        while let Some(piece) = self.pipeline.next() {
            let piece = piece?;
            self.truncated += piece.bad;
            if !piece.block.is_empty() {
                return Ok(Some(piece.block));
            }
        }
        Ok(None)
    }

    fn broken_lines(&self) -> u64 {
        self.truncated
    }
}

pub(super) fn write_head(output: &mut impl Write, info: &TraceInfo) -> Result<(), PowerError> {
    let head = serde_json::to_vec(info).map_err(|e| PowerError::Stream(e.into()))?;
    output.write_all(&BINARY_MAGIC)?;
    output.write_all(&VERSION.to_le_bytes())?;
    output.write_all(&length(head.len())?.to_le_bytes())?;
    Ok(output.write_all(&head)?)
}

fn length(count: usize) -> Result<u32, PowerError> {
    u32::try_from(count).map_err(|_| PowerError::Setting("a block of a trace is too long".into()))
}

pub(super) fn write_block(
    output: &mut impl Write,
    units: &[Unit],
    block: &Block,
) -> Result<(), PowerError> {
    let Some(&first) = block.times_ns.first() else { return Ok(()) };
    let mut contents = Vec::new();
    let word = |word: u32, to: &mut Vec<u8>| to.extend_from_slice(&word.to_le_bytes());
    let steps: Option<Vec<u32>> = block
        .times_ns
        .windows(2)
        .map(|pair| pair[1].checked_sub(pair[0]).and_then(|step| u32::try_from(step).ok()))
        .collect();
    let is_uniform = steps.as_ref().is_some_and(|s| s.windows(2).all(|pair| pair[0] == pair[1]));
    let form = if is_uniform { 0 } else { 2 - u32::from(steps.is_some()) };
    for count in [length(block.len())?, length(block.marks.len())?, form] {
        word(count, &mut contents);
    }
    contents.extend_from_slice(&first.to_le_bytes());
    match steps {
        Some(steps) if is_uniform => word(steps.first().copied().unwrap_or(0), &mut contents),
        Some(steps) => steps.into_iter().for_each(|step| word(step, &mut contents)),
        None => block.times_ns[1..].iter().for_each(|t| contents.extend(t.to_le_bytes())),
    }
    for (channel, unit) in block.channels.iter().zip(units) {
        if *unit == Unit::Joules {
            channel.iter().for_each(|value| contents.extend(value.to_le_bytes()));
        } else {
            #[expect(
                clippy::cast_possible_truncation,
                reason = "24 bits are more than any sensor's"
            )]
            channel.iter().for_each(|value| contents.extend((*value as f32).to_le_bytes()));
        }
    }
    for mark in &block.marks {
        word(length(mark.row)?, &mut contents);
        word(u32::from(mark.label), &mut contents);
    }
    if contents.len() > MAX_BLOCK as usize {
        return Err(PowerError::Setting("a block of a trace is longer than 256 MiB".into()));
    }
    output.write_all(&length(contents.len())?.to_le_bytes())?;
    output.write_all(&crc32fast::hash(&contents).to_le_bytes())?;
    Ok(output.write_all(&contents)?)
}
