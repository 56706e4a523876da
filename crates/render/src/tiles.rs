//! Images computed tile by tile on all threads.

use crate::{image::Image, stats::RenderStats};
use glam::Vec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Side of the square tiles that threads take, in pixels.
const TILE: u32 = 16;

/// Computes every pixel (column, row from the top) on the current rayon pool. Calls
/// `progress(finished, all)` after each tile, from any thread and not always in order.
pub(crate) fn render_tiles(
    width: u32,
    height: u32,
    progress: impl Fn(usize, usize) + Sync,
    pixel: impl Fn(u32, u32, &mut RenderStats) -> Vec3 + Sync,
) -> (Image, RenderStats) {
    let mut image = Image::black(width, height);
    let columns = width.div_ceil(TILE);
    let tiles = columns as usize * height.div_ceil(TILE) as usize;
    let finished = AtomicUsize::new(0);
    let done: Vec<(Vec<Vec3>, RenderStats)> = (0..niwaki_core::to_u32(tiles))
        .into_par_iter()
        .map(|tile| {
            let mut stats = RenderStats::default();
            let pixels = tile_pixels(tile, columns, width, height)
                .map(|(x, y)| pixel(x, y, &mut stats))
                .collect();
            progress(finished.fetch_add(1, Ordering::Relaxed) + 1, tiles);
            (pixels, stats)
        })
        .collect();
    let mut stats = RenderStats::default();
    for (tile, (pixels, taken)) in (0..).zip(done) {
        stats = stats.plus(taken);
        for ((x, y), pixel) in tile_pixels(tile, columns, width, height).zip(pixels) {
            image.set(x, y, pixel);
        }
    }
    (image, stats)
}

/// Pixels of a tile, row by row.
fn tile_pixels(
    tile: u32,
    columns: u32,
    width: u32,
    height: u32,
) -> impl Iterator<Item = (u32, u32)> {
    let (left, top) = (tile % columns * TILE, tile / columns * TILE);
    (top..(top + TILE).min(height))
        .flat_map(move |y| (left..(left + TILE).min(width)).map(move |x| (x, y)))
}
