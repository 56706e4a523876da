//! Fitting a cost model to measurements.

use crate::{BuildCost, CostModel, Preset, RayCost};

/// One preset measured on one scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// The scene's name: samples of one scene are compared with each other.
    pub scene: String,
    /// Which preset.
    pub preset: Preset,
    /// Triangles of the scene.
    pub triangles: usize,
    /// Milliseconds from the mesh to the traversable tree.
    pub build_ms: f64,
    /// Nanoseconds a ray through it.
    pub ray_ns: f64,
}

/// Why measurements do not make a model.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// A preset was measured on fewer than two scenes that [`Preset::Fastest`] was measured on
    /// too. Remedy: measure all presets on the same scenes, of different sizes.
    #[error(
        "preset {preset} was measured on {scenes} scenes together with `fastest`; 2 are needed"
    )]
    TooFewScenes {
        /// The preset's name.
        preset: &'static str,
        /// How many scenes.
        scenes: usize,
    },
    /// A measurement is not a positive number. Remedy: leave it out.
    #[error("scene {scene}, preset {preset}: a time is not a positive number")]
    BadTime {
        /// The scene.
        scene: String,
        /// The preset's name.
        preset: &'static str,
    },
}

impl CostModel {
    /// Fits a model to measurements.
    ///
    /// Build times a triangle and times a ray are lines in log₂ n by least squares of the
    /// *relative* error, so that small scenes count as much as large ones. Neither base nor slope
    /// is negative: scenes of almost one size would otherwise give steep lines, and small inputs
    /// builds that take no time. The ratio of a preset is the geometric mean, over scenes, of its time a ray to that
    /// of [`Preset::Fastest`].
    ///
    /// # Errors
    /// [`FitError`] where there is too little or broken data.
    pub fn fit(samples: &[Sample]) -> Result<Self, FitError> {
        for s in samples {
            let good = |t: f64| t > 0.0 && t.is_finite();
            if !good(s.build_ms) || !good(s.ray_ns) || s.triangles == 0 {
                let (scene, preset) = (s.scene.clone(), s.preset.name());
                return Err(FitError::BadTime { scene, preset });
            }
        }
        let of = |preset: Preset| samples.iter().filter(move |s| s.preset == preset);
        let fastest = |scene: &str| of(Preset::Fastest).find(|s| s.scene == scene);
        let mut builds = [BuildCost::default(); 5];
        let mut rays = [RayCost::default(); 5];
        for (i, preset) in Preset::ALL.into_iter().enumerate() {
            let logs: Vec<f64> = of(preset)
                .filter_map(|s| Some((s.ray_ns / fastest(&s.scene)?.ray_ns).ln()))
                .collect();
            if logs.len() < 2 {
                let (preset, scenes) = (preset.name(), logs.len());
                return Err(FitError::TooFewScenes { preset, scenes });
            }
            let count = logs.len() as f64;
            let mean = logs.iter().sum::<f64>() / count;
            let variance = logs.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / count;
            rays[i] = RayCost { ratio: mean.exp(), spread: variance.sqrt().exp() };
            builds[i] = line(of(preset).map(|s| {
                let n = s.triangles as f64;
                (n.log2(), s.build_ms * 1e6 / n)
            }));
        }
        let ray = line(of(Preset::Fastest).map(|s| ((s.triangles as f64).log2(), s.ray_ns)));
        Ok(Self { builds, ray, rays })
    }
}

/// The line y = base + doubling·x with the least squared relative error, neither of them negative.
fn line(points: impl Iterator<Item = (f64, f64)> + Clone) -> BuildCost {
    // Minimises Σ (a/y + b·x/y − 1)².
    let (mut uu, mut uv, mut vv, mut u1, mut v1) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (x, y) in points.clone() {
        let (u, v) = (1.0 / y, x / y);
        uu += u * u;
        uv += u * v;
        vv += v * v;
        u1 += u;
        v1 += v;
    }
    let determinant = uu * vv - uv * uv;
    let mut doubling =
        if determinant > 1e-12 * uu * vv { (uu * v1 - uv * u1) / determinant } else { 0.0 };
    let mut base = (u1 - doubling * uv) / uu;
    // The error is convex: where the least is out of bounds, the least within lies on the border.
    if doubling < 0.0 {
        (base, doubling) = (u1 / uu, 0.0);
    } else if base < 0.0 {
        (base, doubling) = (0.0, v1 / vv);
    }
    let (mut squares, mut count) = (0.0, 0.0);
    for (x, y) in points {
        let error = (base + doubling * x) / y - 1.0;
        squares += error * error;
        count += 1.0;
    }
    BuildCost { base, doubling, residual: f64::sqrt(squares / count) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples() -> Vec<Sample> {
        let mut samples = Vec::new();
        for (scene, triangles) in [("a", 1 << 12), ("b", 1 << 16), ("c", 1 << 20)] {
            for (i, preset) in Preset::ALL.into_iter().enumerate() {
                let (n, log) = (f64::from(triangles), f64::from(triangles).log2());
                samples.push(Sample {
                    scene: scene.into(),
                    preset,
                    triangles: triangles as usize,
                    build_ms: n * (20.0 * (i + 1) as f64 + 3.0 * log) * 1e-6,
                    ray_ns: (100.0 + 10.0 * log) * 0.8_f64.powf(i as f64),
                });
            }
        }
        samples
    }

    #[test]
    fn finds_the_formula_behind_the_data() {
        let model = CostModel::fit(&samples()).unwrap();
        for (i, (build, ray)) in model.builds.iter().zip(&model.rays).enumerate() {
            assert!((build.base - 20.0 * (i + 1) as f64).abs() < 1e-6, "{build:?}");
            assert!((build.doubling - 3.0).abs() < 1e-6 && build.residual < 1e-9);
            assert!((ray.ratio - 0.8_f64.powf(i as f64)).abs() < 1e-12);
            assert!((ray.spread - 1.0).abs() < 1e-9);
        }
        assert!((model.ray.base - 100.0).abs() < 1e-6 && (model.ray.doubling - 10.0).abs() < 1e-6);
        let s = &samples()[7];
        assert!((model.build_ms(s.preset, s.triangles) / s.build_ms - 1.0).abs() < 1e-9);
        assert!((model.ray_ns(s.preset, s.triangles) / s.ray_ns - 1.0).abs() < 1e-9);
    }

    #[test]
    fn scenes_of_almost_one_size_give_no_steep_lines() {
        for (first, second) in [(1.0, 1.1), (1.1, 1.0)] {
            let y = [120.0 * first, 120.0 * second];
            let line = line([(2000_f64.log2(), y[0]), (2010_f64.log2(), y[1])].into_iter());
            assert!(line.base >= 0.0 && line.doubling >= 0.0, "{line:?}");
            let far = line.base + line.doubling * 2_000_000_f64.log2();
            assert!(far < 2.0 * y[0].max(y[1]), "{line:?}");
            assert!(line.residual < 0.06, "{line:?}");
        }
    }

    #[test]
    fn refuses_too_little_or_broken_data() {
        let mut few = samples();
        few.retain(|s| s.preset != Preset::High || s.scene == "a");
        let expected = FitError::TooFewScenes { preset: "high", scenes: 1 };
        assert_eq!(CostModel::fit(&few), Err(expected));
        let mut bad = samples();
        bad[3].ray_ns = 0.0;
        assert!(matches!(CostModel::fit(&bad), Err(FitError::BadTime { .. })));
    }
}
