//! The scene of what lies in a folder: a COLMAP workspace, the frames of transforms.json, or two
//! photographs.

use super::spec::{SceneSpec, TargetSpec, ViewSpec};
use crate::camera::colmap::{PLACES, is_model, read_model};
use crate::camera::transforms::read_transforms;
use crate::camera::{Camera, CameraError, CameraList, Frame};
use crate::files::InputError;
use crate::image::image_size;
use hybank_core::messages::Quoted;
use std::path::{Path, PathBuf};

/// Files of cameras that make a folder a scene.
const LISTS: [&str; 2] = ["transforms.json", "transforms_train.json"];

/// Endings of photographs.
const PHOTOGRAPHS: [&str; 7] = ["png", "jpg", "jpeg", "ppm", "pgm", "tif", "tiff"];

const KNOWN: &str = "a folder with a COLMAP model and its images, transforms.json, or two photographs of a \
                     rectified rig";

type Found<T> = Result<T, InputError>;

/// A scene, and what its file says of it in comments.
pub struct Described {
    /// The scene.
    pub spec: SceneSpec,
    comments: Vec<String>,
}

impl Described {
    /// The text of the scene file.
    ///
    /// # Errors
    /// That of the encoder.
    pub fn text(&self) -> Result<String, toml::ser::Error> {
        let comments: String = self.comments.iter().map(|comment| format!("# {comment}\n")).collect();
        Ok(comments + &toml::to_string(&self.spec)?)
    }
}

/// The scene of a folder, a `transforms.json` or the left and the right photograph of a rectified rig, for a
/// file in the folder `beside`. Its virtual view is half-way between two views, or the place of the image
/// `view`, which is no view then.
///
/// ```
/// use hybank_ibr::image::{Image, save};
/// use hybank_ibr::scene::describe;
/// let folder = std::env::temp_dir().join(format!("hybank-scene-{}", std::process::id()));
/// std::fs::create_dir_all(&folder)?;
/// let paths = ["left.png", "right.png"].map(|name| folder.join(name));
/// for path in &paths {
///     save(&Image::filled(8, 4, 1, 100.0), path)?;
/// }
/// let scene = describe(&paths, None, &folder)?;
/// assert_eq!((scene.spec.view.len(), scene.spec.targets[0].position), (2, Some(0.5)));
/// assert!(scene.text()?.contains("image = \"left.png\""));
/// # std::fs::remove_dir_all(folder)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`InputError`] of a file, or that there is no scene.
pub fn describe(paths: &[PathBuf], view: Option<&str>, beside: &Path) -> Found<Described> {
    let writer = Writer { beside, view };
    match paths {
        [folder] if folder.is_dir() => writer.of_folder(folder),
        [file] if file.extension().is_some_and(|ending| ending == "json") => writer.of_transforms(file),
        [left, right] if left.is_file() && right.is_file() => writer.of_pair([left, right]),
        _ => {
            let missing = paths.iter().find(|path| !path.exists());
            let path = missing.or(paths.first()).map_or(Path::new(""), PathBuf::as_path);
            let reason = if missing.is_some() { "there is no such file or folder" } else { "it is no scene" };
            Err(InputError::file(path, format!("{reason}; give {KNOWN}")))
        }
    }
}

/// Makes the scene of a file that stands in a folder.
struct Writer<'a> {
    beside: &'a Path,
    /// The image whose place is the virtual view.
    view: Option<&'a str>,
}

/// An image with its camera, and what its `depth` says.
struct Placed<'a> {
    frame: &'a Frame,
    camera: Camera,
    image: PathBuf,
    depth: Option<PathBuf>,
    mask: Option<PathBuf>,
}

/// What lies beside the cameras of a list: the photograph of a frame, its depth map and its mask.
struct Files {
    image: PathBuf,
    depth: Option<PathBuf>,
    mask: Option<PathBuf>,
}

