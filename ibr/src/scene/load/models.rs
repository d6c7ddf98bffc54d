//! Cameras from files of other programs, each file read once.

use super::{Loaded, Loader};
use crate::camera::colmap::{Model, ModelCamera, read_model};
use crate::camera::transforms::{Transforms, read_transforms};
use crate::scene::ViewSpec;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Where the camera of a view is written.
pub(super) enum Source {
    /// The folder of a COLMAP model.
    Colmap(PathBuf),
    /// A transforms file.
    Transforms(PathBuf),
}

#[derive(Clone)]
enum Read {
    Colmap(Arc<Model>),
    Transforms(Arc<Transforms>),
}

/// The files that have been read.
#[derive(Default)]
pub(super) struct Models {
    read: Mutex<BTreeMap<PathBuf, Read>>,
}

impl Models {
    fn get(&self, source: &Source) -> Loaded<Read> {
        let (Source::Colmap(path) | Source::Transforms(path)) = source;
        let mut read = self.read.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = read.get(path) {
            return Ok(found.clone());
        }
        let loaded = match source {
            Source::Colmap(folder) => Read::Colmap(Arc::new(read_model(folder)?)),
            Source::Transforms(file) => Read::Transforms(Arc::new(read_transforms(file)?)),
        };
        read.insert(path.clone(), loaded.clone());
        Ok(loaded)
    }
}

impl Loader<'_> {
    /// Where the camera of a view without a matrix is written.
    pub(super) fn source_of(&self, view: &ViewSpec) -> Option<Source> {
        let own = view.colmap.as_ref().map(|folder| Source::Colmap(self.file(folder)));
        own.or_else(|| self.common_source())
    }

    /// The file of cameras that the scene names at the top.
    pub(super) fn common_source(&self) -> Option<Source> {
        let colmap = self.spec.colmap.as_ref().map(|folder| Source::Colmap(self.file(folder)));
        colmap.or_else(|| self.spec.transforms.as_ref().map(|file| Source::Transforms(self.file(file))))
    }

    /// The camera of an image: by its path, or by the path's last part. `fallback` is the size of the image
    /// if the file does not give it.
    pub(super) fn listed_camera(
        &self,
        source: &Source,
        image: &str,
        fallback: (usize, usize),
    ) -> Loaded<ModelCamera> {
        let missing = |file: &Path, what: &str| {
            self.incomplete(format!("{}: {what} has no image {image:?}", file.display()))
        };
        match (self.models.get(source)?, source) {
            (Read::Colmap(model), Source::Colmap(file) | Source::Transforms(file)) => {
                in_model(&model, image).ok_or_else(|| missing(file, "the model"))
            }
            (Read::Transforms(all), Source::Colmap(file) | Source::Transforms(file)) => {
                let frame = all.find(Path::new(image)).ok_or_else(|| missing(file, "the file"))?;
                Ok(all.camera(frame, fallback)?)
            }
        }
    }
}

fn in_model(model: &Model, image: &str) -> Option<ModelCamera> {
    let last = |name: &str| name.rsplit('/').next().unwrap_or(name).to_string();
    let by_last_part = || model.iter().find(|(name, _)| last(name) == last(image)).map(|(_, camera)| camera);
    model.get(image).or_else(by_last_part).copied()
}
