//! The page: figures and tables beside the claims of the thesis.

use crate::Figure;
use std::fmt::Write;

/// A claim of the thesis, and what was found.
pub(crate) struct Verdict {
    pub(crate) claim: String,
    pub(crate) found: String,
    pub(crate) holds: bool,
}

impl Verdict {
    pub(crate) fn new(claim: impl Into<String>, found: impl Into<String>, holds: bool) -> Self {
        Self { claim: claim.into(), found: found.into(), holds }
    }
}

/// Rows of texts under a heading.
pub(crate) struct Table {
    pub(crate) title: &'static str,
    pub(crate) heads: Vec<String>,
    pub(crate) rows: Vec<Vec<String>>,
    pub(crate) verdicts: Vec<Verdict>,
}

/// What has been found.
#[derive(Default)]
pub(crate) struct Page {
    body: String,
    summary: String,
    misses: usize,
}

const HEAD: &str = "<!DOCTYPE html>
<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Error analysis of rendered views</title><style>
body { font: 15px/1.5 sans-serif; max-width: 980px; margin: 2em auto; padding: 0 1em; color: #222 }
img { width: 100% }
table { border-collapse: collapse; margin: 1em 0 }
th, td { border-bottom: 1px solid #ccc; padding: 0.25em 0.9em; text-align: left }
.miss { color: #b00 }
</style></head><body>
<h1>Error analysis of rendered views</h1>
<p>Virtual experiments after H. T. Nguyen, Multisensor signal processing, PhD thesis, University of Illinois at
Urbana-Champaign, 2007, chapters 3 and 4. The scenes are those of hybank_ibr::analysis. MAE is the mean absolute
error, lambda the density of the samples.</p>
";

impl Page {
    pub(crate) fn figure(&mut self, figure: &Figure) {
        let title = escaped(&figure.chart.title);
        let _ = writeln!(self.body, "<h2>{title}</h2>\n<img src=\"{}\" alt=\"{title}\">", figure.file);
        self.verdicts(&figure.chart.title, &figure.verdicts);
    }

    pub(crate) fn table(&mut self, table: Table) {
        let row = |cells: &[String], tag: &str| {
            let cells: String = cells.iter().map(|c| format!("<{tag}>{}</{tag}>", escaped(c))).collect();
            format!("<tr>{cells}</tr>\n")
        };
        let rows: String = table.rows.iter().map(|cells| row(cells, "td")).collect();
        let heads = row(&table.heads, "th");
        let _ = writeln!(self.body, "<h2>{}</h2>\n<table>\n{heads}{rows}</table>", escaped(table.title));
        self.verdicts(table.title, &table.verdicts);
    }

    fn verdicts(&mut self, title: &str, verdicts: &[Verdict]) {
        self.body.push_str("<table>\n<tr><th>claim</th><th>found</th></tr>\n");
        let _ = writeln!(self.summary, "{title}");
        for v in verdicts {
            let class = if v.holds { "" } else { " class=\"miss\"" };
            let (claim, found) = (escaped(&v.claim), escaped(&v.found));
            let _ = writeln!(self.body, "<tr{class}><td>{claim}</td><td>{found}</td></tr>");
            let mark = if v.holds { "  " } else { "! " };
            let _ = writeln!(self.summary, "{mark}{}: {}", v.claim, v.found);
            self.misses += usize::from(!v.holds);
        }
        self.body.push_str("</table>\n");
    }

    pub(crate) fn html(&self) -> String {
        format!("{HEAD}{}</body></html>\n", self.body)
    }

    pub(crate) fn summary(&self) -> &str {
        &self.summary
    }

    /// Claims that were not found again.
    pub(crate) fn misses(&self) -> usize {
        self.misses
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
