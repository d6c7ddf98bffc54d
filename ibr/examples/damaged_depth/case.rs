//! A scene whose maps are damaged, and its true view.

use super::damage::Damage;
use super::peers::{self, Virtual};
use hybank_ibr::camera::Camera;
use hybank_ibr::image::{Image, MOST_PIXELS, quality, read_image};
use hybank_ibr::pipeline::{RenderError, RenderSettings, Rendering, calibrated, rectified};
use hybank_ibr::propagate::Viewpoint;
use hybank_ibr::scene::{self, Kind, LoadOptions, Scene, SceneSpec, SourceView};
use std::error::Error;
use std::path::{Path, PathBuf};

/// A scene file, read but not loaded, and the true view.
pub(crate) struct Case {
    pub(crate) name: String,
    spec: SceneSpec,
    path: PathBuf,
    truth: Image,
}

impl Case {
    /// A scene of the data folder; `None` with a note if it is not there.
    pub(crate) fn of_data(name: &str, truth: &str) -> Result<Option<Self>, Box<dyn Error>> {
        let Some(folder) = trials::data(&format!("ibr/{name}")) else { return Ok(None) };
        Self::read(name, &folder.join("scene.toml"), &folder.join(truth)).map(Some)
    }

    pub(crate) fn read(name: &str, path: &Path, truth: &Path) -> Result<Self, Box<dyn Error>> {
        let spec = scene::parse(&std::fs::read_to_string(path)?, path)?;
        Ok(Self { name: name.into(), spec, path: path.into(), truth: read_image(truth, MOST_PIXELS)? })
    }

    /// The view rendered with damaged maps, which are written into a folder.
    pub(crate) fn rendered(&self, damage: Damage, folder: &Path) -> Result<Rendered, Box<dyn Error>> {
        let spec = damage.applied(&self.spec, &self.path, folder)?;
        let options = LoadOptions { depth_step: damage.step(), ..LoadOptions::default() };
        let scene = scene::load(&spec, &self.path, &options, &|_| ())?;
        let rendering = render(&scene)?;
        let psnr = self.psnr(&rendering.image)?;
        let outliers = scene.outliers.iter().sum::<f64>() / scene.outliers.len().max(1) as f64;
        Ok(Rendered { psnr, coverage: rendering.coverage(), outliers, scene, spec })
    }

    /// PSNR of a view against the true one.
    pub(crate) fn psnr(&self, image: &Image) -> Result<f64, Box<dyn Error>> {
        Ok(quality::compare(image, &self.truth, None)?.map_or(f64::NAN, |q| q.psnr))
    }

    /// The same view by each of the peers, by name, with its PSNR. Without maps there is none.
    pub(crate) fn peers(&self, damage: Damage, found: &Rendered) -> Result<Vec<Peer>, Box<dyn Error>> {
        let views = match &found.scene.kind {
            Kind::Rectified { views, positions } => {
                let cameras: Vec<f64> = views.iter().map(|view| view.camera).collect();
                self.drawn(damage, found, &cameras, positions[0], false)?
            }
            Kind::Calibrated { views, cameras, .. } => {
                let of_views: Vec<Camera> = views.iter().map(|view| view.camera).collect();
                self.drawn(damage, found, &of_views, cameras[0], true)?
            }
            Kind::Uncalibrated { .. } => Vec::new(),
        };
        views.into_iter().map(|(name, image)| Ok(Peer { name, psnr: self.psnr(&image)? })).collect()
    }

    fn drawn<P: Viewpoint>(
        &self,
        damage: Damage,
        found: &Rendered,
        cameras: &[P],
        camera: P,
        is_depth: bool,
    ) -> Result<Vec<(&'static str, Image)>, Box<dyn Error>> {
        if damage == Damage::Matched {
            return Ok(Vec::new());
        }
        let to = Virtual { camera, size: self.truth.size(), offset: found.scene.offset, is_depth };
        peers::views(&peers::photographs(&found.spec, &self.path, damage.step(), cameras)?, &to)
    }
}

/// Figures of a rendering.
pub(crate) struct Rendered {
    pub(crate) psnr: f64,
    /// Share of the pixels that were seen.
    pub(crate) coverage: f64,
    /// Share of the depths that were outliers.
    pub(crate) outliers: f64,
    scene: Scene,
    /// The scene file with its damaged maps.
    spec: SceneSpec,
}

/// Another way to the view.
pub(crate) struct Peer {
    pub(crate) name: &'static str,
    pub(crate) psnr: f64,
}

fn render(scene: &Scene) -> Result<Rendering, RenderError> {
    let settings = RenderSettings { offset: scene.offset, ..RenderSettings::default() };
    match &scene.kind {
        Kind::Rectified { views, positions } => {
            let views: Vec<_> = views.iter().map(SourceView::view).collect();
            rectified::render(&views, positions[0], &settings)
        }
        Kind::Calibrated { views, cameras, size } => {
            let views: Vec<_> = views.iter().map(SourceView::view).collect();
            calibrated::render(&views, &cameras[0], *size, &settings)
        }
        Kind::Uncalibrated { .. } => Err(RenderError::NoViews),
    }
}
