//! The inner loop: the best rung whose predicted time meets the target.

use serde::{Deserialize, Serialize};

use crate::error::within;
use crate::{Error, Ladder};

/// Shortest target, in milliseconds.
pub const MIN_TARGET_MS: f64 = 0.01;
/// Longest target, in milliseconds: ten minutes.
pub const MAX_TARGET_MS: f64 = 600_000.0;

/// What "meets the target" means.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Aim {
    /// The highest rung predicted to take at most `target · (1 − headroom)`: for a deadline, such
    /// as the refresh of a display, which late frames miss. `headroom` is within 0 and 0.9.
    AtMost {
        /// Share of the target that is kept free for what the prediction does not know.
        headroom: f64,
    },
    /// The rung predicted to come closest to the target from either side, the higher of two as
    /// close: smallest |e|, as the thesis has it (Paper I §4.4).
    Nearest,
}

/// How the ladder is searched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Search {
    /// Asks for every rung that can matter: right for every predictor. The default, because
    /// analytical models jump where their cases meet (Hong and Kim's does), and because a whole
    /// ladder of such predictions takes microseconds.
    #[default]
    Exhaustive,
    /// Asks for about log₂ of the rungs: for predictors that are slow, such as a neural network, and
    /// known not to fall with the rung. Where two of the rungs asked for are out of order, or a
    /// prediction is unusable, it falls back to the whole ladder; a dip between probes goes unseen.
    Bisection,
}

/// Settings of the inner loop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct InnerConfig {
    /// What meets the target. Default: [`Aim::Nearest`].
    pub aim: Aim,
    /// How the ladder is searched. Default: [`Search::Exhaustive`].
    pub search: Search,
    /// Share of the target by which another rung has to be better than the present one before
    /// quality changes, so that it does not flicker between neighbours; within 0 and 0.5, default
    /// 0.01. A rung that no longer meets an [`Aim::AtMost`] is left at once whatever this says.
    pub hysteresis: f64,
}

impl Default for InnerConfig {
    fn default() -> Self {
        Self { aim: Aim::Nearest, search: Search::default(), hysteresis: 0.01 }
    }
}

impl InnerConfig {
    fn validate(&self) -> Result<(), Error> {
        if let Aim::AtMost { headroom } = self.aim {
            within("headroom", headroom, 0.0, 0.9, "within 0 and 0.9")?;
        }
        within("hysteresis", self.hysteresis, 0.0, 0.5, "within 0 and 0.5")
    }
}

/// Whether a choice meets the target.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Status {
    /// The target lies within what the ladder can do.
    OnTarget,
    /// Every rung is predicted to take longer than the target allows; the quickest was chosen.
    AtLowest,
    /// Even the best rung is predicted to leave time over.
    AtHighest,
    /// No rung has a usable prediction (a finite number, not negative): the last choice stands.
    Held,
}

/// What the inner loop chose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// Index into the ladder.
    pub rung: usize,
    /// Its predicted time in milliseconds; none where the last choice was held.
    pub predicted_ms: Option<f64>,
    /// Whether that meets the target.
    pub status: Status,
    /// How many rungs were predicted.
    pub evaluated: usize,
}

/// The inner loop by itself: a ladder, a target and the present rung. [`crate::FrameController`]
/// runs one; build a controller of your own on it where that one does not fit.
#[derive(Clone, Debug)]
pub struct InnerLoop<S> {
    ladder: Ladder<S>,
    target_ms: f64,
    config: InnerConfig,
    /// The last choice.
    rung: Option<usize>,
    /// Predictions of the choice under way: none where not asked for, NaN where unusable.
    known: Vec<Option<f64>>,
}

impl<S> InnerLoop<S> {
    /// Fails for a target that is no frame time and for settings out of range.
    pub fn new(ladder: Ladder<S>, target_ms: f64, config: InnerConfig) -> Result<Self, Error> {
        config.validate()?;
        check_target(target_ms)?;
        let known = vec![None; ladder.rungs().len()];
        Ok(Self { ladder, target_ms, config, rung: None, known })
    }

    /// The scale.
    pub fn ladder(&self) -> &Ladder<S> {
        &self.ladder
    }

    /// The target in milliseconds.
    pub fn target_ms(&self) -> f64 {
        self.target_ms
    }

    /// Changes the target from the next choice on. Fails, and keeps the old one, where it is no
    /// frame time.
    pub fn set_target(&mut self, target_ms: f64) -> Result<(), Error> {
        check_target(target_ms)?;
        self.target_ms = target_ms;
        Ok(())
    }

    /// The last choice, or the lowest rung before the first.
    pub fn rung(&self) -> usize {
        self.rung.unwrap_or(0)
    }

    /// Declares a rung to be the last choice: where to hold, and what hysteresis clings to. Fails
    /// where the ladder has no such rung.
    pub fn start_at(&mut self, rung: usize) -> Result<(), Error> {
        self.ladder.check(rung)?;
        self.rung = Some(rung);
        Ok(())
    }

