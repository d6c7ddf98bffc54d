//! The prediction for either kind of scene.

use crate::analysis::{self, Advice, Limits, ViewError};
use crate::camera::Camera;
use crate::pipeline::{Agreement, RenderError, RenderSettings};
use crate::scene::{Kind, SourceView};

/// Calibrated weights, and the virtual views to predict.
pub(super) enum Predictor<'a> {
    Rig { predictor: analysis::Predictor<'a, f64>, positions: &'a [f64], limits: Option<Limits> },
    Cameras { predictor: analysis::Predictor<'a, Camera>, cameras: &'a [Camera], size: (usize, usize) },
}

impl<'a> Predictor<'a> {
    pub(super) fn new(
        kind: &'a Kind,
        settings: &RenderSettings,
        limits: Option<Limits>,
    ) -> Result<Self, RenderError> {
        match kind {
            Kind::Rectified { views, positions } => {
                let views: Vec<_> = views.iter().map(SourceView::view).collect();
                Ok(Self::Rig { predictor: analysis::Predictor::new(&views, settings)?, positions, limits })
            }
            Kind::Calibrated { views, cameras, size } => {
                let views: Vec<_> = views.iter().map(SourceView::view).collect();
                Ok(Self::Cameras {
                    predictor: analysis::Predictor::new(&views, settings)?,
                    cameras,
                    size: *size,
                })
            }
            Kind::Uncalibrated { .. } => Err(RenderError::NoViews),
        }
    }

    /// How well the views agree.
    pub(super) fn agreement(&self) -> &Agreement {
        match self {
            Self::Rig { predictor, .. } => predictor.agreement(),
            Self::Cameras { predictor, .. } => predictor.agreement(),
        }
    }

    /// The error of a virtual view.
    pub(super) fn at(&self, frame: usize) -> Result<ViewError, RenderError> {
        match self {
            Self::Rig { predictor, positions, limits } => {
                predictor.at(&positions[frame], (), limits.as_ref())
            }
            Self::Cameras { predictor, cameras, size } => predictor.at(&cameras[frame], *size, None),
        }
    }

    /// What would make the error of a virtual view smaller.
    pub(super) fn advice(&self, frame: usize, now: &ViewError) -> Result<Advice, RenderError> {
        match self {
            Self::Rig { predictor, positions, .. } => Advice::on(predictor, &positions[frame], (), now),
            Self::Cameras { predictor, cameras, size } => Advice::on(predictor, &cameras[frame], *size, now),
        }
    }
}
