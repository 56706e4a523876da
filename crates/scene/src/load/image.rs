//! Images as textures.

use super::LoadOptions;
use crate::Texture;
use image::{ImageReader, Limits};
use std::io::Cursor;

/// Decodes PNG or JPEG bytes, whatever the name says.
pub(super) fn decode(
    name: &str,
    bytes: &[u8],
    srgb: bool,
    options: &LoadOptions,
) -> Result<Texture, String> {
    let mut reader =
        ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| e.to_string())?;
    // The crate's own limit (512 MiB) keeps a few bytes from asking for all memory.
    let mut limits = Limits::default();
    limits.max_alloc = limits.max_alloc.map(|bytes| bytes.min(options.max_bytes));
    reader.limits(limits);
    let image = reader.decode().map_err(|e| e.to_string())?.into_rgba8();
    let (width, height) = image.dimensions();
    let pixels = image.into_raw().as_chunks::<4>().0.to_vec();
    Texture::new(name, width, height, pixels, srgb).ok_or_else(|| "it has no pixels".into())
}
