//! Images and maps of arrays.

use crate::errors::refused;
use hybank_ibr::depth::{DepthMap, Measure, fill_unknown};
use hybank_ibr::image::Image;
use numpy::{PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;

/// Images with their maps.
pub(super) struct Views {
    images: Vec<Image>,
    maps: Vec<DepthMap>,
}

impl Views {
    /// From images (H, W, C) and maps (H, W); with `fill` unknown depth is that of the farther neighbour.
    pub(super) fn new(
        images: &[PyReadonlyArray3<'_, f32>],
        maps: &[PyReadonlyArray2<'_, f32>],
        measure: Measure,
        fill: bool,
    ) -> PyResult<Self> {
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

    pub(super) fn both(&self) -> impl Iterator<Item = (&Image, &DepthMap)> {
        self.images.iter().zip(&self.maps)
    }
}

/// The image of an array (H, W, C).
pub(super) fn image(array: &PyReadonlyArray3<'_, f32>) -> PyResult<Image> {
    let array = array.as_array();
    let (height, width, channels) = array.dim();
    Image::new(width, height, channels, array.iter().copied().collect()).map_err(refused)
}
