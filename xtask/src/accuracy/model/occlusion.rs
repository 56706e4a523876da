//! What directions of ambient occlusion, their radius and shadow rays are worth: error of the picture against time.

use crate::accuracy::crops::{around, close, framed};
use crate::bench::progress::Progress;
use crate::bench::rays;
use crate::report::slug;
use crate::tune::fit::spread;
use crate::tune::plant::Plant;
use crate::tune::stage::Stage;
use anyhow::{Context, Result};
use niwaki_core::Builder;
use niwaki_frame_control::RenderSettings;
use niwaki_gpu_tracer::{FrameSettings, reference};
use niwaki_render::metrics::{ErrorMap, FlipSettings, Tile, flip, psnr};
use niwaki_render::{Image, ToneCurve};
use niwaki_trace::AutoScene;
use serde::Serialize;
use std::path::Path;

/// Directions of references.
pub(super) const REFERENCE: u32 = 1024;
/// Directions of the default, as which frames are aimed at by `tune`.
const DEFAULT: u16 = 16;
/// Times that a frame is drawn after the first; the median counts.
const REPEATS: usize = 3;
/// Settings whose worst places are shown.
const SHOWN: [&str; 4] = ["1", "4", "16", "64"];

/// Settings with a name.
#[derive(Clone, Debug)]
pub(super) struct Setup {
    /// The knob that differs from the default: `directions`, `radius` or `shadows`.
    pub(super) knob: &'static str,
    pub(super) value: String,
    pub(super) settings: RenderSettings,
}

/// The settings of some knobs, or of all; of a sweep with `quick` its ends and the default.
pub(super) fn setups(knobs: &[&str], quick: bool) -> Vec<Setup> {
    let usual = RenderSettings { shadows: true, ao_rays: DEFAULT, ..RenderSettings::PRIMARY };
    let mut all = Vec::new();
    let mut add = |knob, value: String, settings| all.push(Setup { knob, value, settings });
    for ao_rays in [0, 1, 2, 4, 8, 16, 32, 64] {
        if !quick || [0, 1, DEFAULT].contains(&ao_rays) {
            add("directions", ao_rays.to_string(), RenderSettings { ao_rays, ..usual });
        }
    }
    for (ao_radius, name) in
        [(0.025, "0.025"), (0.05, "0.05"), (0.1, "0.1"), (0.2, "0.2"), (0.4, "0.4"), (1.0, "1")]
    {
        if !quick || [0.025, 0.1].contains(&ao_radius) {
            add("radius", name.to_owned(), RenderSettings { ao_radius, ..usual });
        }
    }
    for (shadows, name) in [(false, "off"), (true, "on")] {
        add("shadows", name.to_owned(), RenderSettings { shadows, ..usual });
    }
    all.retain(|setup| knobs.contains(&setup.knob));
    all
}

/// What a setup costs, and how wrong its pictures are: means over frames.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Point {
    pub(super) knob: &'static str,
    pub(super) value: String,
    pub(super) shadows: bool,
    pub(super) ao_rays: u16,
    pub(super) ao_radius: f64,
    /// Mean FLIP against the reference: shadows, the default radius, 1,024 directions.
    pub(super) flip: f64,
    /// The same against 1,024 directions of the setup's own radius and shadows: noise.
    pub(super) noise: f64,
    /// Decibels against the reference; absent for equal pictures.
    pub(super) psnr: Option<f64>,
    /// Mean FLIP of the worst tile.
    pub(super) tile: f64,
    /// Milliseconds of a frame.
    pub(super) ms: f64,
    /// The median over frames of ratios to the default.
    pub(super) relative: f64,
    pub(super) is_default: bool,
    pub(super) on_front: bool,
}

impl Point {
    pub(super) fn label(&self) -> String {
        match self.knob {
            "directions" => self.value.clone(),
            knob => format!("{knob} {}", self.value),
        }
    }
}

/// All that was measured of a scene.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Measured {
    /// Numbers of the frames on the path.
    pub(super) frames: Vec<usize>,
    pub(super) points: Vec<Point>,
    /// Mean FLIP between the device and the processor by the same settings, the default's: what is
    /// below is rounding. Absent of simulated devices, whose pictures are the processor's.
    pub(super) rounding: Option<f64>,
    /// The frame and left, top, width and height of the place where the default is worst.
    pub(super) worst: (usize, [u32; 4]),
    /// What pictures show, and their files.
    pub(super) pictures: Vec<(String, String)>,
}

