//! What the window shows: the renderer, the camera, the time, and the text over it.

use super::{
    WITHOUT,
    overlay::{self, Report},
    present::{Presenter, Shown},
};
use crate::{
    render::{
        args::RenderArgs,
        frames::Part,
        gpu::{counted_rays, parts},
        steer::{Ask, Clock, Controls, Fly, Go, RATE},
    },
    report::slug,
};
use anyhow::{Context, Result, anyhow};
use niwaki_hybrid::{EffectPlan, FrameReport, Gpu, HybridError, HybridRenderer};
use niwaki_render::{Exposure, ToneCurve};
use niwaki_scene::{Camera, CameraPath, Scene};
use std::{path::PathBuf, sync::Arc, time::Instant};
use winit::window::Window;

/// How long a message stands, in seconds.
const MESSAGE: f64 = 6.0;

/// Pixels of the window a side of one that is rendered, on a processor without a GPU.
const SOFTWARE_SCALE: u32 = 4;

/// What the window shows.
pub(super) struct View {
    gpu: Gpu,
    renderer: HybridRenderer,
    presenter: Presenter,
    controls: Controls,
    /// What the last frame was drawn with.
    good: Controls,
    scene: Arc<Scene>,
    fly: Fly,
    path: CameraPath,
    /// The camera follows its path.
    follows: bool,
    along: Clock,
    clock: Clock,
    /// The renderer's image is that of an earlier camera, time or setting.
    stale: bool,
    /// The window could not take the last frame: it has to be shown again.
    missed: bool,
    last: Option<Last>,
    message: Option<(String, Instant)>,
    pictures: PathBuf,
    name: String,
}

/// The last frame.
struct Last {
    plan: EffectPlan,
    report: FrameReport,
}

impl View {
    /// Opens the device that can draw on the window, and compiles the kernels.
    pub(super) fn new(
        args: &RenderArgs,
        scene: Arc<Scene>,
        display: Box<dyn wgpu::wgt::WgpuHasDisplayHandle>,
        window: Arc<Window>,
    ) -> Result<Self> {
        let size = window.inner_size();
        let mut descriptor = wgpu::InstanceDescriptor::new_with_display_handle(display);
        descriptor.backends = wgpu::Backends::VULKAN;
        let instance = wgpu::Instance::new(descriptor);
        let surface = instance
            .create_surface(window)
            .map_err(|error| anyhow!("Vulkan cannot draw on this window ({error}); {WITHOUT}"))?;
        let gpu = Gpu::with_surface(&instance, &surface).context(WITHOUT)?;
        let presenter = Presenter::new(
            gpu.adapter(),
            gpu.device(),
            gpu.queue(),
            surface,
            [size.width, size.height],
        )?;
        let software = gpu.adapter().get_info().device_type == wgpu::DeviceType::Cpu;
        let controls = Controls::new(args, if software { SOFTWARE_SCALE } else { 1 });
        let renderer = HybridRenderer::new(&gpu, Arc::clone(&scene), controls.settings().clone())?;
        let path = scene.camera_path();
        let first = scene.cameras.first().context("the scene has no camera")?;
        let fly = Fly::new(first, path.up, scene.mesh.bounds());
        Ok(Self {
            presenter,
            good: controls.clone(),
            controls,
            fly,
            along: along(&path),
            path,
            follows: false,
            clock: Clock::new(scene.animation.is_some(), around(&scene)),
            stale: true,
            missed: false,
            last: None,
            message: None,
            pictures: args.out.clone(),
            name: scene.name.clone(),
            scene,
            renderer,
            gpu,
        })
    }

    /// Shows another scene from where the camera stands.
    pub(super) fn reload(&mut self, scene: Arc<Scene>) {
        let settings = self.controls.settings().clone();
        match HybridRenderer::new(&self.gpu, Arc::clone(&scene), settings) {
            Ok(renderer) => {
                self.renderer = renderer;
                self.path = scene.camera_path();
                self.along = along(&self.path);
                self.clock.around = around(&scene);
                self.say(format!("loaded again, {} triangles", scene.mesh.len()));
                self.scene = scene;
                self.stale = true;
            }
            Err(error) => self.say(error.to_string()),
        }
    }

