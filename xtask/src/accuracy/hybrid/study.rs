//! What the measurements say together.

use super::artifact::Artifact;
use super::measure::{Measured, Sample};
use super::sweep::{PRESETS, Sweep};
use crate::bench::timing::median;
use crate::render::Size;
use crate::report::table::{Best, Cell, Table};
use crate::report::{geometric_mean, pareto_front, slug};
use crate::results::{Failure, Run, finite};
use niwaki_hybrid::Settings;
use serde::Serialize;

/// A place in a family: what is changed, to what.
#[derive(Clone, Debug, Serialize, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) family: String,
    pub(super) value: String,
}

/// What a part of a frame took on the GPU.
#[derive(Clone, Debug, Serialize, PartialEq)]
pub(super) struct Pass {
    pub(super) name: String,
    /// Median over frames, in milliseconds; frames without the pass count 0.
    pub(super) ms: f64,
}

/// A setup on a scene.
#[derive(Clone, Debug, Serialize, PartialEq)]
pub(super) struct Point {
    pub(super) setup: String,
    #[serde(skip)]
    pub(super) number: usize,
    /// It differs from the default in one knob.
    pub(super) one_knob: bool,
    pub(super) families: Vec<Place>,
    pub(super) settings: Settings,
    /// Means over frames of the mean FLIP of the picture against the deepest reference, ...
    pub(super) flip: f64,
    /// ... of the same against a reference of this setup's depth, ...
    pub(super) flip_of_depth: f64,
    /// ... of the mean HDR-FLIP, over frames with more contrast than is displayed, ...
    pub(super) hdr_flip: Option<f64>,
    /// ... of PSNR in decibels, absent for pictures that equal the reference, ...
    pub(super) psnr: Option<f64>,
    /// ... and of SSIM.
    pub(super) ssim: f64,
    /// Mean FLIP of the tile in which the default is worst.
    pub(super) tile: Option<f64>,
    /// Median over frames of the time of a frame, in milliseconds.
    pub(super) ms: f64,
    /// Median over frames of that time over the default's.
    pub(super) relative: f64,
    pub(super) passes: Vec<Pass>,
    /// No other setup is at least as fast and as exact on this scene.
    pub(super) on_front: bool,
}

/// All setups on a scene.
#[derive(Clone, Debug, Serialize)]
pub(super) struct SceneStudy {
    pub(super) scene: String,
    pub(super) triangles: usize,
    /// Numbers of the frames on the camera path of 200.
    pub(super) frames: Vec<u32>,
    pub(super) points: Vec<Point>,
    pub(super) artifact: Artifact,
}

/// Everything that a run found.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Study {
    /// Version of this file's layout.
    pub(super) schema: u32,
    pub(super) suite: &'static str,
    pub(super) run: Run,
    /// What drew the frames.
    pub(super) device: String,
    /// True if times are the device's own; otherwise they run from the call to the end of the work.
    pub(super) device_times: bool,
    pub(super) width: u32,
    pub(super) height: u32,
    /// Reflections and refractions that the reference follows.
    pub(super) reference_depth: u32,
    pub(super) scenes: Vec<SceneStudy>,
    pub(super) failures: Vec<Failure>,
}

fn mean(numbers: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = numbers.fold((0.0, 0.0), |(sum, count), x| (sum + x, count + 1.0));
    sum / count
}

/// The name under which a pass is shown: the faces of the cube map are one.
fn group(pass: &str) -> &str {
    if pass.starts_with("cube face") { "cube map" } else { pass }
}

/// Milliseconds by pass, in the order in which they ran.
fn passes(samples: &[Sample]) -> Vec<Pass> {
    let mut names: Vec<&str> = Vec::new();
    for (name, _) in samples.iter().flat_map(|sample| &sample.passes) {
        if !names.contains(&group(name)) {
            names.push(group(name));
        }
    }
    let of = |sample: &Sample, name: &str| -> f64 {
        sample.passes.iter().filter(|(pass, _)| group(pass) == name).map(|(_, ms)| ms).sum()
    };
    let pass = |name: &str| Pass {
        name: name.to_owned(),
        ms: median(&samples.iter().map(|sample| of(sample, name)).collect::<Vec<_>>()),
    };
    names.into_iter().map(pass).collect()
}

