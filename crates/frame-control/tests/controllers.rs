//! Controllers under anything that may come in: late, doubled, lost and absurd times, empty views.

use niwaki_frame_control::{
    Config, Controller, Error, FixedRung, FrameController, Ladder, MAX_DELAY, RegressionConfig,
    RegressionController, Status, Verdict,
};
use proptest::prelude::*;

fn model(rays: &u32, steps: &f64) -> f64 {
    0.01 * f64::from(*rays) * steps
}

fn features(rays: &u32, steps: &f64) -> [f64; 3] {
    [1.0, *steps, f64::from(*rays) * steps]
}

fn ladder() -> Ladder<u32> {
    Ladder::new((1..=64).collect()).unwrap()
}

/// Functions as types with names.
type Model = fn(&u32, &f64) -> f64;
type Features = fn(&u32, &f64) -> [f64; 3];

fn both() -> FrameController<u32, Model> {
    FrameController::new(ladder(), model as Model, 16.0, Config::default()).unwrap()
}

fn regression() -> RegressionController<u32, Features, 3> {
    let features = features as Features;
    RegressionController::new(ladder(), features, 16.0, 20, RegressionConfig::default()).unwrap()
}

#[test]
fn times_are_matched_by_frame_number() {
    let mut controller = both();
    let first = controller.decide(&40.0);
    let second = controller.decide(&80.0);
    assert_eq!((first.frame, second.frame), (0, 1));
    // Out of order; both say that the device takes twice as long.
    assert_eq!(controller.measure(1, Some(2.0 * second.model_ms.unwrap())), Verdict::Used);
    assert_eq!(controller.measure(0, Some(2.0 * first.model_ms.unwrap())), Verdict::Used);
    assert!((controller.correction().unwrap().factor() - 2.0).abs() < 1e-9);
    // Twice, and for frames that never were.
    assert_eq!(controller.measure(1, Some(16.0)), Verdict::Unknown);
    assert_eq!(controller.measure(7, Some(16.0)), Verdict::Unknown);
    assert_eq!(controller.measure(u64::MAX, Some(16.0)), Verdict::Unknown);
    // Too late.
    let old = controller.decide(&40.0).frame;
    for _ in 0..MAX_DELAY {
        controller.decide(&40.0);
    }
    assert_eq!(controller.measure(old, Some(16.0)), Verdict::Unknown);
    // A new scene.
    let frame = controller.decide(&40.0).frame;
    controller.reset();
    assert_eq!(controller.measure(frame, Some(16.0)), Verdict::Unknown);
    assert_eq!(controller.correction().unwrap().factor(), 1.0);
    assert_eq!(controller.decide(&40.0).frame, frame + 1);
}

#[test]
fn a_sudden_view_restarts_the_outer_loop() {
    // The model is right for short paths and half of the truth for long ones.
    let truth = |rays: u32, steps: f64| model(&rays, &steps) * if steps > 60.0 { 2.0 } else { 1.0 };
    let run = |cut| {
        let config = Config { cut, ..Config::default() };
        let mut controller = FrameController::new(ladder(), model, 16.0, config).unwrap();
        (0..30)
            .filter(|frame| {
                let steps = if *frame < 15 { 40.0 } else { 80.0 };
                let decision = controller.decide(&steps);
                let time = truth(*controller.settings(&decision), steps);
                controller.measure(decision.frame, Some(time));
                (time / 16.0 - 1.0).abs() > 0.1
            })
            .count()
    };
    assert_eq!(run(Some(1.3)), 1, "the first frame after the turn");
    assert!(run(None) > 1);
}

#[test]
fn views_without_a_prediction_hold() {
    let mut controller = both();
    let before = controller.decide(&40.0);
    for nothing in [f64::NAN, f64::INFINITY, -1.0] {
        let decision = controller.decide(&nothing);
        assert_eq!((decision.status, decision.rung), (Status::Held, before.rung));
        assert_eq!((decision.model_ms, decision.predicted_ms), (None, None));
        assert_eq!(controller.measure(decision.frame, Some(9.0)), Verdict::Unknown);
    }
    // An empty view is free, and its time says nothing about the model.
    let decision = controller.decide(&0.0);
    assert_eq!(decision.status, Status::AtHighest);
    assert_eq!(controller.measure(decision.frame, Some(0.5)), Verdict::Absurd);
    assert_eq!(controller.decide(&40.0).status, Status::OnTarget);
}

