//! `cargo xtask render --window`: a scene to walk through, drawn by the hybrid renderer.

mod keys;
mod overlay;
mod present;
mod text;
mod view;

use super::{
    args::{Mode, RenderArgs},
    steer::Ask,
};
use crate::scenes::SceneSpec;
use anyhow::{Context, Result, anyhow, bail};
use niwaki_scene::Scene;
use std::{process::ExitCode, sync::Arc, time::Instant};
use view::View;
use winit::{
    application::ApplicationHandler,
    dpi::PhysicalSize,
    event::{ElementState, MouseButton, MouseScrollDelta, WindowEvent},
    event_loop::{ActiveEventLoop, ControlFlow, EventLoop, OwnedDisplayHandle},
    keyboard::PhysicalKey,
    window::{Fullscreen, Window, WindowId},
};

/// What helps where no window opens.
const WITHOUT: &str = "leave --window out for pictures in files";

/// Opens the window and stays until it is closed. Must run on the main thread.
pub(crate) fn run(args: &RenderArgs, spec: &SceneSpec) -> Result<ExitCode> {
    if !matches!(args.mode, Mode::Hybrid | Mode::FullBvh) {
        bail!(
            "--window shows --mode hybrid and --mode full-bvh; {} takes too long a picture",
            args.mode.name()
        );
    }
    // Before anything is loaded: without a display there is nothing to wait for.
    let event_loop = EventLoop::new()
        .map_err(|error| anyhow!("no window can be opened here ({error}); {WITHOUT}"))?;
    let scene = Arc::new(super::load(args, spec)?);
    let mut app = App {
        args: args.clone(),
        spec: spec.clone(),
        scene,
        display: event_loop.owned_display_handle(),
        open: None,
        drag: None,
        last: Instant::now(),
        outcome: Ok(()),
    };
    event_loop.set_control_flow(ControlFlow::Wait);
    event_loop.run_app(&mut app).context("the window's event loop ended")?;
    app.outcome.map(|()| ExitCode::SUCCESS)
}

struct App {
    args: RenderArgs,
    spec: SceneSpec,
    scene: Arc<Scene>,
    display: OwnedDisplayHandle,
    open: Option<Open>,
    /// Where the mouse was when it last dragged, if it does, and where it is.
    drag: Option<Drag>,
    /// When the last frame was drawn.
    last: Instant,
    outcome: Result<()>,
}

#[derive(Clone, Copy)]
struct Drag {
    at: [f64; 2],
    holds: bool,
}

/// The window and what it shows; the view goes first, since its surface needs the window.
struct Open {
    view: View,
    window: Arc<Window>,
}

impl App {
    fn open(&self, event_loop: &ActiveEventLoop) -> Result<Open> {
        let size = PhysicalSize::new(self.args.size.width, self.args.size.height);
        let attributes = Window::default_attributes()
            .with_title(format!("Niwaki: {}", self.scene.name))
            .with_inner_size(size);
        let window = event_loop
            .create_window(attributes)
            .map_err(|error| anyhow!("the window could not be opened ({error}); {WITHOUT}"))?;
        let window = Arc::new(window);
        let view = View::new(
            &self.args,
            Arc::clone(&self.scene),
            Box::new(self.display.clone()),
            Arc::clone(&window),
        )?;
        Ok(Open { view, window })
    }

    /// Notes an error and ends.
    fn end(&mut self, event_loop: &ActiveEventLoop, outcome: Result<()>) {
        if self.outcome.is_ok() {
            self.outcome = outcome;
        }
        event_loop.exit();
    }

    fn key(&mut self, event_loop: &ActiveEventLoop, ask: Ask, down: bool, repeat: bool) {
        let Some(open) = &mut self.open else { return };
        match ask {
            Ask::Go(go) if !repeat => open.view.fly(go, down),
            Ask::Fast => open.view.set_fast(down),
            Ask::Go(_) => {}
            _ if !down || (repeat && !ask.repeats()) => return,
            Ask::Quit => return event_loop.exit(),
            Ask::FullScreen => {
                let now = open.window.fullscreen();
                open.window.set_fullscreen(match now {
                    Some(_) => None,
                    None => Some(Fullscreen::Borderless(None)),
                });
            }
            Ask::Reload => match super::load(&self.args, &self.spec) {
                Ok(scene) => {
                    self.scene = Arc::new(scene);
                    open.view.reload(Arc::clone(&self.scene));
                }
                Err(error) => open.view.say(format!("{error:#}")),
            },
            ask => open.view.ask(ask),
        }
        open.window.request_redraw();
    }

    fn draw(&mut self, event_loop: &ActiveEventLoop) {
        let Some(open) = &mut self.open else { return };
        let now = Instant::now();
        let seconds = now.duration_since(self.last).as_secs_f64();
        self.last = now;
        let size = open.window.inner_size();
        if size.width == 0 || size.height == 0 {
            // Minimised: nothing is to be seen.
            return;
        }
        let window = [size.width, size.height];
        match open.view.frame(window, open.window.scale_factor(), seconds) {
            Ok(()) => {
                if open.view.is_moving() {
                    open.window.request_redraw();
                }
            }
            Err(error) => self.end(event_loop, Err(error)),
        }
    }
}

impl ApplicationHandler for App {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.open.is_some() {
            return;
        }
        match self.open(event_loop) {
            Ok(open) => {
                open.window.request_redraw();
                self.open = Some(open);
                self.last = Instant::now();
            }
            Err(error) => self.end(event_loop, Err(error)),
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(open) = &mut self.open else { return };
        let was_still = !open.view.is_moving();
        match event {
            WindowEvent::CloseRequested => event_loop.exit(),
            WindowEvent::RedrawRequested => self.draw(event_loop),
            WindowEvent::Resized(size) => {
                open.view.resize([size.width, size.height]);
                open.window.request_redraw();
            }
            WindowEvent::ScaleFactorChanged { .. } => open.window.request_redraw(),
            WindowEvent::Focused(false) => {
                open.view.release();
                self.drag = None;
            }
            WindowEvent::KeyboardInput { event, .. } => {
                let PhysicalKey::Code(code) = event.physical_key else { return };
                let Some(ask) = keys::ask(code) else { return };
                let down = event.state == ElementState::Pressed;
                if was_still && down {
                    // Time in which nothing was drawn is no time to move in.
                    self.last = Instant::now();
                }
                self.key(event_loop, ask, down, event.repeat);
            }
            WindowEvent::MouseInput { state, button: MouseButton::Left, .. } => {
                let at = self.drag.map_or([f64::NAN; 2], |drag| drag.at);
                self.drag = Some(Drag { at, holds: state == ElementState::Pressed });
            }
            WindowEvent::CursorMoved { position, .. } => {
                let to = [position.x, position.y];
                let from = self.drag.unwrap_or(Drag { at: to, holds: false });
                self.drag = Some(Drag { at: to, ..from });
                if from.holds && from.at.iter().all(|x| x.is_finite()) {
                    let height = open.window.inner_size().height;
                    open.view.look([to[0] - from.at[0], to[1] - from.at[1]], height);
                    open.window.request_redraw();
                }
            }
            WindowEvent::MouseWheel { delta, .. } => {
                let steps = match delta {
                    MouseScrollDelta::LineDelta(_, y) => f64::from(y),
                    MouseScrollDelta::PixelDelta(by) => by.y / 40.0,
                };
                open.view.shift_gear(steps);
                open.window.request_redraw();
            }
            _ => {}
        }
    }

    fn exiting(&mut self, _: &ActiveEventLoop) {
        // While the display is still there.
        self.open = None;
    }
}
