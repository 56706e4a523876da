//! Files as bytes, unpacked where they are packed.

use super::LoadOptions;
use crate::LoadError;
use ruzstd::decoding::StreamingDecoder;
use std::{fs::File, io::Read, path::Path};

/// The bytes of a file; those of a name that ends in `.zst` are unpacked.
pub(super) fn bytes(path: &Path, options: &LoadOptions) -> Result<Vec<u8>, LoadError> {
    let too_large = || LoadError::TooLarge {
        path: path.into(),
        what: "its bytes",
        limit: options.max_bytes,
        option: "max_bytes",
    };
    let read_error = |source| LoadError::Read { path: path.into(), source };
    let mut file = File::open(path).map_err(read_error)?;
    let size = file.metadata().map_err(read_error)?.len();
    if size > options.max_bytes {
        return Err(too_large());
    }
    let mut raw = Vec::with_capacity(usize::try_from(size).unwrap_or(0));
    file.read_to_end(&mut raw).map_err(read_error)?;
    if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("zst")) {
        return Ok(raw);
    }
    unpack(&raw, options.max_bytes)
        .map_err(|reason| LoadError::Compression { path: path.into(), reason })?
        .ok_or_else(too_large)
}

/// Unpacks all zstd frames of `packed`; `None` if they hold more than `limit` bytes.
fn unpack(packed: &[u8], limit: u64) -> Result<Option<Vec<u8>>, String> {
    let mut rest = packed;
    let mut out = Vec::new();
    if rest.is_empty() {
        return Err("the file is empty".into());
    }
    while !rest.is_empty() {
        if let Some(after) = skippable(rest) {
            rest = after;
            continue;
        }
        let mut decoder = StreamingDecoder::new(&mut rest).map_err(|e| e.to_string())?;
        let room = limit - out.len() as u64;
        decoder.by_ref().take(room + 1).read_to_end(&mut out).map_err(|e| e.to_string())?;
        if out.len() as u64 > limit {
            return Ok(None);
        }
    }
    Ok(Some(out))
}

/// What follows a skippable frame (RFC 8878, §3.1.2), if `bytes` start with one.
fn skippable(bytes: &[u8]) -> Option<&[u8]> {
    let word = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?));
    if word(0)? & 0xffff_fff0 != 0x184d_2a50 {
        return None;
    }
    bytes.get(8_usize.checked_add(word(4)? as usize)?..)
}
