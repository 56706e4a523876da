//! Published values beside measured ones.

use super::measure::SceneResult;
#[cfg(test)]
use super::measure::Tree;
use super::names::{Standing, candidates};
use super::published::{AVERAGE, Item, Published, Value};
use serde::Serialize;

/// A published value and what was measured for it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Comparison {
    pub(crate) item: Item,
    /// The published scene.
    pub(crate) scene: String,
    /// What was measured in its place.
    pub(crate) measured_on: Option<String>,
    pub(crate) standing: Option<Standing>,
    /// The published builder.
    pub(crate) builder: String,
    /// Ours.
    pub(crate) ours: String,
    /// Whether orderings are checked with this builder of ours.
    pub(crate) leading: bool,
    pub(crate) quantity: String,
    pub(crate) unit: String,
    /// In that unit.
    pub(crate) published: f64,
    /// Relative to sweep where the item has a sweep, as a share of one where it is in percent, and
    /// the value itself otherwise.
    pub(crate) published_relative: f64,
    /// In that unit.
    pub(crate) measured: Option<f64>,
    /// Like `published_relative`.
    pub(crate) measured_relative: Option<f64>,
}

impl Comparison {
    /// A number that is low where the builder is good: the published one and the measured one.
    pub(crate) fn costs(&self) -> Option<(f64, f64)> {
        let measured = self.measured_relative?;
        Some(match self.quantity.as_str() {
            "performance" => (1.0 / self.published_relative, 1.0 / measured),
            // Ranks are published, speedups measured.
            "scaling" => (self.published_relative, 1.0 / measured),
            _ => (self.published_relative, measured),
        })
    }
}

/// A frame's relative time is printed in brackets beside the time that it follows from.
fn is_repeated(value: &Value) -> bool {
    value.quantity == "frame relative"
}

/// All comparisons, in the order of the published values.
pub(crate) fn compare(published: &Published, results: &[SceneResult]) -> Vec<Comparison> {
    let mut comparisons: Vec<Comparison> = Vec::new();
    // Averages follow from the others.
    let (averages, items): (Vec<_>, Vec<_>) =
        Item::ALL.into_iter().partition(|item| *item == Item::IvFigure7);
    for item in items {
        for value in published.of(item).filter(|value| !is_repeated(value)) {
            let found = results.iter().find_map(|result| {
                let (_, standing) =
                    result.stands_for.iter().find(|(name, _)| *name == value.scene)?;
                Some((result, *standing))
            });
            for ours in ours(value) {
                let measured = found.and_then(|(result, _)| measured(value, ours, result));
                let baseline = item.baseline();
                let relative = |value: f64, of: Option<f64>| match baseline {
                    Some(_) => of.map(|of| value / of),
                    None => Some(value),
                };
                let scale = if value.unit == "percent" { 0.01 } else { 1.0 };
                let published_base = baseline.and_then(|builder| {
                    published.get(item, &value.scene, builder, &value.quantity)
                });
                let measured_base = baseline.and_then(|builder| {
                    let base = Value { builder: builder.to_owned(), ..value.clone() };
                    let first = candidates(builder).first()?;
                    found.and_then(|(result, _)| self::measured(&base, first, result))
                });
                comparisons.push(Comparison {
                    item,
                    scene: value.scene.clone(),
                    measured_on: found.map(|(result, _)| result.scene.clone()),
                    standing: found.map(|(_, standing)| standing),
                    builder: value.builder.clone(),
                    ours: ours.to_owned(),
                    leading: false,
                    quantity: value.quantity.clone(),
                    unit: value.unit.clone(),
                    published: value.value,
                    published_relative: relative(value.value, published_base)
                        .map_or(value.value, |x| if baseline.is_some() { x } else { x * scale }),
                    measured,
                    measured_relative: measured
                        .and_then(|x| relative(x, measured_base))
                        .map(|x| if baseline.is_some() { x } else { x * scale }),
                });
            }
        }
    }
    for item in averages {
        let rows = published.of(item).flat_map(|v| ours(v).map(move |ours| (v, ours)));
        let rows: Vec<_> = rows.map(|(v, ours)| average(v, ours, &comparisons)).collect();
        comparisons.extend(rows);
    }
    comparisons.sort_by_key(|c| c.item);
    mark_leading(&mut comparisons);
    comparisons
}

/// Our builders for a value.
fn ours(value: &Value) -> impl Iterator<Item = &'static str> + use<> {
    // Steps and shares cannot be had of a peer, nor its scaling without its own scheduler.
    let own = matches!(value.item, Item::IvFigure6 | Item::VTable4 | Item::VFigure4);
    candidates(&value.builder).iter().copied().filter(move |name| !(own && name.contains(':')))
}

