//! The scene of what lies in a folder: a COLMAP workspace, the frames of transforms.json, a rectified pair
//! of Middlebury, or two photographs.

use super::spec::{SceneSpec, TargetSpec, ViewSpec};
use crate::camera::colmap::{PLACES, is_model, read_model};
use crate::camera::transforms::read_transforms;
use crate::camera::{Camera, CameraList, Frame};
use crate::depth::{DepthMap, Measure};
use crate::files::InputError;
use crate::image::{MOST_PIXELS, image_size, read_image, read_map};
use crate::pipeline::Agreement;
use crate::propagate::RectifiedView;
use hybank_core::messages::Quoted;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Views of general cameras that a scene has: those nearest to the virtual camera.
const MOST_VIEWS: usize = 8;

/// Stored numbers per pixel of disparity, in the sets of Middlebury.
const SCALES: [f64; 6] = [1.0, 2.0, 3.0, 4.0, 8.0, 16.0];

/// Endings of photographs.
const PHOTOGRAPHS: [&str; 7] = ["png", "jpg", "jpeg", "ppm", "pgm", "tif", "tiff"];

const KNOWN: &str = "a folder with a COLMAP model and its images, transforms.json, calib.txt beside im0.png and im1.png, \
                     disp2.png and disp6.png beside im2.png and im6.png, or two photographs of a rectified rig";

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
/// file in the folder `beside`. Its virtual view is half-way between two views.
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
/// let scene = describe(&paths, &folder)?;
/// assert_eq!((scene.spec.view.len(), scene.spec.targets[0].position), (2, Some(0.5)));
/// assert!(scene.text()?.contains("image = \"left.png\""));
/// # std::fs::remove_dir_all(folder)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`InputError`] of a file, or that there is no scene.
pub fn describe(paths: &[PathBuf], beside: &Path) -> Found<Described> {
    let writer = Writer { beside };
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
}

/// An image with its camera, and what its `depth` says.
struct Placed<'a> {
    frame: &'a Frame,
    camera: Camera,
    image: PathBuf,
    depth: Option<PathBuf>,
}

