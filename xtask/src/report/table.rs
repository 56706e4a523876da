//! A table that can be printed, written as CSV and put into HTML.

use comfy_table::{CellAlignment, ContentArrangement, LineStyle, Table as Printed, presets};
use std::fmt::Write as _;

/// What a cell holds.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Cell {
    /// Words.
    Text(String),
    /// A measured or derived number.
    Number(f64),
    /// Nothing was measured.
    Missing,
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.into())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<f64> for Cell {
    fn from(number: f64) -> Self {
        if number.is_finite() { Self::Number(number) } else { Self::Missing }
    }
}

impl From<usize> for Cell {
    fn from(number: usize) -> Self {
        // Counts of a report stay far below 2^53.
        Self::Number(number as f64)
    }
}

impl<T: Into<Self>> From<Option<T>> for Cell {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Missing, Into::into)
    }
}

/// Which end of a column is the good one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Best {
    /// Small numbers.
    Low,
    /// Large numbers.
    High,
    /// Neither.
    Neither,
}

#[derive(Clone, Debug, PartialEq)]
struct Column {
    name: String,
    best: Best,
    digits: Option<usize>,
}

/// Named columns and rows of cells.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Table {
    /// Names the CSV file, so without spaces.
    pub(crate) name: String,
    columns: Vec<Column>,
    rows: Vec<Vec<Cell>>,
}

impl Table {
    pub(crate) fn new(name: impl Into<String>) -> Self {
        Self { name: name.into(), columns: Vec::new(), rows: Vec::new() }
    }

    /// Adds a column whose decimals follow from its numbers. Line breaks in names keep columns
    /// narrow; CSV files have spaces instead.
    pub(crate) fn column(mut self, name: impl Into<String>, best: Best) -> Self {
        self.columns.push(Column { name: name.into(), best, digits: None });
        self
    }

    /// Adds a column with a fixed number of decimals.
    pub(crate) fn column_with_digits(
        mut self,
        name: impl Into<String>,
        best: Best,
        digits: usize,
    ) -> Self {
        self.columns.push(Column { name: name.into(), best, digits: Some(digits) });
        self
    }

    /// Adds a row; there must be a cell for each column.
    pub(crate) fn push(&mut self, row: Vec<Cell>) {
        assert_eq!(row.len(), self.columns.len(), "one cell per column of {}", self.name);
        self.rows.push(row);
    }

    pub(crate) const fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    fn numbers(&self, column: usize) -> impl Iterator<Item = f64> + '_ {
        self.rows.iter().filter_map(move |row| match row[column] {
            Cell::Number(number) => Some(number),
            _ => None,
        })
    }

    /// Decimals such that the smallest number shows three digits, and none for counts.
    fn digits(&self, column: usize) -> usize {
        if let Some(digits) = self.columns[column].digits {
            return digits;
        }
        if self.numbers(column).all(|x| x.fract() == 0.0) {
            return 0;
        }
        let smallest = self.numbers(column).map(f64::abs).filter(|&x| x > 0.0);
        let smallest = smallest.fold(f64::INFINITY, f64::min);
        (0..3).find(|&digits| smallest >= 10f64.powi(2 - digits)).map_or(3, |d| d.unsigned_abs())
            as usize
    }

    /// A column of fixed decimals is for numbers, even where none was measured.
    fn is_numeric(&self, column: usize) -> bool {
        self.columns[column].digits.is_some() || self.numbers(column).next().is_some()
    }

    fn best_of(&self, column: usize) -> Option<f64> {
        // A best among fewer than two says nothing.
        (self.numbers(column).count() > 1).then_some(())?;
        match self.columns[column].best {
            Best::Low => self.numbers(column).reduce(f64::min),
            Best::High => self.numbers(column).reduce(f64::max),
            Best::Neither => None,
        }
    }

    fn show(&self, cell: &Cell, digits: usize) -> String {
        match cell {
            Cell::Text(text) => text.clone(),
            Cell::Number(number) => grouped(*number, digits),
            Cell::Missing => "·".into(),
        }
    }

    /// Lines for a terminal.
    pub(crate) fn to_text(&self) -> String {
        let mut table = Printed::new();
        let line = || LineStyle::none().fill('─').junction('─');
        table.load_style(presets::NOTHING.header_separator(line()).bottom_border(line()));
        // A table that is cut at the terminal's edge no longer lines up; let it run over.
        table.set_content_arrangement(ContentArrangement::Disabled);
        table.set_header(self.columns.iter().map(|c| c.name.as_str()).collect::<Vec<_>>());
        let digits: Vec<_> = (0..self.columns.len()).map(|c| self.digits(c)).collect();
        for row in &self.rows {
            table.add_row(
                row.iter().zip(&digits).map(|(cell, &d)| self.show(cell, d)).collect::<Vec<_>>(),
            );
        }
        for column in 0..self.columns.len() {
            if self.is_numeric(column)
                && let Some(printed) = table.column_mut(column)
            {
                printed.set_cell_alignment(CellAlignment::Right);
            }
        }
        table.trim_fmt()
    }

    /// Comma-separated values, numbers in full.
    pub(crate) fn to_csv(&self) -> anyhow::Result<String> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.write_record(self.columns.iter().map(|c| c.name.replace('\n', " ")))?;
        for row in &self.rows {
            writer.write_record(row.iter().map(|cell| match cell {
                Cell::Text(text) => text.clone(),
                Cell::Number(number) => number.to_string(),
                Cell::Missing => String::new(),
            }))?;
        }
        Ok(String::from_utf8(writer.into_inner()?)?)
    }

    /// An HTML table; the best numbers of a column are strong.
    pub(crate) fn to_html(&self) -> String {
        let mut html = String::from("<div class=\"scroll\"><table><thead><tr>");
        for (c, column) in self.columns.iter().enumerate() {
            let class = if self.is_numeric(c) { " class=\"n\"" } else { "" };
            let _ = write!(html, "<th{class}>{}</th>", escape(&column.name));
        }
        html.push_str("</tr></thead><tbody>\n");
        let digits: Vec<_> = (0..self.columns.len()).map(|c| self.digits(c)).collect();
        let best: Vec<_> = (0..self.columns.len()).map(|c| self.best_of(c)).collect();
        for row in &self.rows {
            html.push_str("<tr>");
            for (c, cell) in row.iter().enumerate() {
                let text = escape(&self.show(cell, digits[c]));
                // Equal to the best as printed is equal for the reader.
                let is_best = matches!((cell, best[c]), (Cell::Number(_), Some(best))
                    if self.show(&Cell::Number(best), digits[c]) == text);
                let class = if self.is_numeric(c) { " class=\"n\"" } else { "" };
                let _ = if is_best {
                    write!(html, "<td{class}><strong>{text}</strong></td>")
                } else {
                    write!(html, "<td{class}>{text}</td>")
                };
            }
            html.push_str("</tr>\n");
        }
        html.push_str("</tbody></table></div>\n");
        html
    }
}

