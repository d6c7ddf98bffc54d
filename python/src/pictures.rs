//! The pictures of a bank, and the page about it.

use crate::background;
use crate::bank::Bank;
use crate::errors::{refused, warn};
use hybank::bank;
use hybank::overview::page::{CapturesOnPage, MOST_FRAMES, Page};
use hybank::plot::{AxisScale, Chart, Curves};
use hybank::units::Hertz;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::Path;
use std::sync::Arc;

/// The curves of all pictures by their names.
pub(crate) fn pictures<'py>(py: Python<'py>, bank: &Arc<bank::Bank>) -> PyResult<Bound<'py, PyDict>> {
    let bank = Arc::clone(bank);
    let found = background::run(py, None, move |_| hybank::overview::pictures(&bank))?;
    let all = PyDict::new(py);
    for picture in found.map_err(refused)? {
        let one = curves(py, &picture.chart)?;
        one.set_item("caption", picture.caption)?;
        all.set_item(picture.name, one)?;
    }
    Ok(all)
}

fn curves<'py>(py: Python<'py>, chart: &Chart) -> PyResult<Bound<'py, PyDict>> {
    let one = PyDict::new(py);
    one.set_item("title", &chart.title)?;
    one.set_item("x_label", &chart.x_label)?;
    one.set_item("y_label", &chart.y_label)?;
    one.set_item("is_logarithmic", chart.x_scale == AxisScale::Decades)?;
    one.set_item("are_stems", chart.curves == Curves::Stems)?;
    let guides = chart.guides.iter().map(|guide| (guide.label.clone(), guide.x));
    one.set_item("guides", guides.collect::<Vec<_>>())?;
    let curve = |series: &hybank::plot::Series| {
        let (x, y): (Vec<f64>, Vec<f64>) = series.points.iter().copied().unzip();
        (series.label.clone(), PyArray1::from_vec(py, x), PyArray1::from_vec(py, y))
    };
    one.set_item("curves", chart.series.iter().map(curve).collect::<Vec<_>>())?;
    Ok(one)
}

/// The page about a bank, and about captures if there are any.
pub(crate) fn page(
    bank: &Bound<'_, Bank>,
    captures: Option<&Bound<'_, PyAny>>,
    axis: isize,
    full_scale: Option<&Bound<'_, PyAny>>,
    path: &Path,
) -> PyResult<String> {
    let py = bank.py();
    let given = captures.map(|captures| -> PyResult<(Vec<Vec<f64>>, f64)> {
        py.import("hybank._inputs")?.call_method1("channels", (bank, captures, axis, full_scale))?.extract()
    });
    let given = given.transpose()?;
    let (bank, mut is_cut) = (Arc::clone(&bank.get().bank), false);
    let given = given.map(|(mut channels, rate)| {
        is_cut = channels.iter().any(|channel| channel.len() > MOST_FRAMES);
        channels.iter_mut().for_each(|channel| channel.truncate(MOST_FRAMES));
        (channels, rate)
    });
    if is_cut {
        warn(py, &format!("only the first {MOST_FRAMES} frames are on the page"))?;
    }
    let mut commands = vec![
        "bank = hybank.design(\"spec.toml\")  # the spec above, saved as spec.toml".to_owned(),
        "hybank.verify(bank)".to_owned(),
        "hybank.analyze(bank, delay_box=\"0.001samples\")".to_owned(),
    ];
    commands.push(match given {
        None => format!("bank.report({:?})", path.display().to_string()),
        Some(_) => format!("bank.report({:?}, captures)", path.display().to_string()),
    });
    let page = background::run(py, None, move |_| {
        let captures =
            given.map(|(channels, rate)| CapturesOnPage::new(&bank, Hertz(rate), channels, is_cut));
        Page::new(&bank, captures.transpose()?).map(|page| page.html(&commands))
    })?;
    page.map_err(refused)
}