/// The points of a scene, in the order of the setups.
pub(super) fn points(sweep: &Sweep, measured: &Measured) -> Vec<Point> {
    let default = &measured.samples[Sweep::DEFAULT];
    let measured = sweep.setups.iter().enumerate().zip(&measured.samples);
    let mut points: Vec<Point> = measured
        .filter(|(_, samples)| !samples.is_empty())
        .map(|((number, setup), samples)| {
            let over = |value: fn(&Sample) -> f64| mean(samples.iter().map(value));
            let hdr: Vec<f64> = samples.iter().filter_map(|s| s.errors.hdr_flip).collect();
            let ratios: Vec<f64> = samples.iter().zip(default).map(|(s, d)| s.ms / d.ms).collect();
            let place = |m: &super::sweep::Member| Place {
                family: m.family.to_owned(),
                value: m.value.clone(),
            };
            let places = sweep.members.iter().filter(|m| m.setup == number).map(place);
            Point {
                setup: setup.name.clone(),
                number,
                one_knob: sweep.is_one_knob(number),
                families: places.collect(),
                settings: setup.settings.clone(),
                flip: over(|s| s.errors.flip),
                flip_of_depth: over(|s| s.errors.flip_of_depth),
                hdr_flip: (!hdr.is_empty()).then(|| mean(hdr.into_iter())),
                psnr: finite(over(|s| s.errors.psnr)),
                ssim: over(|s| s.errors.ssim),
                tile: samples.iter().find_map(|s| s.tile),
                ms: median(&samples.iter().map(|s| s.ms).collect::<Vec<_>>()),
                relative: median(&ratios),
                passes: passes(samples),
                on_front: false,
            }
        })
        .collect();
    let costs: Vec<(f64, f64)> = points.iter().map(|p| (p.ms, p.flip)).collect();
    for (point, on_front) in points.iter_mut().zip(pareto_front(&costs).collect::<Vec<_>>()) {
        point.on_front = on_front;
    }
    points
}

impl SceneStudy {
    /// The point of a setup, unless it failed.
    pub(super) fn point(&self, setup: usize) -> Option<&Point> {
        self.points.iter().find(|point| point.number == setup)
    }

    fn rows(&self, table: &mut Table, keep: impl Fn(&Point) -> bool) {
        for point in self.points.iter().filter(|point| keep(point)) {
            table.push(vec![
                point.setup.clone().into(),
                point.flip.into(),
                point.flip_of_depth.into(),
                point.hdr_flip.into(),
                point.psnr.into(),
                point.ssim.into(),
                point.tile.into(),
                point.ms.into(),
                point.relative.into(),
                if point.on_front { "front" } else { "" }.into(),
            ]);
        }
    }

    fn table(&self, name: &str) -> Table {
        Table::new(format!("hybrid-{name}-{}", slug(&self.scene)))
            .column("setting", Best::Neither)
            .column_with_digits("FLIP", Best::Low, 4)
            .column_with_digits("of depth", Best::Low, 4)
            .column_with_digits("HDR-FLIP", Best::Low, 4)
            .column_with_digits("PSNR\ndB", Best::High, 1)
            .column_with_digits("SSIM", Best::High, 4)
            .column_with_digits("worst\ntile", Best::Low, 3)
            .column_with_digits("frame\nms", Best::Low, 2)
            .column_with_digits("÷\ndefault", Best::Low, 2)
            .column("", Best::Neither)
    }

    /// All setups.
    pub(super) fn full_table(&self) -> Table {
        let mut table = self.table("settings");
        self.rows(&mut table, |_| true);
        table
    }

    /// Those on the front, the default and the presets.
    pub(super) fn front_table(&self) -> Table {
        let mut table = self.table("front");
        let preset = |point: &Point| point.families.iter().any(|place| place.family == PRESETS);
        let shown = |point: &Point| point.number == Sweep::DEFAULT || point.on_front;
        self.rows(&mut table, |point| shown(point) || preset(point));
        table
    }

