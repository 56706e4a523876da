//! Files as bytes, unpacked where they are packed.

use super::LoadOptions;
use crate::LoadError;
use ruzstd::decoding::StreamingDecoder;
use std::{
    fs::{self, File},
    io::{self, Read},
    path::{Component, Path},
};

/// The bytes of a file that `scene` refers to by a path relative to its own.
pub(super) fn beside(
    scene: &Path,
    name: &str,
    options: &LoadOptions,
) -> Result<Vec<u8>, LoadError> {
    if !options.outside && leads_out(Path::new(name)) {
        return Err(LoadError::Outside { path: scene.into(), name: name.into() });
    }
    bytes(&scene.parent().unwrap_or(Path::new("")).join(name), options)
}

/// True for an absolute path and one that climbs out of where it begins.
fn leads_out(path: &Path) -> bool {
    let mut depth = 0_usize;
    for component in path.components() {
        match component {
            Component::Normal(_) => depth += 1,
            Component::CurDir => {}
            Component::ParentDir if depth > 0 => depth -= 1,
            Component::ParentDir | Component::RootDir | Component::Prefix(_) => return true,
        }
    }
    false
}

/// The bytes of a file; those of a name that ends in `.zst` are unpacked.
pub(super) fn bytes(path: &Path, options: &LoadOptions) -> Result<Vec<u8>, LoadError> {
    let too_large = || LoadError::TooLarge {
        path: path.into(),
        what: "its bytes",
        limit: options.max_bytes,
        option: "max_bytes",
    };
    let read_error = |source| LoadError::Read { path: path.into(), source };
    // Asked before it is opened, which waits for a pipe's other end. Devices may have no end.
    let metadata = fs::metadata(path).map_err(read_error)?;
    if !metadata.is_file() {
        return Err(read_error(io::Error::new(io::ErrorKind::InvalidInput, "not a regular file")));
    }
    if metadata.len() > options.max_bytes {
        return Err(too_large());
    }
    let mut raw = Vec::with_capacity(usize::try_from(metadata.len()).unwrap_or(0));
    let file = File::open(path).map_err(read_error)?;
    // It may have grown since, or be one whose size the system does not know.
    file.take(options.max_bytes.saturating_add(1)).read_to_end(&mut raw).map_err(read_error)?;
    if raw.len() as u64 > options.max_bytes {
        return Err(too_large());
    }
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
        decoder
            .by_ref()
            .take(room.saturating_add(1))
            .read_to_end(&mut out)
            .map_err(|e| e.to_string())?;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_that_lead_out() {
        for inside in ["", "a", "./a", "a/b", "a/../b", "a/./../b", "..a", "a..", "C:a"] {
            assert!(cfg!(windows) || !leads_out(Path::new(inside)), "{inside}");
        }
        for outside in ["/a", "..", "../a", "a/../../b", "./..", "//a"] {
            assert!(leads_out(Path::new(outside)), "{outside}");
        }
    }
}