/// Measured in the unit of the published value.
fn measured(value: &Value, ours: &str, result: &SceneResult) -> Option<f64> {
    let tree = || result.trees.iter().find(|tree| tree.builder == ours);
    match (value.item, value.quantity.as_str()) {
        (Item::IvFigure6, step) => {
            let ms = step_ms(result, ours, step)?;
            // Both bars are relative to the whole build without pruning.
            Some(ms / total_ms(result, "bonsai")? * 100.0)
        }
        (Item::VTable4, "split time") => step_ms(result, ours, SPLITTING),
        (Item::VTable4, "split share") => {
            Some(step_ms(result, ours, SPLITTING)? / total_ms(result, ours)? * 100.0)
        }
        (Item::VFigure4, "scaling") => speedups(result, ours).last().map(|&(_, speedup)| speedup),
        (Item::VTable2, "frame") => tree()?.ns_per_ray_binary,
        (_, "build") => Some(tree()?.build_ms),
        // Rays a time, as a percentage once it is relative.
        (_, "performance") => Some(1.0 / tree()?.ns_per_ray?),
        (_, "frame") => tree()?.ns_per_ray,
        (Item::IvFigure8, "sah") => tree()?.sah_iv,
        (_, "sah") => tree()?.sah_v,
        (_, "added references") => Some(tree()?.added_references * 100.0),
        _ => None,
    }
}

/// The step of `bonsai_s` that splits while it selects groups.
const SPLITTING: &str = "selection";

fn step_ms(result: &SceneResult, builder: &str, step: &str) -> Option<f64> {
    result.steps.iter().find(|s| s.builder == builder && s.step == step).map(|s| s.ms)
}

/// The sum of a builder's steps.
pub(crate) fn total_ms(result: &SceneResult, builder: &str) -> Option<f64> {
    let steps = || result.steps.iter().filter(|s| s.builder == builder);
    steps().next()?;
    Some(steps().map(|s| s.ms).sum())
}

/// Numbers of threads, and how many times as fast as on one.
pub(crate) fn speedups(result: &SceneResult, builder: &str) -> Vec<(usize, f64)> {
    let of = || result.scaling.iter().filter(|s| s.builder == builder);
    let Some(one) = of().find(|s| s.threads == 1) else { return Vec::new() };
    of().map(|s| (s.threads, one.build_ms / s.build_ms)).collect()
}

/// An average of figure 7 over the scenes of figures 5 and 8 that were measured.
fn average(value: &Value, ours: &str, comparisons: &[Comparison]) -> Comparison {
    let behind = || rows_behind(value, ours, comparisons).filter(|c| c.measured.is_some());
    let measured = mean(behind().filter_map(|c| c.measured_relative));
    Comparison {
        item: value.item,
        scene: AVERAGE.to_owned(),
        measured_on: None,
        // As far from the published scenes as the farthest.
        standing: behind().filter_map(|c| c.standing).max(),
        builder: value.builder.clone(),
        ours: ours.to_owned(),
        leading: false,
        quantity: value.quantity.clone(),
        unit: value.unit.clone(),
        published: value.value,
        published_relative: value.value / 100.0,
        measured: measured.map(|x| x * 100.0),
        measured_relative: measured,
    }
}

/// The rows of figures 5 and 8 that an average of figure 7 is over.
fn rows_behind<'a>(
    value: &'a Value,
    ours: &'a str,
    comparisons: &'a [Comparison],
) -> impl Iterator<Item = &'a Comparison> {
    comparisons.iter().filter(move |c| {
        matches!(c.item, Item::IvFigure5 | Item::IvFigure8)
            && c.quantity == value.quantity
            && c.builder == value.builder
            && c.ours == ours
    })
}

/// The arithmetic mean, as figure 7 of paper IV has it of builds and costs.
pub(crate) fn mean(numbers: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = numbers.fold((0.0, 0.0), |(sum, count), x| (sum + x, count + 1.0));
    (count > 0.0).then_some(sum / count)
}

/// Marks the first of our builders that was measured for each published one.
fn mark_leading(comparisons: &mut [Comparison]) {
    for at in 0..comparisons.len() {
        let c = &comparisons[at];
        let is_first = !comparisons[..at].iter().any(|other| {
            other.leading
                && (other.item, &other.scene, &other.builder, &other.quantity)
                    == (c.item, &c.scene, &c.builder, &c.quantity)
        });
        comparisons[at].leading = comparisons[at].measured_relative.is_some() && is_first;
    }
}

/// A tree with these numbers and no other.
#[cfg(test)]
pub(crate) fn tree(builder: &str, build_ms: f64, ns_per_ray: f64, sah: f64) -> Tree {
    Tree {
        builder: builder.into(),
        build_ms,
        sah_iv: Some(sah),
        sah_v: Some(sah / 2.0),
        added_references: 0.0,
        ns_per_ray: Some(ns_per_ray),
        ns_per_ray_binary: None,
    }
}

