//! Parts of pictures: enlarged, or framed in the whole.

use niwaki_core::glam::Vec3;
use niwaki_render::Image;
use niwaki_render::metrics::Tile;

/// Sides of crops in files, about, in pixels.
const SHOWN: u32 = 288;
/// The colour of frames around tiles.
const FRAME: Vec3 = Vec3::new(1.0, 0.02, 0.02);

/// A part of the image around the tile, half as wide again on each side.
pub(super) fn around(tile: Tile, image: &Image) -> Tile {
    tile.grown(tile.width.max(tile.height) / 2, image.width(), image.height())
}

/// A part of an image, enlarged.
pub(super) fn close(image: &Image, part: Tile) -> Image {
    image.crop(part).enlarged((SHOWN / part.width.max(part.height).max(1)).max(1))
}

/// A frame of `width` pixels drawn around a tile.
pub(super) fn framed(image: &Image, tile: Tile, width: u32) -> Image {
    let mut image = image.clone();
    let outer = tile.grown(width, image.width(), image.height());
    let inside = |from: u32, count: u32, at: u32| (from..from + count).contains(&at);
    for y in outer.y..outer.y + outer.height {
        for x in outer.x..outer.x + outer.width {
            if !(inside(tile.x, tile.width, x) && inside(tile.y, tile.height, y)) {
                image.set(x, y, FRAME);
            }
        }
    }
    image
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_lie_around_their_tile() {
        let image = Image::black(8, 6);
        let tile = Tile { x: 2, y: 0, width: 3, height: 2 };
        let framed = framed(&image, tile, 1);
        let red: Vec<(u32, u32)> = (0..6)
            .flat_map(|y| (0..8).map(move |x| (x, y)))
            .filter(|&(x, y)| framed.get(x, y) == FRAME)
            .collect();
        assert_eq!(red, [(1, 0), (5, 0), (1, 1), (5, 1), (1, 2), (2, 2), (3, 2), (4, 2), (5, 2)]);
    }
}
