//! The report: the tables, and a map of cases against kernels.

use super::Catalogue;
use super::summary::{Sum, subject, subjects, tables};
use crate::report::page::{FOOT, add_table, head, run_header};
use crate::report::table::escape;
use crate::report::write_page;
use anyhow::Result;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Writes `stability.html` and `csv/*.csv` into a folder; returns the path of the former.
pub(crate) fn write(catalogue: &Catalogue, out: &Path) -> Result<PathBuf> {
    let mut html = head("Stability: hard cases against every builder, kernel and peer");
    let mut files = Vec::new();
    html.push_str(&run_header(&catalogue.run, None));
    html.push_str(
        "<p>Answers are compared with exact arithmetic. <em>Wrong</em> is what no rounding \
         excuses; <em>rounding</em> is a hit that was lost or gained within a few units in the \
         last place of a triangle's border. From inside a closed surface every ray must hit: each \
         that does not is a <em>leak</em>. A kernel of ours has one line for all builders; a peer \
         has one for each of its structures.</p>\n",
    );
    for (i, (title, table)) in tables(catalogue).iter().enumerate() {
        let _ = writeln!(html, "<h2>{}</h2>", escape(title.trim()));
        add_table(&mut html, &mut files, table)?;
        if i == 0 {
            map(&mut html, catalogue);
        }
    }
    html.push_str("<h2>The cases</h2>\n<dl class=\"run\">\n");
    for (name, why, triangles) in &catalogue.cases {
        let (name, why) = (escape(name), escape(why));
        let _ = writeln!(html, "<dt>{name}</dt><dd>{why} ({triangles} triangles)</dd>");
    }
    html.push_str("</dl>\n");
    html.push_str(FOOT);
    write_page(&html, files, out, "stability.html")
}

/// Class, sign and explanation of a place in the map.
fn place(sum: &Sum) -> (&'static str, &'static str, String) {
    if sum.failures() > 0 {
        return ("dead", "✕", format!("{} panics, crashes or hangs", sum.failures()));
    }
    if sum.wrong() > 0 {
        return ("wrong", "!", format!("{} wrong", sum.wrong()));
    }
    if sum.leaks > 0 {
        let rate = sum.leaks_per_million().unwrap_or_default();
        return ("leak", "~", format!("{rate:.1} leaks per million"));
    }
    if sum.refused() > 0 {
        return ("refused", "–", "refused".into());
    }
    ("good", "", "nothing wrong".into())
}

/// Cases against subjects, the worst of each in colour and by a sign.
fn map(html: &mut String, catalogue: &Catalogue) {
    let subjects = subjects(catalogue);
    html.push_str(
        "<h2>Case by case</h2>\n<p class=\"map\"><span class=\"dead\">✕</span> panic, crash or \
         hang <span class=\"wrong\">!</span> wrong answers <span class=\"leak\">~</span> leaks \
         <span class=\"refused\">–</span> refused <span class=\"good\">&nbsp;</span> nothing \
         wrong</p>\n<div class=\"scroll\"><table class=\"map\"><thead><tr><th>case</th>",
    );
    for name in &subjects {
        let _ = write!(html, "<th class=\"up\"><span>{}</span></th>", escape(name));
    }
    html.push_str("</tr></thead><tbody>\n");
    for (case, why, _) in &catalogue.cases {
        let _ = write!(html, "<tr><th title=\"{}\">{}</th>", escape(why), escape(case));
        for name in &subjects {
            let here: Vec<_> = (catalogue.findings.iter())
                .filter(|f| f.case == *case && subject(f) == *name)
                .collect();
            if here.is_empty() {
                html.push_str("<td></td>");
                continue;
            }
            let (class, sign, what) = place(&Sum::of(here));
            let title = escape(&format!("{case}, {name}: {what}"));
            let _ = write!(html, "<td class=\"{class}\" title=\"{title}\">{sign}</td>");
        }
        html.push_str("</tr>\n");
    }
    html.push_str("</tbody></table></div>\n");
}
