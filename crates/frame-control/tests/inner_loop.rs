//! The inner loop: the best rung by definition, whatever the predictor; hysteresis; both ends.

use niwaki_frame_control::{
    Aim, Error, InnerConfig, InnerLoop, Ladder, RenderSettings, Search, Status,
};
use proptest::prelude::*;

fn config(aim: Aim, search: Search, hysteresis: f64) -> InnerConfig {
    InnerConfig { aim, search, hysteresis }
}

/// A ladder whose rungs are their own predicted times.
fn times(times: &[f64], target: f64, config: InnerConfig) -> InnerLoop<f64> {
    InnerLoop::new(Ladder::new(times.to_vec()).unwrap(), target, config).unwrap()
}

const AT_MOST: Aim = Aim::AtMost { headroom: 0.0 };

#[test]
fn hysteresis_holds_between_neighbours() {
    let mut inner = times(&[8.0, 9.0, 10.0, 11.0], 10.0, config(AT_MOST, Search::Exhaustive, 0.05));
    assert_eq!(inner.choose(|t| *t).rung, 2);
    // A little slower: rung 2 no longer fits, and is left at once.
    assert_eq!(inner.choose(|t| t * 1.01).rung, 1);
    // As before: it fits, but not by 5 %.
    assert_eq!(inner.choose(|t| *t).rung, 1);
    // Clearly quicker: it does.
    assert_eq!(inner.choose(|t| t * 0.94).rung, 2);

    let mut inner = times(&[9.0, 9.9, 10.2], 10.0, config(Aim::Nearest, Search::Exhaustive, 0.02));
    assert_eq!(inner.choose(|t| *t).rung, 1);
    assert_eq!(inner.choose(|t| t * 0.99).rung, 1, "the neighbour is closer by less than 2 %");
    assert_eq!(inner.choose(|t| t * 0.96).rung, 2);
}

#[test]
fn noise_smaller_than_hysteresis_does_not_change_quality() {
    for aim in [AT_MOST, Aim::Nearest] {
        let rungs: Vec<f64> = (1..=64).map(f64::from).collect();
        let mut inner = times(&rungs, 30.5, config(aim, Search::Exhaustive, 0.05));
        // The first frames may still settle.
        inner.choose(|t| t * 1.01);
        let settled = inner.choose(|t| t * 1.01).rung;
        for frame in 0..200_u32 {
            let noise = 1.0 + 0.01 * f64::from(frame * 7919 % 21) / 10.0 - 0.01;
            assert_eq!(inner.choose(|t| t * noise).rung, settled, "{aim:?}, frame {frame}");
        }
    }
}

#[test]
fn saturates_at_either_end_says_so_and_recovers() {
    for aim in [AT_MOST, Aim::Nearest] {
        for search in [Search::Exhaustive, Search::Bisection] {
            let mut inner = times(&[5.0, 6.0, 7.0], 6.2, config(aim, search, 0.01));
            let choice = inner.choose(|t| *t);
            assert_eq!((choice.rung, choice.status), (1, Status::OnTarget));
            let choice = inner.choose(|t| t * 10.0);
            assert_eq!((choice.rung, choice.status), (0, Status::AtLowest));
            assert_eq!(choice.predicted_ms, Some(50.0));
            let choice = inner.choose(|t| t * 0.1);
            assert_eq!((choice.rung, choice.status), (2, Status::AtHighest));
            let choice = inner.choose(|t| *t);
            assert_eq!((choice.rung, choice.status), (1, Status::OnTarget), "{aim:?} {search:?}");
            inner.set_target(1.0).unwrap();
            assert_eq!(inner.choose(|t| *t).status, Status::AtLowest);
        }
    }
}

#[test]
fn holds_where_nothing_is_known() {
    let mut inner = times(&[5.0, 6.0, 7.0], 6.2, InnerConfig::default());
    let choice = inner.choose(|_| f64::NAN);
    assert_eq!((choice.rung, choice.status, choice.predicted_ms), (0, Status::Held, None));
    inner.choose(|t| *t);
    for unusable in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0] {
        let choice = inner.choose(|_| unusable);
        assert_eq!((choice.rung, choice.status), (1, Status::Held));
    }
    // A rung without a prediction is passed over.
    let choice = inner.choose(|t| if *t == 6.0 { f64::NAN } else { *t });
    assert_eq!((choice.rung, choice.status), (2, Status::OnTarget));
    // An empty view costs nothing: the best quality is just right.
    assert_eq!(inner.choose(|_| 0.0).status, Status::AtHighest);
}

#[test]
fn bisection_asks_for_few_rungs() {
    let rungs: Vec<f64> = (1..=1024).map(f64::from).collect();
    let mut inner = times(&rungs, 700.4, config(Aim::Nearest, Search::Bisection, 0.01));
    let choice = inner.choose(|t| *t);
    assert_eq!(choice.rung, 699);
    assert!(choice.evaluated <= 13, "{} of 1024", choice.evaluated);
    // Where it sees that the predictor falls, it looks at everything.
    let choice = inner.choose(|t| 2000.0 - *t);
    assert_eq!(choice.evaluated, 1024);
}

