//! What a person reads of a catalogue.

use super::{Catalogue, Finding, engines};
use crate::judge::Tally;
use crate::report::table::{Best, Cell, Table};
use crate::results::Source;
use crate::stability::watch::End;

/// Findings of one kernel, or of one structure of a peer.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sum {
    tally: Tally,
    illegal: u64,
    inside: u64,
    pub(crate) leaks: u64,
    ends: [usize; 4],
}

const ENDS: [End; 4] = [End::Panic, End::Crash, End::Hang, End::Refused];

impl Sum {
    fn add(&mut self, finding: &Finding) {
        if let Some(row) = &finding.row {
            self.tally = self.tally.merge(row.tally);
            self.illegal += row.illegal;
            self.inside += row.inside;
            self.leaks += row.leaks;
        }
        for (count, end) in self.ends.iter_mut().zip(ENDS) {
            *count += usize::from(finding.end == Some(end));
        }
    }

    pub(crate) fn of<'a>(findings: impl IntoIterator<Item = &'a Finding>) -> Self {
        let mut sum = Self::default();
        findings.into_iter().for_each(|finding| sum.add(finding));
        sum
    }

    /// Wrong answers, those to illegal rays included.
    pub(crate) const fn wrong(&self) -> u64 {
        self.tally.ours_wrong + self.illegal
    }

    /// Panics, crashes and hangs.
    pub(crate) fn failures(&self) -> usize {
        self.ends[..3].iter().sum()
    }

    pub(crate) const fn refused(&self) -> usize {
        self.ends[3]
    }

    /// `None` without rays from inside.
    pub(crate) fn leaks_per_million(&self) -> Option<f64> {
        (self.inside > 0).then(|| self.leaks as f64 * 1e6 / self.inside as f64)
    }
}

/// Whose answers are summed: for us a kernel over all trees, for peers a structure with its kernel.
pub(crate) fn subject(finding: &Finding) -> String {
    match finding.source {
        Source::Niwaki if finding.kernel.is_empty() => "niwaki (builders)".into(),
        Source::Niwaki => format!("niwaki {}", finding.kernel),
        source => format!("{} {} {}", source.name(), finding.builder, finding.kernel),
    }
}

/// The subjects in order: ours, then the peers'.
pub(crate) fn subjects(catalogue: &Catalogue) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for finding in &catalogue.findings {
        let name = subject(finding);
        if !names.contains(&name) {
            names.push(name);
        }
    }
    // Cases of which only some kernels answer would otherwise mix the order.
    names.sort_by_key(|name| !name.starts_with("niwaki"));
    names
}

/// The tables with their titles.
pub(crate) fn tables(catalogue: &Catalogue) -> Vec<(&'static str, Table)> {
    let mut tables = vec![
        ("\nAll cases together", by_subject(catalogue)),
        ("\nLeaks per million rays from inside closed surfaces", leaks(catalogue)),
    ];
    let rest = noteworthy(catalogue);
    if !rest.is_empty() {
        tables.push(("\nEverything that counts against us, and how attempts ended", rest));
    }
    tables
}

fn by_subject(catalogue: &Catalogue) -> Table {
    let mut table = Table::new("subjects")
        .column("kernel", Best::Neither)
        .column("rays", Best::Neither)
        .column("rounding", Best::Neither)
        .column("wrong", Best::Low)
        .column("illegal rays\nanswered", Best::Low)
        .column("rays from\ninside", Best::Neither)
        .column("leaks", Best::Low)
        .column_with_digits("leaks\nper million", Best::Low, 2)
        .column("panics", Best::Low)
        .column("crashes", Best::Low)
        .column("hangs", Best::Low)
        .column("refused", Best::Low);
    for name in subjects(catalogue) {
        let sum = Sum::of(catalogue.findings.iter().filter(|f| subject(f) == name));
        let count = |n: u64| Cell::Number(n as f64);
        let mut row: Vec<Cell> = vec![
            name.into(),
            count(sum.tally.rays),
            count(sum.tally.rounding),
            count(sum.tally.ours_wrong),
            count(sum.illegal),
            count(sum.inside),
            count(sum.leaks),
            sum.leaks_per_million().into(),
        ];
        row.extend(sum.ends.map(Cell::from));
        table.push(row);
    }
    table
}