/// A number with groups of three digits apart.
pub(crate) fn grouped(number: f64, digits: usize) -> String {
    let text = format!("{:.digits$}", number.abs());
    let (whole, fraction) =
        text.split_once('.').map_or((text.as_str(), None), |(w, f)| (w, Some(f)));
    let mut result = String::new();
    if number < 0.0 && text.bytes().any(|b| (b'1'..=b'9').contains(&b)) {
        result.push('-');
    }
    for (i, digit) in whole.chars().enumerate() {
        if i > 0 && (whole.len() - i).is_multiple_of(3) {
            result.push(',');
        }
        result.push(digit);
    }
    if let Some(fraction) = fraction {
        result.push('.');
        result.push_str(fraction);
    }
    result
}

/// Text made safe for HTML content and attributes.
pub(crate) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Table {
        let mut table = Table::new("t")
            .column("builder", Best::Neither)
            .column("ms", Best::Low)
            .column("count", Best::Neither);
        table.push(vec!["a,b".into(), 1234.5.into(), 7usize.into()]);
        table.push(vec!["<c>".into(), 3.25.into(), None::<f64>.into()]);
        table
    }

    #[test]
    fn numbers_line_up() {
        let text = sample().to_text();
        let end = |part: &str| {
            text.lines().find_map(|l| l.find(part).map(|at| l[..at + part.len()].chars().count()))
        };
        assert_eq!(end("1,234.50").unwrap(), end("3.25").unwrap(), "{text}");
        assert_eq!(end("ms"), end("3.25"), "{text}");
    }

    #[test]
    fn csv_keeps_full_precision_and_quotes() {
        let csv = sample().to_csv().unwrap();
        assert_eq!(csv, "builder,ms,count\n\"a,b\",1234.5,7\n<c>,3.25,\n");
    }

    #[test]
    fn html_escapes_and_marks_the_best() {
        let html = sample().to_html();
        assert!(html.contains("&lt;c&gt;") && !html.contains("<c>"));
        assert!(html.contains("<strong>3.25</strong>"), "{html}");
        assert!(!html.contains("<strong>1,234.50</strong>"));
    }

    #[test]
    fn digits_are_grouped() {
        assert_eq!(grouped(1_234_567.0, 0), "1,234,567");
        assert_eq!(grouped(-1234.56, 1), "-1,234.6");
        assert_eq!(grouped(999.0, 2), "999.00");
        assert_eq!(grouped(-0.001, 1), "0.0");
    }
}
