//! The tables of the report.

use super::compare::{Comparison, mean, speedups, total_ms};
use super::measure::SceneResult;
use super::names::Standing;
use super::orderings::{Pair, Tally, Verdict};
use super::published::{AVERAGE, Item, Published};
use crate::report::table::{Best, Cell, Table};

/// What a quantity is called in headings, relative as tables show it.
pub(crate) fn heading(item: Item, quantity: &str) -> String {
    let over = item.baseline().map_or("", |_| " ÷ sweep SAH");
    match quantity {
        "build" => format!("build time{over}; lower is better"),
        "performance" => "path-tracing speed ÷ sweep SAH; higher is better".to_owned(),
        "frame" => format!("path-tracing time{over}; lower is better"),
        "sah" => format!("SAH cost{over}; lower is better"),
        "added references" => "references added ÷ triangles".to_owned(),
        "split share" => "splitting ÷ build of Bonsai S".to_owned(),
        "split time" => "splitting, ms".to_owned(),
        other => other.to_owned(),
    }
}

/// The tables that have a scene a row: item and quantity.
pub(crate) const MATRICES: [(Item, &str); 9] = [
    (Item::IvFigure5, "build"),
    (Item::IvFigure5, "performance"),
    (Item::IvFigure8, "sah"),
    (Item::VTable1, "build"),
    (Item::VTable1, "frame"),
    (Item::VTable2, "frame"),
    (Item::VTable3, "added references"),
    (Item::VTable4, "split share"),
    (Item::VTable5, "sah"),
];

/// Names a table's file.
pub(crate) fn file_name(item: Item, quantity: &str) -> String {
    format!("{}-{}", item.id(), quantity.replace(' ', "-"))
}

/// How the measured scene is named beside the published one.
fn measured_on(comparison: &Comparison) -> Cell {
    match (&comparison.measured_on, comparison.standing) {
        (Some(name), Some(Standing::Same)) => name.clone().into(),
        (Some(name), Some(standing)) => format!("{name} ({standing})").into(),
        _ => Cell::Missing,
    }
}

/// The scenes of the papers, and what was measured in their place.
pub(crate) fn scenes(published: &Published, results: &[SceneResult]) -> Table {
    let mut table = Table::new("scenes")
        .column("scene", Best::Neither)
        .column("triangles\nin IV", Best::Neither)
        .column("triangles\nin V", Best::Neither)
        .column("measured on", Best::Neither)
        .column("triangles\nthere", Best::Neither)
        .column("which is", Best::Neither);
    for scene in published.all_scenes() {
        let found = results
            .iter()
            .find_map(|r| r.stands_for.iter().find(|s| s.0 == scene).map(|s| (r, s.1)));
        let what = found.map(|(_, standing)| match standing {
            Standing::Same => "the scene",
            Standing::Version => "another version of the scene",
            Standing::Akin => "another scene of its kind",
            Standing::StandIn => "a procedural stand-in",
        });
        table.push(vec![
            scene.into(),
            published.triangles("IV", scene).into(),
            published.triangles("V", scene).into(),
            found.map(|(result, _)| result.scene.clone()).into(),
            found.map(|(result, _)| result.triangles).into(),
            what.into(),
        ]);
    }
    table
}

/// A column of a matrix: a builder of a paper, or one of ours beside it.
fn columns(rows: &[&Comparison], item: Item) -> Vec<(String, Option<String>)> {
    let mut columns: Vec<(String, Option<String>)> = Vec::new();
    for row in rows {
        if Some(row.builder.as_str()) == item.baseline() {
            continue;
        }
        let published = (row.builder.clone(), None);
        if !columns.contains(&published) {
            // The columns of one builder stand together, the published one first.
            columns.push(published);
            let ours = rows.iter().filter(|r| r.builder == row.builder);
            for other in ours {
                let column = (row.builder.clone(), Some(other.ours.clone()));
                if !columns.contains(&column) {
                    columns.push(column);
                }
            }
        }
    }
    columns
}

