//! What the measurements say together.

use super::measure::RAY_SETS;
use crate::report::geometric_mean;
use crate::report::table::{Best, Cell, Table};
use crate::results::{Failure, Run};
use serde::Serialize;

/// The unit of tables for errors of distances: the largest relative error of rounding to `f32`.
pub(super) const ROUNDOFF: f64 = 1.0 / (1 << 24) as f64;

/// A kernel on a ray set of a scene.
#[derive(Clone, Debug, Serialize, PartialEq)]
pub(super) struct Row {
    pub(super) scene: String,
    pub(super) triangles: usize,
    pub(super) rays: String,
    pub(super) kernel: String,
    /// Kernels that differ in width alone; a line in plots.
    pub(super) family: String,
    /// The tree on which the kernel was fastest; Embree has several.
    pub(super) tree: String,
    /// Children a node, where the tree is ours.
    pub(super) width: Option<usize>,
    /// Nanoseconds a ray.
    pub(super) ns: f64,
    /// Nodes and triangles, where that is known.
    pub(super) bytes: Option<usize>,
    /// Rays whose answers were checked exactly.
    pub(super) checked: usize,
    /// Of these, how many got a wrong answer.
    pub(super) wrong: usize,
    /// Relative error of the distance: median, 99th percentile, largest.
    pub(super) t_median: Option<f64>,
    pub(super) t_p99: Option<f64>,
    pub(super) t_max: Option<f64>,
}

/// A kernel on a closed surface.
#[derive(Clone, Debug, Serialize, PartialEq)]
pub(super) struct Leak {
    pub(super) surface: String,
    pub(super) kernel: String,
    /// Rays from inside, aimed at corners and edges.
    pub(super) rays: usize,
    /// How many hit nothing.
    pub(super) leaks: usize,
}

/// A kernel over all scenes and surfaces.
#[derive(Clone, Debug, Serialize, PartialEq)]
pub(super) struct Summary {
    pub(super) kernel: String,
    pub(super) family: String,
    pub(super) leaks_per_million: Option<f64>,
    pub(super) wrong_per_million: f64,
    pub(super) bytes_per_triangle: Option<f64>,
    /// By ray set.
    pub(super) sets: Vec<SetSummary>,
}

/// A kernel on a ray set of all scenes: geometric means.
#[derive(Clone, Debug, Serialize, PartialEq)]
pub(super) struct SetSummary {
    pub(super) rays: String,
    /// Time a ray over that of the reference.
    pub(super) time: Option<f64>,
    /// 99th percentile of the relative error of the distance.
    pub(super) t_p99: Option<f64>,
}

/// Everything that a run found.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Study {
    /// Version of this file's layout.
    pub(super) schema: u32,
    pub(super) suite: &'static str,
    pub(super) run: Run,
    /// The kernel that times are relative to.
    pub(super) reference: String,
    pub(super) rows: Vec<Row>,
    pub(super) leaks: Vec<Leak>,
    pub(super) summaries: Vec<Summary>,
    pub(super) failures: Vec<Failure>,
}

fn unique<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut list: Vec<&str> = Vec::new();
    for name in names {
        if !list.contains(&name) {
            list.push(name);
        }
    }
    list
}

impl Study {
    pub(super) fn of(
        run: Run,
        reference: String,
        rows: Vec<Row>,
        leaks: Vec<Leak>,
        failures: Vec<Failure>,
    ) -> Self {
        let (schema, suite, summaries) = (1, "kernels", Vec::new());
        let mut study = Self { schema, suite, run, reference, rows, leaks, summaries, failures };
        let kernels = unique(study.rows.iter().map(|row| row.kernel.as_str()));
        study.summaries = kernels.into_iter().map(|kernel| study.summary(kernel)).collect();
        study
    }

    pub(super) fn scenes(&self) -> Vec<&str> {
        unique(self.rows.iter().map(|row| row.scene.as_str()))
    }

