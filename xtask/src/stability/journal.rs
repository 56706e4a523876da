//! What is known so far, on disk: a run that is ended can go on.

use super::Finding;
use super::engines::Engine;
use anyhow::{Context, Result, bail};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// The first line.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Header {
    schema: u32,
    /// What the findings depend on.
    options: Vec<String>,
}

/// Every other line: all that came of an engine at a case.
#[derive(Debug, Serialize, Deserialize)]
struct Entry {
    case: String,
    engine: String,
    findings: Vec<Finding>,
}

/// An open journal.
#[derive(Debug)]
pub(crate) struct Journal {
    path: PathBuf,
    file: File,
}

/// Findings by case and engine.
pub(crate) type Known = HashMap<(String, String), Vec<Finding>>;

impl Journal {
    /// Begins a journal; or goes on with one, and returns what it has, where `resume` says so and
    /// there is one.
    ///
    /// # Errors
    /// If it cannot be read or written, or is that of a run with other options.
    pub(crate) fn open(out: &Path, options: Vec<String>, resume: bool) -> Result<(Self, Known)> {
        let header = Header { schema: 2, options };
        let path = out.join("journal.jsonl");
        std::fs::create_dir_all(out).with_context(|| format!("cannot create {}", out.display()))?;
        let mut known = Known::new();
        let old = if resume && path.exists() {
            std::fs::read_to_string(&path)
                .with_context(|| format!("cannot read {}", path.display()))?
        } else {
            String::new()
        };
        // The last line may be cut off where the program was.
        let whole = old.rfind('\n').map_or(0, |end| end + 1);
        let mut lines = old[..whole].lines();
        if let Some(first) = lines.next() {
            let found: Header = serde_json::from_str(first)
                .with_context(|| format!("{} is no journal", path.display()))?;
            if found != header {
                bail!(
                    "{} is of a run with other options ({}); choose another --out or leave --resume",
                    path.display(),
                    found.options.join(" ")
                );
            }
        }
        for line in lines {
            let Entry { case, engine, findings } = serde_json::from_str(line)
                .with_context(|| format!("{} has a line that is none", path.display()))?;
            known.insert((case, engine), findings);
        }
        let file = OpenOptions::new().create(true).write(true).truncate(false).open(&path);
        let file = file.with_context(|| format!("cannot write {}", path.display()))?;
        file.set_len(whole as u64)?;
        let mut journal = Self { path, file };
        std::io::Seek::seek(&mut journal.file, std::io::SeekFrom::End(0))?;
        if whole == 0 {
            journal.write(&header)?;
        }
        Ok((journal, known))
    }

    /// Adds what came of an engine at a case.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(crate) fn add(&mut self, case: &str, engine: &Engine, found: &[Finding]) -> Result<()> {
        let (case, engine) = (case.to_owned(), engine.label());
        self.write(&Entry { case, engine, findings: found.to_vec() })
    }

    fn write(&mut self, line: &impl Serialize) -> Result<()> {
        let mut text = serde_json::to_string(line)?;
        text.push('\n');
        let written = self.file.write_all(text.as_bytes());
        written.with_context(|| format!("cannot write {}", self.path.display()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_goes_on_where_it_was_cut_off() {
        let out = std::env::temp_dir().join(format!("niwaki-journal-{}", std::process::id()));
        let options = |seed: &str| vec!["--seed".to_owned(), seed.to_owned()];
        let (mut journal, known) = Journal::open(&out, options("1"), true).unwrap();
        assert!(known.is_empty());
        journal.add("one", &Engine::BruteForce, &[]).unwrap();
        journal.file.write_all(b"{\"case\":\"tw").unwrap();

        let (mut journal, known) = Journal::open(&out, options("1"), true).unwrap();
        assert_eq!(known.len(), 1);
        journal.add("two", &Engine::BruteForce, &[]).unwrap();
        let (_, known) = Journal::open(&out, options("1"), true).unwrap();
        assert!(known.contains_key(&("two".to_owned(), Engine::BruteForce.label())));

        let error = Journal::open(&out, options("2"), true).unwrap_err().to_string();
        assert!(error.contains("--seed 1"), "{error}");
        let (_, known) = Journal::open(&out, options("2"), false).unwrap();
        assert!(known.is_empty());
        std::fs::remove_dir_all(&out).unwrap();
    }
}
