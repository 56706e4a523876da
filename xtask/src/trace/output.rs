//! Hits into files.

use anyhow::{Context, Result, bail};
use niwaki_core::Hit;
use std::{
    fs::File,
    io::{BufWriter, Write},
    path::Path,
};

/// How hits are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OutputFormat {
    Csv,
    Npy,
}

impl OutputFormat {
    /// By the name of the file.
    pub(crate) fn of(path: &Path) -> Result<Self> {
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        match extension.as_str() {
            "csv" => Ok(Self::Csv),
            "npy" => Ok(Self::Npy),
            _ => bail!("--out {} must end in .csv or .npy", path.display()),
        }
    }

    /// Writes a file, and the folders that lead to it.
    pub(crate) fn save(self, path: &Path, hits: &[Hit]) -> Result<()> {
        let context = || format!("cannot write hits to {}", path.display());
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).with_context(context)?;
        }
        let mut out = BufWriter::new(File::create(path).with_context(context)?);
        self.write(&mut out, hits).and_then(|()| Ok(out.flush()?)).with_context(context)
    }

    fn write(self, mut out: impl Write, hits: &[Hit]) -> Result<()> {
        match self {
            Self::Csv => {
                writeln!(out, "t,u,v,primitive")?;
                for hit in hits {
                    let Hit { t, u, v, .. } = hit;
                    // `{:?}` is the shortest text that reads as the same number, with exponents.
                    writeln!(out, "{t:?},{u:?},{v:?},{}", primitive(hit))?;
                }
            }
            Self::Npy => {
                out.write_all(&npy_header(hits.len()))?;
                for hit in hits {
                    for field in [hit.t, hit.u, hit.v] {
                        out.write_all(&field.to_le_bytes())?;
                    }
                    out.write_all(&primitive(hit).to_le_bytes())?;
                }
            }
        }
        Ok(())
    }
}

/// −1 for a miss. Trees have less than 2³¹ primitives.
fn primitive(hit: &Hit) -> i32 {
    const { assert!(Hit::NO_PRIM.cast_signed() == -1) };
    hit.prim_id.cast_signed()
}

/// Version 1.0 of NumPy's format: mark, version, length of the text, text padded to 64 bytes.
fn npy_header(count: usize) -> Vec<u8> {
    let text = format!(
        "{{'descr': [('t', '<f4'), ('u', '<f4'), ('v', '<f4'), ('primitive', '<i4')], \
         'fortran_order': False, 'shape': ({count},), }}"
    );
    // 6 + 2 + 2 bytes before the text, a line break after it.
    let whole = (10 + text.len() + 1).next_multiple_of(64);
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    let length = u16::try_from(whole - 10).unwrap_or(u16::MAX);
    out.extend(length.to_le_bytes());
    out.extend(text.as_bytes());
    out.resize(whole - 1, b' ');
    out.push(b'\n');
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const HITS: [Hit; 2] = [Hit { t: 1.5, u: 0.25, v: 1e-30, prim_id: 7 }, Hit::MISS];

    fn written(format: OutputFormat) -> Vec<u8> {
        let mut out = Vec::new();
        format.write(&mut out, &HITS).unwrap();
        out
    }

    #[test]
    fn csv_has_a_header_and_minus_one_for_a_miss() {
        let text = String::from_utf8(written(OutputFormat::Csv)).unwrap();
        assert_eq!(text, "t,u,v,primitive\n1.5,0.25,1e-30,7\ninf,0.0,0.0,-1\n");
    }

    #[test]
    fn npy_is_as_numpy_specifies() {
        let bytes = written(OutputFormat::Npy);
        assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
        let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        assert_eq!((10 + length) % 64, 0);
        let text = std::str::from_utf8(&bytes[10..10 + length]).unwrap();
        assert!(text.contains("'shape': (2,), }") && text.ends_with('\n'), "{text}");
        let data = &bytes[10 + length..];
        assert_eq!(data.len(), 2 * 16);
        assert_eq!(data[..4], 1.5_f32.to_le_bytes());
        assert_eq!(data[12..16], 7_i32.to_le_bytes());
        assert_eq!(data[28..], (-1_i32).to_le_bytes());
    }

    #[test]
    fn the_name_decides() {
        assert_eq!(OutputFormat::of(Path::new("a/b.CSV")).unwrap(), OutputFormat::Csv);
        assert_eq!(OutputFormat::of(Path::new("b.npy")).unwrap(), OutputFormat::Npy);
        for bad in ["b.txt", "csv", ""] {
            assert!(OutputFormat::of(Path::new(bad)).is_err(), "{bad}");
        }
    }
}
