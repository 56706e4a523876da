//! Rays from files.

use anyhow::{Context, Result, bail, ensure};
use niwaki_core::{Ray, glam::Vec3};
use std::{
    fs::File,
    io::{BufReader, Read},
    path::Path,
};

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

/// Bytes of a binary record.
const RECORD: usize = 32;

/// Reads a CSV file or, if it is not called `.csv`, a binary one.
pub(crate) fn load(path: &Path) -> Result<Vec<Ray>> {
    let context = || format!("cannot read rays from {}", path.display());
    let file = File::open(path).with_context(context)?;
    let is_csv = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv"));
    let input = BufReader::new(file);
    if is_csv { from_csv(input) } else { from_binary(input) }.with_context(context)
}

fn ray(fields: [f32; 8]) -> Ray {
    let [ox, oy, oz, t_min, dx, dy, dz, t_max] = fields;
    Ray { origin: Vec3::new(ox, oy, oz), t_min, direction: Vec3::new(dx, dy, dz), t_max }
}

fn from_binary(mut input: impl Read) -> Result<Vec<Ray>> {
    let mut bytes = Vec::new();
    input.read_to_end(&mut bytes)?;
    let (records, rest) = (bytes.chunks_exact(RECORD), bytes.len() % RECORD);
    ensure!(
        rest == 0,
        "it has {} bytes, which is {} records of {RECORD} bytes and {rest} more; a record is origin \
         x, y, z, t_min, direction x, y, z, t_max as little-endian 32-bit floats (CSV files must be \
         called .csv)",
        bytes.len(),
        bytes.len() / RECORD,
    );
    let field =
        |record: &[u8], i: usize| f32::from_le_bytes([0, 1, 2, 3].map(|k| record[4 * i + k]));
    Ok(records.map(|record| ray([0, 1, 2, 3, 4, 5, 6, 7].map(|i| field(record, i)))).collect())
}

fn from_csv(input: impl Read) -> Result<Vec<Ray>> {
    let mut reader =
        csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(input);
    let columns = columns(reader.headers().context("line 1")?)?;
    let mut rays = Vec::new();
    let mut record = csv::StringRecord::new();
    // The reader's own errors name the line.
    while reader.read_record(&mut record)? {
        let mut fields = [0.0; 8];
        for (i, field) in fields.iter_mut().enumerate() {
            *field = match (columns[i], DEFAULTS[i]) {
                (Some(column), _) => {
                    let text = record.get(column).unwrap_or_default();
                    let line = record.position().map_or(0, csv::Position::line);
                    text.parse().ok().with_context(|| {
                        format!("line {line}: {} is `{text}`, not a number", COLUMNS[i][0])
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
fn columns(header: &csv::StringRecord) -> Result<[Option<usize>; 8]> {
    let names = || COLUMNS.map(|[name, _]| name).join(",");
    let mut columns = [None; 8];
    for (column, name) in header.iter().enumerate() {
        let is = |known: &&str| name.eq_ignore_ascii_case(known);
        let Some(i) = COLUMNS.iter().position(|known| known.iter().any(is)) else {
            continue;
        };
        if columns[i].replace(column).is_some() {
            bail!("line 1: {} is there twice", COLUMNS[i][0]);
        }
    }
    let missing = (0..8).find(|&i| columns[i].is_none() && DEFAULTS[i].is_none());
    if let Some(i) = missing {
        let found: Vec<_> = header.iter().collect();
        bail!(
            "line 1 must name the columns {}; {} is missing in `{}`",
            names(),
            COLUMNS[i][0],
            found.join(",")
        );
    }
    Ok(columns)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn csv(text: &str) -> Result<Vec<Ray>> {
        from_csv(text.as_bytes())
    }

    fn error(text: &str) -> String {
        format!("{:#}", csv(text).unwrap_err())
    }

    #[test]
    fn columns_come_in_any_order_and_may_be_left_out() {
        let all = "origin_x,origin_y,origin_z,t_min,direction_x,direction_y,direction_z,t_max\n\
                   1,2,3,0.5,4,-5,6e-3,inf\n";
        let expected = ray([1.0, 2.0, 3.0, 0.5, 4.0, -5.0, 6e-3, f32::INFINITY]);
        assert_eq!(csv(all).unwrap(), [expected]);
        let short = "# a comment\nid, DX ,dy,dz,oz,oy,ox\n7, 4,-5,6e-3, 3,2,1\n\n8,4,-5,6e-3,3,2,1";
        assert_eq!(csv(short).unwrap(), [Ray { t_min: 0.0, ..expected }; 2]);
        assert_eq!(csv("ox,oy,oz,dx,dy,dz\n").unwrap(), []);
        assert!(csv("ox,oy,oz,dx,dy,dz\n1,2,3,nan,0,0").unwrap()[0].direction.x.is_nan());
    }

    #[test]
    fn errors_name_line_and_column() {
        let header = "ox,oy,oz,dx,dy,dz\n";
        let bad = error(&format!("{header}1,2,3,4,5,6\n1,2,3,4,five,6\n"));
        assert!(
            bad.contains("line 3") && bad.contains("direction_y") && bad.contains("five"),
            "{bad}"
        );
        let empty = error(&format!("{header}1,2,3,4,,6\n"));
        assert!(empty.contains("line 2") && empty.contains("direction_y"), "{empty}");
        let short = error(&format!("{header}1,2,3,4,5,6\n1,2,3\n"));
        assert!(short.contains("line: 3") || short.contains("line 3"), "{short}");
        let missing = error("ox,oy,dx,dy,dz\n1,2,3,4,5\n");
        assert!(missing.contains("origin_z is missing"), "{missing}");
        let no_header = error("1,2,3,4,5,6\n");
        assert!(no_header.contains("line 1 must name"), "{no_header}");
        assert!(error("ox,oy,oz,dx,dy,dz,origin_x\n").contains("origin_x is there twice"));
        assert!(error("").contains("line 1 must name"));
    }

    #[test]
    fn binary_records_are_little_endian_and_whole() {
        let fields = [1.0, 2.0, 3.0, 0.5, 4.0, -5.0, 6e-3, f32::INFINITY];
        let mut bytes: Vec<u8> = fields.iter().flat_map(|f: &f32| f.to_le_bytes()).collect();
        assert_eq!(&bytes[..4], [0, 0, 0x80, 0x3f]);
        bytes.extend(bytes.clone());
        assert_eq!(from_binary(&bytes[..]).unwrap(), [ray(fields); 2]);
        assert_eq!(from_binary(&[][..]).unwrap(), []);
        let error = from_binary(&bytes[..63]).unwrap_err().to_string();
        assert!(error.contains("63 bytes") && error.contains("31 more"), "{error}");
    }
}
