//! CSV with named columns.

use crate::{RayFileError, ray};
use niwaki_core::Ray;
use std::io::Read;

/// The columns in the order of a binary record, under both of their names.
const COLUMNS: [[&str; 2]; 8] = [
    ["origin_x", "ox"],
    ["origin_y", "oy"],
    ["origin_z", "oz"],
    ["t_min", "tmin"],
    ["direction_x", "dx"],
    ["direction_y", "dy"],
    ["direction_z", "dz"],
    ["t_max", "tmax"],
];

/// What a column that is not there holds.
const DEFAULTS: [Option<f32>; 8] =
    [None, None, None, Some(0.0), None, None, None, Some(f32::INFINITY)];

/// The long names of all columns.
pub(crate) fn names() -> String {
    COLUMNS.map(|[name, _]| name).join(",")
}

/// Reads CSV whose first line names its columns, in any order and either case:
///
/// ```text
/// origin_x,origin_y,origin_z,t_min,direction_x,direction_y,direction_z,t_max
/// ```
///
/// or `ox,oy,oz,tmin,dx,dy,dz,tmax`. The two of `t` may be missing and are then 0 and ∞; other
/// columns are ignored, as are empty lines, spaces around fields, and lines that begin with `#`.
/// Numbers are what Rust reads as `f32`, `inf` and `nan` among them.
///
/// # Errors
/// All variants of [`RayFileError`] but [`RayFileError::PartialRecord`]; they name the line.
pub fn read_csv(input: impl Read) -> Result<Vec<Ray>, RayFileError> {
    let mut reader =
        csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(input);
    let columns = columns(reader.headers()?)?;
    let mut rays = Vec::new();
    let mut record = csv::StringRecord::new();
    while reader.read_record(&mut record)? {
        let mut fields = [0.0; 8];
        for (i, field) in fields.iter_mut().enumerate() {
            *field = match (columns[i], DEFAULTS[i]) {
                (Some(column), _) => {
                    let text = record.get(column).unwrap_or_default();
                    text.parse().map_err(|_| RayFileError::NotANumber {
                        line: record.position().map_or(0, csv::Position::line),
                        column: COLUMNS[i][0],
                        text: text.to_owned(),
                    })?
                }
                (None, default) => default.unwrap_or(f32::NAN),
            };
        }
        rays.push(ray(fields));
    }
    Ok(rays)
}

/// Where each field stands.
fn columns(header: &csv::StringRecord) -> Result<[Option<usize>; 8], RayFileError> {
    let mut columns = [None; 8];
    for (column, name) in header.iter().enumerate() {
        let is = |known: &&str| name.eq_ignore_ascii_case(known);
        let Some(i) = COLUMNS.iter().position(|known| known.iter().any(is)) else {
            continue;
        };
        if columns[i].replace(column).is_some() {
            return Err(RayFileError::ColumnTwice { column: COLUMNS[i][0] });
        }
    }
    match (0..8).find(|&i| columns[i].is_none() && DEFAULTS[i].is_none()) {
        None => Ok(columns),
        Some(i) => Err(RayFileError::MissingColumn {
            column: COLUMNS[i][0],
            found: header.iter().collect::<Vec<_>>().join(","),
        }),
    }
}
