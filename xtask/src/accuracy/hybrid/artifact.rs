//! The worst artifact of a scene: where it is, which setting removes it, and pictures of it
//! (thesis, paper III, figures 7 and 8).

use super::study::Point;
use super::sweep::Sweep;
use crate::accuracy::crops::{around, close, framed};
use crate::report::slug;
use anyhow::{Context, Result};
use niwaki_render::metrics::{ErrorMap, Tile};
use niwaki_render::{Image, ToneCurve};
use serde::Serialize;
use std::path::Path;

/// A remedy is cheap if a frame takes at most this many times as long as at the default.
const CHEAP: f64 = 1.5;
/// Less than this share of a tile's error is no remedy.
const WORTH: f64 = 0.1;

/// What is seen around the tile, by a setup.
#[derive(Debug)]
pub(super) struct Crop {
    picture: Image,
    error: Image,
}

impl Crop {
    pub(super) fn new(shown: &Image, map: &ErrorMap, tile: Tile) -> Self {
        let around = around(tile, shown);
        Self { picture: close(shown, around), error: close(&map.colorize(), around) }
    }
}

/// The pictures of a scene's worst artifact.
#[derive(Debug)]
pub(super) struct Panels {
    tile: Tile,
    /// The whole frame at the default, as displayed.
    pub(super) whole: Image,
    wanted: Image,
    hits: Image,
    /// With the numbers of their setups.
    pub(super) crops: Vec<(usize, Crop)>,
}

impl Panels {
    /// Of what is wanted there, as displayed, and where rays end at the default.
    pub(super) fn new(wanted: &Image, hits: &Image, tile: Tile) -> Self {
        let part = around(tile, wanted);
        Self {
            tile,
            whole: Image::black(0, 0),
            wanted: close(wanted, part),
            hits: close(hits, part),
            crops: Vec::new(),
        }
    }

    fn crop(&self, setup: usize) -> Option<&Crop> {
        self.crops.iter().find(|(number, _)| *number == setup).map(|(_, crop)| crop)
    }
}

/// The worst artifact at the default settings.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Artifact {
    /// The frame of the camera path.
    pub(super) frame: u32,
    /// Left, top, width and height in pixels.
    pub(super) tile: [u32; 4],
    /// Mean FLIP of the tile at the default.
    pub(super) flip: f64,
    /// What removes most of it.
    pub(super) best: Option<Remedy>,
    /// What removes most of it in little more time than the default takes, if that is another.
    pub(super) cheap: Option<Remedy>,
    /// Pictures, relative to the folder of the report.
    pub(super) pictures: Vec<Picture>,
}

/// A setting that removes an artifact.
#[derive(Clone, Debug, Serialize, PartialEq)]
pub(super) struct Remedy {
    /// One knob and its value.
    pub(super) setup: String,
    #[serde(skip)]
    pub(super) number: usize,
    /// Mean FLIP of the tile with it.
    pub(super) flip: f64,
    /// The share of the tile's error that is gone.
    pub(super) removed: f64,
    /// Time of a frame over that of the default.
    pub(super) relative: f64,
}

/// A picture in a file.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Picture {
    /// What it belongs to: a setup, or nothing for the whole frame.
    pub(super) of: String,
    /// What it shows.
    pub(super) shows: &'static str,
    /// Relative to the folder of the report.
    pub(super) file: String,
}

/// Of settings that differ from the default in one knob, what removes most of the tile's error;
/// and what does so at a little cost, where that is another. What removes next to nothing is none.
pub(super) fn remedies(points: &[Point], flip: f64) -> (Option<Remedy>, Option<Remedy>) {
    let remedy = |point: &Point| {
        let left = point.tile?;
        let removed = if flip > 0.0 { 1.0 - left / flip } else { 0.0 };
        let (setup, number, relative) = (point.setup.clone(), point.number, point.relative);
        Some(Remedy { setup, number, flip: left, removed, relative })
    };
    let better =
        |a: &Remedy, b: &Remedy| a.flip.total_cmp(&b.flip).then(a.relative.total_cmp(&b.relative));
    let all = || {
        let knobs = points.iter().filter(|point| point.one_knob).filter_map(remedy);
        knobs.filter(|remedy| remedy.removed >= WORTH)
    };
    let best = all().min_by(better);
    let cheap = all().filter(|remedy| remedy.relative <= CHEAP).min_by(better);
    let cheap = cheap.filter(|cheap| best.as_ref() != Some(cheap));
    (best, cheap)
}

impl Artifact {
    /// Writes the pictures into the folder `pictures` of `out`; files begin with `name`.
    pub(super) fn save(&mut self, panels: &Panels, name: &str, out: &Path) -> Result<()> {
        let folder = out.join("pictures");
        let context = || format!("cannot create {}", folder.display());
        std::fs::create_dir_all(&folder).with_context(context)?;
        let mut save = |image: &Image, of: &str, shows: &'static str| -> Result<()> {
            let parts = [name, &slug(of), &slug(shows)];
            let parts: Vec<&str> = parts.into_iter().filter(|part| !part.is_empty()).collect();
            let file = format!("pictures/{}.png", parts.join("-"));
            image.save_png(out.join(&file), &ToneCurve::default())?;
            self.pictures.push(Picture { of: of.to_owned(), shows, file });
            Ok(())
        };
        save(&framed(&panels.whole, panels.tile, 2), "", "frame")?;
        let rows = [("default", Sweep::DEFAULT)];
        let remedies = [&self.best, &self.cheap].into_iter().flatten();
        let remedies: Vec<(String, usize)> =
            remedies.map(|r| (r.setup.clone(), r.number)).collect();
        let rows = rows.into_iter().chain(remedies.iter().map(|(name, n)| (name.as_str(), *n)));
        for (of, setup) in rows {
            let Some(crop) = panels.crop(setup) else { continue };
            save(&crop.picture, of, "hybrid")?;
            save(&panels.wanted, of, "Whitted")?;
            save(&crop.error, of, "FLIP")?;
            if setup == Sweep::DEFAULT {
                save(&panels.hits, of, "hits")?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accuracy::hybrid::study::tests::point;

    fn with(setup: &str, tile: f64, relative: f64, one_knob: bool) -> Point {
        Point { tile: Some(tile), relative, one_knob, ..point(setup, 0.01, 1.0) }
    }

    #[test]
    fn the_remedy_is_one_knob_and_the_cheap_one_another() {
        let points = [
            with("default", 0.4, 1.0, false),
            with("region 0.3", 0.1, 1.4, true),
            with("region all", 0.0, 3.0, true),
            with("map 2048", 0.3, 1.1, true),
            with("depth 8", 0.5, 1.2, true),
            with("fine", 0.0, 2.0, false),
        ];
        let (best, cheap) = remedies(&points, 0.4);
        let best = best.unwrap();
        assert_eq!((best.setup.as_str(), best.removed, best.relative), ("region all", 1.0, 3.0));
        let cheap = cheap.unwrap();
        assert_eq!((cheap.setup.as_str(), cheap.flip), ("region 0.3", 0.1));
        assert!((cheap.removed - 0.75).abs() < 1e-12);
        // Nothing helps, and nothing is wrong.
        assert_eq!(remedies(&points[4..5], 0.4), (None, None));
        assert_eq!(remedies(&points, 0.0), (None, None));
        // One that is best and cheap is shown once.
        let (best, cheap) = remedies(&points[1..2], 0.4);
        assert!(best.is_some() && cheap.is_none());
    }
}
