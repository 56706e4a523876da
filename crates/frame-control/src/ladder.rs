//! The scale of quality: settings in order, worst and cheapest first.

use serde::{Deserialize, Serialize};

use crate::Error;

/// An ordered scale of settings of any type: rung 0 is the lowest quality, the last the highest.
///
/// The order *is* the definition of quality: a controller only ever asks how high it may climb. A
/// ladder need not be ordered by cost, though most are (see [`crate::Search`]).
///
/// ```
/// use niwaki_frame_control::Ladder;
///
/// let shadow_map = Ladder::new(vec![256_u32, 512, 1024, 2048])?;
/// assert_eq!(shadow_map.rungs().len(), 4);
/// assert_eq!(serde_json::to_string(&shadow_map)?, "[256,512,1024,2048]");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<S>", into = "Vec<S>")]
#[serde(bound(serialize = "S: Clone + Serialize", deserialize = "S: Deserialize<'de>"))]
pub struct Ladder<S> {
    pub(crate) rungs: Vec<S>,
}

impl<S> Ladder<S> {
    /// A ladder of these settings, worst first. Fails where there are none.
    pub fn new(rungs: Vec<S>) -> Result<Self, Error> {
        if rungs.is_empty() { Err(Error::EmptyLadder) } else { Ok(Self { rungs }) }
    }

    /// Sorts settings by a score, lowest first; equal scores keep their order. Scores that are not
    /// numbers come last or first by their sign, as [`f64::total_cmp`] has it.
    pub fn by_quality(mut settings: Vec<S>, score: impl Fn(&S) -> f64) -> Result<Self, Error> {
        settings.sort_by(|a, b| score(a).total_cmp(&score(b)));
        Self::new(settings)
    }

    /// The settings, worst first; never empty.
    pub fn rungs(&self) -> &[S] {
        &self.rungs
    }

    /// Index of the best rung.
    pub fn top(&self) -> usize {
        self.rungs.len() - 1
    }

    /// The settings of a rung.
    pub fn get(&self, rung: usize) -> Option<&S> {
        self.rungs.get(rung)
    }

    /// Fails where a rung is beyond the ladder.
    pub(crate) fn check(&self, rung: usize) -> Result<(), Error> {
        if rung < self.rungs.len() {
            Ok(())
        } else {
            Err(Error::Rung { rung, rungs: self.rungs.len() })
        }
    }
}

impl<S> TryFrom<Vec<S>> for Ladder<S> {
    type Error = Error;

    fn try_from(rungs: Vec<S>) -> Result<Self, Error> {
        Self::new(rungs)
    }
}

impl<S> From<Ladder<S>> for Vec<S> {
    fn from(ladder: Ladder<S>) -> Self {
        ladder.rungs
    }
}