impl Writer<'_> {
    fn of_folder(&self, folder: &Path) -> Found<Described> {
        let transforms = folder.join("transforms.json");
        if transforms.is_file() {
            return self.of_transforms(&transforms);
        }
        let places = std::iter::once(folder.to_owned()).chain(PLACES.iter().map(|place| folder.join(place)));
        let models: Vec<PathBuf> = places.filter(|place| is_model(place)).collect();
        if !models.is_empty() {
            // A dense reconstruction has undistorted photographs and depth.
            let dense =
                models.iter().find(|model| workspace(model).is_some_and(|w| w.join("stereo").is_dir()));
            return self.of_model(folder, dense.unwrap_or(&models[0]));
        }
        if folder.join("calib.txt").is_file() {
            return self.of_calibrated_pair(folder);
        }
        if let Some(scene) = self.of_numbered(folder)? {
            return Ok(scene);
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
        let comment = "A rectified pair: the left photograph, and the right one. Its disparities are found from \
                       them.";
        self.of_rig(comment, photographs.map(|photograph| (photograph, None)))
    }

    /// Two views of a rig, with the files of their disparities if there are any.
    fn of_rig(&self, comment: &str, views: [(&Path, Option<&Path>); 2]) -> Found<Described> {
        same_size(views.map(|(photograph, _)| photograph))?;
        let mut spec = SceneSpec { targets: vec![TargetSpec::default()], ..SceneSpec::default() };
        spec.targets[0].position = Some(0.5);
        for (position, (photograph, map)) in views.into_iter().enumerate() {
            spec.view.push(ViewSpec {
                image: self.path(photograph)?,
                position: Some(position as f64),
                disparity: Some(map.map_or(Ok("matched".into()), |map| self.path(map))?),
                ..ViewSpec::default()
            });
        }
        Ok(Described { spec, comments: vec![comment.into()] })
    }

    /// A pair of Middlebury of 2014 and later.
    fn of_calibrated_pair(&self, folder: &Path) -> Found<Described> {
        let photographs = [0, 1].map(|k| folder.join(format!("im{k}.png")));
        let maps = [0, 1].map(|k| ["", "GT"].map(|end| folder.join(format!("disp{k}{end}.pfm"))));
        let map = |k: usize| maps[k].iter().find(|map| map.is_file()).map(PathBuf::as_path);
        let views = [0, 1].map(|k| (photographs[k].as_path(), map(k)));
        let mut scene = self.of_rig("A pair of the Middlebury benchmark, with its calibration.", views)?;
        scene.spec.calib = Some(self.path(&folder.join("calib.txt"))?);
        Ok(scene)
    }

    /// Two numbered views of Middlebury before 2014, those with maps that are farthest apart.
    fn of_numbered(&self, folder: &Path) -> Found<Option<Described>> {
        let files = files(folder)?;
        let numbered = |start: &[&str]| -> BTreeMap<usize, &PathBuf> {
            let number = |path: &PathBuf| {
                let stem = path.file_stem()?.to_str()?;
                start.iter().find_map(|start| stem.strip_prefix(start)?.parse().ok())
            };
            files.iter().filter_map(|path| Some((number(path)?, path))).collect()
        };
        let (images, maps) = (numbered(&["im", "view"]), numbered(&["disp"]));
        let both: Vec<(&Path, &Path)> = images
            .iter()
            .filter_map(|(number, image)| Some((image.as_path(), maps.get(number)?.as_path())))
            .collect();
        let [left, .., right] = both[..] else { return Ok(None) };
        let views = [left, right].map(|(image, map)| (image, Some(map)));
        let mut scene = self.of_rig("Two views of a set of Middlebury.", views)?;
        if let Some((scale, share)) = scale_of(left, right)? {
            let percent = 100.0 * share;
            scene.comments.push(format!(
                "With this scale the views agree in depth and colour at {percent:.0} % of the points."
            ));
            scene.spec.disparity_scale = Some(scale);
        }
        Ok(Some(scene))
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
            (images.join(&frame.image), maps.into_iter().find(|map| map.is_file()))
        })?;
        scene.spec.colmap = Some(self.path(model)?);
        Ok(scene)
    }

    fn of_transforms(&self, file: &Path) -> Found<Described> {
        let list = read_transforms(file)?;
        let beside = file.parent().unwrap_or(Path::new(""));
        let mut scene = self.of_list("Frames of transforms.json.", &list, |frame| {
            (beside.join(&frame.image), frame.depth.as_ref().map(|depth| beside.join(depth)))
        })?;
        scene.spec.transforms = Some(self.path(file)?);
        Ok(scene)
    }

    /// Views of general cameras; `files` are the photograph and the depth map of a frame.
    fn of_list(
        &self,
        comment: &str,
        list: &CameraList,
        files: impl Fn(&Frame) -> (PathBuf, Option<PathBuf>),
    ) -> Found<Described> {
        let mut there = Vec::new();
        for frame in &list.frames {
            let (image, depth) = files(frame);
            if image.is_file() {
                let fallback = if frame.has_size() { (0, 0) } else { image_size(&image)? };
                let camera = list.camera(frame, fallback)?.camera;
                there.push(Placed { frame, camera, image, depth });
            }
        }
        // With depth maps of some, those are enough.
        if there.iter().filter(|placed| placed.depth.is_some()).count() > 1 {
            there.retain(|placed| placed.depth.is_some());
        }
        let Some(first) = there.first() else {
            let reason = format!("none of the {} photographs that it lists is there", list.frames.len());
            return Err(InputError::file(list.path(), reason));
        };
        let apart = |placed: &&Placed<'_>, camera: &Camera| (placed.camera.centre() - camera.centre()).norm();
        let others = there.iter().filter(|other| apart(other, &first.camera) > 0.0);
        let by_distance =
            |a: &&Placed<'_>, b: &&Placed<'_>, camera: &Camera| apart(a, camera).total_cmp(&apart(b, camera));
        let second = others.min_by(|a, b| by_distance(a, b, &first.camera)).unwrap_or(first);
        let camera = first
            .camera
            .towards(&second.camera, 0.5)
            .map_err(|source| InputError::file(list.path(), format!("the virtual camera: {source}")))?;
        let [one, other] = [first, second].map(|placed| Quoted(&placed.frame.image).to_string());
        let count = there.len();
        there.sort_by(|a, b| by_distance(&a, &b, &camera));
        there.truncate(MOST_VIEWS);
        let mut comments = vec![comment.to_owned()];
        if count > MOST_VIEWS {
            comments
                .push(format!("The {MOST_VIEWS} of {count} views that are nearest to the virtual camera."));
        }
        comments.push(format!(
            "The virtual camera is half-way between {one} and {other}; camera_of = \"..\" takes that of an image instead."
        ));
        let matrix = camera.matrix();
        let rows = std::array::from_fn(|i| std::array::from_fn(|k| matrix[(i, k)]));
        let target = TargetSpec { camera: Some(rows), ..TargetSpec::default() };
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
            ..ViewSpec::default()
        })
    }
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

/// The scale of two maps of whole numbers with which most points agree, and the share of these; `None` for
/// floats, which are pixels.
fn scale_of(left: (&Path, &Path), right: (&Path, &Path)) -> Found<Option<(f64, f64)>> {
    let is_float = |map: &Path| map.extension().is_some_and(|ending| ending == "pfm");
    if is_float(left.1) || is_float(right.1) {
        return Ok(None);
    }
    let images = [read_image(left.0, MOST_PIXELS)?, read_image(right.0, MOST_PIXELS)?];
    let stored = [read_map(left.1, MOST_PIXELS)?, read_map(right.1, MOST_PIXELS)?];
    let mut best: Option<(f64, f64)> = None;
    for scale in SCALES {
        let map = |k: usize, path: &Path| {
            let (width, height, values) = stored[k].clone();
            let map = DepthMap::new((width, height), values, scale, Measure::Disparity);
            let fitting = map.and_then(|map| map.fits(images[k].size(), 1).map(|()| map));
            fitting.map_err(|e| InputError::file(path, e))
        };
        let maps = [map(0, left.1)?, map(1, right.1)?];
        let view = |k: usize| RectifiedView { image: &images[k], map: &maps[k], camera: k as f64 };
        let share = Agreement::of(&[view(0), view(1)]).worst().map_or(0.0, |pair| pair.share);
        if best.is_none_or(|(_, most)| share > most) {
            best = Some((scale, share));
        }
    }
    Ok(best)
}
