//! Ours against Embree, each at its best: what a user of either would get.

use super::model::{Group, geometric_mean, is_peers};
use super::table::{Best, Cell, Table};
use crate::bench::engines::ROBUST;
use crate::results::{Source, TraceRow};

/// The fastest of our trees under one of our kernels, and Embree's better quality in one mode, on
/// the same rays in turns.
#[derive(Clone, Debug)]
struct Duel<'a> {
    run: usize,
    scene: &'a str,
    triangles: usize,
    threads: usize,
    robust: bool,
    ours: &'a TraceRow,
    theirs: &'a TraceRow,
}

impl Duel<'_> {
    fn ratio(&self) -> f64 {
        self.ours.mrays_per_s / self.theirs.mrays_per_s
    }

    const fn against(&self) -> &'static str {
        if self.robust { "Embree robust" } else { "Embree" }
    }
}

/// The fastest of some rows on a ray set.
fn fastest<'a>(
    group: &Group<'a>,
    rays: &str,
    source: Source,
    kernel: &str,
) -> Option<&'a TraceRow> {
    let is_asked =
        |row: &&&TraceRow| row.rays == rays && row.source == source && row.kernel == kernel;
    let all = group.traces.iter().filter(is_asked).filter(|row| row.mrays_per_s > 0.0);
    all.copied().max_by(|a, b| a.mrays_per_s.total_cmp(&b.mrays_per_s))
}

fn duels<'a>(groups: &[Group<'a>]) -> Vec<Duel<'a>> {
    let mut duels = Vec::new();
    for group in groups {
        for kernel in kernels(group) {
            // Fast against fast. Watertight against robust, and against fast as well: each as its
            // user gets it who asks for nothing.
            let is_fast = kernel.trim_end_matches("_batch").ends_with("_fast");
            let modes: &[bool] = if is_fast { &[false] } else { &[true, false] };
            for &robust in modes {
                let embree = Source::Embree.name().to_owned() + if robust { ROBUST } else { "" };
                duels.extend(group.ray_sets().into_iter().filter_map(|rays| {
                    Some(Duel {
                        run: group.run,
                        scene: group.scene,
                        triangles: group.triangles,
                        threads: group.threads,
                        robust,
                        ours: fastest(group, rays, Source::Niwaki, kernel)?,
                        theirs: fastest(group, rays, Source::Embree, &embree)?,
                    })
                }));
            }
        }
    }
    duels
}

/// Our kernels in the order measured.
fn kernels<'a>(group: &Group<'a>) -> Vec<&'a str> {
    unique(group.traces.iter().map(|row| row.kernel.as_str()).filter(|kernel| !is_peers(kernel)))
}

fn unique<T: PartialEq>(all: impl IntoIterator<Item = T>) -> Vec<T> {
    let mut list = Vec::new();
    for item in all {
        if !list.contains(&item) {
            list.push(item);
        }
    }
    list
}

