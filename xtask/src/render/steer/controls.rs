//! What keys set: the renderer's settings and how the picture is shown.

use super::Ask;
use crate::render::{
    args::{Mode, Preset, RenderArgs, View},
    gpu,
};
use niwaki_hybrid::{Behind, March, NearRegion, SampleRule, Settings, Shadows};

const PRESETS: [Preset; 4] = [Preset::Fast, Preset::Default, Preset::Fine, Preset::Paper];
const VIEWS: [View; 4] = [View::Image, View::Hits, View::Normals, View::Steps];
const MARCHES: [March; 4] = [
    March::Hierarchical,
    March::Pixels,
    March::LINEAR,
    March::Linear { n_min: 16, n_max: 192, rule: SampleRule::AsPrinted },
];
const SHADOWS: [Shadows; 3] = [Shadows::Traced, Shadows::Maps, Shadows::None];

/// Sides of the faces of the cube map in pixels.
const FACES: std::ops::RangeInclusive<u32> = 64..=4096;

/// One step of the traced region: four double it.
const REGION_STEP: f32 = 1.189_207_1;

/// Shares of the scene between which the traced region is set.
const REGIONS: std::ops::RangeInclusive<f32> = 0.005..=4.0;

/// Pixels of the window a side of one that is rendered: 1 to this.
const COARSEST: u32 = 16;

/// What is rendered, and how it is shown.
#[derive(Clone, Debug)]
pub(in crate::render) struct Controls {
    args: RenderArgs,
    /// Of the settings that are not the preset's, those that keys changed.
    changed: Settings,
    /// Pixels of the window a side of one that is rendered.
    pub(in crate::render) scale: u32,
    /// Brighter than middle grey by so many stops; [`Controls::stops`] where the command line
    /// says how bright.
    bias: f32,
    pub(in crate::render) times: bool,
    pub(in crate::render) plan: bool,
    pub(in crate::render) help: bool,
}

impl Controls {
    /// As the command line says.
    pub(in crate::render) fn new(args: &RenderArgs, scale: u32) -> Self {
        Self {
            args: args.clone(),
            changed: gpu::settings(args),
            scale: scale.clamp(1, COARSEST),
            bias: 0.0,
            times: true,
            plan: false,
            help: false,
        }
    }

    /// What the renderer is told.
    pub(in crate::render) fn settings(&self) -> &Settings {
        &self.changed
    }

    /// Does what a key asks for, if it is about these. True if the renderer has to be told.
    pub(in crate::render) fn apply(&mut self, ask: Ask) -> bool {
        let before = self.changed.clone();
        match ask {
            Ask::NextMode => {
                self.args.mode = match self.args.mode {
                    Mode::FullBvh => Mode::Hybrid,
                    _ => Mode::FullBvh,
                };
                self.changed.near_region = gpu::settings(&self.args).near_region;
            }
            Ask::Preset(i) => {
                // All settings are the preset's again.
                self.args.preset = PRESETS.get(i).copied().unwrap_or(self.args.preset);
                (self.args.region, self.args.depth) = (None, None);
                self.changed = gpu::settings(&self.args);
            }
            Ask::NextView => {
                self.args.debug_view = next(&VIEWS, self.args.debug_view);
                self.changed.debug_view = gpu::settings(&self.args).debug_view;
            }
            Ask::NextMarch => self.changed.march = next(&MARCHES, self.changed.march),
            Ask::NextLayers => self.changed.layers = 3 - self.changed.layers.clamp(1, 2),
            Ask::NextShadows => self.changed.shadows = next(&SHADOWS, self.changed.shadows),
            Ask::NextBehind => {
                self.changed.behind = match self.changed.behind {
                    Behind::Sky => Behind::GoOn,
                    _ => Behind::Sky,
                };
            }
            Ask::Region(steps) => self.region(steps),
            Ask::Map(steps) => {
                let side = self.changed.face_resolution;
                let side = if steps < 0 { side / 2 } else { side.saturating_mul(2) };
                self.changed.face_resolution = side.clamp(*FACES.start(), *FACES.end());
            }
            Ask::Depth(steps) => {
                let most = niwaki_hybrid::settings::MAX_DEPTH;
                self.changed.max_depth =
                    self.changed.max_depth.saturating_add_signed(steps).min(most);
            }
            Ask::Scale(steps) => {
                // Fewer pixels are larger ones.
                self.scale = self.scale.saturating_add_signed(-steps).clamp(1, COARSEST);
            }
            Ask::Exposure(steps) => {
                self.bias = (self.bias + 0.5 * steps as f32).clamp(-20.0, 20.0);
            }
            Ask::Times => self.times = !self.times,
            Ask::Plan => self.plan = !self.plan,
            Ask::Help => self.help = !self.help,
            _ => {}
        }
        before != self.changed
    }

    /// With everything traced there is no region to be set: a key leads back to hybrid.
    fn region(&mut self, steps: i32) {
        let from = match self.changed.near_region {
            NearRegion::ShareOfScene(share) => share,
            _ => *REGIONS.end(),
        };
        let share = from * REGION_STEP.powi(steps);
        let share = share.clamp(*REGIONS.start(), *REGIONS.end());
        self.args.mode = Mode::Hybrid;
        self.args.region = Some(share);
        self.changed.near_region = NearRegion::ShareOfScene(share);
    }

    /// The exposure in stops, if the command line set one.
    pub(in crate::render) fn stops(&self) -> Option<f32> {
        // Debug views are shown as they are.
        let plain = (!self.is_rendering()).then_some(0.0);
        plain.or_else(|| self.args.exposure.map(|stops| stops + self.bias))
    }

    /// Stops from middle grey.
    pub(in crate::render) fn bias(&self) -> f32 {
        self.bias
    }

