//! What the rows of a results file say together: groups that may be compared, and ratios.

use super::break_even::Cost;
use crate::bench::engines::ROBUST;
use crate::results::{BuildRow, Results, Source, TraceRow};

/// Measurements of one scene at one number of threads in one run. Only these are compared: they
/// were taken alternately in one process.
#[derive(Clone, Debug)]
pub(crate) struct Group<'a> {
    pub(crate) run: usize,
    pub(crate) scene: &'a str,
    pub(crate) triangles: usize,
    pub(crate) threads: usize,
    pub(crate) builds: Vec<&'a BuildRow>,
    pub(crate) traces: Vec<&'a TraceRow>,
}

/// A tree and what traces it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Engine<'a> {
    pub(crate) source: Source,
    pub(crate) builder: &'a str,
    pub(crate) kernel: &'a str,
}

impl Engine<'_> {
    /// True where a peer traced its own structure.
    pub(crate) fn is_peers_own(&self) -> bool {
        is_peers(self.kernel)
    }

    /// The name in plots: a builder of ours, `embree:medium` for the peer as it comes, and
    /// `embree:medium tree` for its tree under our kernel.
    pub(crate) fn label(&self) -> String {
        match self.source {
            Source::Niwaki => self.builder.to_owned(),
            source if self.kernel.ends_with(ROBUST) => {
                format!("{}:{} robust", source.name(), self.builder)
            }
            source if self.is_peers_own() => format!("{}:{}", source.name(), self.builder),
            source => format!("{}:{} tree", source.name(), self.builder),
        }
    }
}

/// True for a peer's own kernel.
pub(crate) fn is_peers(kernel: &str) -> bool {
    kernel.starts_with(Source::Embree.name()) || kernel.starts_with(Source::Obvhs.name())
}

/// The groups in the order of their first row.
pub(crate) fn groups(results: &Results) -> Vec<Group<'_>> {
    fn find<'g, 'a>(
        groups: &'g mut Vec<Group<'a>>,
        (run, scene, triangles, threads): (usize, &'a str, usize, usize),
    ) -> &'g mut Group<'a> {
        let known = groups.iter().position(|g| {
            (g.run, g.scene, g.triangles, g.threads) == (run, scene, triangles, threads)
        });
        let at = known.unwrap_or_else(|| {
            let (builds, traces) = (Vec::new(), Vec::new());
            groups.push(Group { run, scene, triangles, threads, builds, traces });
            groups.len() - 1
        });
        &mut groups[at]
    }
    let mut groups = Vec::new();
    for row in results.builds() {
        find(&mut groups, (row.run, &row.scene, row.triangles, row.threads)).builds.push(row);
    }
    for row in results.traces() {
        find(&mut groups, (row.run, &row.scene, row.triangles, row.threads)).traces.push(row);
    }
    // Shards and merged files bring the scenes in any order; scene by scene reads best.
    let mut order: Vec<(&str, usize)> =
        results.scenes.iter().map(|s| (s.name.as_str(), s.triangles)).collect();
    for group in &groups {
        if !order.contains(&(group.scene, group.triangles)) {
            order.push((group.scene, group.triangles));
        }
    }
    groups.sort_by_key(|g| {
        let scene = order.iter().position(|&s| s == (g.scene, g.triangles));
        (scene, g.threads, g.run)
    });
    groups
}