impl Writer<'_> {
    fn of_folder(&self, folder: &Path) -> Found<Described> {
        let lists = LISTS.map(|name| folder.join(name));
        if let Some(transforms) = lists.iter().find(|list| list.is_file()) {
            return self.of_transforms(transforms);
        }
        let places = std::iter::once(folder.to_owned()).chain(PLACES.iter().map(|place| folder.join(place)));
        let models: Vec<PathBuf> = places.filter(|place| is_model(place)).collect();
        if !models.is_empty() {
            // A dense reconstruction has undistorted photographs and depth.
            let dense =
                models.iter().find(|model| workspace(model).is_some_and(|w| w.join("stereo").is_dir()));
            return self.of_model(folder, dense.unwrap_or(&models[0]));
        }
        match &photographs(folder)?[..] {
            [left, right] => self.of_pair([left, right]),
            found => Err(InputError::file(
                folder,
                format!(
                    "there is no scene in this folder of {} photographs; a scene is {KNOWN}, which may also be given by their names",
                    found.len()
                ),
            )),
        }
    }

    /// A path as the scene file writes it.
    fn path(&self, path: &Path) -> Found<PathBuf> {
        if path.to_str().is_none() {
            let reason = "a scene file is text in UTF-8, and this path is not; rename it";
            return Err(InputError::file(path, reason));
        }
        match path.strip_prefix(self.beside) {
            Ok(inside) => Ok(inside.to_owned()),
            Err(_) => Ok(std::path::absolute(path).unwrap_or_else(|_| path.to_owned())),
        }
    }

    fn of_pair(&self, photographs: [&Path; 2]) -> Found<Described> {
        if let Some(view) = self.view {
            let reason = "a rectified pair without one of its photographs shows no depth";
            return Err(InputError::file(Path::new(view), reason));
        }
        same_size(photographs)?;
        let mut spec = SceneSpec { targets: vec![TargetSpec::default()], ..SceneSpec::default() };
        spec.targets[0].position = Some(0.5);
        for (position, photograph) in photographs.into_iter().enumerate() {
            spec.view.push(ViewSpec {
                image: self.path(photograph)?,
                position: Some(position as f64),
                disparity: Some("matched".into()),
                ..ViewSpec::default()
            });
        }
        let comment = "A rectified pair: the left photograph, and the right one. Its disparities are found from \
                       them.";
        Ok(Described { spec, comments: vec![comment.into()] })
    }

    fn of_model(&self, folder: &Path, model: &Path) -> Found<Described> {
        let list = read_model(model)?;
        let above = workspace(model).unwrap_or(folder);
        let images = [above, folder, model].map(|place| place.join("images"));
        let images = images.iter().find(|images| images.is_dir()).ok_or_else(|| {
            InputError::file(folder, "the photographs of the COLMAP model are looked for in a folder `images` beside it, which is not there")
        })?;
        let mut scene = self.of_list("Views of a COLMAP model.", &list, |frame| {
            let name = frame.image.to_string_lossy();
            let maps = above.join("stereo/depth_maps");
            let maps = ["geometric", "photometric"].map(|kind| maps.join(format!("{name}.{kind}.bin")));
            let mask = above.join("masks").join(format!("{name}.png"));
            Files {
                image: images.join(&frame.image),
                depth: maps.into_iter().find(|map| map.is_file()),
                mask: mask.is_file().then_some(mask),
            }
        })?;
        scene.spec.colmap = Some(self.path(model)?);
        Ok(scene)
    }

    fn of_transforms(&self, file: &Path) -> Found<Described> {
        let list = read_transforms(file)?;
        let beside = file.parent().unwrap_or(Path::new(""));
        let mut scene = self.of_list("Frames of transforms.json.", &list, |frame| {
            let [depth, mask] =
                [&frame.depth, &frame.mask].map(|file| file.as_ref().map(|file| beside.join(file)));
            Files { image: beside.join(&frame.image), depth, mask }
        })?;
        scene.spec.transforms = Some(self.path(file)?);
        Ok(scene)
    }

    /// Views of general cameras; `files` are those of a frame.
    fn of_list(&self, comment: &str, list: &CameraList, files: impl Fn(&Frame) -> Files) -> Found<Described> {
        let mut there: Vec<Placed<'_>> = Vec::new();
        for frame in &list.frames {
            let Files { image, depth, mask } = files(frame);
            if image.is_file() {
                let fallback = if frame.has_size() { (0, 0) } else { image_size(&image)? };
                let camera = list.camera(frame, fallback)?.camera;
                there.push(Placed { frame, camera, image, depth, mask });
            }
        }
        let place = self.view.map(|view| list.find(view)).transpose();
        let place = place.map_err(|e| InputError::file(list.path(), e))?.map(|(frame, _)| frame);
        there.retain(|placed| place.is_none_or(|place| !std::ptr::eq(placed.frame, place)));
        // With depth maps of some, those are enough.
        if there.iter().filter(|placed| placed.depth.is_some()).count() > 1 {
            there.retain(|placed| placed.depth.is_some());
        }
        let Some(first) = there.first() else {
            let reason = format!("none of the {} photographs that it lists is there", list.frames.len());
            return Err(InputError::file(list.path(), reason));
        };
        let (target, said) = match place {
            Some(place) => at_place(place),
            None => half_way(&there, first)
                .map_err(|source| InputError::file(list.path(), format!("the virtual camera: {source}")))?,
        };
        let comments = vec![comment.to_owned(), said];
        let view = there.iter().map(|placed| self.view_of_camera(placed)).collect::<Found<_>>()?;
        let spec = SceneSpec { view, targets: vec![target], ..SceneSpec::default() };
        Ok(Described { spec, comments })
    }

    fn view_of_camera(&self, placed: &Placed<'_>) -> Found<ViewSpec> {
        let depth = placed.depth.as_ref().map_or(Ok("matched".into()), |depth| self.path(depth))?;
        Ok(ViewSpec {
            image: self.path(&placed.image)?,
            depth_scale: ViewSpec::usual_scale(&depth),
            depth: Some(depth),
            mask: placed.mask.as_ref().map(|mask| self.path(mask)).transpose()?,
            ..ViewSpec::default()
        })
    }
}

