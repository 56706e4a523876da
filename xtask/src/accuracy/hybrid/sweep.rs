//! The settings that are compared: each knob by itself around the default, presets, and a grid.

use crate::render::Preset;
use anyhow::{Result, bail};
use clap::ValueEnum as _;
use niwaki_hybrid::{Behind, March, NearRegion, SampleRule, Settings, Shadows};

/// The families that are no knobs: in them, several settings change at once.
pub(super) const PRESETS: &str = "preset";
pub(super) const GRID: &str = "grid";

/// Settings that are measured once, however many families they belong to.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Setup {
    /// `default`, or the first knob and value that they were met with.
    pub(super) name: String,
    pub(super) settings: Settings,
}

/// A place in a family.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Member {
    pub(super) family: &'static str,
    /// What is changed, to what.
    pub(super) value: String,
    /// Number of the setup.
    pub(super) setup: usize,
}

/// Everything that is compared.
#[derive(Clone, Debug)]
pub(super) struct Sweep {
    /// The default comes first.
    pub(super) setups: Vec<Setup>,
    pub(super) members: Vec<Member>,
}

/// A value of a family.
type Value = (String, Settings);

impl Sweep {
    /// The default's number.
    pub(super) const DEFAULT: usize = 0;

    /// All families, or those that are named; in a hurry only the ends of each knob, and no grid.
    pub(super) fn select(names: &[String], quick: bool) -> Result<Self> {
        let mut families = knobs();
        families.push((PRESETS, presets()));
        families.push((GRID, grid()));
        for name in names {
            if !families.iter().any(|(family, _)| family == name) {
                let known: Vec<_> = families.iter().map(|(family, _)| *family).collect();
                bail!("there is no family `{name}` of settings; there are {}", known.join(", "));
            }
        }
        if names.is_empty() {
            families.retain(|(family, _)| !quick || *family != GRID);
        } else {
            families.retain(|(family, _)| names.iter().any(|name| name == family));
        }
        if quick {
            families.iter_mut().for_each(|(_, values)| keep_ends(values));
        }
        Ok(Self::of(families))
    }

    fn of(families: Vec<(&'static str, Vec<Value>)>) -> Self {
        let default = Setup { name: "default".into(), settings: Settings::default() };
        let mut sweep = Self { setups: vec![default], members: Vec::new() };
        for (family, values) in families {
            for (value, settings) in values {
                let known = sweep.setups.iter().position(|setup| setup.settings == settings);
                let setup = known.unwrap_or_else(|| {
                    let name = match family {
                        PRESETS | GRID => value.clone(),
                        knob => format!("{knob} {value}"),
                    };
                    sweep.setups.push(Setup { name, settings });
                    sweep.setups.len() - 1
                });
                sweep.members.push(Member { family, value, setup });
            }
        }
        sweep
    }

    /// The families in order.
    pub(super) fn families(&self) -> Vec<&'static str> {
        let mut names: Vec<&'static str> = Vec::new();
        for member in &self.members {
            if !names.contains(&member.family) {
                names.push(member.family);
            }
        }
        names
    }

    pub(super) fn of_family<'a>(&'a self, family: &'a str) -> impl Iterator<Item = &'a Member> {
        self.members.iter().filter(move |member| member.family == family)
    }

    /// True for settings that differ from the default in one knob.
    pub(super) fn is_one_knob(&self, setup: usize) -> bool {
        let knob = |m: &Member| m.setup == setup && ![PRESETS, GRID].contains(&m.family);
        setup != Self::DEFAULT && self.members.iter().any(knob)
    }
}

/// The first, the last, and the default.
fn keep_ends(values: &mut Vec<Value>) {
    let last = values.len().saturating_sub(1);
    let mut number = 0;
    values.retain(|(_, settings)| {
        let end = number == 0 || number == last;
        number += 1;
        end || *settings == Settings::default()
    });
}

/// The default with something changed, for each of some values.
fn each<T: Copy>(
    values: &[T],
    name: impl Fn(T) -> String,
    change: impl Fn(&mut Settings, T),
) -> Vec<Value> {
    let changed = |&value: &T| {
        let mut settings = Settings::default();
        change(&mut settings, value);
        (name(value), settings)
    };
    values.iter().map(changed).collect()
}

fn number<T: std::fmt::Display>(value: T) -> String {
    value.to_string()
}

/// The linear march that knobs of it start from, whichever march is the default.
const LINEAR: (u32, u32, SampleRule) = (16, 192, SampleRule::Grazing);

fn linear((n_min, n_max, rule): (u32, u32, SampleRule)) -> March {
    March::Linear { n_min, n_max: n_max.max(n_min), rule }
}

