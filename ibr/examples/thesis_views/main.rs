//! The virtual experiments of the thesis on image-based rendering, chapters 3 and 4: figures 3.5 to 3.7, 3.9
//! and 4.6 to 4.8 as charts, tables 3.1 and 4.1, and a page that sets them beside what the thesis claims.
//!
//! ```text
//! cargo run --release -p hybank-ibr --example thesis_views -- [FOLDER] [--few]
//! ```
//!
//! writes `index.html` and the charts to FOLDER (`thesis_views`). Figure 3.9 takes the photographs "Cones"
//! from the folder HYBANK_DATA, and a synthetic scene if they are not there. `--few` makes the experiments
//! small.

mod flat;
mod page;
mod scanlines;
mod spatial;
#[path = "../demo/synthetic.rs"]
mod synthetic;
mod tables;
mod theory;

use hybank::plot::{Chart, Series};
use page::{Page, Verdict};
use std::path::PathBuf;

/// How large the experiments are.
#[derive(Clone, Copy)]
struct Effort {
    few: bool,
}

impl Effort {
    /// `all`, or `some` of a small run.
    fn of<T>(self, all: T, some: T) -> T {
        if self.few { some } else { all }
    }
}

/// A chart with what the thesis claims of it and what was found.
struct Figure {
    file: &'static str,
    chart: Chart,
    verdicts: Vec<Verdict>,
}

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

fn main() -> Outcome<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let effort = Effort { few: arguments.iter().any(|a| a == "--few") };
    let folder = arguments.iter().find(|a| !a.starts_with("--")).map_or("thesis_views", String::as_str);
    let folder = PathBuf::from(folder);
    std::fs::create_dir_all(&folder)?;
    let mut page = Page::default();
    let figures = [
        flat::pixels(effort)?,
        flat::texture_errors(effort)?,
        flat::depth_errors(effort)?,
        scanlines::rows(effort)?,
        spatial::pixels(effort)?,
        spatial::texture_errors(effort)?,
        spatial::depth_errors(effort)?,
    ];
    page.table(tables::intervals(effort)?);
    for figure in figures {
        std::fs::write(folder.join(figure.file), figure.chart.to_svg()?)?;
        page.figure(&figure);
    }
    page.table(tables::triangles(effort)?);
    let index = folder.join("index.html");
    std::fs::write(&index, page.html())?;
    print!("{}", page.summary());
    println!("{}", index.display());
    match page.misses() {
        0 => Ok(()),
        misses => Err(format!("{misses} claims were not found again").into()),
    }
}

type Curve = Vec<(f64, f64)>;

/// Points of decimal logarithms, for decays.
fn decades(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    points.iter().map(|(x, y)| (x.log10(), y.log10())).collect()
}

/// A chart of labelled curves.
fn chart(title: impl Into<String>, [x, y]: [&str; 2], curves: Vec<(&str, Curve)>) -> Chart {
    let series = curves.into_iter().map(|(label, points)| Series { label: label.into(), points }).collect();
    Chart { title: title.into(), x_label: x.into(), y_label: y.into(), series, ..Chart::default() }
}

/// What is measured and what is predicted at some levels.
fn swept(levels: &[f64], at: impl Fn(f64) -> Outcome<(f64, f64)>) -> Outcome<(Curve, Curve)> {
    let (mut measured, mut predicted) = (Vec::new(), Vec::new());
    for level in levels {
        let found = at(*level)?;
        measured.push((*level, found.0));
        predicted.push((*level, found.1));
    }
    Ok((measured, predicted))
}

/// Slope of the least-squares line through points.
fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let (mx, my) = points.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
    let top: f64 = points.iter().map(|(x, y)| (x - mx) * (y - my)).sum();
    top / points.iter().map(|(x, _)| (x - mx) * (x - mx)).sum::<f64>()
}

/// Mean over draws of an experiment that may find no sample.
fn mean(draws: u64, trial: impl Fn(u64) -> Option<f64>) -> Outcome<f64> {
    let sum: Option<f64> = (0..draws).map(trial).sum();
    Ok(sum.ok_or("an experiment found no samples")? / draws as f64)
}