#[test]
fn targets_and_settings_out_of_range_are_errors() {
    let ladder = Ladder::new(vec![1.0, 2.0]).unwrap();
    for target in [0.0, -16.0, 1e-9, 1e9, f64::NAN, f64::INFINITY] {
        let made = InnerLoop::new(ladder.clone(), target, InnerConfig::default());
        assert!(matches!(made, Err(Error::Target { .. })), "{target}");
    }
    let mut inner = InnerLoop::new(ladder.clone(), 16.0, InnerConfig::default()).unwrap();
    assert!(inner.set_target(0.0).is_err());
    assert_eq!(inner.target_ms(), 16.0, "the old target stands");
    assert!(inner.start_at(2).is_err());
    assert!(Ladder::<f64>::new(Vec::new()).is_err());
    for bad in [f64::NAN, -0.1, 0.95] {
        let aim = Aim::AtMost { headroom: bad };
        assert!(
            InnerLoop::new(ladder.clone(), 16.0, config(aim, Search::Exhaustive, 0.0)).is_err()
        );
        let made = InnerLoop::new(ladder.clone(), 16.0, config(aim, Search::Exhaustive, bad));
        assert!(made.is_err());
    }
}

#[test]
fn ladders_are_chains_and_survive_json() {
    for ladder in [Ladder::ray_tracing(64, 0.1).unwrap(), Ladder::hybrid()] {
        for pair in ladder.rungs().windows(2) {
            assert!(pair[1].at_least(&pair[0]) && pair[1] != pair[0], "{pair:?}");
        }
        Ladder::chain(ladder.rungs().to_vec()).unwrap();
        let text = serde_json::to_string(&ladder).unwrap();
        assert_eq!(serde_json::from_str::<Ladder<RenderSettings>>(&text).unwrap(), ladder);
    }
    assert_eq!(Ladder::ray_tracing(64, 0.1).unwrap().rungs().len(), 66);
    let mut rungs = Ladder::hybrid().rungs().to_vec();
    rungs.swap(3, 4);
    assert_eq!(Ladder::chain(rungs), Err(Error::Unordered { rung: 4 }));
    let too_large = RenderSettings { render_scale: 3.0, ..RenderSettings::PRIMARY };
    assert!(Ladder::chain(vec![too_large]).is_err());
    let text = serde_json::to_string(&[too_large]).unwrap();
    assert!(serde_json::from_str::<Ladder<RenderSettings>>(&text).is_err());
    assert!(serde_json::from_str::<Ladder<RenderSettings>>("[]").is_err());
}

proptest! {
    /// Without hysteresis the choice is what the documentation says, by brute force.
    #[test]
    fn exhaustive_search_is_the_definition(
        rungs in prop::collection::vec(prop_oneof![9 => 0.0..100.0_f64, 1 => Just(f64::NAN)], 1..20),
        target in 1.0..100.0_f64,
    ) {
        for aim in [AT_MOST, Aim::Nearest] {
            let mut inner = times(&rungs, target, config(aim, Search::Exhaustive, 0.0));
            let choice = inner.choose(|t| *t);
            let known: Vec<f64> = rungs.iter().copied().filter(|t| !t.is_nan()).collect();
            let Some(predicted) = choice.predicted_ms else {
                prop_assert!(known.is_empty() && choice.status == Status::Held);
                continue;
            };
            prop_assert_eq!(predicted, rungs[choice.rung]);
            let fits = known.iter().any(|t| *t <= target);
            match aim {
                Aim::Nearest => {
                    let off = |t: f64| (t - target).abs();
                    prop_assert!(known.iter().all(|t| off(*t) >= off(predicted)));
                }
                _ if fits => {
                    prop_assert!(predicted <= target);
                    prop_assert!(rungs[choice.rung + 1..].iter().all(|t| t.is_nan() || *t > target));
                }
                _ => prop_assert!(known.iter().all(|t| *t >= predicted)),
            }
            prop_assert_eq!(choice.status == Status::AtLowest, !fits);
            prop_assert!(choice.evaluated <= rungs.len());
        }
    }

    /// On a predictor that never falls, bisection chooses what the full search chooses.
    #[test]
    fn bisection_agrees_where_time_never_falls(
        steps in prop::collection::vec(0.0..5.0_f64, 1..40),
        targets in prop::collection::vec(1.0..100.0_f64, 1..8),
        hysteresis in 0.0..0.2_f64,
    ) {
        let mut sum = 0.0;
        let rungs: Vec<f64> = steps.iter().map(|step| { sum += step; sum }).collect();
        for aim in [AT_MOST, Aim::Nearest] {
            let mut full = times(&rungs, 50.0, config(aim, Search::Exhaustive, hysteresis));
            let mut half = times(&rungs, 50.0, config(aim, Search::Bisection, hysteresis));
            for target in &targets {
                full.set_target(*target).unwrap();
                half.set_target(*target).unwrap();
                let (a, b) = (full.choose(|t| *t), half.choose(|t| *t));
                prop_assert_eq!((a.rung, a.status), (b.rung, b.status));
            }
        }
    }
}