    /// Writes a line over the picture for a while.
    pub(super) fn say(&mut self, text: String) {
        self.message = Some((text, Instant::now()));
    }

    pub(super) fn resize(&mut self, size: [u32; 2]) {
        self.presenter.resize(size);
        self.stale = true;
    }

    /// A key that moves the camera takes it off its path.
    pub(super) fn fly(&mut self, go: Go, down: bool) {
        self.leave_path();
        self.fly.key(go, down);
    }

    pub(super) fn set_fast(&mut self, fast: bool) {
        self.fly.fast = fast;
    }

    pub(super) fn look(&mut self, [right, down]: [f64; 2], height: u32) {
        self.leave_path();
        self.fly.look(right, down, height);
        self.stale = true;
    }

    pub(super) fn shift_gear(&mut self, steps: f64) {
        self.fly.shift_gear(steps);
    }

    pub(super) fn release(&mut self) {
        self.fly.release();
    }

    fn leave_path(&mut self) {
        self.follows = false;
    }

    /// True if the next frame differs without anyone doing anything.
    pub(super) fn is_moving(&self) -> bool {
        let plays = self.clock.runs && self.scene.animation.is_some();
        plays || self.follows || self.missed || self.fly.moves() || self.message.is_some()
    }

    /// Does what a key asks for.
    pub(super) fn ask(&mut self, ask: Ask) {
        match ask {
            Ask::Pause | Ask::Step(_) if self.scene.animation.is_none() => {
                self.say(String::from("nothing moves in this scene"));
            }
            Ask::Pause => self.clock.runs = !self.clock.runs,
            Ask::Step(frames) => {
                self.clock.step(frames.into());
                self.stale = true;
            }
            Ask::FollowPath => {
                self.follows = !self.follows;
            }
            Ask::PathAnew => {
                (self.along.time, self.clock.time) = (0.0, 0.0);
                self.follows = true;
                self.stale = true;
            }
            Ask::Picture => {
                let said = match self.picture() {
                    Ok(path) => format!("saved {}", path.display()),
                    Err(error) => format!("{error:#}"),
                };
                self.say(said);
            }
            ask => {
                if self.controls.apply(ask) {
                    self.renderer.set_settings(self.controls.settings().clone());
                    self.stale = true;
                }
                self.stale |= matches!(ask, Ask::Scale(_));
            }
        }
    }

    /// Saves the renderer's image, as bright as it is shown and without text.
    fn picture(&self) -> Result<PathBuf> {
        let image = self.renderer.image()?;
        std::fs::create_dir_all(&self.pictures)
            .with_context(|| format!("cannot create the folder {}", self.pictures.display()))?;
        let name = format!("{}-{}", slug(&self.name), self.controls.mode());
        let path = (0..)
            .map(|n| self.pictures.join(format!("{name}-window-{n:04}.png")))
            .find(|path| !path.exists())
            .context("there are too many pictures")?;
        let bias = self.controls.bias();
        let automatic = || ToneCurve::automatic().scale(&image).log2() + bias;
        let stops = self.controls.stops().unwrap_or_else(automatic);
        let shoulder = self.controls.is_rendering();
        image.save_png(&path, &ToneCurve { exposure: Exposure::Stops(stops), shoulder })?;
        Ok(path)
    }

