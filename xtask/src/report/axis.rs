//! Axes: a logarithmic one whose ticks suit ranges of half a decade as well as of nine, one from 0,
//! and one of names.

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::coord::types::RangedCoordf64;
use std::ops::Range;

/// What a chart can have as an axis.
pub(crate) trait Axis: Ranged<ValueType = f64> + ValueFormatter<f64> {}

impl<A: Ranged<ValueType = f64> + ValueFormatter<f64>> Axis for A {}

/// A logarithmic axis with ticks at 1, 2 and 5 times powers of ten, or at powers alone where
/// those would crowd. (The one of plotters ticks powers of ten only, of which a range such as
/// 300…900 has none.)
#[derive(Clone, Debug)]
pub(crate) struct LogAxis {
    range: Range<f64>,
    /// Numbers up to this one are shown by this name: 0 has no place of its own.
    least: Option<(f64, &'static str)>,
}

impl LogAxis {
    /// The axis over some numbers, which must be positive, with a margin: a share of the length.
    pub(crate) fn around(numbers: impl Iterator<Item = f64>, margin: f64) -> Self {
        let (low, high) =
            numbers.fold((f64::INFINITY, 0.0f64), |(low, high), x| (low.min(x), high.max(x)));
        if low > high {
            return Self::exactly(0.1..10.0);
        }
        // Less than this factor would stretch noise over the whole plot.
        let (low, high) = (low.ln(), high.ln());
        let missing = (1.5f64.ln() - (high - low)).max(0.0) / 2.0;
        let (low, high) = (low - missing, high + missing);
        let margin = margin * (high - low);
        Self::exactly((low - margin).exp()..(high + margin).exp())
    }

    /// The axis over exactly this range.
    pub(crate) const fn exactly(range: Range<f64>) -> Self {
        Self { range, least: None }
    }

    /// The same axis, on which all up to this number is shown by this name.
    pub(crate) fn with_least(self, least: Option<(f64, &'static str)>) -> Self {
        Self { least, ..self }
    }

    /// Ticks at these multiples of every `step`-th power of ten, unless there are too many.
    fn ticks(&self, factors: &[f64], step: usize, most: usize) -> Option<Vec<f64>> {
        let mut ticks = Vec::new();
        // Powers from below any number to above it.
        for power in (-330..=308).step_by(step) {
            for factor in factors {
                let tick = factor * 10f64.powi(power);
                if tick > self.range.end * (1.0 + 1e-9) {
                    return Some(ticks);
                }
                if tick >= self.range.start * (1.0 - 1e-9) {
                    if ticks.len() == most {
                        return None;
                    }
                    ticks.push(tick);
                }
            }
        }
        Some(ticks)
    }
}

impl Ranged for LogAxis {
    type ValueType = f64;
    type FormatOption = NoDefaultFormatting;

    fn map(&self, value: &f64, (from, to): (i32, i32)) -> i32 {
        let share = (value / self.range.start).ln() / (self.range.end / self.range.start).ln();
        let at = f64::from(from) + share * f64::from(to - from);
        #[expect(clippy::cast_possible_truncation, reason = "saturates; pixels are few")]
        {
            at.round() as i32
        }
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        const EVERY: [&[f64]; 6] = [
            &[1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 6.0, 7.0, 8.0, 9.0],
            &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0],
            &[1.0, 2.0, 3.0, 5.0, 7.0],
            &[1.0, 2.0, 5.0],
            &[1.0, 3.0],
            &[1.0],
        ];
        let most = hint.max_num_points();
        let fine = EVERY.iter().find_map(|factors| self.ticks(factors, 1, most));
        let coarse = || [2, 3, 5, 10, 30, 110].iter().find_map(|&s| self.ticks(&[1.0], s, most));
        fine.or_else(coarse).unwrap_or_default()
    }

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }
}

impl ValueFormatter<f64> for LogAxis {
    fn format_ext(&self, value: &f64) -> String {
        match self.least {
            // Rounding moves ticks by little.
            Some((least, name)) if *value <= least * (1.0 + 1e-9) => name.into(),
            _ => short(*value),
        }
    }
}

/// An axis from 0.
#[derive(Clone)]
pub(crate) struct LinearAxis(RangedCoordf64);

impl LinearAxis {
    /// Up to exactly this number, or to some if it is not above 0.
    pub(crate) fn up_to(most: f64) -> Self {
        Self((0.0..if most > 0.0 && most.is_finite() { most } else { 1.0 }).into())
    }
}

impl Ranged for LinearAxis {
    type ValueType = f64;
    type FormatOption = NoDefaultFormatting;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        self.0.map(value, limit)
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        self.0.key_points(hint)
    }

    fn range(&self) -> Range<f64> {
        self.0.range()
    }
}

