//! Binary records.

use crate::{RayFileError, ray};
use niwaki_core::Ray;
use std::io::Read;

/// Bytes of a record.
pub(crate) const RECORD: usize = 32;

/// Reads records of 32 bytes to the end: origin x, y, z, `t_min`, direction x, y, z, `t_max` as
/// little-endian 32-bit floats of any bits.
///
/// # Errors
/// [`RayFileError::Io`], and [`RayFileError::PartialRecord`] if the length is not that of whole
/// records.
pub fn read_binary(mut input: impl Read) -> Result<Vec<Ray>, RayFileError> {
    let mut bytes = Vec::new();
    input.read_to_end(&mut bytes)?;
    if bytes.len() % RECORD != 0 {
        return Err(RayFileError::PartialRecord { bytes: bytes.len() });
    }
    let field =
        |record: &[u8], i: usize| f32::from_le_bytes([0, 1, 2, 3].map(|k| record[4 * i + k]));
    let of = |record: &[u8]| ray([0, 1, 2, 3, 4, 5, 6, 7].map(|i| field(record, i)));
    Ok(bytes.chunks_exact(RECORD).map(of).collect())
}
