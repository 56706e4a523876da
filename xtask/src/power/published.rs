//! Table 1 of paper II, from `assets/published`.

use anyhow::{Context, Result};

/// A cell of the table: energy per pixel and its deviation, in nanojoules.
pub(super) struct Published {
    pub(super) device: String,
    pub(super) algorithm: String,
    pub(super) energy: f64,
    pub(super) deviation: f64,
}

/// The algorithms in the order of the table's columns.
pub(super) const ALGORITHMS: [&str; 6] = ["FR", "ZR", "DR", "SV", "SM", "VSM"];

/// Lights of the shadow algorithms in the table.
pub(super) const LIGHTS: u32 = 4;

/// All cells.
pub(super) fn table_1() -> Result<Vec<Published>> {
    let text = include_str!("../../../assets/published/ii-table-1.csv");
    let mut rows = csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(text.as_bytes());
    let mut cells: Vec<Published> = Vec::new();
    for row in rows.records() {
        let row = row?;
        let cell = |at: usize| row.get(at).context("ii-table-1.csv has too few columns");
        let value: f64 = cell(5)?.parse()?;
        if cell(3)? == "energy" {
            cells.push(Published {
                device: cell(1)?.into(),
                algorithm: cell(2)?.into(),
                energy: value,
                deviation: f64::NAN,
            });
        } else if let Some(last) = cells.last_mut() {
            last.deviation = value;
        }
    }
    Ok(cells)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_has_what_the_paper_prints() {
        let cells = table_1().unwrap();
        assert_eq!(cells.len(), 3 * 6 + 3);
        let of = |device: &str, algorithm: &str| {
            let cell = cells.iter().find(|c| c.device == device && c.algorithm == algorithm);
            cell.map(|c| (c.energy, c.deviation))
        };
        assert_eq!(of("GeForce 580", "DR"), Some((510.6, 87.1)));
        assert_eq!(of("Radeon 7970", "VSM"), Some((804.0, 250.0)));
        assert_eq!(of("iPhone 4S", "DR"), None);
    }
}
