//! Taking measurements in turns.

use std::time::Duration;

/// How long to measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Effort {
    /// Least number of measurements of each.
    pub(crate) at_least: usize,
    /// Most of each.
    pub(crate) at_most: usize,
    /// Go on until each has taken so long in total.
    pub(crate) total: Duration,
    /// Stop when one has taken so long in total, even short of the least number: minutes average
    /// the machine's noise by themselves.
    pub(crate) enough: Duration,
}

impl Effort {
    /// At least three, and until `seconds` have been spent on each; of what takes 300 times as long,
    /// fewer.
    pub(crate) fn seconds(seconds: f64) -> Self {
        let total = Duration::from_secs_f64(seconds);
        Self { at_least: 3, at_most: 10_000, total, enough: total * 300 }
    }
}

/// Measures `count` rivals in turns: A B C, A B C, … until each has its least number of
/// measurements or enough time, then always the one that has had the least time so far. A change of the machine's
/// speed thus meets all of them, the fast ones with more measurements than the slow ones.
/// `measure(i)` measures the i-th once and returns how long that took; one that has had its effort
/// drops out of the turns, as does one that fails.
pub(crate) fn in_turns(
    count: usize,
    effort: Effort,
    mut measure: impl FnMut(usize) -> Option<Duration>,
) {
    let mut spent = vec![(0, Duration::ZERO); count];
    let mut going: Vec<usize> = (0..count).collect();
    // Rounds first: a stable order among those with equally few measurements, then by time.
    while let Some(&next) = going.iter().min_by_key(|&&i| {
        let (times, total) = spent[i];
        if times < effort.at_least { (times, Duration::ZERO) } else { (effort.at_least, total) }
    }) {
        let (times, total) = &mut spent[next];
        let done = match measure(next) {
            None => true,
            Some(time) => {
                *times += 1;
                *total += time;
                *times >= effort.at_most
                    || (*times >= effort.at_least && *total >= effort.total)
                    || *total >= effort.enough
            }
        };
        if done {
            going.retain(|&i| i != next);
        }
    }
}

/// The median; the mean of the middle two of an even number. NaN of nothing.
pub(crate) fn median(numbers: &[f64]) -> f64 {
    let mut sorted = numbers.to_vec();
    sorted.sort_by(f64::total_cmp);
    match sorted.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => sorted[n / 2],
        n => f64::midpoint(sorted[n / 2 - 1], sorted[n / 2]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_alternate_and_end() {
        let [total, enough] = [10, 1_000].map(Duration::from_secs);
        let effort = Effort { at_least: 2, at_most: 5, total, enough };
        let seconds = [1, 4, 100];
        let mut order = Vec::new();
        in_turns(3, effort, |i| {
            order.push(i);
            Some(Duration::from_secs(seconds[i]))
        });
        // Two rounds; the third is done; then the first until it has had the most turns, for it
        // stays behind the second in time; the second needs one more for its 10 s.
        assert_eq!(order, [0, 1, 2, 0, 1, 2, 0, 0, 0, 1]);
    }

    #[test]
    fn the_slow_are_not_repeated() {
        let mut calls = [0; 3];
        in_turns(3, Effort::seconds(1.0), |i| {
            calls[i] += 1;
            Some(Duration::from_secs([1, 200, 400][i]))
        });
        assert_eq!(calls, [3, 2, 1]);
    }

    #[test]
    fn failures_drop_out() {
        let mut calls = [0; 2];
        in_turns(2, Effort::seconds(0.002), |i| {
            calls[i] += 1;
            (i == 0).then_some(Duration::from_millis(1))
        });
        assert_eq!(calls, [3, 1]);
    }

    #[test]
    fn medians() {
        assert_eq!(median(&[3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), 2.5);
        assert!(median(&[]).is_nan());
    }
}
