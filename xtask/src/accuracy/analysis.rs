//! What the measured points say together.

use crate::report::table::{Best, Cell, Table};
use crate::report::{geometric_mean, pareto_front};
use crate::results::{Failure, Run};
use niwaki_presets::{CostModel, FitError, Preset, Sample};
use serde::Serialize;

/// Names the table of the cost model; the model itself is `cost-model.csv`.
pub(crate) const MODEL_TABLE: &str = "cost-model-terms";

/// A tree of one builder with one setting on one scene.
#[derive(Clone, Debug, Serialize, PartialEq)]
pub(crate) struct Point {
    pub(crate) scene: String,
    pub(crate) triangles: usize,
    pub(crate) family: String,
    /// Builder and setting.
    pub(crate) label: String,
    /// Built by us.
    pub(crate) ours: bool,
    /// From the mesh to the binary tree.
    pub(crate) build_ms: f64,
    /// From the mesh to the traversable 8-wide tree.
    pub(crate) once_ms: f64,
    /// Mean of the ray sets.
    pub(crate) ray_ns: f64,
    pub(crate) references: usize,
    pub(crate) peak_bytes: Option<usize>,
    pub(crate) sah: Option<f64>,
    pub(crate) epo: Option<f64>,
    pub(crate) lcv: Option<f64>,
    /// No other tree of the scene is at least as fast to build and to trace.
    pub(crate) on_front: bool,
}

/// How well metrics tell the time per ray on one scene.
#[derive(Clone, Debug, Serialize, PartialEq)]
pub(crate) struct Correlation {
    pub(crate) scene: String,
    /// Trees that it is over.
    pub(crate) trees: usize,
    pub(crate) sah: Option<f64>,
    pub(crate) epo: Option<f64>,
    pub(crate) lcv: Option<f64>,
    /// Of (1 − α)·SAH + α·EPO with the α that correlates best (Aila et al. 2013, section 4).
    pub(crate) combined: Option<f64>,
    pub(crate) alpha: Option<f64>,
}

/// Everything that a run found.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Study {
    /// Version of this file's layout.
    pub(crate) schema: u32,
    pub(crate) run: Run,
    pub(crate) points: Vec<Point>,
    pub(crate) correlations: Vec<Correlation>,
    pub(crate) failures: Vec<Failure>,
    /// Fitted where presets were measured on two scenes or more.
    #[serde(skip)]
    pub(crate) model: Option<Result<CostModel, FitError>>,
}

impl Study {
    pub(crate) fn of(run: Run, mut points: Vec<Point>, failures: Vec<Failure>) -> Self {
        mark_front(&mut points);
        let correlations = scenes(&points).map(|scene| correlate(scene, &points)).collect();
        let samples: Vec<Sample> = points.iter().filter_map(sample).collect();
        let model =
            (scenes(&points).count() >= 2 && !samples.is_empty()).then(|| CostModel::fit(&samples));
        Self { schema: 1, run, points, correlations, failures, model }
    }

    /// The points of a scene.
    pub(crate) fn of_scene<'a>(&'a self, scene: &'a str) -> impl Iterator<Item = &'a Point> {
        self.points.iter().filter(move |point| point.scene == scene)
    }

    /// The scenes in the order measured.
    pub(crate) fn scenes(&self) -> impl Iterator<Item = &str> {
        scenes(&self.points)
    }

    /// All tables with their titles.
    pub(crate) fn tables(&self) -> Vec<(String, Table)> {
        let mut tables: Vec<_> =
            self.scenes().map(|scene| (format!("\n{scene}"), self.scene_table(scene))).collect();
        if self.scenes().nth(1).is_some() {
            tables.push(("\nGeometric means over scenes, relative to sweep".into(), self.means()));
        }
        let title = "\nCorrelation of a metric with the time per ray (logarithms, Pearson)";
        tables.push((title.into(), self.correlation_table()));
        if let Some(Ok(model)) = &self.model {
            tables.push(("\nThe cost model of the presets".into(), self.model_table(model)));
        }
        tables
    }

