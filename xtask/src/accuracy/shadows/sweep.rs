//! The settings that are compared.

use anyhow::{Result, bail};
use niwaki_raster::{Algorithm, Bias, Filter, Settings, Variance};

/// The knobs, by which points are joined in plots.
pub(super) const KNOBS: [&str; 4] = ["resolution", "filter", "bias", "sides"];

/// Settings with a name.
#[derive(Clone, Debug)]
pub(super) struct Setup {
    /// One of [`KNOBS`]; nothing for shadow volumes as they are by default.
    pub(super) knob: &'static str,
    /// What is set.
    pub(super) value: String,
    pub(super) settings: Settings,
}

impl Setup {
    /// The line in plots to which it belongs.
    pub(super) fn family(&self) -> String {
        match self.knob {
            "" => self.settings.algorithm.short().to_owned(),
            knob => format!("{} {knob}", self.settings.algorithm),
        }
    }
}

/// All setups for images of a size, or those of some knobs; shadow volumes always.
pub(super) fn setups(
    knobs: &[String],
    [width, height]: [u32; 2],
    quick: bool,
) -> Result<Vec<Setup>> {
    if let Some(unknown) = knobs.iter().find(|knob| !KNOBS.contains(&knob.as_str())) {
        bail!("`{unknown}` is no knob of shadows; there are {}", KNOBS.join(", "));
    }
    let new = |algorithm| Settings::new(algorithm, width, height);
    let [volumes, maps, variance] = Algorithm::SHADOWS.map(new);
    let base = maps.shadow_resolution;
    let both = Settings { one_sided: false, ..volumes.clone() };
    let mut all = vec![Setup { knob: "", value: String::new(), settings: volumes }];
    let mut add = |knob, value: String, settings: Settings| {
        all.push(Setup { knob, value, settings });
    };
    // A quarter to four times the paper's rule.
    let sides = [base / 4, base / 2, base, 2 * base, 4 * base];
    for side in sides.into_iter().filter(|side| *side >= 16).step_by(if quick { 2 } else { 1 }) {
        for settings in [&maps, &variance] {
            let settings = Settings { shadow_resolution: side, ..settings.clone() };
            add("resolution", format!("{side}²"), settings);
        }
    }
    let filters = [
        ("nearest", Filter::Nearest),
        ("1 tap", Filter::Closer(1)),
        ("2² taps", Filter::Closer(2)),
        ("3² taps", Filter::Closer(3)),
        ("5² taps", Filter::Closer(5)),
    ];
    for (name, filter) in filters.into_iter().step_by(if quick { 4 } else { 1 }) {
        // Wider filters compare with pixels that lie further off on the same surface.
        let Filter::Closer(taps) = filter else {
            add("filter", name.into(), Settings { filter, ..maps.clone() });
            continue;
        };
        let wide = 0.5 * (taps as f32 + 1.0);
        let bias = Bias { constant: 0.5 * wide, slope: wide, normal: 0.0 };
        add("filter", name.into(), Settings { filter, bias, ..maps.clone() });
    }
    let widths = [
        ("finest level", 1.0, 1.0),
        ("a pixel's", 65_536.0, 1.0),
        ("2 or more", 65_536.0, 2.0),
        ("4 or more", 65_536.0, 4.0),
        ("8 or more", 65_536.0, 8.0),
    ];
    for (name, most_filter, least_filter) in widths.into_iter().step_by(if quick { 4 } else { 1 }) {
        let of = Variance { most_filter, least_filter, ..variance.variance };
        add("filter", name.into(), Settings { variance: of, ..variance.clone() });
    }
    let biases = [
        ("none", Bias::NONE),
        ("half a pixel", Bias { constant: 0.5, slope: 0.0, normal: 0.0 }),
        ("and its slope", Bias { constant: 0.5, slope: 1.0, normal: 0.0 }),
        ("along the normal", Bias { constant: 0.0, slope: 0.0, normal: 1.5 }),
        ("four times", Bias { constant: 2.0, slope: 4.0, normal: 0.0 }),
        ("sixteen times", Bias { constant: 8.0, slope: 16.0, normal: 0.0 }),
    ];
    for (name, bias) in biases.into_iter().step_by(if quick { 2 } else { 1 }) {
        add("bias", name.into(), Settings { bias, ..maps.clone() });
    }
    for bleeding in [0.1_f32, 0.3].into_iter().step_by(if quick { 2 } else { 1 }) {
        let of = Variance { bleeding, ..variance.variance };
        add("bias", format!("bleeding {bleeding}"), Settings { variance: of, ..variance.clone() });
    }
    let none = Variance { bias: Bias::NONE, least_deviation: 0.0, ..variance.variance };
    add("bias", "none".into(), Settings { variance: none, ..variance.clone() });
    add("sides", "closed parts cast from both".into(), both);
    all.retain(|s| s.knob.is_empty() || knobs.is_empty() || knobs.iter().any(|k| k == s.knob));
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn knobs_are_selected_and_unknown_ones_named() {
        let count = |knobs: &[&str], quick| {
            let knobs: Vec<String> = knobs.iter().map(|k| (*k).to_owned()).collect();
            setups(&knobs, [320, 180], quick).map(|s| s.len())
        };
        assert_eq!(count(&["resolution"], false).unwrap(), 1 + 2 * 5);
        assert!(count(&[], true).unwrap() < count(&[], false).unwrap());
        assert!(count(&["width"], false).unwrap_err().to_string().contains("bias"));
    }
}
