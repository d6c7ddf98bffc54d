//! A scene that is ready to be rendered: what its virtual views share is found.

use super::super::failure::{Failure, failed};
use crate::camera::Camera;
use crate::cli::arguments::RenderArguments;
use crate::image::Image;
use crate::pipeline::uncalibrated::{self, GeometryReport, Target, UncalibratedSettings};
use crate::pipeline::{RenderSettings, Renderer, Rendering};
use crate::scene::{Kind, Scene, SourceView};
use crate::uncalibrated::Point;

/// A rendering with the region that is compared, unless that is the whole image.
pub(super) struct Rendered {
    pub(super) rendering: Rendering,
    pub(super) hull: Option<Vec<bool>>,
    pub(super) geometry: Option<GeometryReport>,
}

impl Rendered {
    fn whole(rendering: Rendering) -> Self {
        Self { rendering, hull: None, geometry: None }
    }
}

/// The views with their virtual cameras.
pub(super) enum Ready<'a> {
    Rectified(Renderer<'a, f64>, &'a [f64]),
    Calibrated(Renderer<'a, Camera>, &'a [Camera], (usize, usize)),
    Uncalibrated(Photographs<'a>),
}

/// Photographs without cameras.
pub(super) struct Photographs<'a> {
    images: Vec<&'a Image>,
    tracks: &'a [Vec<Option<Point>>],
    targets: &'a [Target],
    size: (usize, usize),
    settings: RenderSettings,
    special: UncalibratedSettings,
}

impl<'a> Ready<'a> {
    pub(super) fn new(scene: &'a Scene, arguments: &RenderArguments) -> Result<Self, Failure> {
        let settings = arguments.settings(scene.offset);
        Ok(match &scene.kind {
            Kind::Rectified { views, positions } => {
                let views: Vec<_> = views.iter().map(SourceView::view).collect();
                Self::Rectified(Renderer::new(&views, &settings).map_err(failed)?, positions)
            }
            Kind::Calibrated { views, cameras, size } => {
                let views: Vec<_> = views.iter().map(SourceView::view).collect();
                Self::Calibrated(Renderer::new(&views, &settings).map_err(failed)?, cameras, *size)
            }
            Kind::Uncalibrated { images, tracks, targets, size } => {
                let seed = arguments.seed.unwrap_or(UncalibratedSettings::default().seed);
                let (images, special) = (images.iter().collect(), UncalibratedSettings { seed });
                Self::Uncalibrated(Photographs { images, tracks, targets, size: *size, settings, special })
            }
        })
    }

    /// The virtual view `frame` of a list or path; 0 if there is one.
    pub(super) fn render(&self, frame: usize) -> Result<Rendered, Failure> {
        match self {
            Self::Rectified(renderer, positions) => {
                renderer.render(&positions[frame], renderer.views()[0].image.size()).map(Rendered::whole)
            }
            Self::Calibrated(renderer, cameras, size) => {
                renderer.render(&cameras[frame], *size).map(Rendered::whole)
            }
            Self::Uncalibrated(Photographs { images, tracks, targets, size, settings, special }) => {
                let done = uncalibrated::render(images, tracks, &targets[frame], *size, settings, special);
                done.map(|done| Rendered {
                    rendering: done.rendering,
                    hull: Some(done.region),
                    geometry: Some(done.geometry),
                })
            }
        }
        .map_err(failed)
    }
}
