//! Cameras from files of other programs, each file read once.

use super::{Goal, Loaded, Loader};
use crate::camera::colmap::{ScenePoint, read_model, read_points};
use crate::camera::names::{self, NameError};
use crate::camera::resize::Size;
use crate::camera::transforms::read_transforms;
use crate::camera::{CameraList, ListedCamera};
use crate::depth::Mesh;
use crate::files::InputError;
use crate::scene::ViewSpec;
use hybank_core::messages::Quoted;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Where the camera of a view is written: the folder of a COLMAP model or a transforms file.
pub(super) struct Source {
    pub(super) path: PathBuf,
    read: fn(&Path) -> Result<CameraList, InputError>,
}

/// The files that have been read.
#[derive(Default)]
pub(super) struct Models {
    read: Mutex<BTreeMap<PathBuf, Arc<CameraList>>>,
    points: Mutex<BTreeMap<PathBuf, Arc<Vec<ScenePoint>>>>,
    meshes: Mutex<BTreeMap<PathBuf, Arc<Mesh>>>,
}

impl Models {
    fn get(&self, source: &Source) -> Loaded<Arc<CameraList>> {
        once(&self.read, &source.path, source.read)
    }

    pub(super) fn mesh(&self, path: &Path) -> Loaded<Arc<Mesh>> {
        once(&self.meshes, path, Mesh::read)
    }

    /// The points of the COLMAP model in a folder that one of its images shows.
    pub(super) fn points(&self, folder: &Path, image: &str) -> Loaded<Vec<Vector3<f64>>> {
        let list = self.get(&Source { path: folder.into(), read: read_model })?;
        let id = list.find(image).ok().map(|(frame, _)| frame.id);
        let points = once(&self.points, folder, read_points)?;
        let shown = points.iter().filter(|point| id.is_some_and(|id| point.images.contains(&id)));
        Ok(shown.map(|point| point.position).collect())
    }
}

/// What a file holds, read once.
fn once<T>(
    known: &Mutex<BTreeMap<PathBuf, Arc<T>>>,
    path: &Path,
    read: fn(&Path) -> Result<T, InputError>,
) -> Loaded<Arc<T>> {
    let mut known = known.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(found) = known.get(path) {
        return Ok(found.clone());
    }
    let found = Arc::new(read(path)?);
    known.insert(path.into(), found.clone());
    Ok(found)
}

impl Loader<'_> {
    /// Where the camera of a view without a matrix is written.
    pub(super) fn source_of(&self, view: &ViewSpec) -> Option<Source> {
        let own = view.colmap.as_ref().map(|folder| Source { path: self.file(folder), read: read_model });
        own.or_else(|| self.common_source())
    }

    /// The file of cameras that the scene names at the top.
    pub(super) fn common_source(&self) -> Option<Source> {
        let source = |path: &PathBuf, read| Source { path: self.file(path), read };
        let colmap = self.spec.colmap.as_ref().map(|folder| source(folder, read_model));
        colmap.or_else(|| self.spec.transforms.as_ref().map(|file| source(file, read_transforms)))
    }

    /// The file that lists the camera of a virtual view.
    pub(super) fn source_of_goal(&self, goal: &Goal) -> Option<Source> {
        let own = goal.target.cameras.as_ref();
        own.map(|file| Source { path: self.file(file), read: CameraList::read })
            .or_else(|| self.common_source())
    }

    /// The camera of an image, as the file lists it. `fallback` is the size of the image if the file does
    /// not give it; `which` names the view in messages.
    pub(super) fn listed_camera(
        &self,
        source: &Source,
        image: &str,
        fallback: Size,
        which: &str,
    ) -> Loaded<ListedCamera> {
        let list = self.models.get(source)?;
        let refused = |e: NameError| self.incomplete(format!("{which}: {}: {e}", Quoted(list.path())));
        let (frame, _) = list.find(image).map_err(refused)?;
        list.camera(frame, fallback)
    }

    /// The name of an image in a file of cameras, and whether its folders agree with it.
    pub(super) fn listed_name(&self, source: &Source, image: &str) -> Loaded<Option<(String, bool)>> {
        let list = self.models.get(source)?;
        let found = list.find(image).ok();
        Ok(found.map(|(frame, found)| (frame.image.display().to_string(), found.whole)))
    }

    /// Some of the images that a file lists, for messages.
    pub(super) fn some_names(&self, source: &Source) -> Loaded<String> {
        let list = self.models.get(source)?;
        let images: Vec<_> = list.frames.iter().map(|frame| frame.image.to_string_lossy()).collect();
        Ok(format!("{} lists {}", Quoted(list.path()), names::list(&images, ", ")))
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
            let file = source.path;
            if let Some((other, sure)) = seen.insert((file.clone(), name.clone()), (view, whole))
                && other.image != view.image
                && !(sure && whole)
            {
                return Err(self.incomplete(format!(
                    "{}: {} and {} would both have the camera of image \"{}\", the only one of that file name; give the other one a `camera`, or remove its [[view]]",
                    Quoted(file),
                    other.named(),
                    view.named(),
                    Quoted(name)
                )));
            }
        }
        Ok(())
    }
}