/// The virtual view at the place of an image, and what a comment says of it.
fn at_place(place: &Frame) -> (TargetSpec, String) {
    let image = place.image.display().to_string();
    let said = format!("The virtual camera is that of {}, which is no view.", Quoted(&image));
    (TargetSpec { camera_of: Some(image), ..TargetSpec::default() }, said)
}

/// The virtual view between a view and the one nearest to it.
fn half_way(there: &[Placed<'_>], first: &Placed<'_>) -> Result<(TargetSpec, String), CameraError> {
    let apart = |placed: &Placed<'_>| (placed.camera.centre() - first.camera.centre()).norm();
    let others = there.iter().filter(|other| apart(other) > 0.0);
    let second = others.min_by(|a, b| apart(a).total_cmp(&apart(b))).unwrap_or(first);
    let matrix = *first.camera.towards(&second.camera, 0.5)?.matrix();
    let [one, other] = [first, second].map(|placed| Quoted(&placed.frame.image).to_string());
    let said = format!(
        "The virtual camera is half-way between {one} and {other}; camera_of = \"..\" takes that of an image instead."
    );
    let rows = std::array::from_fn(|i| std::array::from_fn(|k| matrix[(i, k)]));
    Ok((TargetSpec { camera: Some(rows), ..TargetSpec::default() }, said))
}

/// The folder with `sparse` and `stereo` above a model.
fn workspace(model: &Path) -> Option<&Path> {
    model.ancestors().take(3).find(|folder| folder.join("images").is_dir())
}

/// The files in a folder, in the order of their names.
fn files(folder: &Path) -> Found<Vec<PathBuf>> {
    let listed = std::fs::read_dir(folder).map_err(|e| InputError::file(folder, e.to_string()))?;
    let mut files: Vec<PathBuf> =
        listed.filter_map(|entry| Some(entry.ok()?.path())).filter(|path| path.is_file()).collect();
    files.sort();
    Ok(files)
}

fn photographs(folder: &Path) -> Found<Vec<PathBuf>> {
    let is_photograph = |path: &PathBuf| {
        let ending = path.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase);
        ending.is_some_and(|ending| PHOTOGRAPHS.contains(&ending.as_str()))
    };
    Ok(files(folder)?.into_iter().filter(is_photograph).collect())
}

/// The photographs of a rectified rig have one size.
fn same_size([left, right]: [&Path; 2]) -> Found<()> {
    let sizes = [image_size(left)?, image_size(right)?];
    if sizes[0] == sizes[1] {
        return Ok(());
    }
    let [left, right] = [left, right].map(|path| Quoted(path).to_string());
    Err(InputError::Sizes { left, right, sizes })
}