    fn scene_table(&self, scene: &str) -> Table {
        let mut table = Table::new(format!("points-{}", crate::report::slug(scene)))
            .column("family", Best::Neither)
            .column("builder", Best::Neither)
            .column_with_digits("build\nms", Best::Low, 2)
            .column_with_digits("traversable\nms", Best::Low, 2)
            .column_with_digits("ray\nns", Best::Low, 1)
            .column("references", Best::Neither)
            .column("peak bytes\n/ triangle", Best::Low)
            .column_with_digits("SAH", Best::Low, 2)
            .column_with_digits("EPO", Best::Low, 2)
            .column_with_digits("LCV", Best::Low, 2)
            .column("front", Best::Neither);
        for p in self.of_scene(scene) {
            table.push(vec![
                p.family.clone().into(),
                p.label.clone().into(),
                p.build_ms.into(),
                p.once_ms.into(),
                p.ray_ns.into(),
                p.references.into(),
                p.peak_bytes.map(|bytes| (bytes as f64 / p.triangles as f64).round()).into(),
                p.sah.into(),
                p.epo.into(),
                p.lcv.into(),
                if p.on_front { "●" } else { "" }.into(),
            ]);
        }
        table
    }

    /// Each builder against `sweep`, over all scenes that have both.
    fn means(&self) -> Table {
        let mut table = Table::new("means")
            .column("family", Best::Neither)
            .column("builder", Best::Neither)
            .column_with_digits("traversable", Best::Low, 3)
            .column_with_digits("ray", Best::Low, 3)
            .column_with_digits("SAH", Best::Low, 3)
            .column_with_digits("EPO", Best::Low, 3)
            .column_with_digits("references\n/ triangle", Best::Low, 3)
            .column("scenes on\nthe front", Best::High);
        let mut seen: Vec<&str> = Vec::new();
        for point in &self.points {
            if seen.contains(&point.label.as_str()) {
                continue;
            }
            seen.push(&point.label);
            let pairs: Vec<(&Point, &Point)> = self
                .points
                .iter()
                .filter(|p| p.label == point.label)
                .filter_map(|p| Some((p, self.of_scene(&p.scene).find(|s| s.label == "sweep")?)))
                .collect();
            let mean = |value: fn(&Point) -> Option<f64>| {
                let ratios = pairs.iter().filter_map(|(p, s)| Some(value(p)? / value(s)?));
                Cell::from(geometric_mean(ratios))
            };
            let references = self.points.iter().filter(|p| p.label == point.label);
            table.push(vec![
                point.family.clone().into(),
                point.label.clone().into(),
                mean(|p| Some(p.once_ms)),
                mean(|p| Some(p.ray_ns)),
                mean(|p| p.sah),
                mean(|p| p.epo),
                geometric_mean(references.map(|p| p.references as f64 / p.triangles as f64)).into(),
                self.points.iter().filter(|p| p.label == point.label && p.on_front).count().into(),
            ]);
        }
        table
    }

    fn correlation_table(&self) -> Table {
        let mut table = Table::new("correlations")
            .column("scene", Best::Neither)
            .column("trees", Best::Neither)
            .column_with_digits("SAH", Best::High, 3)
            .column_with_digits("EPO", Best::High, 3)
            .column_with_digits("LCV", Best::High, 3)
            .column_with_digits("(1 − α) SAH\n+ α EPO", Best::High, 3)
            .column_with_digits("α", Best::Neither, 2);
        for c in &self.correlations {
            table.push(vec![
                c.scene.clone().into(),
                c.trees.into(),
                c.sah.into(),
                c.epo.into(),
                c.lcv.into(),
                c.combined.into(),
                c.alpha.into(),
            ]);
        }
        table
    }

    pub(crate) fn model_table(&self, model: &CostModel) -> Table {
        let mut table = Table::new(MODEL_TABLE)
            .column("preset", Best::Neither)
            .column_with_digits("build: ns/triangle\n+ per doubling", Best::Low, 2)
            .column_with_digits("· log₂ n", Best::Low, 2)
            .column_with_digits("error of\nthe fit", Best::Low, 3)
            .column_with_digits("ray ÷ fastest", Best::Low, 3)
            .column_with_digits("spread\n× or ÷", Best::Low, 3);
        for (i, preset) in Preset::ALL.into_iter().enumerate() {
            let (build, ray) = (&model.builds[i], &model.rays[i]);
            table.push(vec![
                preset.name().into(),
                build.base.into(),
                build.doubling.into(),
                build.residual.into(),
                ray.ratio.into(),
                ray.spread.into(),
            ]);
        }
        table
    }
}

fn scenes(points: &[Point]) -> impl Iterator<Item = &str> {
    let mut names: Vec<&str> = Vec::new();
    for point in points {
        if !names.contains(&point.scene.as_str()) {
            names.push(&point.scene);
        }
    }
    names.into_iter()
}

