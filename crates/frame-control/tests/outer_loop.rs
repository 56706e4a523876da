//! The outer loop: convergence, the admissible gain, and whatever a timer may report.

use niwaki_frame_control::{Correction, CorrectionConfig, Error, Verdict, admissible_gain};
use proptest::prelude::*;

fn default() -> Correction {
    Correction::new(CorrectionConfig::default()).unwrap()
}

/// θ(k+1) = θ(k) + g·(−σ·θ(k+1−d) − θ(k)) from 1: whether it has died out after `frames`.
fn dies_out(gain: f64, delay: u32, sensitivity: f64, frames: usize) -> bool {
    let delay = delay as usize;
    let mut theta = vec![1.0; delay];
    for k in delay - 1..frames {
        let late = theta[k + 1 - delay];
        theta.push(theta[k] + gain * (-sensitivity * late - theta[k]));
        if theta[k + 1].abs() > 1e6 {
            return false;
        }
    }
    theta[frames - delay..].iter().all(|theta| theta.abs() < 1e-3)
}

#[test]
fn the_admissible_gain_is_where_the_loop_starts_to_ring() {
    for delay in [1, 2, 3, 5, 8, 16] {
        for sensitivity in [0.0, 0.3, 0.7, 0.9, 1.5, 3.0] {
            let bound = admissible_gain(delay, sensitivity);
            for share in [0.1, 0.5, 0.9, 0.98] {
                assert!(
                    dies_out(share * bound, delay, sensitivity, 60_000),
                    "stable: delay {delay}, sensitivity {sensitivity}, {share} of {bound}"
                );
            }
            // Below 1 the bound holds for every delay at once, so it is not tight for each.
            if sensitivity > 1.0 || delay == 1 {
                assert!(
                    !dies_out(1.02 * bound, delay, sensitivity, 60_000),
                    "unstable: delay {delay}, sensitivity {sensitivity}, beyond {bound}"
                );
            }
        }
        // Also with the other sign, as far as that does not feed itself.
        assert!(dies_out(0.9 * admissible_gain(delay, 0.9), delay, -0.9, 60_000));
    }
    // The bound falls with the delay, and meets the published one of a pure delayed integrator
    // where the sensitivity is all there is: gain · sensitivity -> 2 sin(π / (4d − 2)).
    for delay in [2_u32, 3, 6] {
        let limit = 2.0 * (std::f64::consts::PI / f64::from(4 * delay - 2)).sin();
        let product = 1e6 * admissible_gain(delay, 1e6);
        assert!((product - limit).abs() < 1e-3 * limit, "delay {delay}: {product} against {limit}");
    }
    for bad in [f64::NAN, f64::INFINITY, -1.0] {
        assert_eq!(admissible_gain(3, bad), 0.0);
    }
}

/// Late measurements matched with their own frame: stable at a gain at which an integrator that
/// compares them with today's prediction runs away.
#[test]
fn matching_late_measurements_keeps_large_gains_stable() {
    let (delay, gain) = (4_usize, 0.8);
    let config = CorrectionConfig {
        gain,
        max_gain: gain,
        delay: 4,
        sensitivity: 0.5,
        warm_up: false,
        outlier_threshold: None,
        max_rate: 20.0,
        ..CorrectionConfig::default()
    };
    let mut correction = Correction::new(config).unwrap();
    let truth = 1.6_f64;
    let mut stale = vec![0.0_f64];
    for frame in 0..200 {
        if frame >= delay {
            correction.learn(10.0, Some(10.0 * truth));
            let error = truth.ln() - stale[frame - delay];
            stale.push((stale[frame] + gain * error).clamp(-20.0, 20.0));
        } else {
            stale.push(0.0);
        }
    }
    assert!((correction.factor() - truth).abs() < 1e-9);
    let rings = stale[150..].iter().any(|theta| (theta - truth.ln()).abs() > 1.0);
    assert!(rings, "the stale integrator should ring");
}

#[test]
fn unstable_gains_are_errors_that_name_the_bound() {
    let gain = |gain, delay, sensitivity| {
        let config = CorrectionConfig {
            gain,
            max_gain: gain,
            delay,
            sensitivity,
            ..CorrectionConfig::default()
        };
        Correction::new(config).map(|_| ())
    };
    assert_eq!(gain(0.99, 64, 1.0), Ok(()));
    assert!(matches!(gain(1.0, 3, 1.0), Err(Error::UnstableGain { .. })));
    assert!(matches!(gain(0.2, 6, 4.0), Err(Error::UnstableGain { .. })));
    assert_eq!(gain(0.05, 6, 4.0), Ok(()));
    for bad in [0.0, -0.1, f64::NAN, f64::INFINITY] {
        assert!(gain(bad, 3, 0.5).is_err(), "{bad}");
        assert!(gain(0.1, 3, bad).is_err() || bad == 0.0);
        for config in [
            CorrectionConfig { max_rate: bad, ..CorrectionConfig::default() },
            CorrectionConfig { max_correction: bad, ..CorrectionConfig::default() },
            CorrectionConfig { outlier_threshold: Some(bad), ..CorrectionConfig::default() },
        ] {
            assert!(Correction::new(config).is_err(), "{config:?}");
        }
    }
    assert!(gain(0.1, 0, 0.5).is_err() && gain(0.1, 65, 0.5).is_err());
    let text = gain(1.5, 3, 1.0).unwrap_err().to_string();
    assert!(text.contains("1.0000"), "{text}");
}