    /// True if the picture is the rendering, not a debug view.
    pub(in crate::render) fn is_rendering(&self) -> bool {
        self.args.debug_view == View::Image
    }

    /// Mode, for file names and tables.
    pub(in crate::render) fn mode(&self) -> String {
        self.args.mode.name()
    }

    /// What is set, a line each: its keys, its name, its value.
    pub(in crate::render) fn lines(&self) -> Vec<[String; 3]> {
        let s = &self.changed;
        let march = match s.march {
            March::Linear { n_min, n_max, rule } => format!("{rule:?}, {n_min} to {n_max} samples"),
            other => format!("{other:?}").to_lowercase(),
        };
        let region = match s.near_region {
            NearRegion::ShareOfScene(share) => format!("{:.1} % of the scene", 100.0 * share),
            other => other.to_string(),
        };
        let exposure = match (self.is_rendering(), self.args.exposure) {
            (false, _) => String::from("as it is"),
            (true, Some(stops)) => format!("{:+.1} stops", stops + self.bias),
            (true, None) => format!("automatic {:+.1}", self.bias),
        };
        let lines = [
            ("Tab", "mode", self.mode()),
            ("1-4", "preset", format!("{:?}", self.args.preset).to_lowercase()),
            ("V", "view", format!("{:?}", self.args.debug_view).to_lowercase()),
            ("- =", "region", region),
            ("[ ]", "faces", format!("{0} x {0}", s.face_resolution)),
            (", .", "depth", s.max_depth.to_string()),
            ("M", "march", march),
            ("L", "layers", s.layers.to_string()),
            ("B", "behind", format!("{:?}", s.behind)),
            ("K", "shadows", format!("{:?}", s.shadows).to_lowercase()),
            ("X C", "pixels", format!("1 : {}", self.scale)),
            ("PgDn PgUp", "exposure", exposure),
        ];
        lines.map(|(keys, name, value)| [keys.to_owned(), name.to_owned(), value]).into()
    }
}

/// The one after this one, and the first after the last or one that is not in the list.
fn next<T: Copy + PartialEq>(all: &[T], now: T) -> T {
    let after = all.iter().position(|other| *other == now).map_or(0, |i| i + 1);
    all[after % all.len()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::{Cli, Command};
    use clap::Parser;

    fn controls(more: &[&str]) -> Controls {
        let arguments =
            [&["xtask", "render", "--scene", "chess", "--mode", "hybrid"], more].concat();
        let Command::Render(args) = Cli::try_parse_from(arguments).unwrap().command else {
            panic!("not a rendering")
        };
        Controls::new(&args, 1)
    }

    #[test]
    fn keys_reach_every_setting_and_come_back() {
        let mut c = controls(&[]);
        let start = c.settings().clone();
        for (there, back) in [
            (Ask::Region(1), Ask::Region(-1)),
            (Ask::Map(1), Ask::Map(-1)),
            (Ask::Depth(1), Ask::Depth(-1)),
        ] {
            assert!(c.apply(there) && *c.settings() != start, "{there:?}");
            c.apply(back);
        }
        assert_eq!(c.settings().face_resolution, start.face_resolution);
        for (ask, times) in [
            (Ask::NextView, VIEWS.len()),
            (Ask::NextMarch, MARCHES.len()),
            (Ask::NextLayers, 2),
            (Ask::NextShadows, SHADOWS.len()),
            (Ask::NextBehind, 2),
            (Ask::NextMode, 2),
        ] {
            let before = c.settings().clone();
            for left in (0..times).rev() {
                assert!(c.apply(ask), "{ask:?}");
                assert_eq!(*c.settings() == before, left == 0, "{ask:?}");
            }
        }
        assert!(c.apply(Ask::Preset(0)));
        assert_eq!(*c.settings(), Settings::fast());
        c.apply(Ask::Preset(1));
        assert_eq!(*c.settings(), start);
    }

    #[test]
    fn settings_stay_within_their_ranges() {
        let mut c = controls(&[]);
        for ask in [Ask::Region(-1), Ask::Map(-1), Ask::Depth(-1), Ask::Scale(-1)] {
            (0..200).for_each(|_| _ = c.apply(ask));
        }
        assert_eq!(c.settings().near_region, NearRegion::ShareOfScene(*REGIONS.start()));
        assert_eq!((c.settings().face_resolution, c.settings().max_depth), (*FACES.start(), 0));
        assert_eq!(c.scale, COARSEST);
        for ask in [Ask::Region(1), Ask::Map(1), Ask::Depth(1), Ask::Scale(1), Ask::Exposure(1)] {
            (0..200).for_each(|_| _ = c.apply(ask));
        }
        assert_eq!(*c.settings(), c.settings().sanitized());
        assert_eq!((c.settings().face_resolution, c.scale), (*FACES.end(), 1));
    }

    #[test]
    fn the_command_line_sets_where_keys_begin() {
        let more = ["--mode", "full-bvh", "--depth", "3", "--exposure", "-1", "--preset", "fine"];
        let arguments = [&["xtask", "render", "--scene", "chess"], &more[..]].concat();
        let Command::Render(args) = Cli::try_parse_from(arguments).unwrap().command else {
            panic!("not a rendering")
        };
        let mut c = Controls::new(&args, 4);
        assert_eq!((c.settings().max_depth, c.scale, c.stops()), (3, 4, Some(-1.0)));
        assert_eq!(c.settings().near_region, NearRegion::WholeScene);
        // A region can be set only where there is one.
        c.apply(Ask::Region(-1));
        assert_eq!(c.mode(), "hybrid");
        c.apply(Ask::Exposure(1));
        assert_eq!(c.stops(), Some(-0.5));
        c.apply(Ask::NextView);
        assert_eq!(c.stops(), Some(0.0));
    }
}
