//! Reads rays from CSV and binary files.
//!
//! ```
//! use niwaki_ray_file::{RayFileError, read_binary, read_csv};
//!
//! let rays = read_csv("ox,oy,oz,dx,dy,dz\n1,2,3,0,0,-1\n".as_bytes())?;
//! assert_eq!((rays[0].origin.z, rays[0].t_min, rays[0].t_max), (3.0, 0.0, f32::INFINITY));
//!
//! let error = read_csv("ox,oy,oz,dx,dy,dz\n1,2,three,0,0,-1\n".as_bytes()).unwrap_err();
//! assert_eq!(error.to_string(), "line 2: origin_z is `three`, not a number");
//! assert!(matches!(read_binary(&[0; 33][..]), Err(RayFileError::PartialRecord { bytes: 33 })));
//! # Ok::<(), RayFileError>(())
//! ```
//!
//! | function | reads |
//! |---|---|
//! | [`load`] | a file, by its name |
//! | [`read_csv`] | CSV with named columns |
//! | [`read_binary`] | records of eight 32-bit floats |
//!
//! Rays are not judged: one with NaN in it is a ray, which hits nothing. Reading takes memory in
//! proportion to the file.
//!
//! There are no feature flags.

mod binary_file;
mod csv_file;
mod error;

pub use binary_file::read_binary;
pub use csv_file::read_csv;
pub use error::RayFileError;

use niwaki_core::{Ray, glam::Vec3};
use std::{fs::File, io::BufReader, path::Path};

/// Reads a CSV file or, if its name does not end in `.csv`, a binary one.
///
/// # Errors
/// As [`read_csv`] and [`read_binary`]; none of them names the file.
pub fn load(path: &Path) -> Result<Vec<Ray>, RayFileError> {
    let input = BufReader::new(File::open(path)?);
    let is_csv = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv"));
    if is_csv { read_csv(input) } else { read_binary(input) }
}

/// Of the fields in the order of a binary record.
fn ray(fields: [f32; 8]) -> Ray {
    let [ox, oy, oz, t_min, dx, dy, dz, t_max] = fields;
    Ray { origin: Vec3::new(ox, oy, oz), t_min, direction: Vec3::new(dx, dy, dz), t_max }
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