/// Ratios by kernel and ray set, over all scenes and for each: one titled table for each number of
/// threads. None without Embree.
pub(crate) fn tables(groups: &[Group<'_>]) -> Vec<(String, Table)> {
    let all = duels(groups);
    let mut threads = unique(all.iter().map(|duel| duel.threads));
    threads.sort_unstable();
    let of = |&threads: &usize| {
        let duels: Vec<_> = all.iter().filter(|duel| duel.threads == threads).collect();
        let plural = if threads == 1 { "" } else { "s" };
        (format!("{threads} thread{plural}"), table(threads, &duels))
    };
    threads.iter().map(of).collect()
}

fn table(threads: usize, duels: &[&Duel<'_>]) -> Table {
    let scenes = unique(duels.iter().map(|duel| (duel.scene, duel.triangles, duel.run)));
    let mut table = Table::new(format!("against-embree-{threads}t"))
        .column("our kernel", Best::Neither)
        .column("against", Best::Neither)
        .column("rays", Best::Neither)
        .column_with_digits("mean", Best::Neither, 3)
        .column_with_digits("least", Best::Neither, 3);
    for &(scene, triangles, run) in &scenes {
        let namesakes = || scenes.iter().filter(|other| other.0 == scene);
        let mut name = scene.to_owned();
        if namesakes().any(|other| other.1 != triangles) {
            name += &format!("\n{triangles}");
        }
        if namesakes().any(|other| other.2 != run) {
            name += &format!("\nrun {run}");
        }
        table = table.column_with_digits(name, Best::Neither, 3);
    }
    let line = |duel: &Duel<'_>| {
        (duel.ours.kernel.clone(), duel.against(), duel.ours.rays.clone(), duel.robust)
    };
    for (kernel, against, rays, robust) in unique(duels.iter().map(|duel| line(duel))) {
        let here: Vec<_> = duels
            .iter()
            .filter(|d| d.ours.kernel == kernel && d.robust == robust && d.ours.rays == rays)
            .collect();
        let ratios = || here.iter().map(|duel| duel.ratio());
        let mut row: Vec<Cell> = vec![
            kernel.into(),
            against.into(),
            rays.into(),
            geometric_mean(ratios()).into(),
            ratios().reduce(f64::min).into(),
        ];
        row.extend(scenes.iter().map(|&scene| {
            let found = here.iter().find(|d| (d.scene, d.triangles, d.run) == scene);
            Cell::from(found.map(|duel| duel.ratio()))
        }));
        table.push(row);
    }
    table
}

/// Every ratio with both trees and speeds.
pub(crate) fn details(groups: &[Group<'_>]) -> Table {
    let mut table = Table::new("against-embree")
        .column("scene", Best::Neither)
        .column("triangles", Best::Neither)
        .column("threads", Best::Neither)
        .column("rays", Best::Neither)
        .column("our kernel", Best::Neither)
        .column("rays\n/call", Best::Neither)
        .column("our best tree", Best::Neither)
        .column_with_digits("Mray/s", Best::Neither, 3)
        .column("against", Best::Neither)
        .column("its better\nquality", Best::Neither)
        .column_with_digits("its\nMray/s", Best::Neither, 3)
        .column_with_digits("ratio", Best::Neither, 3);
    for duel in duels(groups) {
        table.push(vec![
            duel.scene.into(),
            duel.triangles.into(),
            duel.threads.into(),
            duel.ours.rays.clone().into(),
            duel.ours.kernel.clone().into(),
            duel.ours.rays_per_call.into(),
            duel.ours.builder.clone().into(),
            duel.ours.mrays_per_s.into(),
            duel.against().into(),
            duel.theirs.builder.clone().into(),
            duel.theirs.mrays_per_s.into(),
            duel.ratio().into(),
        ]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::groups;
    use crate::results::tests::trace;
    use crate::results::{Results, Row, Run};

    fn row(scene: &str, source: Source, builder: &str, kernel: &str, mrays: f64) -> Row {
        let mut row = trace(scene, builder, 1, mrays);
        row.source = source;
        row.kernel = kernel.into();
        row.rays_per_call = if kernel.ends_with("_batch") { 1024 } else { 1 };
        Row::Trace(row)
    }

    fn results(with_embree: bool) -> Results {
        let mut rows = Vec::new();
        for (scene, factor) in [("a", 1.0), ("b", 4.0)] {
            for (builder, speed) in [("sweep", 6.0), ("bonsai", 5.0)] {
                for (kernel, share) in [("avx2_fast", 1.0), ("avx2", 0.5), ("avx2_batch", 2.0)] {
                    rows.push(row(scene, Source::Niwaki, builder, kernel, speed * share * factor));
                }
            }
            // Trees of Embree under our kernel are no trees of ours.
            rows.push(row(scene, Source::Embree, "high", "avx2", 99.0));
            if with_embree {
                for (quality, speed) in [("medium", 3.0), ("high", 4.0)] {
                    rows.push(row(scene, Source::Embree, quality, "embree", speed));
                    rows.push(row(scene, Source::Embree, quality, "embree_robust", 0.5 * speed));
                }
            }
        }
        Results { runs: vec![Run::default()], rows, ..Results::default() }
    }

    #[test]
    fn the_best_meet_in_the_same_mode() {
        let results = results(true);
        let tables = tables(&groups(&results));
        assert_eq!(tables.len(), 1);
        let csv = tables[0].1.to_csv().unwrap();
        let expected = "our kernel,against,rays,mean,least,a,b\n\
                        avx2_fast,Embree,camera,3,1.5,1.5,6\n\
                        avx2,Embree robust,camera,3,1.5,1.5,6\n\
                        avx2,Embree,camera,1.5,0.75,0.75,3\n\
                        avx2_batch,Embree robust,camera,12,6,6,24\n\
                        avx2_batch,Embree,camera,6,3,3,12\n";
        let rounded: Vec<String> = csv
            .split_inclusive(&[',', '\n'][..])
            .map(|cell| {
                let (word, end) = cell.split_at(cell.len() - 1);
                word.parse::<f64>()
                    .map_or(cell.to_owned(), |x| format!("{}{end}", (x * 1e6).round() / 1e6))
            })
            .collect();
        assert_eq!(rounded.concat(), expected);
        let details = details(&groups(&results)).to_csv().unwrap();
        assert!(
            details.contains("\na,1000,1,camera,avx2,1,sweep,3,Embree robust,high,2,1.5\n"),
            "{details}"
        );
        assert!(details.contains(",avx2_batch,1024,sweep,"), "{details}");
    }

    #[test]
    fn without_embree_there_is_no_section() {
        let results = results(false);
        assert!(tables(&groups(&results)).is_empty());
        assert!(details(&groups(&results)).is_empty());
    }
}
