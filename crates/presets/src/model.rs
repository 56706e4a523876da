//! What presets cost, as formulas of the number of triangles.

use crate::Preset;
use std::fmt::Write as _;
use std::sync::OnceLock;

/// Nanoseconds a triangle that a build takes, up to the traversable tree: `base` plus `doubling`
/// for each doubling of the triangles, n·(base + doubling·log₂ n) in all.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BuildCost {
    /// For one triangle.
    pub base: f64,
    /// For each doubling.
    pub doubling: f64,
    /// How far measured builds are from this: the root of the mean squared relative error.
    pub residual: f64,
}

/// Nanoseconds that a ray takes through the tree of a preset, relative to [`Preset::Fastest`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RayCost {
    /// The mean over scenes; below 1 for better trees.
    pub ratio: f64,
    /// By which factor, up or down, single scenes deviate: e to the standard deviation of the
    /// logarithms.
    pub spread: f64,
}

/// What each preset costs, fitted on measurements.
///
/// The time for `rays` rays is build + rays · ray, where a ray through the tree of
/// [`Preset::Fastest`] takes `ray.base + ray.doubling · log₂ n` nanoseconds and one through another
/// preset's tree its [`RayCost::ratio`] times as much. Both scale with threads, so that the choice
/// hardly depends on their number.
#[derive(Clone, Debug, PartialEq)]
pub struct CostModel {
    /// By preset, in the order of [`Preset::ALL`].
    pub builds: [BuildCost; 5],
    /// A ray through the tree of [`Preset::Fastest`]: here the time is that of a ray, not of a
    /// triangle.
    pub ray: BuildCost,
    /// By preset, in the order of [`Preset::ALL`].
    pub rays: [RayCost; 5],
}

/// Why a cost model could not be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A line is not `build|ray|ratio,preset,number,number,number`. Remedy: write the file by
    /// [`CostModel::to_csv`].
    #[error("line {line} of the cost model is `{text}`, not `kind,preset,number,number,number`")]
    BadLine {
        /// Counted from 1.
        line: usize,
        /// What it holds.
        text: String,
    },
    /// A line is missing. Remedy: as above.
    #[error("the cost model has no line `{kind},{preset},…`")]
    Missing {
        /// `build`, `ray` or `ratio`.
        kind: &'static str,
        /// The preset.
        preset: &'static str,
    },
}

