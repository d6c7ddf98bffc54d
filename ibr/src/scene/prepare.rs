//! What is done to the views of a scene once, before any virtual view is rendered from them.

use super::register::Registered;
use super::unknown::{Unknown, resolve};
use super::{SourceView, diagnosis::diagnosis, notes};
use crate::restore::{dense, restore};

/// How views are prepared.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PrepareSettings<'a> {
    /// What unknown depths are taken for.
    pub unknown: Unknown,
    /// Do not correct small errors of the cameras.
    pub keep_cameras: bool,
    /// Of each view the pixels that show no part of the scene, which is none if a list is empty.
    pub hidden: &'a [Vec<bool>],
}

/// What was done to views.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Preparation {
    /// Unknown depths that were filled from their neighbours.
    pub filled: usize,
    /// Those that were taken as far away.
    pub far: usize,
    /// Share of the values of each map that were outliers.
    pub outliers: Vec<f64>,
    /// Root mean square displacement between the views that was corrected, in pixels.
    pub misregistration: Option<f64>,
    /// What seems to be wrong with the views.
    pub faults: Vec<String>,
    /// What was changed, in words.
    pub notes: Vec<String>,
}

/// Says what seems to be wrong with views, makes their maps dense, restores them ([`restore`]), and corrects
/// small errors of the cameras. Unknown values of maps most of whose values are known become what
/// `unknown` says.
///
/// ```
/// use hybank_ibr::depth::{DepthMap, Measure};
/// use hybank_ibr::image::Image;
/// use hybank_ibr::scene::{PrepareSettings, SourceView, prepare};
/// let mut disparities = vec![4.0; 32 * 24];
/// disparities[100] = 0.0;
/// let map = DepthMap::new((32, 24), disparities, 1.0, Measure::Disparity)?;
/// let mut views = [SourceView { image: Image::filled(32, 24, 1, 9.0), map, camera: 0.0 }];
/// assert_eq!(prepare(&mut views, &PrepareSettings::default()).filled, 1);
/// assert_eq!(views[0].map.data()[100], 4.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn prepare<P: Registered>(views: &mut [SourceView<P>], settings: &PrepareSettings<'_>) -> Preparation {
    let images: Vec<_> = views.iter().map(|view| &view.image).collect();
    let faults = notes::of_dark(&images).into_iter().chain(diagnosis(views)).collect();
    let mut far = make_dense(views, settings.unknown);
    // First, as errors of cameras look like noise of the maps.
    let misregistration = if settings.keep_cameras { None } else { P::register(views) };
    let mut filled = views.iter().map(|view| view.map.guesses()).sum::<usize>();
    let restored = restore(&views.iter().map(SourceView::view).collect::<Vec<_>>());
    let outliers: Vec<f64> = restored.iter().map(|restored| restored.outliers).collect();
    views.iter_mut().zip(restored).for_each(|(view, restored)| view.map = restored.map);
    for (view, hidden) in views.iter_mut().zip(settings.hidden) {
        let (guesses, gone) = view.map.forget(hidden);
        (filled, far) = (filled.saturating_sub(guesses), far.saturating_sub(gone));
    }
    let corrected = misregistration.map(notes::of_misregistration);
    let notes =
        [notes::of_far(far), corrected, notes::of_outliers(&outliers)].into_iter().flatten().collect();
    Preparation { filled, far, outliers, misregistration, faults, notes }
}

/// Gives every pixel of the maps a value where that is wanted; how many are far away then.
fn make_dense<P: Registered>(views: &mut [SourceView<P>], unknown: Unknown) -> usize {
    let far = resolve(views, unknown);
    let found = dense(&views.iter().map(SourceView::view).collect::<Vec<_>>());
    let scattered = views.iter_mut().zip(found).filter_map(|(view, map)| Some((view, map?)));
    scattered.for_each(|(view, map)| view.map = map);
    far
}
