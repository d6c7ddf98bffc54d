//! Views without cameras: images and tracks.

use super::views::image;
use super::{RenderOptions, made};
use crate::background;
use crate::errors::{refused, warn};
use crate::results::of_report;
use hybank_ibr::image::Image;
use hybank_ibr::pipeline::uncalibrated::{OrderBy, Target, UncalibratedSettings, render};
use hybank_ibr::uncalibrated::Point;
use numpy::{PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;

/// One position for each track and view.
type Tracks = Vec<Vec<Option<Point>>>;

/// The view from images (H, W, C) and tracks (P, V, 2), NaN where a point is not seen. The virtual camera is
/// given by the positions (P, 2) of the points in it, or lies between the first two views.
#[pyfunction]
#[pyo3(signature = (images, tracks, points, between, size, options, seed))]
#[allow(clippy::too_many_arguments, reason = "keywords of a Python function")]
pub(crate) fn render_uncalibrated<'py>(
    py: Python<'py>,
    images: Vec<PyReadonlyArray3<'_, f32>>,
    tracks: PyReadonlyArray3<'_, f64>,
    points: Option<PyReadonlyArray2<'_, f64>>,
    between: f64,
    size: (usize, usize),
    options: RenderOptions,
    seed: Option<u64>,
) -> PyResult<Bound<'py, PyAny>> {
    let images = images.iter().map(image).collect::<PyResult<Vec<_>>>()?;
    let tracks = positions(&tracks);
    let target = points.map_or(Target::Between(between), |points| Target::Tracks(column(&points)));
    let size = (size.1, size.0);
    let special = UncalibratedSettings::default();
    let special = UncalibratedSettings { seed: seed.unwrap_or(special.seed) };
    let settings = options.settings()?;
    let run = move |_: &_| {
        let images: Vec<&Image> = images.iter().collect();
        render(&images, &tracks, &target, size, &settings, &special)
    };
    let done = background::run(py, None, run)?.map_err(refused)?;
    if done.geometry.order_by == OrderBy::Nothing {
        warn(
            py,
            &"the order of depth is undecided: guessed calibrations contradict each other, and colours do not show \
              it, so no surface hides another",
        )?;
    }
    let geometry = of_report(py, "Geometry", &done.geometry)?;
    made(py, &done.rendering, Some(done.region), Some(geometry))
}

fn positions(tracks: &PyReadonlyArray3<'_, f64>) -> Tracks {
    let tracks = tracks.as_array();
    let (count, views, _) = tracks.dim();
    let position = |j, i| point(tracks[[j, i, 0]], tracks[[j, i, 1]]);
    (0..count).map(|j| (0..views).map(|i| position(j, i)).collect()).collect()
}

fn column(points: &PyReadonlyArray2<'_, f64>) -> Vec<Option<Point>> {
    points.as_array().rows().into_iter().map(|row| point(row[0], row[1])).collect()
}

/// `None` where a point is not seen.
fn point(x: f64, y: f64) -> Option<Point> {
    (!x.is_nan() && !y.is_nan()).then(|| Point::new(x, y))
}