/// A frame that is compared.
struct Moment {
    frame: usize,
    tone: ToneCurve,
    /// By shadows and radius, as displayed; the first is the reference.
    wanted: Vec<((bool, f64), Image)>,
}

impl Moment {
    fn of(&self, settings: &RenderSettings) -> &Image {
        let key = (settings.shadows, settings.ao_radius);
        self.wanted.iter().find(|(own, _)| *own == key).map_or(self.reference(), |(_, image)| image)
    }

    fn reference(&self) -> &Image {
        &self.wanted[0].1
    }
}

/// Steps of the progress bar.
pub(super) fn steps(setups: &[Setup], frames: u32) -> usize {
    frames as usize * (1 + setups.len())
}

/// Pictures and times of all setups in some frames of the path, and pictures of the worst place in `out`.
pub(super) fn measure(
    plant: &mut Plant,
    stage: &Stage,
    setups: &[Setup],
    frames: u32,
    out: &Path,
    progress: &Progress,
) -> Result<Measured> {
    let name = &stage.scene.name;
    let tree = rays::recorder().build_mesh(&stage.scene.mesh)?;
    let tree = AutoScene::new(&tree, &stage.scene.mesh)?;
    let usual = RenderSettings { shadows: true, ao_rays: DEFAULT, ..RenderSettings::PRIMARY };
    // On the processor, so that every device is compared with the same.
    let drawn =
        |camera, settings: &FrameSettings| reference::draw(&stage.scene, &tree, camera, settings);
    let mut moments = Vec::new();
    for frame in spread(stage.cameras.len(), frames as usize) {
        progress.message(&format!("{name}: frame {frame}, {REFERENCE} directions"));
        let mut keys = vec![(true, usual.ao_radius)];
        for setup in setups {
            let key = (setup.settings.shadows, setup.settings.ao_radius);
            if !keys.contains(&key) {
                keys.push(key);
            }
        }
        let images: Vec<Image> = keys
            .iter()
            .map(|&(shadows, ao_radius)| {
                let settings = stage.frame(&RenderSettings { shadows, ao_radius, ..usual });
                // Other turns than those of the frames that are judged.
                let seed = settings.seed ^ 0x5eed;
                drawn(
                    &stage.cameras[frame],
                    &FrameSettings { ao_rays: REFERENCE, seed, ..settings },
                )
            })
            .collect();
        let tone = ToneCurve::automatic().exposed_as(&images[0]);
        let shown = images.iter().map(|image| tone.apply(image));
        moments.push(Moment { frame, tone, wanted: keys.into_iter().zip(shown).collect() });
        progress.step();
    }
    let viewing = FlipSettings::default();
    let mut spent: Vec<Vec<f64>> = vec![Vec::new(); setups.len()];
    let mut shown: Vec<Vec<(Image, ErrorMap)>> = vec![Vec::new(); setups.len()];
    let mut noise = vec![0.0; setups.len()];
    for moment in &moments {
        for (i, setup) in setups.iter().enumerate() {
            progress.message(&format!("{name}: {} {}", setup.knob, setup.value));
            spent[i].push(time(plant, stage, moment.frame, &setup.settings)?);
            let image = match plant.image()? {
                Some(image) => image,
                None => drawn(&stage.cameras[moment.frame], &stage.frame(&setup.settings)),
            };
            let image = moment.tone.apply(&image);
            noise[i] += flip(&image, moment.of(&setup.settings), &viewing)?.mean();
            let map = flip(&image, moment.reference(), &viewing)?;
            shown[i].push((image, map));
            progress.step();
        }
    }
    // Where the default is worst, or what stands for it.
    let default = setups.iter().position(|setup| setup.settings == usual).unwrap_or_default();
    let side = (stage.size[0].min(stage.size[1]) / 5).max(8);
    let worst = shown[default]
        .iter()
        .enumerate()
        .filter_map(|(k, (_, map))| Some((k, map.worst_tile(side)?)))
        .max_by(|a, b| a.1.1.total_cmp(&b.1.1));
    let (at, (tile, _)) = worst.context("there are no pixels")?;
    let mut points = Vec::with_capacity(setups.len());
    for (i, setup) in setups.iter().enumerate() {
        let count = moments.len() as f64;
        let mean =
            |of: &dyn Fn(&(Image, ErrorMap)) -> f64| shown[i].iter().map(of).sum::<f64>() / count;
        let mut decibels = 0.0;
        for ((image, _), moment) in shown[i].iter().zip(&moments) {
            decibels += psnr(image, moment.reference())? / count;
        }
        let ratios: Vec<f64> = spent[i].iter().zip(&spent[default]).map(|(a, b)| a / b).collect();
        points.push(Point {
            knob: setup.knob,
            value: setup.value.clone(),
            shadows: setup.settings.shadows,
            ao_rays: setup.settings.ao_rays,
            ao_radius: setup.settings.ao_radius,
            flip: mean(&|(_, map)| map.mean()),
            noise: noise[i] / count,
            psnr: decibels.is_finite().then_some(decibels),
            tile: shown[i][at].1.mean_of(tile),
            ms: spent[i].iter().sum::<f64>() / count,
            relative: super::sampling::median(&ratios),
            is_default: setup.settings == usual,
            on_front: false,
        });
    }
    let costs: Vec<(f64, f64)> = points.iter().map(|p| (p.flip, p.ms)).collect();
    for (point, on_front) in points.iter_mut().zip(crate::report::pareto_front(&costs)) {
        point.on_front = on_front;
    }
    let rounding = match plant {
        Plant::Vulkan { .. } => {
            let moment = &moments[at];
            let own = drawn(&stage.cameras[moment.frame], &stage.frame(&setups[default].settings));
            Some(flip(&shown[default][at].0, &moment.tone.apply(&own), &viewing)?.mean())
        }
        Plant::Simulated { .. } => None,
    };
    let place = Place { name: slug(name), tile, out };
    let mut pictures = place.save_frame(&shown[default][at].0, moments[at].reference())?;
    for (setup, shown) in setups.iter().zip(&shown) {
        let is_shown = setup.knob == "directions" && SHOWN.contains(&setup.value.as_str());
        if is_shown || setup.knob != "directions" && setup.settings != usual {
            let (image, map) = &shown[at];
            pictures.extend(place.save(&format!("{} {}", setup.knob, setup.value), image, map)?);
        }
    }
    Ok(Measured {
        frames: moments.iter().map(|moment| moment.frame).collect(),
        points,
        rounding,
        worst: (moments[at].frame, [tile.x, tile.y, tile.width, tile.height]),
        pictures,
    })
}

