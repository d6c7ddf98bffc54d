//! Complete renderings: the three stages, one after the other, for each kind of input.

mod agreement;
pub mod calibrated;
pub(crate) mod depth_errors;
mod exposure;
pub(crate) mod nearness;
pub mod rectified;
mod rendering;
mod shares;
mod smoothing;
pub mod uncalibrated;
mod view_weights;

pub(crate) use agreement::GREY_LEVELS;
pub use agreement::{Agreement, PairAgreement};
pub(crate) use depth_errors::{DEVIATION_PER_MEDIAN, median};
pub use exposure::Exposure;
pub(crate) use exposure::without_drift;
pub use rendering::{RenderError, RenderSettings, Rendering, Report};
use rendering::{check_counts, check_size};
pub use view_weights::ViewWeights;

use crate::propagate::{View, Viewpoint};
use crate::sample::{Dropped, Sample};
use std::ops::Range;

/// Renders virtual views of some photographs with maps. What the virtual camera does not change is found
/// once: how the views agree, their noise, exposures and errors of depth.
///
/// ```
/// use hybank_ibr::depth::{DepthMap, Measure};
/// use hybank_ibr::image::Image;
/// use hybank_ibr::pipeline::{RenderSettings, Renderer};
/// use hybank_ibr::propagate::RectifiedView;
/// let image = Image::filled(32, 8, 1, 100.0);
/// let map = DepthMap::new((32, 8), vec![4.0; 256], 1.0, Measure::Disparity)?;
/// let views = [0.0, 1.0].map(|camera| RectifiedView { image: &image, map: &map, camera });
/// let renderer = Renderer::new(&views, &RenderSettings::default())?;
/// let film = [0.25, 0.5, 0.75].map(|position| renderer.render(&position, image.size()));
/// assert_eq!(film[1].as_ref().map(|view| view.coverage()), Ok(1.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Renderer<'a, P> {
    views: Vec<View<'a, P>>,
    settings: RenderSettings,
    agreement: Agreement,
}

/// Samples of some rows of the virtual image.
#[derive(Debug, Clone, Default)]
pub struct Visible<const C: usize> {
    /// Those that nothing hides, with the weights and the exposures of their views.
    pub samples: Vec<Sample<C>>,
    /// Samples before hidden ones were removed.
    pub propagated: usize,
    /// Pixels that did not become samples, where rows know them.
    pub dropped: Dropped,
}

/// The stages for one virtual view in C channels.
pub trait Stages<const C: usize>: Sync {
    /// Samples as the first stage makes them.
    type Samples;

    /// Stage one: pixels of the views become samples of these rows of the virtual image.
    fn propagate(&self, rows: &Range<usize>) -> Self::Samples;

    /// Stage two: samples that lie behind others go, and views get their shares.
    fn remove_hidden(&self, rows: &Range<usize>, samples: Self::Samples) -> Visible<C>;

    /// Stage three: the image is fitted to the visible samples; `visible` gives those of some rows.
    ///
    /// # Errors
    /// [`RenderError::NoOverlap`] and [`RenderError::Fit`].
    fn interpolate(
        &self,
        visible: impl Fn(Range<usize>) -> Visible<C> + Sync,
    ) -> Result<Rendering, RenderError>;
}

/// A kind of cameras with its stages: rigs work in rows, and general cameras on the plane.
pub trait Geometry: Viewpoint {
    /// A virtual view.
    type Virtual<'a>: Stages<1> + Stages<3>
    where
        Self: 'a;

    /// Refuses views that do not fit each other.
    ///
    /// # Errors
    /// [`RenderError`].
    fn check(views: &[View<'_, Self>]) -> Result<(), RenderError>;

    /// The virtual view of a camera: which views it is made of, and with which weights.
    ///
    /// # Errors
    /// [`RenderError`].
    fn virtual_view<'a>(
        renderer: &'a Renderer<'_, Self>,
        camera: &Self,
        size: (usize, usize),
    ) -> Result<Self::Virtual<'a>, RenderError>;
}

impl<'a, P: Geometry> Renderer<'a, P> {
    /// Of views with dense maps, as [`prepare`](crate::scene::prepare) makes them.
    ///
    /// # Errors
    /// [`RenderError`], naming view, sizes and numbers.
    pub fn new(views: &[View<'a, P>], settings: &RenderSettings) -> Result<Self, RenderError> {
        P::check(views)?;
        settings.check()?;
        Ok(Self { views: views.to_vec(), settings: *settings, agreement: Agreement::of(views) })
    }

    /// The views.
    pub fn views(&self) -> &[View<'a, P>] {
        &self.views
    }

    /// How well the views agree.
    pub fn agreement(&self) -> &Agreement {
        &self.agreement
    }

    fn settings(&self) -> &RenderSettings {
        &self.settings
    }

    /// The view of `camera` with `size` pixels, RGB if any view is; that of a rectified rig has the size of
    /// the views.
    ///
    /// # Errors
    /// [`RenderError`].
    pub fn render(&self, camera: &P, size: (usize, usize)) -> Result<Rendering, RenderError> {
        let view = P::virtual_view(self, camera, size)?;
        let rendering = match self.views.iter().any(|view| view.image.channels() == 3) {
            true => stages::<3, _>(&view)?,
            false => stages::<1, _>(&view)?,
        };
        Ok(Rendering { agreement: self.agreement.clone(), ..rendering })
    }
}

/// The Propagation Algorithm.
fn stages<const C: usize, V: Stages<C>>(view: &V) -> Result<Rendering, RenderError> {
    view.interpolate(|rows| {
        let samples = view.propagate(&rows);
        view.remove_hidden(&rows, samples)
    })
}
