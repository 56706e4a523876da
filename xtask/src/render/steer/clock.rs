//! The time of the scene, and the place on the camera's path.

/// Frames a second of an animation that is stepped through, and of camera paths.
pub(in crate::render) const RATE: f64 = 30.0;

/// The longest that may pass between two frames of the window in seconds; on a slower device the
/// scene moves more slowly, so that nothing is missed.
const LONGEST: f64 = 0.25;

/// Time that can be stopped.
#[derive(Clone, Debug)]
pub(in crate::render) struct Clock {
    /// Seconds since the beginning.
    pub(in crate::render) time: f64,
    pub(in crate::render) runs: bool,
    /// After how many seconds it begins anew, if it does.
    pub(in crate::render) around: Option<f64>,
}

impl Clock {
    /// At its beginning.
    pub(in crate::render) fn new(runs: bool, around: Option<f64>) -> Self {
        let around = around.filter(|seconds| *seconds > 0.0 && seconds.is_finite());
        Self { time: 0.0, runs, around }
    }

    /// Lets so many seconds pass, if it runs.
    pub(in crate::render) fn pass(&mut self, seconds: f64) {
        if self.runs && seconds > 0.0 {
            self.set(self.time + seconds.min(LONGEST));
        }
    }

    /// Stops, a number of frames from here.
    pub(in crate::render) fn step(&mut self, frames: f64) {
        self.runs = false;
        self.set(self.time + frames / RATE);
    }

    fn set(&mut self, time: f64) {
        self.time = match self.around {
            Some(around) => time.rem_euclid(around),
            None => time.max(0.0),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_passes_stops_and_comes_round() {
        let mut clock = Clock::new(true, Some(1.0));
        for _ in 0..9 {
            clock.pass(0.125);
        }
        assert!((clock.time - 0.125).abs() < 1e-9);
        clock.step(-6.0);
        assert!((clock.time - 0.925).abs() < 1e-9 && !clock.runs);
        clock.pass(0.1);
        assert!((clock.time - 0.925).abs() < 1e-9);
    }

    #[test]
    fn slow_frames_and_odd_durations_are_harmless() {
        let mut clock = Clock::new(true, Some(0.0));
        clock.pass(100.0);
        assert_eq!((clock.time, clock.around), (LONGEST, None));
        clock.pass(f64::NAN);
        clock.step(-1e9);
        assert_eq!(clock.time, 0.0);
        assert_eq!(Clock::new(true, Some(f64::NAN)).around, None);
    }
}