    /// Draws a frame, so many seconds after the last.
    pub(super) fn frame(&mut self, window: [u32; 2], scale: f64, seconds: f64) -> Result<()> {
        let before = (self.clock.time, self.along.time);
        self.clock.pass(seconds);
        self.along.runs = self.follows;
        self.along.pass(seconds);
        if self.follows {
            self.fly.place(&on(&self.path, self.along.time));
        } else if self.fly.moves() {
            self.fly.step(seconds);
            self.stale = true;
        }
        self.stale |= before != (self.clock.time, self.along.time);
        if self.message.as_ref().is_some_and(|(_, at)| at.elapsed().as_secs_f64() > MESSAGE) {
            self.message = None;
        }
        if self.stale {
            let [width, height] = window.map(|side| side.div_ceil(self.controls.scale));
            let camera = self.fly.camera();
            match self.renderer.draw(&camera, width, height, self.clock.time) {
                Ok((plan, report)) => {
                    self.last = Some(Last { plan, report });
                    self.good = self.controls.clone();
                    self.stale = false;
                }
                Err(error) => self.step_back(error)?,
            }
        }
        self.present(window, scale)
    }

    /// Goes back to the settings of the last good frame, if others are what is wrong.
    fn step_back(&mut self, error: HybridError) -> Result<()> {
        let lost = matches!(error, HybridError::DeviceLost(_));
        let same = self.good.settings() == self.controls.settings()
            && self.good.scale == self.controls.scale;
        if lost || same {
            return Err(error.into());
        }
        self.controls = self.good.clone();
        self.renderer.set_settings(self.controls.settings().clone());
        self.say(error.to_string());
        Ok(())
    }

    fn present(&mut self, window: [u32; 2], scale: f64) -> Result<()> {
        let output = self.renderer.output();
        let size = output.map_or([0, 0], |(_, size)| size);
        let parts: Vec<Part> = self.last.as_ref().map_or_else(Vec::new, |l| parts(&l.report));
        let counts =
            self.last.as_ref().map_or_else(Vec::new, |last| counted_rays(&last.report).into());
        let plan = match &self.last {
            Some(last) if self.controls.plan => last.plan.to_string(),
            _ => String::new(),
        };
        let title = [
            self.gpu.name().to_owned(),
            format!("{}, {} triangles", self.name, self.scene.mesh.len()),
            format!("{} x {} in {} x {}", size[0], size[1], window[0], window[1]),
        ];
        let report = Report {
            title: &title,
            parts: &parts,
            counts: &counts,
            notes: &self.notes(),
            plan: &plan,
            message: self.message.as_ref().map(|(text, _)| text.as_str()),
        };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to 8")]
        let zoom = scale.round().clamp(1.0, 8.0) as u32;
        let page = overlay::page(window, zoom, &self.controls, &report);
        let shown = output.map(|(image, size)| Shown {
            image,
            size,
            stops: self.controls.stops(),
            bias: self.controls.bias(),
            shoulder: self.controls.is_rendering(),
        });
        self.missed = !self.presenter.present(shown, &page)?;
        if self.missed {
            // A window that cannot be seen has no hurry.
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
        Ok(())
    }

    fn notes(&self) -> [String; 2] {
        let time = match (&self.scene.animation, self.clock.runs) {
            (None, _) => String::from("nothing moves"),
            (Some(_), true) => format!("time {:.2} s", self.clock.time),
            (Some(_), false) => format!("time {:.2} s, paused", self.clock.time),
        };
        let camera: Camera = self.fly.camera();
        let place = camera.position;
        let how = if self.follows {
            format!("on its path, {:.1} s", self.along.time)
        } else {
            format!("flies, {:.3} a second", self.fly.speed())
        };
        [time, format!("camera {:.2} {:.2} {:.2} {how}", place.x, place.y, place.z)]
    }
}

/// The time of a camera on its path: closed ones go round, open ones begin anew.
fn along(path: &CameraPath) -> Clock {
    Clock::new(false, Some(f64::from(path.frames.max(1)) / RATE))
}

/// The camera after so many seconds on its path.
fn on(path: &CameraPath, seconds: f64) -> Camera {
    path.at(seconds * RATE / f64::from(path.frames.max(1)))
}

/// After how many seconds the scene's motion begins anew: key frames end, other motions go on.
fn around(scene: &Scene) -> Option<f64> {
    let animation = scene.animation.as_ref()?;
    (!animation.rig.nodes.is_empty()).then_some(animation.duration)
}