/// A result of these trees.
#[cfg(test)]
pub(crate) fn result(scene: &str, standing: Standing, trees: Vec<Tree>) -> SceneResult {
    SceneResult {
        stands_for: vec![(scene.into(), standing)],
        scene: crate::thesis::names::plain(scene),
        triangles: 1000,
        threads: 1,
        trees,
        steps: Vec::new(),
        scaling: Vec::new(),
        info: crate::results::SceneInfo::default(),
        rows: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thesis::measure::{Scaling, Step};

    fn find<'a>(
        comparisons: &'a [Comparison],
        item: Item,
        scene: &str,
        ours: &str,
        quantity: &str,
    ) -> &'a Comparison {
        let same = |c: &&Comparison| {
            c.item == item && c.scene == scene && c.ours == ours && c.quantity == quantity
        };
        comparisons.iter().find(same).unwrap()
    }

    #[test]
    fn values_are_relative_to_sweep_of_their_own_table() {
        let published = Published::read().unwrap();
        let trees = vec![tree("sweep", 100.0, 50.0, 80.0), tree("bonsai_p", 25.0, 40.0, 76.0)];
        let results = [result("Sponza", Standing::Same, trees)];
        let all = compare(&published, &results);
        let c = find(&all, Item::IvFigure5, "Sponza", "bonsai_p", "build");
        assert!((c.published_relative - 13.4 / 51.4).abs() < 1e-12);
        assert_eq!(c.measured_relative, Some(0.25));
        let c = find(&all, Item::IvFigure5, "Sponza", "bonsai_p", "performance");
        assert_eq!((c.published_relative, c.measured_relative), (1.05, Some(1.25)));
        let c = find(&all, Item::VTable1, "Sponza", "bonsai_p", "frame");
        assert!((c.published_relative - 1137.0 / 1210.0).abs() < 1e-12);
        assert_eq!(c.measured_relative, Some(0.8));
        let c = find(&all, Item::VTable5, "Sponza", "bonsai_p", "sah");
        assert_eq!(c.measured, Some(38.0));
        // With one scene the averages are its values.
        let c = find(&all, Item::IvFigure7, AVERAGE, "bonsai_p", "sah");
        assert_eq!((c.published_relative, c.measured_relative), (1.01, Some(0.95)));
        // Not measured: another builder, another scene.
        let c = find(&all, Item::IvFigure5, "Sponza", "binned", "build");
        assert!(c.measured.is_none() && !c.leading && c.measured_on.is_some());
        let c = find(&all, Item::IvFigure5, "Sala", "sweep", "build");
        assert!(c.measured.is_none() && c.measured_on.is_none());
    }

    #[test]
    fn a_builder_that_is_not_there_is_led_by_its_next_candidate() {
        let published = Published::read().unwrap();
        let trees = vec![tree("sweep", 9.0, 5.0, 8.0), tree("embree:medium", 3.0, 4.0, 7.0)];
        let all = compare(&published, &[result("Sponza", Standing::Same, trees)]);
        let leads = |ours| find(&all, Item::VTable1, "Sponza", ours, "build").leading;
        assert!(leads("embree:medium") && !leads("binned"));
    }

    #[test]
    fn steps_and_scaling_are_read() {
        let published = Published::read().unwrap();
        let mut miguel = result("San Miguel", Standing::Version, Vec::new());
        let step =
            |builder: &str, step: &str, ms| Step { builder: builder.into(), step: step.into(), ms };
        miguel.steps = vec![
            step("bonsai", "selection", 95.0),
            step("bonsai", "top tree", 5.0),
            step("bonsai_p", "top tree", 8.0),
            step("bonsai_s", "selection", 30.0),
            step("bonsai_s", "top tree", 10.0),
        ];
        let mut plant = result("Power Plant", Standing::StandIn, Vec::new());
        let scaled = |builder: &str, threads, build_ms| Scaling {
            builder: builder.into(),
            threads,
            build_ms,
        };
        plant.scaling = vec![scaled("binned", 1, 12.0), scaled("binned", 2, 8.0)];
        let all = compare(&published, &[miguel, plant]);
        let top = |ours| find(&all, Item::IvFigure6, "San Miguel", ours, "top tree");
        assert_eq!(top("bonsai").measured_relative, Some(0.05));
        assert_eq!(top("bonsai_p").measured_relative, Some(0.08), "of the build without pruning");
        let share = find(&all, Item::VTable4, "San Miguel", "bonsai_s", "split share");
        assert_eq!((share.published_relative, share.measured_relative), (0.3, Some(0.75)));
        let scaling = find(&all, Item::VFigure4, "Power Plant", "binned", "scaling");
        assert_eq!(scaling.measured_relative, Some(1.5));
        assert_eq!(scaling.costs(), Some((1.0, 1.0 / 1.5)));
    }
}