#[test]
fn one_spike_hardly_moves_it_and_a_step_is_followed_at_once() {
    let mut correction = default();
    for frame in 0..50 {
        let noise = 1.0 + 0.01 * (f64::from(frame * 7 % 11) / 5.0 - 1.0);
        correction.learn(10.0, Some(12.0 * noise));
    }
    let before = correction.factor();
    assert!((before - 1.2).abs() < 0.01);
    assert_eq!(correction.learn(10.0, Some(90.0)), Verdict::Suspect);
    assert!((correction.factor() / before - 1.0).abs() < 0.02, "a spike of 7.5 ×");
    assert_eq!(correction.learn(10.0, Some(12.0)), Verdict::Used);
    // Alternating spikes confirm nothing.
    for spike in [60.0, 2.0, 70.0, 3.0] {
        assert_eq!(correction.learn(10.0, Some(spike)), Verdict::Suspect);
    }
    assert!((correction.factor() / 1.2 - 1.0).abs() < 0.05);
    let mut correction = default();
    for _ in 0..50 {
        correction.learn(10.0, Some(12.0));
    }
    // The clock falls by a quarter.
    assert_eq!(correction.learn(10.0, Some(16.0)), Verdict::Suspect);
    assert_eq!(correction.learn(10.0, Some(16.0)), Verdict::Confirmed);
    assert!((correction.factor() / 1.6 - 1.0).abs() < 0.01, "{}", correction.factor());
}

#[test]
fn the_rate_is_bounded() {
    let config = CorrectionConfig { max_rate: 0.1, ..CorrectionConfig::default() };
    let mut correction = Correction::new(config).unwrap();
    correction.learn(10.0, Some(10.0));
    let mut last = 0.0;
    for _ in 0..60 {
        correction.learn(10.0, Some(80.0));
        let now = correction.factor().ln();
        assert!(now - last <= 0.1 + 1e-12);
        last = now;
    }
    assert!((correction.factor() - 8.0).abs() < 0.01, "it still gets there");
}

#[test]
fn what_is_no_measurement_changes_nothing() {
    let mut correction = default();
    correction.learn(10.0, Some(13.0));
    let state = format!("{correction:?}");
    assert_eq!(correction.learn(10.0, None), Verdict::Dropped);
    for (predicted, measured) in [
        (10.0, f64::NAN),
        (10.0, f64::INFINITY),
        (10.0, 0.0),
        (10.0, -0.0),
        (10.0, -5.0),
        (10.0, 1e300),
        (10.0, 1e-300),
        (0.0, 5.0),
        (-1.0, 5.0),
        (f64::NAN, 5.0),
        (f64::INFINITY, 5.0),
    ] {
        assert_eq!(correction.learn(predicted, Some(measured)), Verdict::Absurd);
        assert_eq!(format!("{correction:?}"), state);
    }
}

/// A time as a broken timer may give it.
fn anything() -> impl Strategy<Value = Option<f64>> {
    prop_oneof![
        4 => (1.0..100.0_f64).prop_map(Some),
        1 => any::<f64>().prop_map(Some),
        1 => (-300.0..300.0_f64).prop_map(|e| Some(10_f64.powf(e))),
        1 => Just(None),
        1 => prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(0.0), Just(-7.0)].prop_map(Some),
    ]
}

proptest! {
    /// Up to a sensitivity of 1 and a gain of 1 each step is a convex combination: no gain that changes
    /// from frame to frame makes the loop grow, at any delay and for either sign.
    #[test]
    fn gains_that_change_never_make_it_grow(
        gains in prop::collection::vec(0.0..1.0_f64, 1..300),
        start in prop::collection::vec(-1.0..1.0_f64, 1..20),
        sensitivity in -1.0..1.0_f64,
    ) {
        let (mut theta, delay) = (start.clone(), start.len());
        let largest = start.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        for (k, gain) in gains.iter().enumerate() {
            let now = theta[k + delay - 1];
            theta.push(now + gain * (-sensitivity * theta[k] - now));
            prop_assert!(theta[k + delay].abs() <= largest * (1.0 + 1e-12));
        }
    }

    #[test]
    fn any_sequence_keeps_the_correction_bounded(
        times in prop::collection::vec((anything(), anything()), 0..200),
        per_mille in 1..1000_u32,
        max_correction in 1.5..1e6_f64,
        outliers in any::<bool>(),
        warm_up in any::<bool>(),
    ) {
        let gain = f64::from(per_mille) / 1000.0;
        let config = CorrectionConfig {
            gain,
            max_gain: gain.max(0.8),
            max_correction,
            warm_up,
            outlier_threshold: outliers.then_some(4.0),
            ..CorrectionConfig::default()
        };
        let mut correction = Correction::new(config).unwrap();
        for (predicted, measured) in times {
            correction.learn(predicted.unwrap_or(10.0), measured);
            let factor = correction.factor();
            prop_assert!(factor.is_finite());
            prop_assert!(factor <= max_correction * 1.000_001);
            prop_assert!(factor >= 0.999_999 / max_correction);
            prop_assert!((0.0..=1.0).contains(&correction.mean_error()));
        }
        // And it recovers: honest measurements lead it to the truth, from wherever it is.
        for _ in 0..40_000 / per_mille + 100 {
            correction.learn(10.0, Some(12.0));
        }
        prop_assert!((correction.factor() / 1.2_f64.min(max_correction) - 1.0).abs() < 1e-3);
    }
}