impl<'a> Group<'a> {
    /// The build row of a builder.
    pub(crate) fn build(&self, source: Source, builder: &str) -> Option<&'a BuildRow> {
        self.builds.iter().find(|r| r.source == source && r.builder == builder).copied()
    }

    /// The names of the ray sets in the order measured.
    pub(crate) fn ray_sets(&self) -> Vec<&'a str> {
        let mut sets = Vec::new();
        for row in &self.traces {
            if !sets.contains(&row.rays.as_str()) {
                sets.push(&row.rays);
            }
        }
        sets
    }

    /// What was traced, in the order measured.
    pub(crate) fn engines(&self) -> Vec<Engine<'a>> {
        let mut engines = Vec::new();
        for row in &self.traces {
            let engine = Engine { source: row.source, builder: &row.builder, kernel: &row.kernel };
            if !engines.contains(&engine) {
                engines.push(engine);
            }
        }
        engines
    }

    /// Million rays per second.
    pub(crate) fn rate(&self, engine: Engine<'_>, rays: &str) -> Option<f64> {
        self.trace(engine, rays).map(|row| row.mrays_per_s)
    }

    /// The trace row.
    pub(crate) fn trace(&self, engine: Engine<'_>, rays: &str) -> Option<&'a TraceRow> {
        let same = |row: &&&TraceRow| {
            row.rays == rays
                && row.source == engine.source
                && row.builder == engine.builder
                && row.kernel == engine.kernel
        };
        self.traces.iter().find(same).copied()
    }

    /// Our kernel that plots and ratios use: the one that is fastest over all rows, of those that
    /// were asked for one ray at a time, as peers are. Of batches only where there is nothing else.
    pub(crate) fn our_kernel(&self) -> Option<&'a str> {
        let ours = || self.traces.iter().filter(|row| !is_peers(&row.kernel));
        let fewest = ours().map(|row| row.rays_per_call).min()?;
        let mut sums: Vec<(&str, f64, usize)> = Vec::new();
        for row in ours().filter(|row| row.rays_per_call == fewest) {
            match sums.iter_mut().find(|(kernel, ..)| *kernel == row.kernel) {
                Some((_, sum, count)) => (*sum, *count) = (*sum + row.mrays_per_s, *count + 1),
                None => sums.push((&row.kernel, row.mrays_per_s, 1)),
            }
        }
        sums.into_iter()
            .max_by(|a, b| (a.1 / a.2 as f64).total_cmp(&(b.1 / b.2 as f64)))
            .map(|(kernel, ..)| kernel)
    }

    /// What building costs once and a ray of an equal mix of the sets costs each, for what a
    /// user would run: our trees under our kernel and peers as they come, and peers' trees under
    /// our kernel.
    pub(crate) fn costs(&self) -> Vec<(Engine<'a>, Cost)> {
        let sets = self.ray_sets();
        let main_kernel = self.our_kernel();
        let cost = |engine: Engine<'a>| {
            let build = self.build(engine.source, engine.builder)?;
            let once = if engine.is_peers_own() {
                build.ms_commit_median?
            } else {
                build.ms_wide_median?
            };
            let mut microseconds = 0.0;
            for rays in &sets {
                microseconds += 1.0 / self.rate(engine, rays).filter(|&rate| rate > 0.0)?;
            }
            let per_ray = microseconds / sets.len() as f64 / 1000.0;
            (per_ray.is_finite() && once.is_finite()).then_some((engine, Cost { once, per_ray }))
        };
        self.engines()
            .into_iter()
            .filter(|engine| engine.is_peers_own() || Some(engine.kernel) == main_kernel)
            .filter_map(cost)
            .collect()
    }
}

/// The geometric mean; absent without numbers or where one is not positive.
pub(crate) fn geometric_mean(numbers: impl IntoIterator<Item = f64>) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0);
    for number in numbers {
        if !(number > 0.0 && number.is_finite()) {
            return None;
        }
        sum += number.ln();
        count += 1;
    }
    (count > 0).then(|| (sum / f64::from(count)).exp())
}

/// Which of several pairs of costs are on the Pareto front: no other is at most as high in both
/// and lower in one.
pub(crate) fn pareto_front(costs: &[(f64, f64)]) -> impl Iterator<Item = bool> + '_ {
    costs.iter().map(|a| !costs.iter().any(|b| b.0 <= a.0 && b.1 <= a.1 && b != a))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::tests::{build, trace};
    use crate::results::{Row, Run};

    #[test]
    fn groups_never_mix_runs_or_threads() {
        let mut other_run = build("a", "sweep", 1, 5.0);
        other_run.run = 1;
        let results = Results {
            runs: vec![Run::default(), Run::default()],
            rows: vec![
                Row::Build(build("b", "sweep", 1, 1.0)),
                Row::Build(build("a", "sweep", 2, 1.0)),
                Row::Build(build("a", "sweep", 1, 1.0)),
                Row::Build(other_run),
                Row::Trace(trace("a", "sweep", 2, 4.0)),
            ],
            ..Results::default()
        };
        let groups = groups(&results);
        let keys: Vec<_> = groups.iter().map(|g| (g.scene, g.threads, g.run)).collect();
        assert_eq!(keys, [("b", 1, 0), ("a", 1, 0), ("a", 1, 1), ("a", 2, 0)]);
        assert_eq!(groups[3].traces.len(), 1);
    }

    #[test]
    fn a_mix_costs_the_mean_of_the_times_per_ray() {
        let mut shadow = trace("a", "sweep", 1, 4.0);
        shadow.rays = "shadow".into();
        let results = Results {
            runs: vec![Run::default()],
            rows: vec![
                Row::Build(build("a", "sweep", 1, 10.0)),
                Row::Trace(trace("a", "sweep", 1, 1.0)),
                Row::Trace(shadow),
            ],
            ..Results::default()
        };
        let groups = groups(&results);
        let (engine, cost) = groups[0].costs()[0];
        assert_eq!(engine.label(), "sweep");
        // 20 ms to a traversable tree; 1 µs and 0.25 µs a ray.
        assert_eq!(cost.once, 20.0);
        assert!((cost.per_ray - 0.000_625).abs() < 1e-12);
    }

    #[test]
    fn means_are_geometric() {
        assert!((geometric_mean([1.0, 4.0]).unwrap() - 2.0).abs() < 1e-12);
        assert_eq!(geometric_mean([]), None);
        assert_eq!(geometric_mean([1.0, 0.0]), None);
    }
}