    /// Chooses by `predict`, which gives milliseconds for settings. Allocates nothing.
    pub fn choose(&mut self, mut predict: impl FnMut(&S) -> f64) -> Choice {
        self.known.fill(None);
        let mut table = Table {
            known: &mut self.known,
            predict: |rung: usize| predict(&self.ladder.rungs[rung]),
            evaluated: 0,
        };
        let (limit, aim) = match self.config.aim {
            Aim::AtMost { headroom } => (self.target_ms * (1.0 - headroom), self.config.aim),
            aim => (self.target_ms, aim),
        };
        let best = match self.config.search {
            Search::Bisection => table.bisect(aim, limit),
            Search::Exhaustive => None,
        };
        let best = best.or_else(|| table.scan(aim, limit));
        let Some(best) = best else {
            let evaluated = table.evaluated;
            let rung = self.rung();
            return Choice { rung, predicted_ms: None, status: Status::Held, evaluated };
        };
        let rung = match self.rung {
            Some(present) if present != best => {
                table.settle(aim, limit, self.target_ms * self.config.hysteresis, present, best)
            }
            _ => best,
        };
        let status = table.status(limit, best);
        let predicted_ms = table.usable(rung);
        let evaluated = table.evaluated;
        self.rung = Some(rung);
        Choice { rung, predicted_ms, status, evaluated }
    }
}

fn check_target(milliseconds: f64) -> Result<(), Error> {
    if (MIN_TARGET_MS..=MAX_TARGET_MS).contains(&milliseconds) {
        Ok(())
    } else {
        Err(Error::Target { milliseconds })
    }
}

/// Predictions by rung, each asked for once at most.
struct Table<'a, F> {
    known: &'a mut [Option<f64>],
    predict: F,
    evaluated: usize,
}

impl<F: FnMut(usize) -> f64> Table<'_, F> {
    fn top(&self) -> usize {
        self.known.len() - 1
    }

    /// The prediction of a rung where it is finite and not negative.
    fn usable(&mut self, rung: usize) -> Option<f64> {
        let time = match self.known[rung] {
            Some(time) => time,
            None => {
                let time = (self.predict)(rung);
                let time = if time.is_finite() && time >= 0.0 { time } else { f64::NAN };
                self.evaluated += 1;
                self.known[rung] = Some(time);
                time
            }
        };
        (!time.is_nan()).then_some(time)
    }

    fn fits(&mut self, rung: usize, limit: f64) -> bool {
        self.usable(rung).is_some_and(|time| time <= limit)
    }

    /// The best rung by looking at all that can matter; none where no prediction is usable.
    fn scan(&mut self, aim: Aim, limit: f64) -> Option<usize> {
        match aim {
            Aim::AtMost { .. } => (0..=self.top())
                .rev()
                .find(|&rung| self.fits(rung, limit))
                .or_else(|| self.least(|time| time)),
            Aim::Nearest => self.least(|time| (time - limit).abs()),
        }
    }

    /// The rung of the least cost, the highest of equal ones.
    fn least(&mut self, cost: impl Fn(f64) -> f64) -> Option<usize> {
        let mut best = None;
        for rung in 0..=self.top() {
            if let Some(cost) = self.usable(rung).map(&cost)
                && best.is_none_or(|(_, least)| cost <= least)
            {
                best = Some((rung, cost));
            }
        }
        best.map(|(rung, _)| rung)
    }

    /// The best rung by halving; none where what was seen is not a predictor that never falls.
    fn bisect(&mut self, aim: Aim, limit: f64) -> Option<usize> {
        // Rungs below `low` fit, those from `high` on do not.
        let (mut low, mut high) = (0, self.known.len());
        while low < high {
            let middle = low + (high - low) / 2;
            if self.usable(middle)? <= limit {
                low = middle + 1;
            } else {
                high = middle;
            }
        }
        let fitting = low.checked_sub(1);
        let best = match (aim, fitting) {
            (_, None) => 0,
            (Aim::Nearest, Some(below)) if below < self.top() => {
                let (under, over) = (self.usable(below)?, self.usable(below + 1)?);
                if over - limit <= limit - under { below + 1 } else { below }
            }
            (_, Some(rung)) => rung,
        };
        self.usable(best)?;
        let mut last = 0.0;
        for time in self.known.iter().flatten() {
            if *time < last {
                return None;
            }
            last = *time;
        }
        Some(best)
    }

    /// The rung to take where the present one is `present` and the best is `best`.
    fn settle(&mut self, aim: Aim, limit: f64, slack: f64, present: usize, best: usize) -> usize {
        let Some(time) = self.usable(present) else { return best };
        let Some(best_time) = self.usable(best) else { return best };
        match aim {
            Aim::AtMost { .. } if time > limit => best,
            // Climbs only as far as there is slack, so that a little noise does not bring it back.
            Aim::AtMost { .. } => (present + 1..=best)
                .rev()
                .find(|&rung| self.fits(rung, limit - slack))
                .unwrap_or(present),
            Aim::Nearest if (time - limit).abs() <= (best_time - limit).abs() + slack => present,
            Aim::Nearest => best,
        }
    }

    /// What the predictions that were asked for say about the target.
    fn status(&mut self, limit: f64, best: usize) -> Status {
        let top = self.top();
        match self.usable(best) {
            // The quickest rung of all does not fit.
            Some(time) if time > limit && !self.any_known(|time| time <= limit) => Status::AtLowest,
            Some(time) if best == top && time < limit && !self.any_known(|time| time >= limit) => {
                Status::AtHighest
            }
            _ => Status::OnTarget,
        }
    }

    fn any_known(&self, is: impl Fn(f64) -> bool) -> bool {
        self.known.iter().flatten().any(|&time| is(time))
    }
}