/// One knob after the other, values from cheap to dear where that is known.
fn knobs() -> Vec<(&'static str, Vec<Value>)> {
    let region = |region: NearRegion| match region {
        NearRegion::ShareOfScene(share) => share.to_string(),
        _ => "all".into(),
    };
    let share = NearRegion::ShareOfScene;
    let shares = [0.02, 0.05, 0.1, 0.15, 0.3, 0.5].map(share);
    let regions = [&shares[..], &[NearRegion::WholeScene]].concat();
    let behind = |behind: Behind| match behind {
        Behind::Sky => "sky".to_owned(),
        _ => "go on".to_owned(),
    };
    let still = |endless| if endless { "endless" } else { "thin" }.to_owned();
    let rule = |rule: SampleRule| match rule {
        SampleRule::AsPrinted => "as printed".to_owned(),
        _ => "grazing".to_owned(),
    };
    let shadows = |shadows: Shadows| match shadows {
        Shadows::Maps => "maps".to_owned(),
        _ => "traced".to_owned(),
    };
    let march = |march: March| match march {
        March::Linear { .. } => "linear".to_owned(),
        March::Hierarchical => "hierarchical".to_owned(),
        _ => "pixels".to_owned(),
    };
    let marches = [linear(LINEAR), March::Pixels, March::Hierarchical];
    let (n_min, n_max, grazing) = LINEAR;
    vec![
        ("region", each(&regions, region, |s, region| s.near_region = region)),
        ("map", each(&[256, 512, 1024, 2048], number, |s, side| s.face_resolution = side)),
        ("march", each(&marches, march, |s, march| s.march = march)),
        ("n_min", each(&[2, 16, 64, 192], number, |s, n| s.march = linear((n, n_max, grazing)))),
        ("n_max", each(&[32, 64, 192, 512], number, |s, n| s.march = linear((n_min, n, grazing)))),
        (
            "rule",
            each(&[SampleRule::AsPrinted, grazing], rule, |s, rule| {
                s.march = linear((n_min, n_max, rule));
            }),
        ),
        ("layers", each(&[1, 2], number, |s, layers| s.layers = layers)),
        ("thickness", each(&[0.0, 0.5, 1.0, 2.0, 4.0], number, |s, x| s.thickness = x)),
        ("still", each(&[false, true], still, |s, endless| s.endless_when_still = endless)),
        ("behind", each(&[Behind::Sky, Behind::GoOn], behind, |s, behind| s.behind = behind)),
        ("look", each(&[false, true], number, |s, through| s.look_through = through)),
        ("depth", each(&[1, 2, 3, 4, 6, 8], number, |s, depth| s.max_depth = depth)),
        (
            "shadows",
            each(&[Shadows::Maps, Shadows::Traced], shadows, |s, shadows| {
                s.shadows = shadows;
            }),
        ),
    ]
}

/// The presets of `cargo xtask render`, and what all of them approximate.
fn presets() -> Vec<Value> {
    let name = |preset: &Preset| {
        preset.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
    };
    let presets = Preset::value_variants().iter();
    let exact = ("exact".to_owned(), Settings::exact());
    presets.map(|preset| (name(preset), preset.settings())).chain([exact]).collect()
}

/// Low and high values of the knobs that weigh most, in all combinations.
fn grid() -> Vec<Value> {
    let mut values = Vec::new();
    for region in [0.05, 0.3] {
        for face_resolution in [512, 2048] {
            for max_depth in [2, 8] {
                for (march, name) in [(linear(LINEAR), "linear"), (March::Hierarchical, "hier.")] {
                    let settings = Settings {
                        near_region: NearRegion::ShareOfScene(region),
                        face_resolution,
                        max_depth,
                        march,
                        ..Settings::default()
                    };
                    values
                        .push((format!("{region}/{face_resolution}/{max_depth}/{name}"), settings));
                }
            }
        }
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_setup_is_measured_once_and_the_default_is_in_every_knob() {
        for quick in [false, true] {
            let sweep = Sweep::select(&[], quick).unwrap();
            assert_eq!(sweep.setups[Sweep::DEFAULT].settings, Settings::default());
            for (i, a) in sweep.setups.iter().enumerate() {
                assert_eq!(a.settings, a.settings.sanitized(), "{} is in range", a.name);
                for b in &sweep.setups[..i] {
                    assert_ne!(a.settings, b.settings, "{} and {}", a.name, b.name);
                    assert_ne!(a.name, b.name);
                }
            }
            for family in sweep.families() {
                let members: Vec<_> = sweep.of_family(family).collect();
                assert!(members.len() >= 2, "{family}");
                let default = members.iter().any(|m| m.setup == Sweep::DEFAULT);
                let linear = matches!(Settings::default().march, March::Linear { .. });
                let of_linear = ["n_min", "n_max", "rule"].contains(&family);
                assert_eq!(default, family != GRID && (linear || !of_linear), "{family}");
            }
        }
    }

    #[test]
    fn a_knob_changes_one_thing() {
        let sweep = Sweep::select(&["region".into(), "preset".into()], false).unwrap();
        assert_eq!(sweep.families(), ["region", "preset"]);
        let find = |name: &str| sweep.setups.iter().position(|s| s.name == name).unwrap();
        assert!(sweep.is_one_knob(find("region 0.3")) && sweep.is_one_knob(find("region all")));
        assert!(!sweep.is_one_knob(find("fine")) && !sweep.is_one_knob(Sweep::DEFAULT));
        let error = Sweep::select(&["regions".into()], false).unwrap_err().to_string();
        assert!(error.contains("`regions`") && error.contains("region, map"), "{error}");
    }
}