impl CostModel {
    /// The model that comes with this crate: see `docs/presets.md` for how it was measured.
    #[must_use]
    pub fn measured() -> &'static Self {
        static MODEL: OnceLock<CostModel> = OnceLock::new();
        MODEL.get_or_init(|| {
            Self::from_csv(include_str!("cost-model.csv")).expect("a test reads this file")
        })
    }

    /// Milliseconds for building a traversable tree over `triangles` by `preset`.
    #[must_use]
    pub fn build_ms(&self, preset: Preset, triangles: usize) -> f64 {
        let n = triangles.max(1) as f64;
        let cost = &self.builds[preset as usize];
        n * (cost.base + cost.doubling * n.log2()).max(0.0) * 1e-6
    }

    /// Nanoseconds a ray through that tree.
    #[must_use]
    pub fn ray_ns(&self, preset: Preset, triangles: usize) -> f64 {
        let n = triangles.max(1) as f64;
        let reference = (self.ray.base + self.ray.doubling * n.log2()).max(1.0);
        reference * self.rays[preset as usize].ratio
    }

    /// Milliseconds for both.
    #[must_use]
    pub fn total_ms(&self, preset: Preset, rays: u64, triangles: usize) -> f64 {
        self.build_ms(preset, triangles) + rays as f64 * self.ray_ns(preset, triangles) * 1e-6
    }

    /// The preset with the least total; the faster builder among equals.
    #[must_use]
    pub fn best(&self, rays: u64, triangles: usize) -> Preset {
        let total = |preset| self.total_ms(preset, rays, triangles);
        Preset::ALL.into_iter().fold(Preset::Fastest, |best, preset| {
            if total(preset) < total(best) { preset } else { best }
        })
    }

    /// The model as text: lines `build,preset,base,doubling,residual`, one line
    /// `ray,fastest,base,doubling,residual`, and lines `ratio,preset,ratio,spread,0`.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let mut text = String::from("kind,preset,a,b,c\n");
        let mut line = |kind: &str, preset: Preset, [a, b, c]: [f64; 3]| {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{kind},{preset},{a:.4},{b:.4},{c:.4}");
        };
        for (preset, cost) in Preset::ALL.into_iter().zip(&self.builds) {
            line("build", preset, [cost.base, cost.doubling, cost.residual]);
        }
        line("ray", Preset::Fastest, [self.ray.base, self.ray.doubling, self.ray.residual]);
        for (preset, cost) in Preset::ALL.into_iter().zip(&self.rays) {
            line("ratio", preset, [cost.ratio, cost.spread, 0.0]);
        }
        text
    }

    /// Reads what [`CostModel::to_csv`] writes; lines that start with `#` or `kind` are comments.
    ///
    /// # Errors
    /// [`ModelError`] names the line that is bad or missing.
    pub fn from_csv(text: &str) -> Result<Self, ModelError> {
        let mut builds = [None; 5];
        let mut rays = [None; 5];
        let mut ray = None;
        for (number, text) in text.lines().enumerate() {
            if text.trim().is_empty() || text.starts_with('#') || text.starts_with("kind") {
                continue;
            }
            let bad = || ModelError::BadLine { line: number + 1, text: text.to_owned() };
            let fields: Vec<&str> = text.split(',').map(str::trim).collect();
            let [kind, preset, a, b, c] = fields[..] else { return Err(bad()) };
            let preset = Preset::by_name(preset).ok_or_else(bad)? as usize;
            let mut numbers = [0.0; 3];
            for (number, field) in numbers.iter_mut().zip([a, b, c]) {
                *number = field.parse().ok().filter(|n: &f64| n.is_finite()).ok_or_else(bad)?;
            }
            let [base, doubling, residual] = numbers;
            if kind == "ratio" && base <= 0.0 {
                return Err(bad());
            }
            match kind {
                "build" => builds[preset] = Some(BuildCost { base, doubling, residual }),
                "ray" => ray = Some(BuildCost { base, doubling, residual }),
                "ratio" => rays[preset] = Some(RayCost { ratio: base, spread: doubling }),
                _ => return Err(bad()),
            }
        }
        let mut model = Self {
            builds: Default::default(),
            ray: BuildCost::default(),
            rays: Default::default(),
        };
        let missing = |kind, preset: Preset| ModelError::Missing { kind, preset: preset.name() };
        for (i, preset) in Preset::ALL.into_iter().enumerate() {
            model.builds[i] = builds[i].ok_or_else(|| missing("build", preset))?;
            model.rays[i] = rays[i].ok_or_else(|| missing("ratio", preset))?;
        }
        model.ray = ray.ok_or_else(|| missing("ray", Preset::Fastest))?;
        Ok(model)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_measured_model_is_read_and_written() {
        let model = CostModel::from_csv(include_str!("cost-model.csv")).unwrap();
        assert_eq!(CostModel::from_csv(&model.to_csv()).unwrap(), model);
        assert_eq!(CostModel::measured(), &model);
    }

    #[test]
    fn more_rays_never_ask_for_a_worse_tree() {
        for triangles in [0, 1, 1000, 100_000, 10_000_000] {
            let chosen: Vec<f64> = (0..60)
                .map(|power| Preset::for_rays(1 << power, triangles))
                .map(|preset| CostModel::measured().ray_ns(preset, triangles))
                .collect();
            assert!(chosen.is_sorted_by(|a, b| a >= b), "{triangles}: {chosen:?}");
        }
        assert_eq!(Preset::for_rays(0, 1_000_000), Preset::Fastest);
        assert_eq!(Preset::for_rays(u64::MAX, 1_000_000), Preset::Best);
    }

    #[test]
    fn faults_of_a_file_are_named() {
        let whole = CostModel::measured().to_csv();
        let broken = whole.replace("build,fast,", "build,fats,");
        let error = CostModel::from_csv(&broken).unwrap_err();
        assert!(matches!(error, ModelError::BadLine { line: 3, .. }), "{error}");
        let short: String = whole.lines().take(4).map(|line| format!("{line}\n")).collect();
        let error = CostModel::from_csv(&short).unwrap_err();
        assert_eq!(error, ModelError::Missing { kind: "ratio", preset: "fastest" });
        assert!(CostModel::from_csv("build,fast,1,NaN,2").is_err());
    }
}
