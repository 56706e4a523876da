//! Values over time: key frames and what lies between them.

use glam::{DQuat, DVec3};
use std::sync::Arc;

/// How values between keys come about (glTF 2.0, appendix C).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// The value of the last key holds until the next.
    Step,
    /// Along a line; rotations along the shorter arc, at an even speed.
    #[default]
    Linear,
    /// A cubic Hermite spline with tangents of its own at each key.
    Cubic,
}

/// Why keys make no track.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TrackError {
    /// There is no key. Remedy: leave the track out.
    #[error("there are no keys")]
    Empty,
    /// There are more or fewer values than keys call for. Remedy: one value a key, or, for cubic
    /// splines, three: the tangent that comes in, the value, the tangent that goes out.
    #[error("{keys} keys call for {wanted} values, but there are {values}")]
    Count {
        /// Number of keys.
        keys: usize,
        /// How many values they call for.
        wanted: usize,
        /// How many there are.
        values: usize,
    },
    /// A time is NaN or infinite. Remedy: correct it.
    #[error("the time of key {key} is {time}")]
    Time {
        /// The key, from 0.
        key: usize,
        /// Its time.
        time: f32,
    },
    /// Times go backwards. Remedy: sort the keys.
    #[error("key {key} is at {time} s, before the key that it follows, at {before} s")]
    Order {
        /// The key, from 0.
        key: usize,
        /// Its time in seconds.
        time: f32,
        /// The time of the key before.
        before: f32,
    },
    /// A value or a tangent is NaN or infinite, or a rotation of no length. Remedy: correct it.
    #[error("the value of key {key} is {value:?}, which is no {what}")]
    Value {
        /// The key, from 0.
        key: usize,
        /// Its value or tangent.
        value: Vec<f32>,
        /// What it should be.
        what: &'static str,
    },
}

/// Values of `N` numbers over time: vectors of three, or rotations as quaternions (x, y, z, w).
///
/// Before the first key its value holds, after the last that one's. Keys at the same time are a
/// jump.
///
/// ```
/// use niwaki_scene::animation::{Interpolation, Track};
/// let track = Track::<3>::new(Interpolation::Linear, vec![0.0, 2.0].into(), vec![[0.0; 3], [4.0, 0.0, 0.0]])?;
/// assert_eq!(track.at(0.5).x, 1.0);
/// # Ok::<(), niwaki_scene::animation::TrackError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Track<const N: usize> {
    interpolation: Interpolation,
    /// Never empty, finite, in order; tracks of one file often share theirs.
    times: Arc<[f32]>,
    /// One a key, or three for cubic splines.
    values: Vec<[f32; N]>,
}

/// Where a time lies among keys.
enum Place {
    /// On a key, or past the ends.
    Key(usize),
    /// After this key, by a share of the way to the next that takes so many seconds.
    After(usize, f64, f64),
}

impl<const N: usize> Track<N> {
    /// A track of keys at `times`, in seconds, in order.
    ///
    /// # Errors
    /// [`TrackError`] names the first key that is wrong.
    pub fn new(
        interpolation: Interpolation,
        times: Arc<[f32]>,
        values: Vec<[f32; N]>,
    ) -> Result<Self, TrackError> {
        check_times(&times)?;
        let keys = times.len();
        let each = if interpolation == Interpolation::Cubic { 3 } else { 1 };
        if keys.checked_mul(each) != Some(values.len()) {
            let wanted = keys.saturating_mul(each);
            return Err(TrackError::Count { keys, wanted, values: values.len() });
        }
        for (i, value) in values.iter().enumerate() {
            let fail = |what| Err(TrackError::Value { key: i / each, value: value.to_vec(), what });
            if !value.iter().all(|x| x.is_finite()) {
                return fail("finite number");
            }
            // Tangents may be 0.
            let is_value = each == 1 || i % 3 == 1;
            if N == 4 && is_value && value.iter().all(|&x| x == 0.0) {
                return fail("rotation");
            }
        }
        Ok(Self { interpolation, times, values })
    }

    /// The time of the last key in seconds.
    #[must_use]
    pub fn end(&self) -> f64 {
        self.times.last().copied().unwrap_or(0.0).into()
    }