    /// The ray sets that some scene has.
    pub(super) fn ray_sets(&self) -> Vec<&'static str> {
        let mut sets = RAY_SETS.to_vec();
        sets.retain(|set| self.rows.iter().any(|row| row.rays == *set));
        sets
    }

    fn row(&self, scene: &str, rays: &str, kernel: &str) -> Option<&Row> {
        let same = |row: &&Row| row.scene == scene && row.rays == rays && row.kernel == kernel;
        self.rows.iter().find(same)
    }

    /// Time a ray over that of the reference on the same rays.
    pub(super) fn relative(&self, row: &Row) -> Option<f64> {
        self.row(&row.scene, &row.rays, &self.reference).map(|reference| row.ns / reference.ns)
    }

    fn leaks_per_million(&self, kernel: &str, surface: Option<&str>) -> Option<f64> {
        let here = || {
            self.leaks
                .iter()
                .filter(|leak| leak.kernel == kernel)
                .filter(|leak| surface.is_none_or(|surface| leak.surface == surface))
        };
        let rays: usize = here().map(|leak| leak.rays).sum();
        let leaks: usize = here().map(|leak| leak.leaks).sum();
        (rays > 0).then(|| leaks as f64 * 1e6 / rays as f64)
    }

    fn summary(&self, kernel: &str) -> Summary {
        let rows = || self.rows.iter().filter(|row| row.kernel == kernel);
        let set = |rays: &'static str| {
            let rows = || rows().filter(|row| row.rays == rays);
            SetSummary {
                rays: rays.to_owned(),
                time: geometric_mean(rows().filter_map(|row| self.relative(row))),
                // Where a kernel makes no error, the smallest that f64 shows.
                t_p99: geometric_mean(
                    rows().filter_map(|row| Some(row.t_p99?.max(f64::EPSILON / 2.0))),
                ),
            }
        };
        let (wrong, checked) =
            rows().fold((0, 0), |sum, row| (sum.0 + row.wrong, sum.1 + row.checked));
        Summary {
            kernel: kernel.to_owned(),
            family: rows().next().map(|row| row.family.clone()).unwrap_or_default(),
            leaks_per_million: self.leaks_per_million(kernel, None),
            wrong_per_million: wrong as f64 * 1e6 / (checked.max(1)) as f64,
            bytes_per_triangle: geometric_mean(
                rows().filter_map(|row| Some(row.bytes? as f64 / row.triangles as f64)),
            ),
            sets: self.ray_sets().into_iter().map(set).collect(),
        }
    }

    /// All kernels over all scenes.
    pub(super) fn summary_table(&self) -> Table {
        let sets = self.ray_sets();
        let mut table = Table::new("kernels").column("kernel", Best::Neither).column_with_digits(
            "leaks\n/ million",
            Best::Low,
            1,
        );
        for rays in &sets {
            table = table.column_with_digits(format!("{rays}\ntime"), Best::Low, 3);
        }
        for rays in &sets {
            table = table.column_with_digits(format!("{rays}\nt error"), Best::Low, 2);
        }
        table = table.column_with_digits("wrong\n/ million", Best::Low, 1).column_with_digits(
            "bytes\n/ triangle",
            Best::Low,
            1,
        );
        for summary in &self.summaries {
            let mut row: Vec<Cell> =
                vec![summary.kernel.clone().into(), summary.leaks_per_million.into()];
            row.extend(summary.sets.iter().map(|set| Cell::from(set.time)));
            let in_roundoffs = |set: &SetSummary| set.t_p99.map(|error| error / ROUNDOFF);
            row.extend(summary.sets.iter().map(|set| Cell::from(in_roundoffs(set))));
            row.push(summary.wrong_per_million.into());
            row.push(summary.bytes_per_triangle.into());
            table.push(row);
        }
        table
    }

    /// Leaks by surface.
    pub(super) fn leak_table(&self) -> Table {
        let surfaces = unique(self.leaks.iter().map(|leak| leak.surface.as_str()));
        let mut table = Table::new("leaks").column("kernel", Best::Neither);
        for surface in &surfaces {
            let name = surface.trim_start_matches("closed_").replace('_', "\n");
            table = table.column_with_digits(name, Best::Low, 1);
        }
        for kernel in unique(self.leaks.iter().map(|leak| leak.kernel.as_str())) {
            let mut row: Vec<Cell> = vec![kernel.into()];
            row.extend(surfaces.iter().map(|s| self.leaks_per_million(kernel, Some(s)).into()));
            table.push(row);
        }
        table
    }

    /// All ray sets of a scene.
    pub(super) fn scene_table(&self, scene: &str) -> Table {
        let mut table = Table::new(format!("kernels-{}", crate::report::slug(scene)))
            .column("rays", Best::Neither)
            .column("kernel", Best::Neither)
            .column("tree", Best::Neither)
            .column_with_digits("ray\nns", Best::Neither, 1)
            .column_with_digits("relative", Best::Neither, 3)
            .column_with_digits("t error\nmedian", Best::Neither, 2)
            .column_with_digits("99 %", Best::Neither, 2)
            .column_with_digits("largest", Best::Neither, 2)
            .column_with_digits("wrong\n/ million", Best::Neither, 1)
            .column("checked", Best::Neither)
            .column_with_digits("MiB", Best::Neither, 2);
        for row in self.rows.iter().filter(|row| row.scene == scene) {
            let error = |error: Option<f64>| Cell::from(error.map(|error| error / ROUNDOFF));
            table.push(vec![
                row.rays.clone().into(),
                row.kernel.clone().into(),
                row.tree.clone().into(),
                row.ns.into(),
                self.relative(row).into(),
                error(row.t_median),
                error(row.t_p99),
                error(row.t_max),
                (row.wrong as f64 * 1e6 / row.checked.max(1) as f64).into(),
                row.checked.into(),
                row.bytes.map(|bytes| bytes as f64 / f64::from(1 << 20)).into(),
            ]);
        }
        table
    }

    /// All tables with their titles.
    pub(super) fn tables(&self) -> Vec<(String, Table)> {
        let means = format!("All scenes: geometric means, times relative to {}", self.reference);
        let mut tables = vec![
            (means, self.summary_table()),
            ("Leaks in a million rays, by closed surface".into(), self.leak_table()),
        ];
        tables.extend(self.scenes().into_iter().map(|s| (s.to_owned(), self.scene_table(s))));
        tables.retain(|(_, table)| !table.is_empty());
        tables
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(scene: &str, kernel: &str, ns: f64, t_p99: f64) -> Row {
        Row {
            scene: scene.into(),
            triangles: 10,
            rays: "bounce".into(),
            kernel: kernel.into(),
            family: kernel.into(),
            tree: "high".into(),
            width: Some(8),
            ns,
            bytes: Some(400),
            checked: 1000,
            wrong: 1,
            t_median: Some(0.0),
            t_p99: Some(t_p99),
            t_max: Some(1.0),
        }
    }

    #[test]
    fn means_are_over_scenes_and_leaks_over_surfaces() {
        let rows = vec![
            row("a", "avx2", 10.0, 1e-6),
            row("a", "avx2_fast", 5.0, 0.0),
            row("b", "avx2", 10.0, 1e-8),
            row("b", "avx2_fast", 20.0, 0.0),
        ];
        let leak = |surface: &str, kernel: &str, leaks| Leak {
            surface: surface.into(),
            kernel: kernel.into(),
            rays: 1000,
            leaks,
        };
        let leaks =
            vec![leak("x", "avx2", 0), leak("x", "avx2_fast", 3), leak("y", "avx2_fast", 1)];
        let study = Study::of(Run::default(), "avx2".into(), rows, leaks, Vec::new());
        let [watertight, fast] = study.summaries.as_slice() else { panic!("two kernels") };
        assert_eq!(watertight.leaks_per_million, Some(0.0));
        assert_eq!(fast.leaks_per_million, Some(2000.0));
        assert_eq!(fast.wrong_per_million, 1000.0);
        assert_eq!(fast.bytes_per_triangle.map(f64::round), Some(40.0));
        assert!((fast.sets[0].time.unwrap() - 1.0).abs() < 1e-12);
        assert!((watertight.sets[0].t_p99.unwrap() / 1e-7 - 1.0).abs() < 1e-9);
        assert!((fast.sets[0].t_p99.unwrap() / (f64::EPSILON / 2.0) - 1.0).abs() < 1e-9);
        let leaks = study.leak_table().to_csv().unwrap();
        assert_eq!(leaks, "kernel,x,y\navx2,0,\navx2_fast,3000,1000\n");
        assert_eq!(study.tables().len(), 4);
    }
}
