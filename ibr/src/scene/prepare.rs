//! What is done to the views of a scene once, before any virtual view is rendered from them.

use super::SourceView;
use super::register::Registered;
use super::unknown::{Unknown, resolve};
use crate::restore::{dense, restore};

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
}

/// Makes the maps of views dense, restores them ([`restore`]), and corrects small errors of the cameras
/// unless they are to be kept. Unknown values of maps most of whose values are known become what `unknown`
/// says.
///
/// ```
/// use hybank_ibr::depth::{DepthMap, Measure};
/// use hybank_ibr::image::Image;
/// use hybank_ibr::scene::{SourceView, Unknown, prepare};
/// let mut disparities = vec![4.0; 32 * 24];
/// disparities[100] = 0.0;
/// let map = DepthMap::new((32, 24), disparities, 1.0, Measure::Disparity)?;
/// let mut views = [SourceView { image: Image::filled(32, 24, 1, 9.0), map, camera: 0.0 }];
/// assert_eq!(prepare(&mut views, Unknown::Fill, false).filled, 1);
/// assert_eq!(views[0].map.data()[100], 4.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn prepare<P: Registered>(
    views: &mut [SourceView<P>],
    unknown: Unknown,
    keep_cameras: bool,
) -> Preparation {
    let far = make_dense(views, unknown);
    // First, as errors of cameras look like noise of the maps.
    let misregistration = if keep_cameras { None } else { P::register(views) };
    let filled = views.iter().map(|view| view.map.guesses()).sum();
    let restored = restore(&views.iter().map(SourceView::view).collect::<Vec<_>>());
    let outliers = restored.iter().map(|restored| restored.outliers).collect();
    views.iter_mut().zip(restored).for_each(|(view, restored)| view.map = restored.map);
    Preparation { filled, far, outliers, misregistration }
}

/// Gives every pixel of the maps a value where that is wanted; how many are far away then.
fn make_dense<P: Registered>(views: &mut [SourceView<P>], unknown: Unknown) -> usize {
    let far = resolve(views, unknown);
    let found = dense(&views.iter().map(SourceView::view).collect::<Vec<_>>());
    let scattered = views.iter_mut().zip(found).filter_map(|(view, map)| Some((view, map?)));
    scattered.for_each(|(view, map)| view.map = map);
    far
}
