//! Images and maps of arrays.

use crate::errors::refused;
use hybank_ibr::depth::{DepthMap, Measure};
use hybank_ibr::image::Image;
use hybank_ibr::scene::SourceView;
use numpy::{PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;

/// Views from images (H, W, C), maps (H, W) and cameras.
pub(super) fn views<P>(
    images: &[PyReadonlyArray3<'_, f32>],
    maps: &[PyReadonlyArray2<'_, f32>],
    cameras: Vec<P>,
    measure: Measure,
) -> PyResult<Vec<SourceView<P>>> {
    let view = |((array, stored), camera): ((_, &PyReadonlyArray2<'_, f32>), P)| {
        let stored = stored.as_array();
        let (height, width) = stored.dim();
        let map = DepthMap::new((width, height), stored.iter().copied().collect(), 1.0, measure);
        Ok(SourceView { image: image(array)?, map: map.map_err(refused)?, camera })
    };
    images.iter().zip(maps).zip(cameras).map(view).collect()
}

/// The image of an array (H, W, C).
pub(super) fn image(array: &PyReadonlyArray3<'_, f32>) -> PyResult<Image> {
    let array = array.as_array();
    let (height, width, channels) = array.dim();
    Image::new(width, height, channels, array.iter().copied().collect()).map_err(refused)
}