    /// The values of the keys, without tangents, in order.
    pub fn keys(&self) -> impl Iterator<Item = [f32; N]> + '_ {
        let cubic = self.interpolation == Interpolation::Cubic;
        let (first, step) = if cubic { (1, 3) } else { (0, 1) };
        self.values.iter().skip(first).step_by(step).copied()
    }

    fn place(&self, time: f64) -> Place {
        place(&self.times, self.interpolation, time)
    }

    /// A value, or for cubic splines a tangent, as `part` 0 (in), 1 (value) or 2 (out).
    fn get(&self, key: usize, part: usize) -> [f64; N] {
        let i = if self.interpolation == Interpolation::Cubic { 3 * key + part } else { key };
        self.values.get(i).copied().unwrap_or([0.0; N]).map(f64::from)
    }

    /// Between two keys along the spline that glTF 2.0 prints in appendix C.5.
    fn spline(&self, key: usize, t: f64, span: f64) -> [f64; N] {
        let [from, leave] = [self.get(key, 1), self.get(key, 2)];
        let [come, to] = [self.get(key + 1, 0), self.get(key + 1, 1)];
        std::array::from_fn(|i| hermite([from[i], leave[i], come[i], to[i]], t, span))
    }
}

/// Where a time lies among the times of keys.
fn place(times: &[f32], interpolation: Interpolation, time: f64) -> Place {
    let after = times.partition_point(|&t| f64::from(t) <= time);
    let Some(key) = after.checked_sub(1) else { return Place::Key(0) };
    let Some(&next) = times.get(after) else { return Place::Key(key) };
    let from = f64::from(times[key]);
    let span = f64::from(next) - from;
    match interpolation {
        Interpolation::Step => Place::Key(key),
        _ => Place::After(key, (time - from) / span, span),
    }
}

/// The share `t` of the way along the spline that leaves its first value by one tangent and comes
/// to its last by another, in units of `span` seconds.
fn hermite([from, leave, come, to]: [f64; 4], t: f64, span: f64) -> f64 {
    let (t2, t3) = (t * t, t * t * t);
    (2.0 * t3 - 3.0 * t2 + 1.0) * from
        + span * (t3 - 2.0 * t2 + t) * leave
        + (3.0 * t2 - 2.0 * t3) * to
        + span * (t3 - t2) * come
}

/// The times of keys are finite and in order.
fn check_times(times: &[f32]) -> Result<(), TrackError> {
    if times.is_empty() {
        return Err(TrackError::Empty);
    }
    for (key, &time) in times.iter().enumerate() {
        if !time.is_finite() {
            return Err(TrackError::Time { key, time });
        }
        let before = times[key.saturating_sub(1)];
        if time < before {
            return Err(TrackError::Order { key, time, before });
        }
    }
    Ok(())
}

/// The weights of all morph targets of a mesh over time. Before, after and between its keys it is
/// as a [`Track`].
#[derive(Clone, Debug, PartialEq)]
pub struct WeightTrack {
    interpolation: Interpolation,
    times: Arc<[f32]>,
    /// Key by key one a target; for cubic splines, key by key the tangents that come in of all
    /// targets, their weights, and the tangents that go out.
    values: Vec<f32>,
    targets: usize,
}

impl WeightTrack {
    /// A track of keys at `times`, in seconds, in order, for `targets` targets. Values lie as in
    /// glTF 2.0: key by key, and there one a target, or, for cubic splines, the tangents that come
    /// in of all targets, their weights, and the tangents that go out.
    ///
    /// # Errors
    /// [`TrackError`] names the first key that is wrong.
    pub fn new(
        interpolation: Interpolation,
        times: Arc<[f32]>,
        targets: usize,
        values: Vec<f32>,
    ) -> Result<Self, TrackError> {
        check_times(&times)?;
        let parts = if interpolation == Interpolation::Cubic { 3 } else { 1 };
        let each = targets.saturating_mul(parts);
        let wanted = times.len().saturating_mul(each);
        if wanted != values.len() {
            return Err(TrackError::Count { keys: times.len(), wanted, values: values.len() });
        }
        if let Some(i) = values.iter().position(|x| !x.is_finite()) {
            return Err(TrackError::Value {
                key: i / each,
                value: vec![values[i]],
                what: "finite weight or tangent",
            });
        }
        Ok(Self { interpolation, times, values, targets })
    }

    /// The time of the last key in seconds.
    #[must_use]
    pub fn end(&self) -> f64 {
        self.times.last().copied().unwrap_or(0.0).into()
    }

    /// Number of targets.
    #[must_use]
    pub const fn targets(&self) -> usize {
        self.targets
    }

