//! Means of frames, and how well they are known.

use serde::{Deserialize, Serialize};

/// A mean with its spread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Statistic {
    /// The mean.
    pub mean: f64,
    /// Standard deviation over frames (or windows), as in the paper's table 1.
    pub deviation: f64,
    /// Half the width of the confidence interval of the mean; see [`statistic`].
    pub half_width: f64,
    /// How many there are.
    pub count: usize,
}

/// The statistic of a series in the order of time, with a confidence interval at this level (such as
/// 0.95).
///
/// Frames differ for two reasons: the view changes along the animation, which is the same whenever the
/// animation is repeated, and chance. The interval is for the mean of the *same animation repeated*, so
/// it is Student's with the variance of chance alone, half the mean square of differences between
/// neighbours (von Neumann 1941). What changes slowly by chance, such as a device that warms up, is taken
/// for the animation's; repeat the animation to see that.
#[must_use]
pub fn statistic(series: &[f64], confidence: f64) -> Statistic {
    let count = series.len();
    let n = count as f64;
    if count == 0 {
        return Statistic::default();
    }
    let mean = series.iter().sum::<f64>() / n;
    let squares: f64 = series.iter().map(|x| (x - mean).powi(2)).sum();
    if count == 1 || squares == 0.0 {
        let half_width = if count == 1 { f64::INFINITY } else { 0.0 };
        return Statistic { mean, deviation: 0.0, half_width, count };
    }
    let deviation = (squares / (n - 1.0)).sqrt();
    let steps: f64 = series.windows(2).map(|p| (p[1] - p[0]).powi(2)).sum();
    let chance = (0.5 * steps / (n - 1.0)).sqrt();
    let half_width = student(confidence, n - 1.0) * chance / n.sqrt();
    Statistic { mean, deviation, half_width, count }
}

/// The number t such that a Student variable with so many degrees of freedom lies within ±t with this
/// probability, by bisection of its distribution.
#[must_use]
pub fn student(confidence: f64, degrees: f64) -> f64 {
    if !(confidence > 0.0 && confidence < 1.0 && degrees > 0.0) {
        return f64::NAN;
    }
    let outside = |t: f64| beta(0.5 * degrees, 0.5, degrees / (degrees + t * t));
    let wanted = 1.0 - confidence;
    let (mut low, mut high) = (0.0, 1.0);
    while outside(high) > wanted && high < 1e12 {
        high *= 2.0;
    }
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if outside(middle) > wanted { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// The regularised incomplete beta function, by its continued fraction (Abramowitz and Stegun 26.5.8),
/// evaluated by Lentz's method.
fn beta(a: f64, b: f64, x: f64) -> f64 {
    if x <= 0.0 || x >= 1.0 {
        return x.clamp(0.0, 1.0);
    }
    // The fraction converges fast on one side of the mean; the other is its complement.
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - beta_fraction(b, a, 1.0 - x);
    }
    beta_fraction(a, b, x)
}

fn beta_fraction(a: f64, b: f64, x: f64) -> f64 {
    const TINY: f64 = 1e-300;
    let front =
        (ln_gamma(a + b) - ln_gamma(a) - ln_gamma(b) + a * x.ln() + b * (1.0 - x).ln()).exp();
    let off_zero = |v: f64| if v.abs() < TINY { TINY } else { v };
    let mut c = 1.0;
    let mut d = 1.0 / off_zero(1.0 - (a + b) * x / (a + 1.0));
    let mut value = d;
    for step in 1..500 {
        let m = f64::from(step);
        for term in [
            m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m)),
            -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0)),
        ] {
            d = 1.0 / off_zero(1.0 + term * d);
            c = off_zero(1.0 + term / c);
            value *= d * c;
        }
        if (d * c - 1.0).abs() < 1e-14 {
            break;
        }
    }
    front * value / a
}

/// The logarithm of the gamma function of a positive number: Stirling's series, after a shift to where
/// it is exact to 1e-14.
fn ln_gamma(x: f64) -> f64 {
    let mut shift = 0.0;
    let mut x = x;
    while x < 10.0 {
        shift -= x.ln();
        x += 1.0;
    }
    let series = 1.0 / (12.0 * x) - 1.0 / (360.0 * x.powi(3)) + 1.0 / (1260.0 * x.powi(5))
        - 1.0 / (1680.0 * x.powi(7));
    shift + (x - 0.5) * x.ln() - x + 0.5 * (2.0 * std::f64::consts::PI).ln() + series
}