impl ValueFormatter<f64> for LinearAxis {
    fn format_ext(&self, value: &f64) -> String {
        short(*value)
    }
}

/// An axis of names: the first stands at 0, the next at 1, and so on.
#[derive(Clone, Debug)]
pub(crate) struct NameAxis(Vec<String>);

impl NameAxis {
    pub(crate) const fn new(names: Vec<String>) -> Self {
        Self(names)
    }
}

impl Ranged for NameAxis {
    type ValueType = f64;
    type FormatOption = NoDefaultFormatting;

    fn map(&self, value: &f64, (from, to): (i32, i32)) -> i32 {
        let share = (value + 0.5) / self.0.len().max(1) as f64;
        #[expect(clippy::cast_possible_truncation, reason = "saturates; pixels are few")]
        {
            (f64::from(from) + share * f64::from(to - from)).round() as i32
        }
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        (0..self.0.len()).map(|i| i as f64).collect()
    }

    fn range(&self) -> Range<f64> {
        -0.5..self.0.len() as f64 - 0.5
    }
}

impl ValueFormatter<f64> for NameAxis {
    fn format_ext(&self, value: &f64) -> String {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a tick")]
        self.0.get(value.round() as usize).cloned().unwrap_or_default()
    }
}

/// A number as an axis or a sentence shows it: `0.05`, `250`, `30k`, `1.2M`.
pub(crate) fn short(number: f64) -> String {
    let trimmed = |x: f64| {
        // Three significant digits; ticks need at most two.
        let digits = (2.0 - x.abs().log10().floor()).clamp(0.0, 9.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 9")]
        let text = format!("{x:.*}", digits as usize);
        if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text
        }
    };
    // The limits lie where rounding to three digits would show 1000 of the smaller unit.
    match number.abs() {
        0.0 => "0".into(),
        x if x < 0.999_5e-3 => format!("{number:.1e}").replace(".0e", "e"),
        x if x < 999.5 => trimmed(number),
        x if x < 999.5e3 => trimmed(number / 1e3) + "k",
        x if x < 999.5e6 => trimmed(number / 1e6) + "M",
        x if x < 999.5e9 => trimmed(number / 1e9) + "G",
        x if x < 999.5e12 => trimmed(number / 1e12) + "T",
        _ => format!("{number:.0e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_range_gets_a_few_ticks() {
        for (from, to) in [(300.0, 900.0), (0.9, 1.1), (1e-3, 1e6), (1.0, 10.0), (7e-7, 3e-6)] {
            let axis = LogAxis::around([from, to].into_iter(), 0.05);
            let ticks = axis.key_points(8);
            assert!((2..=8).contains(&ticks.len()), "{from}..{to}: {ticks:?}");
            assert!(ticks.iter().all(|t| axis.range().contains(t)));
        }
    }

    #[test]
    fn the_ends_map_to_the_ends() {
        let axis = LogAxis::exactly(1.0..100.0);
        assert_eq!(axis.map(&1.0, (0, 200)), 0);
        assert_eq!(axis.map(&10.0, (0, 200)), 100);
        assert_eq!(axis.map(&100.0, (200, 0)), 0);
    }

    #[test]
    fn zero_may_have_a_place() {
        let axis = LogAxis::around([0.1, 1e3].into_iter(), 0.05).with_least(Some((0.1, "0")));
        assert_eq!((axis.format_ext(&0.1), axis.format_ext(&1.0)), ("0".into(), "1".into()));
        assert_eq!(LogAxis::exactly(0.1..1.0).format_ext(&0.1), "0.1");
    }

    #[test]
    fn names_stand_in_the_middle_of_equal_parts() {
        let axis = NameAxis::new(vec!["a".into(), "b".into()]);
        assert_eq!((axis.map(&0.0, (0, 100)), axis.map(&1.0, (0, 100))), (25, 75));
        assert_eq!(axis.map(&1.0, (100, 0)), 25);
        let names: Vec<_> = axis.key_points(1).iter().map(|x| axis.format_ext(x)).collect();
        assert_eq!(names, ["a", "b"]);
    }

    #[test]
    fn linear_axes_begin_at_zero_whatever_they_show() {
        assert_eq!(LinearAxis::up_to(4.0).range(), 0.0..4.0);
        for odd in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(LinearAxis::up_to(odd).range(), 0.0..1.0);
        }
    }

    #[test]
    fn numbers_are_short() {
        for (number, text) in [
            (0.0, "0"),
            (0.05, "0.05"),
            (6e-8, "6e-8"),
            (1.5e-7, "1.5e-7"),
            (2.5, "2.5"),
            (250.0, "250"),
            (999.7, "1k"),
            (30_000.0, "30k"),
            (1_234_567.0, "1.23M"),
            (5e9, "5G"),
            (1e20, "1e20"),
        ] {
            assert_eq!(short(number), text);
        }
    }
}