/// A quantity of an item: a scene a row, each builder's published value beside ours.
pub(crate) fn matrix(
    item: Item,
    quantity: &str,
    comparisons: &[Comparison],
    pairs: &[Pair],
) -> Table {
    let rows: Vec<_> =
        comparisons.iter().filter(|c| c.item == item && c.quantity == quantity).collect();
    let columns = columns(&rows, item);
    let digits = if quantity == "build" { 3 } else { 2 };
    let mut table = Table::new(file_name(item, quantity))
        .column("scene", Best::Neither)
        .column("measured on", Best::Neither)
        .column("orderings\nthat hold", Best::Neither);
    for (published, ours) in &columns {
        let name = match ours {
            None => format!("{published}\npublished"),
            Some(ours) => ours.replace(':', ":\n"),
        };
        table = table.column_with_digits(name, Best::Neither, digits);
    }
    let mut scenes: Vec<&str> = Vec::new();
    for row in &rows {
        if !scenes.contains(&row.scene.as_str()) {
            scenes.push(&row.scene);
        }
    }
    let value = |scene: &str, column: &(String, Option<String>)| {
        let (builder, ours) = column;
        let row = rows.iter().find(|r| {
            r.scene == scene && r.builder == *builder && ours.as_ref().is_none_or(|o| *o == r.ours)
        })?;
        if ours.is_some() { row.measured_relative } else { Some(row.published_relative) }
    };
    for scene in &scenes {
        let first = rows.iter().find(|r| r.scene == *scene);
        let mut cells = vec![(*scene).into(), first.map_or(Cell::Missing, |c| measured_on(c))];
        let of = |p: &&Pair| p.item == item && p.quantity == quantity && p.scene == *scene;
        cells.push(Tally::of(pairs.iter().filter(of)).short().into());
        cells.extend(columns.iter().map(|column| Cell::from(value(scene, column))));
        table.push(cells);
    }
    let had = |scene: &&&str| {
        rows.iter().any(|r| r.scene == ***scene && r.standing.is_some_and(Standing::is_had))
    };
    let measured = |scene: &&&str| rows.iter().any(|r| r.scene == ***scene && r.measured.is_some());
    let had: Vec<&str> = scenes.iter().filter(had).copied().collect();
    let measured: Vec<&str> = scenes.iter().filter(measured).copied().collect();
    for (name, among) in [("mean, real scenes", &had), ("mean, all measured", &measured)] {
        // Published and measured over the same scenes, or they would not compare.
        if among.len() < 2 {
            continue;
        }
        let mut cells = vec![name.into(), format!("{} of {}", among.len(), scenes.len()).into()];
        let of = |p: &&Pair| {
            p.item == item && p.quantity == quantity && among.contains(&p.scene.as_str())
        };
        cells.push(Tally::of(pairs.iter().filter(of)).short().into());
        for column in &columns {
            cells.push(mean(among.iter().filter_map(|scene| value(scene, column))).into());
        }
        table.push(cells);
    }
    table
}

/// Figure 7 of paper IV: averages, over all scenes and over those that were had.
pub(crate) fn averages(comparisons: &[Comparison]) -> Table {
    let mut table = Table::new(Item::IvFigure7.id())
        .column("published\nbuilder", Best::Neither)
        .column("ours", Best::Neither)
        .column("quantity", Best::Neither)
        .column_with_digits("published\n14 scenes", Best::Neither, 3)
        .column_with_digits("measured\nall scenes", Best::Neither, 3)
        .column_with_digits("published\nreal scenes", Best::Neither, 3)
        .column_with_digits("measured\nreal scenes", Best::Neither, 3);
    for row in comparisons.iter().filter(|c| c.item == Item::IvFigure7 && c.scene == AVERAGE) {
        let behind = || {
            comparisons.iter().filter(|c| {
                matches!(c.item, Item::IvFigure5 | Item::IvFigure8)
                    && (&c.quantity, &c.builder, &c.ours)
                        == (&row.quantity, &row.builder, &row.ours)
                    && c.standing.is_some_and(Standing::is_had)
                    && c.measured.is_some()
            })
        };
        table.push(vec![
            row.builder.clone().into(),
            row.ours.clone().into(),
            row.quantity.clone().into(),
            row.published_relative.into(),
            row.measured_relative.into(),
            mean(behind().map(|c| c.published_relative)).into(),
            mean(behind().filter_map(|c| c.measured_relative)).into(),
        ]);
    }
    table
}

/// Figure 6 of paper IV: the steps of Bonsai's variants, as shares of the build without pruning.
pub(crate) fn steps(comparisons: &[Comparison], result: &SceneResult) -> Table {
    let variants = [("Bonsai", "bonsai"), ("Bonsai P", "bonsai_p")];
    let mut table = Table::new(Item::IvFigure6.id()).column("step", Best::Neither);
    for (published, ours) in variants {
        table = table
            .column_with_digits(format!("{published}\npublished"), Best::Neither, 3)
            .column_with_digits(ours, Best::Neither, 3);
    }
    let Some(whole) = total_ms(result, "bonsai") else { return table };
    let mut names: Vec<&str> = Vec::new();
    for step in &result.steps {
        if !names.contains(&step.step.as_str()) {
            names.push(&step.step);
        }
    }
    for name in names {
        let mut row: Vec<Cell> = vec![name.into()];
        for (published, ours) in variants {
            let known = comparisons.iter().find(|c| {
                c.item == Item::IvFigure6 && c.builder == published && c.quantity == name
            });
            row.push(known.map(|c| c.published_relative).into());
            let step = result.steps.iter().find(|s| s.builder == ours && s.step == name);
            row.push(step.map(|s| s.ms / whole).into());
        }
        table.push(row);
    }
    // The published sums follow from the build times of figure 5.
    let build = |name: &str| {
        let same = |c: &&Comparison| {
            c.item == Item::IvFigure5
                && c.scene == "San Miguel"
                && c.quantity == "build"
                && c.builder == name
        };
        comparisons.iter().find(same).map(|c| c.published)
    };
    let mut row: Vec<Cell> = vec!["all".into()];
    for (published, ours) in variants {
        let ratio = build(published).zip(build("Bonsai")).map(|(a, b)| a / b);
        row.push(ratio.into());
        row.push(total_ms(result, ours).map(|ms| ms / whole).into());
    }
    table.push(row);
    table
}