    /// What each pass of a frame takes, by setup.
    pub(super) fn pass_table(&self) -> Table {
        let mut names: Vec<&str> = Vec::new();
        for pass in self.points.iter().flat_map(|point| &point.passes) {
            if !names.contains(&pass.name.as_str()) {
                names.push(&pass.name);
            }
        }
        let mut table = Table::new(format!("hybrid-passes-{}", slug(&self.scene)))
            .column("ms", Best::Neither)
            .column_with_digits("frame", Best::Low, 2);
        for name in &names {
            table = table.column_with_digits(name.replace(' ', "\n"), Best::Neither, 2);
        }
        for point in self.points.iter().filter(|point| !point.passes.is_empty()) {
            let ms = |name: &&str| {
                point.passes.iter().find(|pass| pass.name == **name).map(|pass| pass.ms)
            };
            let mut row: Vec<Cell> = vec![point.setup.clone().into(), point.ms.into()];
            row.extend(names.iter().map(|name| Cell::from(ms(name))));
            table.push(row);
        }
        table
    }
}

impl Study {
    pub(super) fn of(
        run: Run,
        (device, device_times): (String, bool),
        size: Size,
        scenes: Vec<SceneStudy>,
        failures: Vec<Failure>,
    ) -> Self {
        Self {
            schema: 1,
            suite: "hybrid",
            run,
            device,
            device_times,
            width: size.width,
            height: size.height,
            reference_depth: super::measure::DEEPEST,
            scenes,
            failures,
        }
    }

    /// Error and time of each setting over those of the default: geometric means over scenes.
    pub(super) fn summary_table(&self, sweep: &Sweep) -> Table {
        let mut table = Table::new("hybrid-settings")
            .column("knob", Best::Neither)
            .column("value", Best::Neither)
            .column_with_digits("FLIP\n÷ default", Best::Neither, 3)
            .column_with_digits("frame time\n÷ default", Best::Neither, 3)
            .column_with_digits("FLIP\nmean", Best::Neither, 4)
            .column_with_digits("FLIP\nlargest", Best::Neither, 4)
            .column("on the front of", Best::Neither);
        for member in &sweep.members {
            let points: Vec<(&Point, &Point)> = self
                .scenes
                .iter()
                .filter_map(|s| Some((s.point(member.setup)?, s.point(Sweep::DEFAULT)?)))
                .collect();
            if points.is_empty() {
                continue;
            }
            let fronts = points.iter().filter(|(point, _)| point.on_front).count();
            let default = member.setup == Sweep::DEFAULT && member.family != PRESETS;
            table.push(vec![
                member.family.into(),
                if default { format!("{} *", member.value) } else { member.value.clone() }.into(),
                geometric_mean(points.iter().map(|(p, d)| p.flip / d.flip)).into(),
                geometric_mean(points.iter().map(|(p, _)| p.relative)).into(),
                mean(points.iter().map(|(p, _)| p.flip)).into(),
                points.iter().map(|(p, _)| p.flip).fold(0.0, f64::max).into(),
                format!("{fronts} of {}", points.len()).into(),
            ]);
        }
        table
    }

