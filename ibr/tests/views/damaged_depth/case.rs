//! A scene whose maps are damaged, and its true view.

use super::damage::Damage;
use crate::support::render as support;
use hybank_ibr::image::{Image, MOST_PIXELS, quality, read_image};
use hybank_ibr::pipeline::{RenderError, RenderSettings, Rendering};
use hybank_ibr::scene::{self, Kind, LoadOptions, Scene, SceneSpec, SourceView};
use std::error::Error;
use std::path::{Path, PathBuf};

/// A scene file, read but not loaded, and the true view.
pub(crate) struct Case {
    spec: SceneSpec,
    path: PathBuf,
    truth: Image,
}

impl Case {
    /// A scene of the data folder; `None` with a note if it is not there.
    pub(crate) fn of_data(name: &str, truth: &str) -> Result<Option<Self>, Box<dyn Error>> {
        let Some(folder) = trials::data(&format!("ibr/{name}")) else { return Ok(None) };
        Self::read(&folder.join("scene.toml"), &folder.join(truth)).map(Some)
    }

    pub(crate) fn read(path: &Path, truth: &Path) -> Result<Self, Box<dyn Error>> {
        let spec = scene::parse(&std::fs::read_to_string(path)?, path)?;
        Ok(Self { spec, path: path.into(), truth: read_image(truth, MOST_PIXELS)? })
    }

    /// PSNR of the view rendered with damaged maps, which are written into a folder.
    pub(crate) fn rendered(&self, damage: Damage, folder: &Path) -> Result<f64, Box<dyn Error>> {
        let spec = damage.applied(&self.spec, &self.path, folder)?;
        let options = LoadOptions { depth_step: damage.step(), ..LoadOptions::default() };
        let scene = scene::load(&spec, &self.path, &options)?;
        self.psnr(&render(&scene)?.image)
    }

    /// PSNR of a view against the true one.
    pub(crate) fn psnr(&self, image: &Image) -> Result<f64, Box<dyn Error>> {
        Ok(quality::compare(image, &self.truth, None)?.map_or(f64::NAN, |q| q.psnr))
    }
}

fn render(scene: &Scene) -> Result<Rendering, RenderError> {
    let settings = RenderSettings { offset: scene.offset, ..RenderSettings::default() };
    match &scene.kind {
        Kind::Rectified { views, positions } => {
            let views: Vec<_> = views.iter().map(SourceView::view).collect();
            support::render(&views, &positions[0], views[0].image.size(), &settings)
        }
        Kind::Calibrated { views, cameras, size } => {
            let views: Vec<_> = views.iter().map(SourceView::view).collect();
            support::render(&views, &cameras[0], *size, &settings)
        }
        Kind::Uncalibrated { .. } => Err(RenderError::NoViews),
    }
}
