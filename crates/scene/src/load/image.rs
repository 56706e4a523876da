//! Images as textures.

use crate::Texture;
use image::ImageReader;
use std::io::Cursor;

/// Decodes PNG or JPEG bytes, whatever the name says.
pub(super) fn decode(name: &str, bytes: &[u8], srgb: bool) -> Result<Texture, String> {
    // The crate's own limits (512 MiB) keep a few bytes from asking for all memory.
    let image = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| e.to_string())?
        .decode()
        .map_err(|e| e.to_string())?
        .into_rgba8();
    let (width, height) = image.dimensions();
    let pixels = image.into_raw().as_chunks::<4>().0.to_vec();
    Texture::new(name, width, height, pixels, srgb).ok_or_else(|| "it has no pixels".into())
}