    /// Part 0 (in), 1 (weight) or 2 (out) of a key.
    fn get(&self, key: usize, part: usize, target: usize) -> f64 {
        let row = if self.interpolation == Interpolation::Cubic { 3 * key + part } else { key };
        self.values.get(row * self.targets + target).copied().unwrap_or(0.0).into()
    }

    /// The weights at a time, in seconds, one a target.
    pub fn at(&self, time: f64) -> impl Iterator<Item = f64> + '_ {
        let place = place(&self.times, self.interpolation, time);
        (0..self.targets).map(move |target| {
            let get = |key, part| self.get(key, part, target);
            match place {
                Place::Key(key) => get(key, 1),
                Place::After(key, t, span) if self.interpolation == Interpolation::Cubic => {
                    let ends = [get(key, 1), get(key, 2), get(key + 1, 0), get(key + 1, 1)];
                    hermite(ends, t, span)
                }
                Place::After(key, t, _) => get(key, 1) * (1.0 - t) + get(key + 1, 1) * t,
            }
        })
    }
}

impl Track<3> {
    /// The value at a time, in seconds.
    #[must_use]
    pub fn at(&self, time: f64) -> DVec3 {
        match self.place(time) {
            Place::Key(key) => self.get(key, 1).into(),
            Place::After(key, t, span) if self.interpolation == Interpolation::Cubic => {
                self.spline(key, t, span).into()
            }
            Place::After(key, t, _) => {
                let (from, to) = (DVec3::from(self.get(key, 1)), DVec3::from(self.get(key + 1, 1)));
                from * (1.0 - t) + to * t
            }
        }
    }
}

impl Track<4> {
    /// The unit rotation at a time, in seconds.
    #[must_use]
    pub fn at(&self, time: f64) -> DQuat {
        let unit = |key| normalized(DQuat::from_array(self.get(key, 1)));
        match self.place(time) {
            Place::Key(key) => unit(key),
            Place::After(key, t, span) if self.interpolation == Interpolation::Cubic => {
                let between = DQuat::from_array(self.spline(key, t, span));
                // Splines between opposite rotations may pass through no rotation at all.
                if between.length_squared() > 0.0 { normalized(between) } else { unit(key) }
            }
            Place::After(key, t, _) => slerp(unit(key), unit(key + 1), t),
        }
    }
}

/// Of unit length; the identity where there is no length.
pub(super) fn normalized(q: DQuat) -> DQuat {
    // Scaled first, so that the squares of tiny and of huge numbers stay numbers.
    let most = q.to_array().into_iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    if most > 0.0 && most.is_finite() { (q * (1.0 / most)).normalize() } else { DQuat::IDENTITY }
}

/// From one unit rotation to another along the shorter arc at an even speed (Shoemake 1985).
///
/// By bisection, from sums, products and roots alone, so that the bits are the same on every
/// platform. What 17 halvings leave of an arc is its own chord to 1e-15.
fn slerp(mut from: DQuat, to: DQuat, mut t: f64) -> DQuat {
    let mut to = if from.dot(to) < 0.0 { -to } else { to };
    for _ in 0..17 {
        let middle = (from + to).normalize();
        if t < 0.5 {
            (to, t) = (middle, 2.0 * t);
        } else {
            (from, t) = (middle, 2.0 * t - 1.0);
        }
    }
    (from * (1.0 - t) + to * t).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turn(angle: f64) -> DQuat {
        DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), angle)
    }

    #[test]
    fn rotations_turn_evenly_and_the_short_way() {
        for (a, b) in [(0.1, 3.0), (0.0, 1e-9), (-1.0, 1.0), (0.3, 0.3)] {
            for i in 0..=20 {
                let t = f64::from(i) / 20.0;
                let wanted = turn(a + (b - a) * t);
                for to in [turn(b), -turn(b)] {
                    let got = slerp(turn(a), to, t);
                    assert!((got.dot(wanted).abs() - 1.0).abs() < 1e-14, "{a} {b} {t}: {got}");
                    assert!((got - wanted).length().min((got + wanted).length()) < 1e-12);
                }
            }
        }
    }

    #[test]
    fn quaternions_of_any_length_are_normalised() {
        for scale in [1e-200, 1e-30, 1.0, 1e30, 1e200] {
            let q = normalized(turn(1.0) * scale);
            assert!((q - turn(1.0)).length() < 1e-12, "{scale}");
        }
        assert_eq!(normalized(DQuat::from_array([0.0; 4])), DQuat::IDENTITY);
        assert_eq!(normalized(DQuat::from_array([f64::NAN; 4])), DQuat::IDENTITY);
    }
}
