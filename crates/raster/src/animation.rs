//! Frames along a camera path, logged for the analysis of power.

use crate::{FrameReport, Renderer};
use niwaki_gpu_frame::FrameError;
use niwaki_power::{CLOCK, FrameLog, FrameLogHeader, FrameRecord, PassTime, now_ns};
use niwaki_scene::CameraPath;
use std::time::Duration;

/// How a camera path is played.
#[derive(Clone, Debug, PartialEq)]
pub struct Animation {
    /// Width and height of the images in pixels.
    pub size: [u32; 2],
    /// How many frames are drawn, spread evenly over the path.
    pub frames: u32,
    /// Frames drawn before that and not logged, spread over the path too, as drivers compile when
    /// something is drawn for the first time.
    pub warm_up: u32,
    /// How long nothing is drawn before and after: the idle power by which a trace is aligned, and
    /// which may be subtracted.
    pub idle: Duration,
    /// How many frames, from the first on, are marker frames, and as many at the end: a mark is
    /// given to the meter as each begins.
    pub markers: u32,
}

impl Default for Animation {
    /// 200 frames of 640 × 360, two of them drawn before, a second of idling and one marker frame
    /// at each end.
    fn default() -> Self {
        Self {
            size: [640, 360],
            frames: CameraPath::FRAMES,
            warm_up: 2,
            idle: Duration::from_secs(1),
            markers: 1,
        }
    }
}

impl Animation {
    /// Draws the frames one after another, each waited for, and logs them on the clock that
    /// recorders of power use too ([`niwaki_power::now_ns`]). `mark` gives a mark to the meter; it
    /// is called as a marker frame begins, and its own time is not the frame's.
    ///
    /// # Errors
    /// As [`Renderer::draw`].
    pub fn play(
        &self,
        renderer: &mut Renderer,
        path: &CameraPath,
        mut mark: impl FnMut(),
    ) -> Result<FrameLog, FrameError> {
        let [width, height] = self.size;
        let camera = |frame: u32, of: u32| {
            let steps = if path.closed { of } else { of.saturating_sub(1) };
            path.at(f64::from(frame) / f64::from(steps.max(1)))
        };
        for frame in 0..self.warm_up {
            renderer.draw(&camera(frame, self.warm_up), width, height)?;
        }
        let header = FrameLogHeader {
            clock: CLOCK,
            device: renderer.device_name().to_owned(),
            scene: renderer.scene().name.clone(),
        };
        let mut log = FrameLog { header, frames: Vec::with_capacity(self.frames as usize) };
        std::thread::sleep(self.idle);
        for frame in 0..self.frames {
            let marker = frame < self.markers || frame >= self.frames.saturating_sub(self.markers);
            let camera = camera(frame, self.frames);
            if marker {
                mark();
            }
            let start_ns = now_ns();
            let report = renderer.draw(&camera, width, height)?;
            let end_ns = now_ns();
            log.frames.push(record(&report, frame, [start_ns, end_ns], marker));
        }
        std::thread::sleep(self.idle);
        Ok(log)
    }
}

/// A frame as logs have it.
fn record(
    report: &FrameReport,
    frame: u32,
    [start_ns, end_ns]: [i64; 2],
    marker: bool,
) -> FrameRecord {
    let timed = report.passes.iter().filter_map(|pass| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let ns = (pass.ms()? * 1e6) as u64;
        Some(PassTime { name: pass.pass.name().replace([' ', '-'], "_").to_lowercase(), ns })
    });
    FrameRecord {
        frame: frame.into(),
        start_ns,
        end_ns,
        algorithm: report.algorithm.short().into(),
        lights: report.lights,
        width: report.size[0],
        height: report.size[1],
        marker,
        passes: timed.collect(),
    }
}
