//! Views without cameras: images and tracks.

use super::View;
use super::views::image;
use crate::background;
use crate::errors::refused;
use hybank_ibr::image::Image;
use hybank_ibr::pipeline::RenderSettings;
use hybank_ibr::pipeline::uncalibrated::{GeometryReport, OrderBy, Target, UncalibratedSettings, render};
use hybank_ibr::uncalibrated::Point;
use numpy::{PyReadonlyArray2, PyReadonlyArray3};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;

/// The geometry that was estimated from tracks.
#[pyclass(frozen, get_all, module = "hybank")]
#[derive(FromPyObject)]
pub(crate) struct Geometry {
    /// Points that both of the first two views see.
    matches: usize,
    /// Of these, those within the threshold of the fundamental matrix.
    inliers: usize,
    /// Root mean square Sampson distance of the inliers, pixels.
    sampson_rms: f64,
    /// Points from which the virtual camera was estimated.
    sightings: usize,
    /// Of these, those within the threshold of the virtual camera.
    resection_inliers: usize,
    /// Root mean square reprojection error of these, pixels.
    resection_rms: f64,
    /// Share of the guessed calibrations that agree on the order of depth.
    order_agreement: f64,
    /// What decided the order of depth: given, calibrations, colours, both or nothing.
    order_by: String,
}

/// One position for each track and view.
type Tracks = Vec<Vec<Option<Point>>>;

/// The view from images (H, W, C) and tracks (P, V, 2), NaN where a point is not seen. The virtual camera is
/// given by the positions (P, 2) of the points in it, or lies between the first two views.
#[pyfunction]
#[pyo3(signature = (images, tracks, points, between, size, reverse_order))]
pub(crate) fn render_uncalibrated(
    py: Python<'_>,
    images: Vec<PyReadonlyArray3<'_, f32>>,
    tracks: PyReadonlyArray3<'_, f64>,
    points: Option<PyReadonlyArray2<'_, f64>>,
    between: f64,
    size: (usize, usize),
    reverse_order: bool,
) -> PyResult<View> {
    let images = images.iter().map(image).collect::<PyResult<Vec<_>>>()?;
    let tracks = positions(&tracks);
    let target = points.map_or(Target::Between(between), |points| Target::Tracks(column(&points)));
    let size = (size.1, size.0);
    let special = UncalibratedSettings { reverse_order, ..UncalibratedSettings::default() };
    let run = move |_: &_| {
        let images: Vec<&Image> = images.iter().collect();
        render(&images, &tracks, &target, size, &RenderSettings::default(), &special, &|_| ())
    };
    let done = background::run(py, None, run)?.map_err(refused)?;
    if done.geometry.order_by == OrderBy::Nothing {
        PyErr::warn(
            py,
            &py.get_type::<PyUserWarning>(),
            c"the order of depth is undecided: guessed calibrations contradict each other, and colours do not \
              show it; if far objects hide near ones, use reverse_order=True",
            2,
        )?;
    }
    View::new(py, &done.rendering, Some(done.region), Some(Geometry::from(done.geometry)))
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

impl From<GeometryReport> for Geometry {
    fn from(report: GeometryReport) -> Self {
        Self {
            matches: report.matches,
            inliers: report.inliers,
            sampson_rms: report.sampson_rms,
            sightings: report.sightings,
            resection_inliers: report.resection_inliers,
            resection_rms: report.resection_rms,
            order_agreement: report.order_agreement,
            order_by: match report.order_by {
                OrderBy::Given => "given",
                OrderBy::Calibrations => "calibrations",
                OrderBy::Colours => "colours",
                OrderBy::Both => "both",
                OrderBy::Nothing => "nothing",
            }
            .to_owned(),
        }
    }
}
