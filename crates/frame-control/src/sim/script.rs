//! What happens in a run: where the camera goes, and what befalls the device.

use core::f64::consts::PI;

use super::device::Device;
use super::{Camera, Scene, View};

/// Something that befalls the device before a frame is drawn, and lasts.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Event {
    /// The driver enters a power state with this share of the nominal clocks, of cores and of memory,
    /// 0.1 to 2.
    Clock(f64),
    /// Another process takes this share of the device, 0 to 0.95.
    Competing(f64),
    /// The surroundings have this temperature in °C.
    Surroundings(f64),
}

/// A scene, a camera for each frame, and events.
#[derive(Clone, Debug)]
pub struct Script {
    /// Name for tables.
    pub name: String,
    /// The scene.
    pub scene: Scene,
    /// One camera a frame.
    pub cameras: Vec<Camera>,
    /// Events with the frame that they come before.
    pub events: Vec<(usize, Event)>,
}

/// First and last angle and distance of a camera that goes around the middle.
struct Orbit {
    angles: (f64, f64),
    distances: (f64, f64),
}

impl Script {
    /// Frames.
    pub fn frames(&self) -> usize {
        self.cameras.len()
    }

    /// The view of a frame; beyond the last that of the last, and of nothing where there are none.
    pub fn view(&self, frame: usize) -> View {
        let last = Camera { position: [1e6, 1e6], heading: 0.0 };
        let camera = self.cameras.get(frame).or(self.cameras.last()).unwrap_or(&last);
        self.scene.view(camera)
    }

    /// Lets the events of a frame happen.
    pub(super) fn strike(&self, frame: usize, device: &mut Device) {
        for (_, event) in self.events.iter().filter(|(at, _)| *at == frame) {
            let around = &mut device.surroundings;
            match *event {
                Event::Clock(share) => around.clock = share.clamp(0.1, 2.0),
                Event::Competing(share) => around.competing = share.clamp(0.0, 0.95),
                Event::Surroundings(celsius) => around.celsius = celsius.clamp(-50.0, 150.0),
            }
        }
    }

    /// Once around the scene while moving in on its middle, as both animations of the thesis do.
    fn orbit(name: &str, scene: Scene, frames: usize, path: Orbit) -> Self {
        let cameras = (0..frames)
            .map(|frame| {
                let t = frame as f64 / frames.saturating_sub(1).max(1) as f64;
                let angle = path.angles.0 + (path.angles.1 - path.angles.0) * t;
                let distance = path.distances.0 + (path.distances.1 - path.distances.0) * t;
                let position = [distance * angle.cos(), distance * angle.sin()];
                Camera { position, heading: angle + PI }
            })
            .collect();
        Self { name: name.into(), scene, cameras, events: Vec::new() }
    }

    /// The thesis's fairy animation.
    pub fn fairy(frames: usize) -> Self {
        let path = Orbit { angles: (0.6, 0.6 + 1.2 * PI), distances: (13.0, 8.5) };
        Self::orbit("fairy", Scene::fairy(), frames, path)
    }

    /// The thesis's cabin animation: from afar to right next to the tree.
    pub fn cabin(frames: usize) -> Self {
        let path = Orbit { angles: (1.7, 1.7 + 0.9 * PI), distances: (12.0, 8.0) };
        Self::orbit("cabin", Scene::cabin(), frames, path)
    }

    /// Looks at the scene, is suddenly before the wall, and looks back: frames `at` to `back`.
    pub fn wall(scene: Scene, frames: usize, at: usize, back: usize) -> Self {
        let cameras = (0..frames)
            .map(|frame| {
                let drift = 0.002 * frame as f64;
                if (at..back).contains(&frame) {
                    Camera { position: [20.0, drift], heading: 0.0 }
                } else {
                    Camera { position: [9.0, drift], heading: PI }
                }
            })
            .collect();
        Self { name: "wall".into(), scene, cameras, events: Vec::new() }
    }

    /// Looks away from the middle of the scene, at the wall, and turns by 180° before frame `at`.
    pub fn turn(scene: Scene, frames: usize, at: usize) -> Self {
        let cameras = (0..frames)
            .map(|frame| {
                let position = [9.0 - 0.005 * frame as f64, -2.0];
                let away = f64::atan2(position[1], position[0]);
                Camera { position, heading: if frame < at { away } else { away + PI } }
            })
            .collect();
        Self { name: "turn".into(), scene, cameras, events: Vec::new() }
    }

    /// Cuts to another view every few frames, as films and players who look around do: near and far,
    /// at the middle of the scene and past it.
    pub fn cuts(scene: Scene, frames: usize, every: usize) -> Self {
        let cameras = (0..frames)
            .map(|frame| {
                let shot = (frame / every.max(1)) as f64;
                let angle = 2.4 * shot + 0.002 * frame as f64;
                let distance = 8.5 + 5.0 * (0.618 * shot).fract();
                let position = [distance * angle.cos(), distance * angle.sin()];
                let past = 0.9 * ((0.382 * shot).fract() - 0.5);
                Camera { position, heading: angle + PI + past }
            })
            .collect();
        Self { name: "cuts".into(), scene, cameras, events: Vec::new() }
    }

    /// Walks slowly past the scene.
    pub fn drift(scene: Scene, frames: usize) -> Self {
        let cameras = (0..frames)
            .map(|frame| {
                let along = -6.0 + 12.0 * frame as f64 / frames.max(1) as f64;
                Camera { position: [along, -9.0], heading: 0.5 * PI }
            })
            .collect();
        Self { name: "drift".into(), scene, cameras, events: Vec::new() }
    }

    /// Adds an event before a frame.
    #[must_use]
    pub fn with(mut self, frame: usize, event: Event) -> Self {
        self.events.push((frame, event));
        self
    }

    /// Gives it another name.
    #[must_use]
    pub fn named(mut self, name: &str) -> Self {
        self.name = name.into();
        self
    }
}
