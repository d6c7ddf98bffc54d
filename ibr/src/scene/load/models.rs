//! Cameras from files of other programs, each file read once.

use super::{Loaded, Loader};
use crate::camera::colmap::{Model, ModelCamera, read_model};
use crate::camera::names::{self, NameError};
use crate::camera::resize::Size;
use crate::camera::transforms::{Transforms, read_transforms};
use crate::scene::ViewSpec;
use std::collections::BTreeMap;
use std::path::PathBuf;
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

    /// The camera of an image, as the file lists it. `fallback` is the size of the image if the file does
    /// not give it; `which` names the view in messages.
    pub(super) fn listed_camera(
        &self,
        source: &Source,
        image: &str,
        fallback: Size,
        which: &str,
    ) -> Loaded<ModelCamera> {
        let (Source::Colmap(file) | Source::Transforms(file)) = source;
        let refused = |e: NameError| self.incomplete(format!("{which}: {}: {e}", file.display()));
        match self.models.get(source)? {
            Read::Colmap(model) => {
                let names = names_of(&model);
                let found = names::find(&names, image).map_err(refused)?;
                Ok(model[names[found.index]])
            }
            Read::Transforms(all) => {
                let (frame, _) = all.find(image).map_err(refused)?;
                Ok(all.camera(frame, fallback)?)
            }
        }
    }

    /// The name of an image in a file of cameras, and whether its folders agree with it.
    fn listed_name(&self, source: &Source, image: &str) -> Loaded<Option<(String, bool)>> {
        Ok(match self.models.get(source)? {
            Read::Colmap(model) => {
                let names = names_of(&model);
                names::find(&names, image).ok().map(|found| (names[found.index].to_string(), found.whole))
            }
            Read::Transforms(all) => {
                let frame = all.find(image).ok();
                frame.map(|(frame, found)| (frame.image.display().to_string(), found.whole))
            }
        })
    }

    /// Some of the images that a file lists, for messages.
    pub(super) fn some_names(&self, source: &Source) -> Loaded<String> {
        let (Source::Colmap(file) | Source::Transforms(file)) = source;
        let listed = match self.models.get(source)? {
            Read::Colmap(model) => names::list(&names_of(&model), ", "),
            Read::Transforms(all) => {
                let images: Vec<_> = all.frames.iter().map(|frame| frame.image.to_string_lossy()).collect();
                names::list(&images.iter().map(AsRef::as_ref).collect::<Vec<_>>(), ", ")
            }
        };
        Ok(format!("{} lists {listed}", file.display()))
    }

    /// Whether the scene's file of cameras lists an image.
    pub(super) fn is_listed(&self, image: &str) -> Loaded<bool> {
        let Some(source) = self.common_source() else { return Ok(false) };
        Ok(self.listed_name(&source, image)?.is_some_and(|(_, whole)| whole))
    }

    /// Refuses two photographs with the camera of one image, where a folder says that it is not theirs; the
    /// view that is left out has a camera too.
    pub(super) fn a_camera_each(&self) -> Loaded<()> {
        let mut seen: BTreeMap<(PathBuf, String), (&ViewSpec, bool)> = BTreeMap::new();
        for view in self.spec.view.iter().filter(|view| view.camera.is_none()) {
            let Some(source) = self.source_of(view) else { continue };
            let Some((name, whole)) = self.listed_name(&source, &view.image.to_string_lossy())? else {
                continue;
            };
            let (Source::Colmap(file) | Source::Transforms(file)) = source;
            if let Some((other, sure)) = seen.insert((file.clone(), name.clone()), (view, whole))
                && other.image != view.image
                && !(sure && whole)
            {
                return Err(self.incomplete(format!(
                    "{}: views {:?} and {:?} would both have the camera of image {name:?}, the only one of that file name; give the other one a `camera`, or remove its [[view]]",
                    file.display(),
                    other.label(),
                    view.label()
                )));
            }
        }
        Ok(())
    }
}

fn names_of(model: &Model) -> Vec<&str> {
    model.keys().map(String::as_str).collect()
}
