//! Which structure is best when N rays will be traced.

/// A structure that costs `once` milliseconds to build and `per_ray` milliseconds a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cost {
    /// Milliseconds before the first ray.
    pub(crate) once: f64,
    /// Milliseconds a ray.
    pub(crate) per_ray: f64,
}

impl Cost {
    /// Milliseconds to build and trace `rays`.
    pub(crate) fn total(&self, rays: f64) -> f64 {
        self.once + self.per_ray * rays
    }
}

/// A range of ray counts in which one structure has the lowest total time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Interval {
    /// Position in the list of costs.
    pub(crate) best: usize,
    /// From so many rays on.
    pub(crate) from: f64,
    /// Up to so many rays; ∞ in the last interval.
    pub(crate) to: f64,
}

/// The lower envelope of the total times over all numbers of rays from 0 on: which cost is
/// lowest where, in ascending order. Empty without costs.
pub(crate) fn lower_envelope(costs: &[Cost]) -> Vec<Interval> {
    let by_cost = |a: &usize, b: &usize| {
        let (a, b) = (&costs[*a], &costs[*b]);
        a.once.total_cmp(&b.once).then(a.per_ray.total_cmp(&b.per_ray))
    };
    let Some(mut best) = (0..costs.len()).min_by(by_cost) else { return Vec::new() };
    let mut intervals = Vec::new();
    let mut from = 0.0;
    loop {
        // Only a flatter line can overtake, and the first to do so is next; where several meet
        // the best at the same count, the flattest goes on as the best.
        let overtake = |i: usize| {
            let gain = costs[best].per_ray - costs[i].per_ray;
            (gain > 0.0).then(|| ((costs[i].once - costs[best].once) / gain, costs[i].per_ray, i))
        };
        let next = (0..costs.len())
            .filter_map(overtake)
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let Some((to, _, successor)) = next else {
            intervals.push(Interval { best, from, to: f64::INFINITY });
            return intervals;
        };
        if to > from {
            intervals.push(Interval { best, from, to });
        }
        (best, from) = (successor, to.max(from));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn brute_force(costs: &[Cost], rays: f64) -> f64 {
        costs.iter().map(|c| c.total(rays)).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn fast_builds_win_first_and_fast_traces_last() {
        let cost = |once, per_ray| Cost { once, per_ray };
        // Crossings: (0, 1) at 10 / 1 = 10; (1, 2) at 90 / 0.5 = 180; 3 is never best.
        let costs = [cost(10.0, 2.0), cost(20.0, 1.0), cost(110.0, 0.5), cost(60.0, 0.99)];
        assert_eq!(
            lower_envelope(&costs),
            [
                Interval { best: 0, from: 0.0, to: 10.0 },
                Interval { best: 1, from: 10.0, to: 180.0 },
                Interval { best: 2, from: 180.0, to: f64::INFINITY },
            ]
        );
        assert_eq!(lower_envelope(&[]), []);
        assert_eq!(lower_envelope(&costs[..1]).len(), 1);
    }

    #[test]
    fn equal_structures_and_common_crossings_give_one_interval_each() {
        let cost = |once, per_ray| Cost { once, per_ray };
        assert_eq!(lower_envelope(&[cost(1.0, 1.0); 3]).len(), 1);
        // All three meet at 10 rays.
        let costs = [cost(10.0, 2.0), cost(20.0, 1.0), cost(25.0, 0.5)];
        let intervals = lower_envelope(&costs);
        assert_eq!(intervals.iter().map(|i| i.best).collect::<Vec<_>>(), [0, 2]);
    }

    #[test]
    fn the_envelope_is_the_minimum_everywhere() {
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            f64::from(u32::try_from(state >> 33).unwrap()) / f64::from(1u32 << 31)
        };
        for _ in 0..200 {
            let costs: Vec<Cost> =
                (0..12).map(|_| Cost { once: random() * 100.0, per_ray: random() }).collect();
            let intervals = lower_envelope(&costs);
            assert_eq!(intervals[0].from, 0.0);
            assert!(intervals.windows(2).all(|w| w[0].to == w[1].from && w[0].from < w[0].to));
            for interval in intervals {
                let inside = if interval.to.is_finite() {
                    f64::midpoint(interval.from, interval.to)
                } else {
                    interval.from * 2.0 + 1.0
                };
                let best = brute_force(&costs, inside);
                assert!((costs[interval.best].total(inside) - best).abs() <= 1e-9 * best);
            }
        }
    }
}
