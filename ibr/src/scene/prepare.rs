//! What is done to the views of a scene once, before any virtual view is rendered from them.

use super::SourceView;
use crate::depth::fill_unknown;
use crate::propagate::Viewpoint;
use crate::restore::{coloured, dense, restore};
use rayon::prelude::*;

/// What was done to views.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Preparation {
    /// Unknown depths that were filled from their neighbours.
    pub filled: usize,
    /// Share of the values of each map that were outliers.
    pub outliers: Vec<f64>,
    /// Numbers of the grey views that took the colours of others.
    pub coloured: Vec<usize>,
}

/// Makes the maps of views dense, restores them ([`restore`]), and gives grey photographs beside coloured
/// ones their colours ([`coloured`]). With `fill` unknown values of maps most of whose values are known are
/// filled from their neighbours ([`fill_unknown`]).
///
/// ```
/// use hybank_ibr::depth::{DepthMap, Measure};
/// use hybank_ibr::image::Image;
/// use hybank_ibr::scene::{SourceView, prepare};
/// let mut disparities = vec![4.0; 32 * 24];
/// disparities[100] = 0.0;
/// let map = DepthMap::new((32, 24), disparities, 1.0, Measure::Disparity)?;
/// let mut views = [SourceView { image: Image::filled(32, 24, 1, 9.0), map, camera: 0.0 }];
/// assert_eq!(prepare(&mut views, true).filled, 1);
/// assert_eq!(views[0].map.data()[100], 4.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn prepare<P: Viewpoint>(views: &mut [SourceView<P>], fill: bool) -> Preparation {
    make_dense(views, fill);
    let filled = views.iter().map(|view| view.map.guesses()).sum();
    let restored = restore(&views.iter().map(SourceView::view).collect::<Vec<_>>());
    let outliers = restored.iter().map(|restored| restored.outliers).collect();
    views.iter_mut().zip(restored).for_each(|(view, restored)| view.map = restored.map);
    let images = coloured(&views.iter().map(SourceView::view).collect::<Vec<_>>());
    let coloured = (0..views.len()).filter(|view| images[*view].is_some()).collect();
    let replaced = views.iter_mut().zip(images).filter_map(|(view, image)| Some((view, image?)));
    replaced.for_each(|(view, image)| view.image = image);
    Preparation { filled, outliers, coloured }
}

/// Gives every pixel of the maps a value where that is wanted.
fn make_dense<P: Viewpoint>(views: &mut [SourceView<P>], fill: bool) {
    if fill {
        let full = views.par_iter_mut().filter(|view| !view.map.is_scattered());
        full.for_each(|view| _ = fill_unknown(&mut view.map));
    }
    let found = dense(&views.iter().map(SourceView::view).collect::<Vec<_>>());
    let scattered = views.iter_mut().zip(found).filter_map(|(view, map)| Some((view, map?)));
    scattered.for_each(|(view, map)| view.map = map);
}
