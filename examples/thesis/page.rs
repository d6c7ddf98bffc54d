//! The page: each figure beside what is known of the thesis's own.

use crate::{Figure, Outcome};
use std::fmt::Write as _;
use std::path::Path;

const STYLE: &str = "
:root { color-scheme: light; }
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 62rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.1rem; margin: 2.5rem 0 0.5rem; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: 0.2rem 1rem; margin: 0; }
dt { color: #555; } dd { margin: 0; }
figure { margin: 1rem 0; overflow-x: auto; } figure svg { display: block; width: 100%; min-width: 34rem; height: auto; }
table { border-collapse: collapse; } div { overflow-x: auto; }
th, td { text-align: left; padding: 0.3rem 1rem 0.3rem 0; border-bottom: 1px solid #ddd; white-space: nowrap; }
";

const WHAT_IS_KNOWN: &str = "\
    The thesis's parameters are known for its FIR example (figures 5.11 to 5.17 and table 5.1), whose norm is about \
    4 %. Of its IIR example (figures 5.8 to 5.10) the norm of 4.68 % and the order of 28 are known, but not the front \
    end Phi, so those figures are drawn with the Phi of the FIR example and cannot be compared number by number. What \
    figures 5.8 to 5.13 show, and in which order, is taken from the demonstration of the article of 2008. The values of \
    table 5.1 are not known here.";

/// A method in table 5.1.
pub(super) struct Row {
    pub(super) method: &'static str,
    /// RMSE and largest error for each signal.
    pub(super) errors: Vec<(f64, f64)>,
}

/// All that was made.
pub(super) struct Page {
    pub(super) figures: Vec<Figure>,
    pub(super) table: Vec<Row>,
}

impl Page {
    /// Writes the page and each chart.
    pub(super) fn write(&self, folder: &Path) -> Outcome<()> {
        let mut shown = Vec::new();
        for figure in &self.figures {
            let mut charts = Vec::new();
            for (chart, part) in figure.charts.iter().zip('a'..) {
                let svg = chart.to_svg()?;
                let part = if figure.charts.len() > 1 { part.to_string() } else { String::new() };
                std::fs::write(folder.join(format!("figure-{}{part}.svg", figure.number)), &svg)?;
                charts.push(svg);
            }
            shown.push((figure, charts));
        }
        std::fs::write(folder.join("index.html"), self.html(&shown))?;
        Ok(())
    }

    /// What is printed.
    pub(super) fn summary(&self) -> String {
        let mut text = String::new();
        for Figure { number, title, found, .. } in &self.figures {
            let _ = writeln!(text, "{number:<5} {title}\n      {found}");
        }
        text += "\nTable 5.1                step: RMSE, largest       cosines: RMSE, largest\n";
        for Row { method, errors } in &self.table {
            let _ = write!(text, "{method:<22}");
            for (rmse, most) in errors {
                let _ = write!(text, "   {rmse:>9.3e}  {most:>9.3e}   ");
            }
            text.push('\n');
        }
        text
    }

    fn html(&self, shown: &[(&Figure, Vec<String>)]) -> String {
        let title = "Hybrid filter banks: figures 5.8 to 5.17 and table 5.1 of the thesis";
        let charts: String = shown.iter().map(|(figure, charts)| figure_html(figure, charts)).collect();
        format!(
            "<!DOCTYPE html>
<html lang=\"en\">
<head>
<meta charset=\"utf-8\">
<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">
<link rel=\"icon\" href=\"data:,\">
<title>{title}</title>
<style>{STYLE}</style>
</head>
<body>
<h1>{title}</h1>
<p>{WHAT_IS_KNOWN}</p>
{charts}<h2>Table 5.1: errors over fast samples 41 to 199</h2>
{}</body>
</html>
",
            self.table_html()
        )
    }

    fn table_html(&self) -> String {
        let error = |(rmse, most): &(f64, f64)| format!("<td>{rmse:.3e}</td><td>{most:.3e}</td>");
        let row = |row: &Row| {
            let errors: String = row.errors.iter().map(error).collect();
            format!("<tr><td>{}</td>{errors}</tr>\n", row.method)
        };
        let rows: String = self.table.iter().map(row).collect();
        format!(
            "<div><table>\n<tr><th>method</th><th>step: RMSE</th><th>largest</th><th>cosines: RMSE</th>\
             <th>largest</th></tr>\n{rows}</table></div>\n"
        )
    }
}

fn figure_html(Figure { number, title, thesis, found, .. }: &Figure, charts: &[String]) -> String {
    let charts: String = charts.iter().map(|chart| format!("<figure>{chart}</figure>\n")).collect();
    format!(
        "<h2>Figure {number}: {title}</h2>\n<dl><dt>thesis</dt><dd>{thesis}</dd>\n\
         <dt>here</dt><dd>{found}</dd></dl>\n{charts}"
    )
}