/// Figure 4 of paper V: how many times as fast as on one thread.
pub(crate) fn scaling(result: &SceneResult) -> Table {
    let mut table = Table::new(Item::VFigure4.id())
        .column("builder", Best::Neither)
        .column("threads", Best::Neither)
        .column("build\nms", Best::Neither)
        .column_with_digits("times as\nfast as 1", Best::Neither, 2);
    for row in &result.scaling {
        let speedups = speedups(result, &row.builder);
        let speedup = speedups.iter().find(|(threads, _)| *threads == row.threads);
        table.push(vec![
            row.builder.clone().into(),
            row.threads.into(),
            row.build_ms.into(),
            speedup.map(|s| s.1).into(),
        ]);
    }
    table
}

/// How many published orders hold, by item and quantity.
pub(crate) fn orderings(pairs: &[Pair]) -> Table {
    let mut table =
        Table::new("orderings").column("item", Best::Neither).column("quantity", Best::Neither);
    for among in ["real", "all"] {
        for name in ["pairs", "hold", "tie", "reversed"] {
            table = table.column(format!("{among}\n{name}"), Best::Neither);
        }
        table = table.column_with_digits(format!("{among}\nhold, tie"), Best::Neither, 2);
    }
    let mut keys: Vec<(Item, &str)> = Vec::new();
    for pair in pairs {
        if !keys.contains(&(pair.item, &pair.quantity)) {
            keys.push((pair.item, &pair.quantity));
        }
    }
    let mut push = |title: [Cell; 2], of: &dyn Fn(&&Pair) -> bool| {
        let mut row = title.to_vec();
        for only_had in [true, false] {
            let tally = Tally::of(pairs.iter().filter(|p| of(p) && (p.had || !only_had)));
            let share = (tally.holds + tally.ties) as f64 / tally.all() as f64;
            row.extend([tally.all(), tally.holds, tally.ties, tally.reversed].map(Cell::from));
            row.push(share.into());
        }
        table.push(row);
    };
    for (item, quantity) in keys {
        push([item.id().into(), quantity.into()], &|p| p.item == item && p.quantity == quantity);
    }
    // Averages count the same scenes again.
    push(["all".into(), "but averages".into()], &|p| p.item != Item::IvFigure7);
    table
}

/// The orders that do not hold, those of real scenes first, each by how far it is from holding.
pub(crate) fn reversed(pairs: &[Pair]) -> Table {
    let mut table = Table::new("reversed")
        .column("item", Best::Neither)
        .column("quantity", Best::Neither)
        .column("scene", Best::Neither)
        .column("real", Best::Neither)
        .column("published: better", Best::Neither)
        .column("than", Best::Neither)
        .column_with_digits("by", Best::Neither, 2)
        .column("ours: better", Best::Neither)
        .column("than", Best::Neither)
        .column_with_digits("by", Best::Neither, 2);
    let mut rows: Vec<_> = pairs.iter().filter(|p| p.verdict == Verdict::Reversed).collect();
    let far = |pair: &Pair| pair.published / pair.measured;
    rows.sort_by(|a, b| b.had.cmp(&a.had).then(far(b).total_cmp(&far(a))));
    for pair in rows {
        table.push(vec![
            pair.item.id().into(),
            pair.quantity.clone().into(),
            pair.scene.clone().into(),
            if pair.had { "yes".into() } else { "no".into() },
            pair.better.clone().into(),
            pair.worse.clone().into(),
            pair.published.into(),
            pair.our_worse.clone().into(),
            pair.our_better.clone().into(),
            (1.0 / pair.measured).into(),
        ]);
    }
    table
}

