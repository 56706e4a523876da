//! What a person reads at the end of a verification.

use super::ledger::Ledger;
use crate::judge::Tally;
use crate::report::table::{Best, Table};
use std::collections::BTreeMap;

/// Prints summaries; every row is in the JSON file.
pub(crate) fn tables(ledger: &Ledger) {
    println!("\nAnswers, all builders together (counts of rays)");
    println!("{}", answers(ledger).to_text());
    println!("\nTrees (SAH with C_I = 2, C_L = 0, C_T = 1)");
    println!("{}", trees(ledger).to_text());
    if !ledger.absent.is_empty() {
        println!("\nPeers that could not take part");
        println!("{}", absent(ledger).to_text());
    }
    if !ledger.culprits.is_empty() {
        println!("\nWhat counts against us");
        println!("{}", culprits(ledger).to_text());
    }
}

fn table(name: &str, columns: &[&str]) -> Table {
    columns.iter().fold(Table::new(name), |table, &column| table.column(column, Best::Neither))
}

/// One line per scene, kernel, opponent and query. All hard cases share their lines, but for those
/// with something to report.
fn answers(ledger: &Ledger) -> Table {
    const HARD: &str = "hard cases";
    let mut sums: BTreeMap<(usize, &str, &str, &str), Tally> = BTreeMap::new();
    let mut order = vec![HARD];
    for row in &ledger.rows {
        let quiet = Tally { rays: row.tally.rays, ..Tally::default() } == row.tally;
        let is_hard = matches!(row.against.as_str(), "brute_force" | "exact");
        let scene = if is_hard && quiet { HARD } else { row.scene.as_str() };
        let place = order.iter().position(|s| *s == scene).unwrap_or_else(|| {
            order.push(scene);
            order.len() - 1
        });
        let key = (place, row.kernel.as_str(), row.against.as_str(), row.query);
        let sum = sums.entry(key).or_default();
        *sum = sum.merge(row.tally);
    }
    let mut table = table(
        "answers",
        &[
            "scene",
            "kernel",
            "against",
            "query",
            "rays",
            "tie",
            "rounding",
            "by us",
            "by peer",
            "peer wrong",
            "ours wrong",
        ],
    );
    for ((place, kernel, against, query), t) in sums {
        let counts =
            [t.rays, t.tie, t.rounding, t.ours_rounded, t.peer_rounded, t.peer_wrong, t.ours_wrong];
        let words = [order[place], kernel, against, query].map(Into::into);
        table.push(words.into_iter().chain(counts.map(|n| (n as f64).into())).collect());
    }
    table
}

/// Full scenes only: the hard cases' trees are in the JSON file, and their faults among the
/// culprits.
fn trees(ledger: &Ledger) -> Table {
    let full: Vec<&str> = ledger
        .rows
        .iter()
        .filter(|row| !matches!(row.against.as_str(), "brute_force" | "exact"))
        .map(|row| row.scene.as_str())
        .collect();
    let mut table = table(
        "trees",
        &[
            "scene",
            "source",
            "builder",
            "triangles",
            "nodes",
            "references",
            "SAH",
            "valid",
            "same bytes",
        ],
    );
    for t in ledger.trees.iter().filter(|t| full.contains(&t.scene.as_str())) {
        table.push(vec![
            t.scene.clone().into(),
            t.source.into(),
            t.builder.clone().into(),
            t.triangles.into(),
            t.nodes.into(),
            t.references.into(),
            t.sah.into(),
            yes(t.valid).into(),
            t.deterministic.map(yes).into(),
        ]);
    }
    table
}

fn absent(ledger: &Ledger) -> Table {
    let mut table = table("absent", &["scene", "peer", "why"]);
    for a in &ledger.absent {
        table.push([&a.scene, &a.peer, &a.why].map(|s| s.as_str().into()).to_vec());
    }
    table
}

fn culprits(ledger: &Ledger) -> Table {
    let mut table = table("culprits", &["scene", "builder", "check", "what"]);
    for c in &ledger.culprits {
        table.push([&c.scene, &c.builder, &c.check, &c.what].map(|s| s.as_str().into()).to_vec());
    }
    table
}

const fn yes(b: bool) -> &'static str {
    if b { "yes" } else { "NO" }
}