fn sample(point: &Point) -> Option<Sample> {
    let preset = Preset::by_name(&point.label)?;
    Some(Sample {
        scene: point.scene.clone(),
        preset,
        triangles: point.triangles,
        build_ms: point.once_ms,
        ray_ns: point.ray_ns,
    })
}

fn mark_front(points: &mut [Point]) {
    let all: Vec<String> = scenes(points).map(str::to_owned).collect();
    for scene in all {
        let here: Vec<usize> = (0..points.len()).filter(|&i| points[i].scene == scene).collect();
        let costs: Vec<(f64, f64)> =
            here.iter().map(|&i| (points[i].once_ms, points[i].ray_ns)).collect();
        for (i, on_front) in here.into_iter().zip(pareto_front(&costs)) {
            points[i].on_front = on_front;
        }
    }
}

/// Pearson's correlation of logarithms; nothing with fewer than three trees or without variation.
fn pearson(pairs: &[(f64, f64)]) -> Option<f64> {
    let logs: Vec<(f64, f64)> =
        pairs.iter().filter(|(x, y)| *x > 0.0 && *y > 0.0).map(|(x, y)| (x.ln(), y.ln())).collect();
    if logs.len() < 3 {
        return None;
    }
    let count = logs.len() as f64;
    let mean_x = logs.iter().map(|p| p.0).sum::<f64>() / count;
    let mean_y = logs.iter().map(|p| p.1).sum::<f64>() / count;
    let (mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0);
    for (x, y) in logs {
        let (dx, dy) = (x - mean_x, y - mean_y);
        xx += dx * dx;
        yy += dy * dy;
        xy += dx * dy;
    }
    (xx > 0.0 && yy > 0.0).then(|| xy / (xx * yy).sqrt())
}

fn correlate(scene: &str, points: &[Point]) -> Correlation {
    let here: Vec<&Point> = points.iter().filter(|p| p.scene == scene).collect();
    let with = |value: &dyn Fn(&Point) -> Option<f64>| {
        let pairs: Vec<_> = here.iter().filter_map(|p| Some((value(p)?, p.ray_ns))).collect();
        pearson(&pairs)
    };
    let mut combined: Option<(f64, f64)> = None;
    for step in 0..=100 {
        let alpha = f64::from(step) / 100.0;
        let value = |p: &Point| Some((1.0 - alpha) * p.sah? + alpha * p.epo?);
        if let Some(r) = with(&value)
            && combined.is_none_or(|(best, _)| r > best)
        {
            combined = Some((r, alpha));
        }
    }
    Correlation {
        scene: scene.to_owned(),
        trees: here.len(),
        sah: with(&|p| p.sah),
        epo: with(&|p| p.epo),
        lcv: with(&|p| p.lcv),
        combined: combined.map(|(r, _)| r),
        alpha: combined.map(|(_, alpha)| alpha),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(scene: &str, label: &str, once_ms: f64, ray_ns: f64, sah: f64) -> Point {
        Point {
            scene: scene.into(),
            triangles: 1000,
            family: "f".into(),
            label: label.into(),
            ours: true,
            build_ms: once_ms,
            once_ms,
            ray_ns,
            references: 1000,
            peak_bytes: None,
            sah: Some(sah),
            epo: Some(1.0),
            lcv: None,
            on_front: false,
        }
    }

    #[test]
    fn the_front_is_what_nothing_beats_in_both() {
        let points = vec![
            point("a", "sweep", 3.0, 1.0, 10.0),
            point("a", "fast", 1.0, 3.0, 30.0),
            point("a", "poor", 2.0, 3.0, 30.0),
            point("b", "poor", 2.0, 3.0, 30.0),
        ];
        let study = Study::of(Run::default(), points, Vec::new());
        let front: Vec<bool> = study.points.iter().map(|p| p.on_front).collect();
        assert_eq!(front, [true, true, false, true]);
        assert_eq!(study.tables().len(), 4);
    }

    #[test]
    fn a_metric_that_is_proportional_correlates_fully() {
        let points = (1..6).map(|i| {
            let ray = f64::from(i);
            point("a", &format!("{i}"), 1.0, ray, 7.0 * ray * ray)
        });
        let study = Study::of(Run::default(), points.collect(), Vec::new());
        let c = &study.correlations[0];
        assert!((c.sah.unwrap() - 1.0).abs() < 1e-12 && c.epo.is_none() && c.lcv.is_none());
        assert_eq!(c.alpha, Some(0.0));
        assert!(study.model.is_none());
    }
}