/// Subjects against surfaces.
fn leaks(catalogue: &Catalogue) -> Table {
    let rate = |case: &str, name: &str| {
        let here = catalogue.findings.iter().filter(|f| f.case == case && subject(f) == name);
        Sum::of(here).leaks_per_million()
    };
    let subjects = subjects(catalogue);
    let surfaces: Vec<&str> = catalogue
        .cases
        .iter()
        .map(|(case, ..)| case.as_str())
        .filter(|case| subjects.iter().any(|name| rate(case, name).is_some()))
        .collect();
    let mut table = Table::new("leaks").column("kernel", Best::Neither);
    for surface in &surfaces {
        table = table.column_with_digits(surface.replacen('_', "\n", 1), Best::Low, 1);
    }
    for name in &subjects {
        let rates: Vec<_> = surfaces.iter().map(|surface| rate(surface, name)).collect();
        if rates.iter().any(Option::is_some) {
            let cells = rates.into_iter().map(Cell::from);
            table.push(std::iter::once(Cell::from(name.as_str())).chain(cells).collect());
        }
    }
    table
}

/// What has to be read one by one.
fn noteworthy(catalogue: &Catalogue) -> Table {
    let mut table = ["case", "builder", "kernel", "what"]
        .into_iter()
        .fold(Table::new("noteworthy"), |table, column| table.column(column, Best::Neither));
    for finding in &catalogue.findings {
        let what = match (&finding.end, &finding.what, &finding.row) {
            (Some(end), what, _) => {
                let what = what.as_deref().unwrap_or_default();
                format!("{}: {}", end.name(), what.replace('\n', " "))
            }
            (None, _, Some(row)) if finding.counts_against_us() => {
                let example = row.example.clone().unwrap_or_default();
                let leaks = if engines::is_watertight(&finding.kernel) { row.leaks } else { 0 };
                let wrong = row.tally.ours_wrong + row.illegal;
                format!("{wrong} wrong, {leaks} leaks; {example}")
            }
            _ => continue,
        };
        table.push(vec![
            finding.case.as_str().into(),
            format!("{}:{}", finding.source.name(), finding.builder).into(),
            finding.kernel.as_str().into(),
            what.into(),
        ]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::Run;
    use crate::stability::worker::Row;

    fn finding(source: Source, builder: &str, kernel: &str, row: Option<Row>) -> Finding {
        Finding {
            case: "c".into(),
            source,
            builder: builder.into(),
            kernel: kernel.into(),
            end: row.is_none().then_some(End::Hang),
            row,
            what: None,
        }
    }

    fn catalogue() -> Catalogue {
        let row = |rays, leaks, wrong| {
            let tally = Tally { rays, ours_wrong: wrong, ..Tally::default() };
            Some(Row { tally, inside: 1000, leaks, ..Row::default() })
        };
        Catalogue {
            schema: 1,
            run: Run::default(),
            cases: vec![("c".into(), "hard".into(), 3)],
            findings: vec![
                finding(Source::Embree, "medium", "robust", row(10, 5, 2)),
                finding(Source::Niwaki, "a", "avx2_fast", row(10, 1, 0)),
                finding(Source::Niwaki, "b", "avx2_fast", row(20, 2, 0)),
                finding(Source::Niwaki, "c", "", None),
            ],
        }
    }

    #[test]
    fn our_trees_share_a_line_and_come_first() {
        let catalogue = catalogue();
        let expected = ["niwaki avx2_fast", "niwaki (builders)", "embree medium robust"];
        assert_eq!(subjects(&catalogue), expected);
        let ours = catalogue.findings.iter().filter(|f| subject(f) == "niwaki avx2_fast");
        let sum = Sum::of(ours);
        assert_eq!((sum.tally.rays, sum.leaks, sum.failures()), (30, 3, 0));
        assert_eq!(sum.leaks_per_million(), Some(1500.0));
    }

    #[test]
    fn only_ours_count_against_us() {
        let catalogue = catalogue();
        let against: Vec<_> = catalogue.findings.iter().map(Finding::counts_against_us).collect();
        // A fast kernel may leak, a peer may be wrong, but nothing of ours may hang.
        assert_eq!(against, [false, false, false, true]);
        let tables = tables(&catalogue);
        assert!(tables.iter().any(|(_, table)| table.to_text().contains("hang")));
    }
}
