//! What the pages share: the head, the header of a run, tables and figures with their CSV.

use super::table::{Table, escape};
use crate::results::{Failure, Run};
use anyhow::{Context, Result};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use std::fmt::Write as _;
use std::path::Path;

/// A file to be written beside the report: its name without `.csv`, and its text.
pub(crate) type Csv = (String, String);

const STYLE: &str = include_str!("style.css");

/// The beginning of a page, up to and with its heading.
pub(crate) fn head(title: &str) -> String {
    let title = escape(title);
    format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width\">\n\
         <title>{title}</title>\n<style>\n{STYLE}</style></head><body><main>\n<h1>{title}</h1>\n"
    )
}

/// The end of a page.
pub(crate) const FOOT: &str = "</main></body></html>\n";

/// The header of a run.
pub(crate) fn run_header(run: &Run, number: Option<usize>) -> String {
    let mut html = String::from("<dl class=\"run\">");
    let mut add = |name: &str, value: &str| {
        if !value.is_empty() {
            let _ = write!(html, "<dt>{name}</dt><dd>{}</dd>", escape(value));
        }
    };
    if let Some(number) = number {
        add("run", &number.to_string());
    }
    let machine = &run.machine;
    add("machine", &format!("{}, {} hardware threads, {}", machine.cpu, machine.cores, machine.os));
    add("instructions", &machine.isa.join(" "));
    let threads: Vec<_> = run.threads.iter().map(ToString::to_string).collect();
    add("threads", &threads.join(", "));
    add("wide trees", &run.collapse);
    add("compiler", &format!("{}; {}", run.rustc, run.flags));
    let peers = if run.peers.is_empty() { "none".into() } else { run.peers.join(", ") };
    add("peers", &peers);
    let revision = run.revision.as_deref().map(|r| format!(", revision {r}")).unwrap_or_default();
    add("when", &format!("{}{revision}", run.date));
    add("arguments", &run.arguments.join(" "));
    add("shard", run.shard.as_deref().unwrap_or_default());
    html.push_str("</dl>\n");
    html
}

/// The list of what failed, if anything did.
pub(crate) fn failures(html: &mut String, failures: &[Failure]) {
    if failures.is_empty() {
        return;
    }
    html.push_str("<h2>What failed</h2>\n<ul class=\"failures\">\n");
    for failure in failures {
        let (scene, error) = (escape(&failure.scene), escape(&failure.error));
        let _ = writeln!(html, "<li><strong>{scene}</strong>: {error}</li>");
    }
    html.push_str("</ul>\n");
}

/// A plot with the CSV of its data.
pub(crate) fn figure(
    html: &mut String,
    files: &mut Vec<Csv>,
    svg: &str,
    caption: &str,
    data: &Table,
) -> Result<()> {
    let csv = data.to_csv()?;
    let link = csv_link(&data.name, &csv);
    let _ = writeln!(html, "<figure>{svg}<figcaption>{caption} {link}</figcaption></figure>");
    if !files.iter().any(|(name, _)| *name == data.name) {
        files.push((data.name.clone(), csv));
    }
    Ok(())
}

/// A table with its CSV.
pub(crate) fn add_table(html: &mut String, files: &mut Vec<Csv>, table: &Table) -> Result<()> {
    let csv = table.to_csv()?;
    html.push_str(&table.to_html());
    let _ = writeln!(html, "<p class=\"csv\">{}</p>", csv_link(&table.name, &csv));
    files.push((table.name.clone(), csv));
    Ok(())
}

/// A PNG file as the address of an image that the page holds.
pub(crate) fn picture_data(path: &Path) -> Result<String> {
    let bytes = std::fs::read(path)
        .with_context(|| format!("cannot read the picture {}", path.display()))?;
    Ok(format!("data:image/png;base64,{}", BASE64.encode(bytes)))
}

/// A link that holds the file.
pub(crate) fn csv_link(name: &str, csv: &str) -> String {
    let data = BASE64.encode(csv);
    format!("<a download=\"{name}.csv\" href=\"data:text/csv;base64,{data}\">{name}.csv</a>")
}
