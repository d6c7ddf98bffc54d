//! `hybank.ibr.render`: virtual views from arrays.

mod uncalibrated;
mod views;

use crate::background;
use crate::errors::{choose, refused, warn};
use crate::results::Made;
use hybank_ibr::camera::Camera;
use hybank_ibr::depth::Measure;
use hybank_ibr::interpolate::plane::PlaneSettings;
use hybank_ibr::interpolate::{Cover, HoleFill};
use hybank_ibr::pipeline::{Geometry, RenderSettings, Renderer, Rendering};
use hybank_ibr::scene::{PrepareSettings, Registered, SourceView, Unknown, prepare};
use nalgebra::Matrix3x4;
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
pub(crate) use uncalibrated::render_uncalibrated;
use views::views;

/// The view from `at` on the line of rectified cameras, from images (H, W, C) and maps (H, W).
#[pyfunction]
#[pyo3(signature = (images, maps, positions, at, options, unknown))]
pub(crate) fn render_rectified<'py>(
    py: Python<'py>,
    images: Vec<PyReadonlyArray3<'_, f32>>,
    maps: Vec<PyReadonlyArray2<'_, f32>>,
    positions: Vec<f64>,
    at: f64,
    options: RenderOptions,
    unknown: String,
) -> PyResult<Bound<'py, PyAny>> {
    let views = views(&images, &maps, positions, Measure::Disparity)?;
    let size = views.first().map_or((0, 0), |view| view.image.size());
    rendered(py, views, &unknown, &options, at, size)
}

/// The view of `camera` with `size` (H, W), from images, depths and cameras (3, 4).
#[pyfunction]
#[pyo3(signature = (images, maps, cameras, camera, size, options, unknown))]
#[allow(clippy::too_many_arguments, reason = "keywords of a Python function")]
pub(crate) fn render_calibrated<'py>(
    py: Python<'py>,
    images: Vec<PyReadonlyArray3<'_, f32>>,
    maps: Vec<PyReadonlyArray2<'_, f32>>,
    cameras: Vec<PyReadonlyArray2<'_, f64>>,
    camera: PyReadonlyArray2<'_, f64>,
    size: (usize, usize),
    options: RenderOptions,
    unknown: String,
) -> PyResult<Bound<'py, PyAny>> {
    let cameras = cameras.iter().map(metric).collect::<PyResult<Vec<_>>>()?;
    let views = views(&images, &maps, cameras, Measure::Depth)?;
    rendered(py, views, &unknown, &options, metric(&camera)?, (size.1, size.0))
}

/// The view of a camera from views that are prepared first; what seems to be wrong with them is a warning.
fn rendered<'py, P: Registered + Geometry + 'static>(
    py: Python<'py>,
    mut views: Vec<SourceView<P>>,
    unknown: &str,
    options: &RenderOptions,
    camera: P,
    size: (usize, usize),
) -> PyResult<Bound<'py, PyAny>> {
    let kinds =
        [("auto", Unknown::Auto), ("far", Unknown::Far), ("fill", Unknown::Fill), ("drop", Unknown::Drop)];
    let (unknown, settings) = (choose("unknown", unknown, &kinds)?, options.settings()?);
    let keep_cameras = options.keep_cameras;
    let run = move |_: &_| {
        let prepared = prepare(&mut views, &PrepareSettings { unknown, keep_cameras, hidden: &[] });
        let views: Vec<_> = views.iter().map(SourceView::view).collect();
        let rendering = Renderer::new(&views, &settings).and_then(|r| r.render(&camera, size));
        rendering.map(|rendering| (rendering, prepared.faults)).map_err(|e| e.to_string())
    };
    let (rendering, faults) = background::run(py, None, run)?.map_err(refused)?;
    faults.iter().try_for_each(|fault| warn(py, fault))?;
    rendering.agreement.pairs.iter().filter(|pair| pair.is_poor()).try_for_each(|pair| warn(py, pair))?;
    made(py, &rendering, None, None)
}

/// How views are rendered, by the names of the command line.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct RenderOptions {
    fill: String,
    degree: Option<String>,
    offset: f64,
    nearest: Option<usize>,
    keep_exposure: bool,
    keep_cameras: bool,
}

impl RenderOptions {
    fn settings(&self) -> PyResult<RenderSettings> {
        let Self { offset, nearest, keep_exposure, .. } = *self;
        let fills =
            [("background", HoleFill::Background), ("bridge", HoleFill::Bridge), ("leave", HoleFill::Leave)];
        let planes = [("cubic", PlaneSettings::default()), ("linear", PlaneSettings::LINEAR)];
        let mut settings = RenderSettings { offset, nearest, keep_exposure, ..RenderSettings::default() };
        let stage = &mut settings.interpolation;
        stage.fill = choose("fill", &self.fill, &fills)?;
        stage.plane = choose("degree", self.degree.as_deref().unwrap_or("cubic"), &planes)?;
        Ok(settings)
    }
}

/// The camera of a matrix (3, 4).
fn metric(matrix: &PyReadonlyArray2<'_, f64>) -> PyResult<Camera> {
    let rows = matrix.as_array();
    Camera::metric(Matrix3x4::from_fn(|i, j| rows[[i, j]]), false).map_err(refused)
}

/// A rendering as arrays; without a region it is the whole image.
fn made<'py>(
    py: Python<'py>,
    rendering: &Rendering,
    region: Option<Vec<bool>>,
    geometry: Option<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (width, height) = rendering.image.size();
    let image = PyArray1::from_slice(py, rendering.image.data());
    let image = match rendering.image.channels() {
        1 => image.reshape([height, width])?.into_any(),
        channels => image.reshape([height, width, channels])?.into_any(),
    };
    let mask = rendering.mask.iter().map(|cover| match cover {
        Cover::Seen => 0u8,
        Cover::Crack => 1,
        Cover::Disocclusion => 2,
        Cover::Guessed => 3,
    });
    let region = region.unwrap_or_else(|| vec![true; width * height]);
    Made::new(py, "View")?
        .with("image", image)?
        .with("depth", PyArray1::from_slice(py, rendering.depth.data()).reshape([height, width])?)?
        .with("mask", PyArray1::from_iter(py, mask).reshape([height, width])?)?
        .with("coverage", rendering.coverage())?
        .with("region", PyArray1::from_vec(py, region).reshape([height, width])?)?
        .with("geometry", geometry)?
        .object()
}