#[test]
fn bad_settings_are_errors() {
    let make = |target, config| FrameController::new(ladder(), model, target, config).map(|_| ());
    assert!(matches!(make(0.0, Config::default()), Err(Error::Target { .. })));
    assert!(make(16.0, Config { cut: Some(1.0), ..Config::default() }).is_err());
    assert!(make(16.0, Config { cut: Some(f64::NAN), ..Config::default() }).is_err());
    assert!(FixedRung::new(&ladder(), 64).is_err());
    let make = |start, config| {
        RegressionController::new(ladder(), features, 16.0, start, config).map(|_| ())
    };
    let config = RegressionConfig::default();
    assert!(make(64, config).is_err());
    assert!(make(0, RegressionConfig { forgetting: 0.4, ..config }).is_err());
    assert!(make(0, RegressionConfig { ridge: 0.0, ..config }).is_err());
    assert!(make(0, RegressionConfig { ridge: f64::NAN, ..config }).is_err());
    let mut controller = both();
    assert!(controller.set_target(f64::NAN).is_err());
    assert_eq!(controller.inner().target_ms(), 16.0);
    assert!(controller.start_at(99).is_err());
}

/// The regression finds the coefficients of a linear device, whatever it starts with.
#[test]
fn regression_learns_a_linear_device() {
    let mut controller = regression();
    let truth = |rays: u32, steps: f64| 1.5 + 0.02 * steps + 0.008 * f64::from(rays) * steps;
    let mut off = 0;
    for frame in 0..120 {
        let steps = 50.0 + 20.0 * (f64::from(frame) * 0.3).sin();
        let decision = controller.decide(&steps);
        let rays = controller.inner().ladder().rungs()[decision.rung];
        let time = truth(rays, steps);
        controller.measure(decision.frame, Some(time));
        if frame > 20 {
            let error = (decision.predicted_ms.unwrap() / time - 1.0).abs();
            off += u32::from(error > 0.01);
        }
    }
    assert_eq!(off, 0);
    assert!(controller.regression().coefficients_ms().iter().all(|c| *c >= 0.0));
}

proptest! {
    /// Whatever times come for whatever frames, decisions stay on the ladder and finite; and honest
    /// times bring every controller back to the target.
    #[test]
    fn garbage_is_survived(
        events in prop::collection::vec(
            (
                prop_oneof![
                    8 => 10.0..90.0_f64,
                    1 => any::<f64>(),
                    1 => Just(0.0),
                    1 => Just(f64::NAN),
                ],
                0_u64..8,
                prop_oneof![
                    3 => (1.0..60.0_f64).prop_map(Some),
                    1 => any::<f64>().prop_map(Some),
                    1 => (-300.0..300.0_f64).prop_map(|e| Some(10_f64.powf(e))),
                    1 => Just(None),
                    1 => Just(Some(f64::INFINITY)),
                ],
            ),
            0..80,
        ),
    ) {
        let controllers: [Box<dyn Controller<f64>>; 2] = [Box::new(both()), Box::new(regression())];
        for mut controller in controllers {
            for (steps, late, time) in &events {
                let decision = controller.decide(steps);
                prop_assert!(decision.rung < 64);
                prop_assert!(decision.predicted_ms.is_none_or(|t| t.is_finite() && t >= 0.0));
                prop_assert!(decision.model_ms.is_none_or(|t| t.is_finite() && t >= 0.0));
                controller.measure(decision.frame.saturating_sub(*late), *time);
            }
            let mut off = 0.0;
            // A view that moves: a still one would never show a regression what it got wrong.
            for frame in 0..400 {
                let steps = 40.0 + 8.0 * (0.3 * f64::from(frame)).sin();
                let decision = controller.decide(&steps);
                let time = 1.25 * model(&(1 + u32::try_from(decision.rung).unwrap()), &steps);
                controller.measure(decision.frame, Some(time));
                off = (time / 16.0 - 1.0).abs();
            }
            prop_assert!(off < 0.05, "{off}");
        }
    }
}