/// Milliseconds of a frame: the first may compile, and the last is the picture that is judged.
fn time(plant: &mut Plant, stage: &Stage, frame: usize, settings: &RenderSettings) -> Result<f64> {
    if matches!(plant, Plant::Simulated { .. }) {
        return plant.probe(stage, frame, settings);
    }
    plant.draw(stage, 0, frame, settings)?;
    let times: Vec<f64> =
        (0..REPEATS).map(|_| plant.draw(stage, 0, frame, settings)).collect::<Result<_>>()?;
    Ok(super::sampling::median(&times))
}

/// A place in a picture, and where its pictures go.
struct Place<'a> {
    name: String,
    tile: Tile,
    out: &'a Path,
}

impl Place<'_> {
    fn write(&self, what: &str, image: &Image) -> Result<(String, String)> {
        let file = format!("pictures/{}-{}.png", self.name, slug(what));
        let path = self.out.join(&file);
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)
                .with_context(|| format!("cannot create {}", folder.display()))?;
        }
        image.save_png(&path, &ToneCurve::default())?;
        Ok((what.to_owned(), file))
    }

    /// The whole frame with the place in it, and what is wanted there.
    fn save_frame(&self, image: &Image, wanted: &Image) -> Result<Vec<(String, String)>> {
        let wanted = close(wanted, around(self.tile, wanted));
        Ok(vec![
            self.write("default, the frame", &framed(image, self.tile, 2))?,
            self.write(&format!("{REFERENCE} directions"), &wanted)?,
        ])
    }

    /// The place by a setup, and its error.
    fn save(&self, name: &str, image: &Image, map: &ErrorMap) -> Result<Vec<(String, String)>> {
        let part = around(self.tile, image);
        let error = close(&map.colorize(), part);
        Ok(vec![
            self.write(name, &close(image, part))?,
            self.write(&format!("{name}, FLIP"), &error)?,
        ])
    }
}