    /// Where the default is worst in each scene, and what removes it.
    pub(super) fn artifact_table(&self) -> Table {
        let mut table = Table::new("hybrid-artifacts")
            .column("scene", Best::Neither)
            .column("frame", Best::Neither)
            .column("tile at", Best::Neither)
            .column_with_digits("FLIP\nthere", Best::Neither, 3)
            .column("what removes most", Best::Neither)
            .column_with_digits("removed\n%", Best::Neither, 0)
            .column_with_digits("time\n÷ default", Best::Neither, 2)
            .column("in little more time", Best::Neither)
            .column_with_digits("removed\n%", Best::Neither, 0)
            .column_with_digits("time\n÷ default", Best::Neither, 2);
        for scene in &self.scenes {
            let artifact = &scene.artifact;
            let [x, y, ..] = artifact.tile;
            let mut row: Vec<Cell> = vec![
                scene.scene.clone().into(),
                (artifact.frame as usize).into(),
                format!("{x}, {y}").into(),
                artifact.flip.into(),
            ];
            for remedy in [&artifact.best, &artifact.cheap] {
                row.push(remedy.as_ref().map(|r| r.setup.as_str()).into());
                row.push(remedy.as_ref().map(|r| r.removed * 100.0).into());
                row.push(remedy.as_ref().map(|r| r.relative).into());
            }
            table.push(row);
        }
        table
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::accuracy::hybrid::measure::Errors;

    pub(in crate::accuracy::hybrid) fn point(setup: &str, flip: f64, ms: f64) -> Point {
        Point {
            setup: setup.into(),
            number: 0,
            one_knob: false,
            families: Vec::new(),
            settings: Settings::default(),
            flip,
            flip_of_depth: flip,
            hdr_flip: None,
            psnr: None,
            ssim: 1.0,
            tile: None,
            ms,
            relative: 1.0,
            passes: Vec::new(),
            on_front: false,
        }
    }

    fn sample(flip: f64, passes: &[(&str, f64)]) -> Sample {
        let errors =
            Errors { flip, flip_of_depth: flip, hdr_flip: None, psnr: 30.0 + flip, ssim: 0.9 };
        let passes: Vec<_> = passes.iter().map(|(name, ms)| ((*name).to_owned(), *ms)).collect();
        let ms = passes.iter().map(|(_, ms)| ms).sum();
        Sample { errors, passes, ms, tile: None }
    }

    fn measured(samples: Vec<Vec<Sample>>) -> Measured {
        let tile = niwaki_render::metrics::Tile { x: 0, y: 0, width: 1, height: 1 };
        let black = niwaki_render::Image::black(1, 1);
        Measured {
            samples,
            frames: vec![50, 150],
            worst: (0, tile),
            panels: super::super::artifact::Panels::new(&black, &black, tile),
            failures: Vec::new(),
        }
    }

    #[test]
    fn errors_are_means_times_are_medians_and_ratios_are_of_the_same_frame() {
        let sweep = Sweep::select(&["behind".into()], false).unwrap();
        assert_eq!(sweep.setups.len(), 2);
        let faces = [("cube face +x", 1.0), ("cube face -x", 2.0), ("ray traversal", 7.0)];
        let samples = vec![
            vec![sample(0.1, &faces), sample(0.3, &[("ray traversal", 40.0)])],
            vec![sample(0.2, &[("ray traversal", 5.0)]), sample(0.4, &[("ray traversal", 60.0)])],
        ];
        let points = points(&sweep, &measured(samples));
        let [default, sky] = points.as_slice() else { panic!("two points") };
        assert!((default.flip - 0.2).abs() < 1e-12 && (sky.flip - 0.3).abs() < 1e-12);
        assert_eq!((default.ms, default.relative), (25.0, 1.0));
        // (5/10 + 60/40) / 2, not 32.5/25.
        assert_eq!((sky.ms, sky.relative), (32.5, 1.0));
        let passes: Vec<_> = default.passes.iter().map(|p| (p.name.as_str(), p.ms)).collect();
        assert_eq!(passes, [("cube map", 1.5), ("ray traversal", 23.5)]);
        assert!(default.on_front && !sky.on_front);
        assert!((default.psnr.unwrap() - 30.2).abs() < 1e-9 && sky.one_knob);
    }

    #[test]
    fn a_failed_setup_has_no_point_and_the_summary_leaves_it_out() {
        let sweep = Sweep::select(&["behind".into()], false).unwrap();
        let samples = vec![vec![sample(0.1, &[("a", 1.0)])], Vec::new()];
        let points = points(&sweep, &measured(samples));
        assert_eq!(points.len(), 1);
        let artifact = Artifact {
            frame: 50,
            tile: [1, 2, 3, 4],
            flip: 0.1,
            best: None,
            cheap: None,
            pictures: Vec::new(),
        };
        let scene =
            SceneStudy { scene: "a".into(), triangles: 1, frames: vec![50], points, artifact };
        let size = Size { width: 4, height: 2 };
        let study = Study::of(Run::default(), ("x".into(), true), size, vec![scene], Vec::new());
        let csv = study.summary_table(&sweep).to_csv().unwrap();
        assert_eq!(csv.lines().count(), 2, "{csv}");
        assert!(csv.contains("behind,go on *,1,1,0.1,0.1,1 of 1"), "{csv}");
        let csv = study.artifact_table().to_csv().unwrap();
        assert!(csv.ends_with("a,50,\"1, 2\",0.1,,,,,,\n"), "{csv}");
    }
}