/// Where the level of a series changes for good.
///
/// Binary segmentation: the split that lowers the sum of squares most is taken if the means of both sides
/// differ by at least `least` times the larger and by four standard errors, and each side is `length` long;
/// then both sides are searched. The noise is that of differences between neighbours, which slow changes
/// and steps hardly move.
pub(crate) fn level_changes(series: &[f64], least: f64, length: usize) -> Vec<usize> {
    let length = length.max(1);
    let mut sums = vec![0.0];
    sums.extend(series.iter().scan(0.0, |sum, x| {
        *sum += x;
        Some(*sum)
    }));
    let mut steps: Vec<_> = series.windows(2).map(|p| (p[1] - p[0]).abs()).collect();
    if steps.is_empty() {
        return Vec::new();
    }
    let middle = steps.len() / 2;
    let median = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
    let noise = median / (0.6745 * std::f64::consts::SQRT_2);
    let mut found = Vec::new();
    let mut parts = vec![(0, series.len())];
    while let Some((from, to)) = parts.pop() {
        if to - from < 2 * length {
            continue;
        }
        let mean = |a: usize, b: usize| (sums[b] - sums[a]) / (b - a) as f64;
        let gain = |at: usize| {
            let (left, right) = ((at - from) as f64, (to - at) as f64);
            (mean(from, at) - mean(at, to)).powi(2) * left * right / (left + right)
        };
        let best = (from + length..=to - length).max_by(|&a, &b| gain(a).total_cmp(&gain(b)));
        let Some(at) = best else { continue };
        let (a, b) = (mean(from, at), mean(at, to));
        let error = noise * (1.0 / (at - from) as f64 + 1.0 / (to - at) as f64).sqrt();
        // The means right beside the change: a slope changes those of the whole sides only.
        let near = (mean(at.saturating_sub(length).max(from), at), mean(at, (at + length).min(to)));
        let is_change = (a - b).abs() > (least * a.abs().max(b.abs())).max(4.0 * error)
            && (near.0 - near.1).abs() > 0.5 * (a - b).abs();
        if is_change {
            found.push(at);
            parts.push((from, at));
            parts.push((at, to));
        }
    }
    found.sort_unstable();
    found
}

/// The median of some numbers; NaN of none.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        // Abramowitz and Stegun, table 26.10.
        for (confidence, degrees, t) in [
            (0.95, 1.0, 12.706),
            (0.95, 4.0, 2.776),
            (0.95, 30.0, 2.042),
            (0.99, 10.0, 3.169),
            (0.90, 120.0, 1.658),
            (0.95, 1e6, 1.960),
        ] {
            let found = student(confidence, degrees);
            assert!((found - t).abs() < 6e-4 * t, "{confidence} {degrees}: {found}");
        }
    }

    #[test]
    fn intervals_hold_the_mean_of_the_animation() {
        let mut random = fastrand::Rng::with_seed(7);
        let path = |i: i32| 100.0 + 30.0 * (0.02 * f64::from(i)).sin();
        let truth = (0..300).map(path).sum::<f64>() / 300.0;
        let (mut inside, mut width) = (0, 0.0);
        for _ in 0..400 {
            let run: Vec<_> = (0..300).map(|i| path(i) + 6.0 * (random.f64() - 0.5)).collect();
            let found = statistic(&run, 0.95);
            inside += u32::from((found.mean - truth).abs() <= found.half_width);
            width += found.half_width / 400.0;
            assert!(found.deviation > 15.0, "the deviation is over frames");
        }
        // 95 % of 400, give or take three deviations.
        assert!((367..=393).contains(&inside), "{inside}");
        let expected = 1.968 * (36.0f64 / 12.0 / 300.0).sqrt();
        assert!((width / expected - 1.0).abs() < 0.05, "{width} {expected}");
    }

    #[test]
    fn steps_are_found_and_slopes_are_not() {
        let mut random = fastrand::Rng::with_seed(3);
        let mut noisy = |level: f64| level + random.f64() - 0.5;
        let steps: Vec<_> =
            (0..300).map(|i| noisy(if (100..200).contains(&i) { 250.0 } else { 170.0 })).collect();
        assert_eq!(level_changes(&steps, 0.05, 5), [100, 200]);
        let slope: Vec<_> = (0..300).map(|i| noisy(200.0 + 0.1 * f64::from(i))).collect();
        assert!(level_changes(&slope, 0.05, 5).is_empty());
        assert!(
            level_changes(&[], 0.05, 5).is_empty() && level_changes(&[1.0], 0.05, 0).is_empty()
        );
    }
}