/// Every comparison, in full: for other programs.
pub(crate) fn comparisons(comparisons: &[Comparison]) -> Table {
    let mut table = Table::new("comparisons");
    for name in [
        "item",
        "scene",
        "measured_on",
        "standing",
        "builder",
        "ours",
        "quantity",
        "unit",
        "published",
        "measured",
        "published_relative",
        "measured_relative",
    ] {
        table = table.column(name, Best::Neither);
    }
    for c in comparisons {
        table.push(vec![
            c.item.id().into(),
            c.scene.clone().into(),
            c.measured_on.clone().into(),
            c.standing.map(|s| s.to_string()).into(),
            c.builder.clone().into(),
            c.ours.clone().into(),
            c.quantity.clone().into(),
            c.unit.clone().into(),
            c.published.into(),
            c.measured.into(),
            c.published_relative.into(),
            c.measured_relative.into(),
        ]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thesis::compare::{compare, result, tree};
    use crate::thesis::orderings::pairs;

    fn sample() -> Vec<Comparison> {
        let trees = |bonsai| {
            vec![
                tree("sweep", 100.0, 50.0, 80.0),
                tree("binned", 60.0, 55.0, 84.0),
                tree("bonsai_p", bonsai, 50.0, 80.0),
            ]
        };
        let results = [
            result("Sponza", Standing::Same, trees(20.0)),
            result("Conference", Standing::Version, trees(30.0)),
            result("Sala", Standing::StandIn, trees(40.0)),
        ];
        compare(&Published::read().unwrap(), &results)
    }

    fn cells(table: &Table, row: &str) -> Vec<String> {
        let csv = table.to_csv().unwrap();
        let line = csv.lines().find(|line| line.starts_with(row)).unwrap();
        line.split(',').map(String::from).collect()
    }

    #[test]
    fn published_and_measured_stand_side_by_side() {
        let comparisons = sample();
        let pairs = pairs(&comparisons);
        let table = matrix(Item::IvFigure5, "build", &comparisons, &pairs);
        let header = table.to_csv().unwrap().lines().next().unwrap().to_owned();
        let columns: Vec<_> = header.split(',').collect();
        let at = columns.iter().position(|c| *c == "Bonsai P published").unwrap();
        assert_eq!(columns[at + 1], "bonsai_p");
        let sponza = cells(&table, "Sponza");
        assert_eq!(sponza[1], "sponza");
        assert!((sponza[at].parse::<f64>().unwrap() - 13.4 / 51.4).abs() < 1e-12);
        assert_eq!(sponza[at + 1], "0.2");
        // Sweep after binned after Bonsai P, as published.
        assert_eq!(sponza[2], "3/3");
        assert_eq!(cells(&table, "Sala")[1], "sala (stand-in)");
        // Hairball was not measured, but its published values are shown.
        let hairball = cells(&table, "Hairball");
        assert!(!hairball[at].is_empty() && hairball[at + 1].is_empty());
        // Means of real scenes are over these two alone, published ones too.
        let means = cells(&table, "\"mean, real scenes\"");
        assert!(means.contains(&"2 of 14".to_owned()), "{means:?}");
        assert!(means.contains(&"0.25".to_owned()), "{means:?}");
        let text = table.to_text();
        let widths: Vec<_> = text
            .lines()
            .filter(|l| l.starts_with("S"))
            .map(|l| l.trim_end().chars().count())
            .collect();
        assert!(widths.windows(2).all(|w| w[0].abs_diff(w[1]) <= 6), "{text}");
    }

    #[test]
    fn orderings_are_counted_and_reversals_listed() {
        let comparisons = sample();
        let pairs = pairs(&comparisons);
        let all = cells(&orderings(&pairs), "all,but averages");
        let number = |at: usize| all[at].parse::<usize>().unwrap();
        assert_eq!(number(2), number(3) + number(4) + number(5));
        assert!(number(7) > number(2), "stand-ins are in the second half: {all:?}");
        // Published on Sponza: Bonsai P traces at 105 % of sweep; here it is a tie. On Conference
        // binned traces at 93 %: holds.
        let list = reversed(&pairs).to_csv().unwrap();
        assert!(!list.contains("performance,Sponza"), "{list}");
        assert_eq!(list.lines().count() - 1, number(10) + count_averages(&pairs));
    }

    fn count_averages(pairs: &[Pair]) -> usize {
        let of = |p: &&Pair| p.item == Item::IvFigure7 && p.verdict == Verdict::Reversed;
        pairs.iter().filter(of).count()
    }

    #[test]
    fn averages_of_real_scenes_leave_stand_ins_out() {
        let table = averages(&sample());
        let row = cells(&table, "Bonsai P,bonsai_p,build");
        let number = |at: usize| row[at].parse::<f64>().unwrap();
        assert!((number(3) - 0.27).abs() < 1e-12);
        assert!((number(4) - 0.3).abs() < 1e-12 && (number(6) - 0.25).abs() < 1e-12);
        assert!((number(5) - (13.4 / 51.4 + 16.9 / 57.8) / 2.0).abs() < 1e-12);
        assert_eq!(
            cells(&scenes(&Published::read().unwrap(), &[]), "Mini"),
            ["Mini", "", "912411", "", "", ""]
        );
    }
}
