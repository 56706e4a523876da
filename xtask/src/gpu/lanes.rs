//! A plot of lanes: a line for each kernel, with a dot for each of its numbers on one axis.

use crate::report::axis::{LogAxis, short};
use crate::report::canvas::{Area, FAINT, GRID, INK, SIZE, draw, failed, text};
use anyhow::Result;
use plotters::coord::ranged1d::{BoldPoints, Ranged};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Colours of series, in their order.
const COLOURS: [RGBColor; 8] = [
    RGBColor(62, 122, 230),
    RGBColor(214, 125, 20),
    RGBColor(20, 150, 100),
    RGBColor(196, 68, 60),
    RGBColor(160, 84, 200),
    RGBColor(16, 158, 178),
    RGBColor(210, 90, 160),
    RGBColor(120, 128, 138),
];

/// A line of the plot.
pub(super) struct Lane<'a> {
    pub(super) name: &'a str,
    /// One of each series; nothing where it was not measured.
    pub(super) values: Vec<Option<f64>>,
    /// Whose name is set apart.
    pub(super) is_peer: bool,
}

/// Where the names end, and the lanes begin.
const LEFT: i32 = 256;
/// Above the lanes, for the legend.
const TOP: i32 = 30;
/// Below them, for the axis.
const BOTTOM: i32 = 44;

/// Draws lanes from the top, with what the axis shows.
pub(super) fn plot(
    description: &str,
    axis: &str,
    series: &[&str],
    lanes: &[Lane<'_>],
) -> Result<String> {
    draw(description, |area| {
        let (width, height) = (i32::try_from(SIZE.0)?, i32::try_from(SIZE.1)?);
        let right = width - 16;
        let numbers = lanes.iter().flat_map(|lane| lane.values.iter().copied().flatten());
        let range = LogAxis::around(numbers, 0.04);
        let place = |value: f64| range.map(&value, (LEFT, right));
        let floor = height - BOTTOM;
        for tick in range.key_points(BoldPoints(8)) {
            let x = place(tick);
            line(area, [(x, TOP), (x, floor)], GRID)?;
            label(area, short(tick), (x, floor + 6), (HPos::Center, VPos::Top), 11.0, FAINT)?;
        }
        let middle = (LEFT + right) / 2;
        label(area, axis.into(), (middle, floor + 24), (HPos::Center, VPos::Top), 12.0, INK)?;
        let mut x = LEFT;
        for (name, colour) in series.iter().zip(COLOURS.iter().cycle()) {
            area.draw(&Circle::new((x + 5, 14), 5, colour.filled())).map_err(failed)?;
            label(area, (*name).into(), (x + 15, 14), (HPos::Left, VPos::Center), 12.0, INK)?;
            x += 30 + 8 * i32::try_from(name.chars().count())?;
        }
        let count = i32::try_from(lanes.len().max(1))?;
        let size = (f64::from(floor - TOP) / f64::from(count) * 0.8).clamp(7.0, 11.5);
        for (lane, i) in lanes.iter().zip(0..) {
            let y = TOP + (floor - TOP) * (2 * i + 1) / (2 * count);
            line(area, [(LEFT, y), (right, y)], GRID)?;
            let ink = if lane.is_peer { FAINT } else { INK };
            label(area, lane.name.into(), (LEFT - 8, y), (HPos::Right, VPos::Center), size, ink)?;
            for (value, colour) in lane.values.iter().zip(COLOURS.iter().cycle()) {
                let Some(value) = value else { continue };
                let at = (place(*value), y);
                if lane.is_peer {
                    area.draw(&TriangleMarker::new(at, 5, colour.filled())).map_err(failed)?;
                } else {
                    area.draw(&Circle::new(at, 4, colour.filled())).map_err(failed)?;
                }
            }
        }
        Ok(())
    })
}

fn line(area: &Area<'_>, ends: [(i32, i32); 2], colour: RGBColor) -> Result<()> {
    area.draw(&PathElement::new(ends, colour.stroke_width(1))).map_err(failed)
}

fn label(
    area: &Area<'_>,
    words: String,
    at: (i32, i32),
    (across, along): (HPos, VPos),
    size: f64,
    colour: RGBColor,
) -> Result<()> {
    let style = text(size, colour).pos(Pos::new(across, along));
    area.draw(&Text::new(words, at, style)).map_err(failed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_lane_and_series_is_named() {
        let lane = |name, values: [Option<f64>; 2], is_peer| Lane {
            name,
            values: values.to_vec(),
            is_peer,
        };
        let lanes = [
            lane("ours", [Some(2.0), Some(30.0)], false),
            lane("the driver", [Some(5.0), None], true),
        ];
        let svg = plot("Rates", "million rays a second", &["camera", "ao"], &lanes).unwrap();
        for word in ["ours", "the driver", "camera", "ao", "million rays a second"] {
            assert!(svg.contains(word), "{word} in {svg}");
        }
        assert_eq!(svg.matches("<circle").count(), 2 + 2);
        assert!(plot("Nothing", "ms", &[], &[]).is_ok());
    }
}
