//! Settings, errors and results of renderings.

use super::Agreement;
use crate::depth::DepthMap;
use crate::image::Image;
use crate::interpolate::plane::{Convergence, PlaneFit};
use crate::interpolate::{Cover, HoleCount, Settings};
use crate::occlusion::DepthTest;
use crate::sample::Dropped;
use crate::setting::{FINITE, POSITIVE, SettingError};

/// Settings of a rendering. The defaults are the same for every scene.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RenderSettings {
    /// Fit, holes, and the depth test of the second stage.
    pub interpolation: Settings,
    /// Added to every column, in pixels: registration of the virtual image.
    pub offset: f64,
    /// Use the colours of every view as they are. Otherwise views get the exposure and the white balance of
    /// the first one, except for drift, which follows the place of the virtual camera.
    pub keep_exposure: bool,
    /// Use lambda and stiffness as they are. Otherwise they follow from the noise and the slopes of the
    /// photographs, where cameras are known.
    pub keep_smoothing: bool,
    /// Use only so many views, those nearest to the virtual camera. Without it four views share in each
    /// point.
    pub nearest: Option<usize>,
}

impl RenderSettings {
    /// The depth test.
    pub fn depth_test(&self) -> &DepthTest {
        &self.interpolation.depth_test
    }

    /// Refuses settings outside their range.
    ///
    /// # Errors
    /// [`SettingError`].
    pub fn check(&self) -> Result<(), SettingError> {
        self.interpolation.check()?;
        POSITIVE.check("number of nearest views", self.nearest.unwrap_or(1) as f64)?;
        FINITE.check("offset", self.offset)
    }
}

/// Errors of a rendering.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// No view was given.
    #[error("there is no view to render from: give at least one")]
    NoViews,
    /// More views or pixels than the indices of samples can hold.
    #[error("{views} views of up to {pixels} pixels: at most 65535 views of 2^32 - 1 pixels can be used")]
    TooLarge {
        /// Views given.
        views: usize,
        /// Pixels of the largest.
        pixels: usize,
    },
    /// Views of different sizes in a rectified rig, or a map of another size than its image.
    #[error("view {view}: {what} has {} x {} pixels instead of {} x {}", size.0, size.1, expected.0, expected.1)]
    Size {
        /// Index of the view.
        view: usize,
        /// The image or the map.
        what: &'static str,
        /// Its width and height.
        size: (usize, usize),
        /// Width and height expected.
        expected: (usize, usize),
    },
    /// A setting or a position outside its range.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// Images and columns of tracks do not fit.
    #[error(
        "{images} images have {columns} columns of tracks; views without cameras are made from two photographs, each with a column"
    )]
    Tracks {
        /// Images given.
        images: usize,
        /// Columns of tracks given.
        columns: usize,
    },
    /// The geometry of views without cameras could not be estimated.
    #[error(transparent)]
    Geometry(#[from] crate::uncalibrated::GeometryError),
    /// The equations of a row could not be solved.
    #[error("row {row}: {source}")]
    Fit {
        /// The row.
        row: usize,
        /// The solver's error.
        source: hybank_sampling::SamplingError,
    },
    /// No sample lies in the virtual image.
    #[error(
        "no sample lies in the virtual image: of {pixels} pixels {} have no depth, {} lie behind the virtual camera and {} fall outside its image; check positions, cameras and the depth scale",
        dropped.unknown, dropped.behind, dropped.outside
    )]
    NoOverlap {
        /// Pixels of all views.
        pixels: usize,
        /// Pixels dropped, by reason.
        dropped: Dropped,
    },
}

/// Counts of samples and holes of a rendering.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize)]
pub struct Report {
    /// Samples in the virtual image.
    pub propagated: usize,
    /// Of these, removed as hidden.
    pub occluded: usize,
    /// Of these, used by the interpolation.
    pub used: usize,
    /// Pixels that did not become samples.
    pub dropped: Dropped,
    /// Pixels of the virtual image without a sample.
    #[serde(skip)]
    pub holes: HoleCount,
    /// How the plane fit ended; `None` for the row fit.
    #[serde(skip)]
    pub convergence: Option<Convergence>,
}

/// A rendered view.
#[derive(Debug, Clone, PartialEq)]
pub struct Rendering {
    /// The image.
    pub image: Image,
    /// Origin of each pixel's value.
    pub mask: Vec<Cover>,
    /// Depth of each pixel at the virtual camera, NaN in holes: the disparity for a baseline of one of a
    /// rectified rig, the depth of calibrated cameras, and the signed order of depth without cameras.
    pub depth: DepthMap,
    /// Visible samples that are nearest to each pixel.
    pub counts: Vec<u16>,
    /// The views that were used, by number from 0.
    pub views: Vec<usize>,
    /// Counts.
    pub report: Report,
    /// How well the views agree with each other; empty without depth maps.
    pub agreement: Agreement,
}

impl Rendering {
    /// Of a plane fit of C channels; the report is that of the stages before it.
    pub(super) fn of_plane<const C: usize>(
        fit: PlaneFit,
        mut report: Report,
        views: Vec<usize>,
        agreement: Agreement,
    ) -> Self {
        let PlaneFit { values, mask, depth, counts, convergence } = fit;
        (report.holes, report.convergence) = (HoleCount::of(&mask), Some(convergence));
        Self {
            image: Image::from_values(depth.size(), C, values),
            mask,
            depth,
            counts,
            views,
            report,
            agreement,
        }
    }

    /// Share of the pixels that samples cover.
    pub fn coverage(&self) -> f64 {
        1.0 - HoleCount::of(&self.mask).total() as f64 / self.mask.len() as f64
    }

    /// Opacity of each pixel: 1 where a surface was seen or bridged, 0 where the value was made up because
    /// no view shows what is there, or where only a guess says how deep it lies.
    pub fn alpha(&self) -> Vec<f32> {
        let is_made_up = |cover: &Cover| matches!(cover, Cover::Disocclusion | Cover::Guessed);
        self.mask.iter().map(|cover| if is_made_up(cover) { 0.0 } else { 1.0 }).collect()
    }
}

pub(super) fn check_size(
    view: usize,
    what: &'static str,
    size: (usize, usize),
    expected: (usize, usize),
) -> Result<(), RenderError> {
    if size == expected { Ok(()) } else { Err(RenderError::Size { view, what, size, expected }) }
}

pub(super) fn check_counts(views: usize, pixels: usize) -> Result<(), RenderError> {
    if views == 0 {
        return Err(RenderError::NoViews);
    }
    if views > usize::from(u16::MAX) || pixels > u32::MAX as usize {
        return Err(RenderError::TooLarge { views, pixels });
    }
    Ok(())
}
