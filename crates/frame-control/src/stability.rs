//! How large the gain of the outer loop may be.

/// The gain below which the outer loop is stable, for measurements that are `delay` frames late
/// and a bound on the loop's `sensitivity`; both as in [`crate::CorrectionConfig`].
///
/// The law of the loop, linearised: with θ the logarithm of the correction, and ρ = ρ₀ − σθ the
/// logarithm of measured over predicted time, which depends on θ because θ chooses the settings and
/// the predictor errs differently at different settings,
///
/// ```text
/// θ(k+1) = θ(k) + g · (ρ(k+1−d) − θ(k))      z^d − (1 − g)·z^(d−1) + g·σ = 0
/// ```
///
/// - |σ| < 1: on the unit circle |z − (1 − g)| is at least 1 − |1 − g|, so no root leaves the
///   disc while |1 − g| + g|σ| < 1: every gain below 2 / (1 + σ) is stable **whatever the delay**.
///   That is what matching each measurement with the prediction of its own frame buys; an integrator
///   fed with stale errors may take no more than 2 sin(π / (4d − 2)).
/// - σ ≥ 1: the bound comes from Nyquist's criterion and falls with the delay.
///
/// Returns 0 for a sensitivity that is not a number, negative or infinite, and takes a delay of 0 as
/// 1 (no measurement is earlier than the next decision).
pub fn admissible_gain(delay: u32, sensitivity: f64) -> f64 {
    if !(sensitivity >= 0.0 && sensitivity.is_finite()) {
        return 0.0;
    }
    let bound = 2.0 / (1.0 + sensitivity);
    if sensitivity <= 1.0 || delay <= 1 {
        return bound;
    }
    let turns = f64::from(delay - 1);
    // Where the loop gain is one, the phase lag has to be below half a turn.
    let stable = |gain: f64| {
        let pole = 1.0 - gain;
        let loop_gain = gain * sensitivity;
        let cosine = (1.0 + pole * pole - loop_gain * loop_gain) / (2.0 * pole);
        if cosine <= -1.0 {
            return false;
        }
        let omega = cosine.min(1.0).acos();
        turns * omega + omega.sin().atan2(omega.cos() - pole) < core::f64::consts::PI
    };
    let (mut low, mut high) = (0.0, bound);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if stable(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}
