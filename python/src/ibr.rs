//! `hybank.ibr.render`: virtual views from arrays.

use crate::background;
use crate::errors::{HybankError, refused};
use hybank_ibr::camera::Camera;
use hybank_ibr::depth::{DepthMap, Measure, fill_unknown};
use hybank_ibr::image::Image;
use hybank_ibr::interpolate::Cover;
use hybank_ibr::pipeline::{Method, RenderError, RenderSettings, Rendering, calibrated, rectified};
use hybank_ibr::propagate::{CalibratedView, RectifiedView};
use nalgebra::Matrix3x4;
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;

/// A rendered view.
#[pyclass(frozen, get_all, module = "hybank")]
pub(crate) struct View {
    /// Intensities 0 to 255: (H, W), or (H, W, 3) if an image has colours.
    image: Py<PyAny>,
    /// Depth at the virtual camera, NaN in holes: (H, W).
    depth: Py<PyAny>,
    /// 0 where a view saw the pixel, 1 in cracks, 2 where no view saw it: (H, W).
    mask: Py<PyAny>,
    /// Share of the pixels that samples cover.
    coverage: f64,
}

/// Where the views and the virtual one are.
enum Rig {
    Rectified { positions: Vec<f64>, at: f64 },
    Calibrated { cameras: Vec<Camera>, camera: Box<Camera>, size: (usize, usize) },
}

/// The view from `at` on the line of rectified cameras, from images (H, W, C) and maps (H, W).
#[pyfunction]
#[pyo3(signature = (images, maps, positions, at, method, fill))]
pub(crate) fn render_rectified(
    py: Python<'_>,
    images: Vec<PyReadonlyArray3<'_, f32>>,
    maps: Vec<PyReadonlyArray2<'_, f32>>,
    positions: Vec<f64>,
    at: f64,
    method: &str,
    fill: bool,
) -> PyResult<View> {
    let views = Views::new(&images, &maps, Measure::Disparity, fill)?;
    render(py, views, Rig::Rectified { positions, at }, settings(method)?)
}

/// The view of `camera` with `size` (H, W), from images, depths and cameras (3, 4).
#[pyfunction]
#[pyo3(signature = (images, maps, cameras, camera, size, method, fill))]
#[allow(clippy::too_many_arguments, reason = "keywords of a Python function")]
pub(crate) fn render_calibrated(
    py: Python<'_>,
    images: Vec<PyReadonlyArray3<'_, f32>>,
    maps: Vec<PyReadonlyArray2<'_, f32>>,
    cameras: Vec<PyReadonlyArray2<'_, f64>>,
    camera: PyReadonlyArray2<'_, f64>,
    size: (usize, usize),
    method: &str,
    fill: bool,
) -> PyResult<View> {
    let views = Views::new(&images, &maps, Measure::Depth, fill)?;
    let cameras = cameras.iter().map(metric).collect::<PyResult<_>>()?;
    let rig = Rig::Calibrated { cameras, camera: Box::new(metric(&camera)?), size: (size.1, size.0) };
    render(py, views, rig, settings(method)?)
}

/// Images with their maps.
struct Views {
    images: Vec<Image>,
    maps: Vec<DepthMap>,
}

impl Views {
    fn new(
        images: &[PyReadonlyArray3<'_, f32>],
        maps: &[PyReadonlyArray2<'_, f32>],
        measure: Measure,
        fill: bool,
    ) -> PyResult<Self> {
        let image = |array: &PyReadonlyArray3<'_, f32>| {
            let array = array.as_array();
            let (height, width, channels) = array.dim();
            Image::new(width, height, channels, array.iter().copied().collect()).map_err(refused)
        };
        let map = |array: &PyReadonlyArray2<'_, f32>| {
            let array = array.as_array();
            let (height, width) = array.dim();
            let stored = array.iter().copied().collect();
            let mut map = DepthMap::new((width, height), stored, 1.0, measure).map_err(refused)?;
            if fill {
                fill_unknown(&mut map);
            }
            Ok(map)
        };
        Ok(Self {
            images: images.iter().map(image).collect::<PyResult<_>>()?,
            maps: maps.iter().map(map).collect::<PyResult<_>>()?,
        })
    }

    fn render(&self, rig: &Rig, settings: &RenderSettings) -> Result<Rendering, RenderError> {
        let both = || self.images.iter().zip(&self.maps);
        match rig {
            Rig::Rectified { positions, at } => {
                let view = |((image, disparity), &position)| RectifiedView { image, disparity, position };
                let views: Vec<_> = both().zip(positions).map(view).collect();
                rectified::render(&views, *at, settings)
            }
            Rig::Calibrated { cameras, camera, size } => {
                let view = |((image, depth), &camera)| CalibratedView { image, depth, camera };
                let views: Vec<_> = both().zip(cameras).map(view).collect();
                calibrated::render(&views, camera, *size, settings)
            }
        }
    }
}

fn settings(method: &str) -> PyResult<RenderSettings> {
    let method = match method {
        "auto" => Method::Auto,
        "rows" => Method::Rows,
        "plane" => Method::Plane,
        _ => {
            return Err(HybankError::new_err(format!(
                "method: \"{method}\" is unknown; choose \"auto\", \"rows\" or \"plane\""
            )));
        }
    };
    Ok(RenderSettings { method, ..RenderSettings::default() })
}

fn metric(matrix: &PyReadonlyArray2<'_, f64>) -> PyResult<Camera> {
    let rows = matrix.as_array();
    if rows.dim() != (3, 4) {
        return Err(HybankError::new_err(format!(
            "a camera is a matrix of shape (3, 4), not {:?}",
            rows.dim()
        )));
    }
    Camera::metric(Matrix3x4::from_fn(|i, j| rows[[i, j]]), false).map_err(refused)
}

fn render(py: Python<'_>, views: Views, rig: Rig, settings: RenderSettings) -> PyResult<View> {
    let rendering = background::run(py, None, move |_| views.render(&rig, &settings))?.map_err(refused)?;
    let (width, height) = rendering.image.size();
    let channels = rendering.image.channels();
    let image = PyArray1::from_slice(py, rendering.image.data());
    let image = match channels {
        1 => image.reshape([height, width])?.into_any(),
        _ => image.reshape([height, width, channels])?.into_any(),
    };
    let mask = rendering.mask.iter().map(|cover| match cover {
        Cover::Seen => 0u8,
        Cover::Crack => 1,
        Cover::Disocclusion => 2,
    });
    Ok(View {
        image: image.unbind(),
        depth: PyArray1::from_slice(py, rendering.depth.data()).reshape([height, width])?.into_any().unbind(),
        mask: PyArray1::from_iter(py, mask).reshape([height, width])?.into_any().unbind(),
        coverage: rendering.coverage(),
    })
}
