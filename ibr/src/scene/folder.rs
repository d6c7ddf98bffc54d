//! A scene file for what lies in a folder: a COLMAP workspace, the frames of transforms.json, a rectified
//! pair of Middlebury, or two photographs.

use crate::camera::colmap::{PLACES, is_model, read_model};
use crate::camera::transforms::read_transforms;
use crate::camera::{Camera, CameraList, Frame};
use crate::depth::{DepthMap, Measure};
use crate::files::InputError;
use crate::image::{image_size, read_image, read_map};
use crate::pipeline::Agreement;
use crate::propagate::RectifiedView;
use hybank::messages::Quoted;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Views of general cameras that a scene has: those nearest to the virtual camera.
const MOST_VIEWS: usize = 8;

/// Stored numbers per pixel of disparity, in the sets of Middlebury.
const SCALES: [f64; 6] = [1.0, 2.0, 3.0, 4.0, 8.0, 16.0];

/// Endings of photographs.
const PHOTOGRAPHS: [&str; 7] = ["png", "jpg", "jpeg", "ppm", "pgm", "tif", "tiff"];

const KNOWN: &str = "a folder with a COLMAP model and its images, transforms.json, calib.txt beside im0.png and im1.png, \
                     disp2.png and disp6.png beside im2.png and im6.png, or two photographs of a rectified rig";

type Described<T> = Result<T, InputError>;

/// The text of a scene file in the folder `beside`, for a folder, a `transforms.json` or the left and the
/// right photograph of a rectified rig. Its virtual view is half-way between two views.
///
/// # Errors
/// [`InputError`] of a file, or that there is no scene.
pub fn describe(paths: &[PathBuf], beside: &Path) -> Described<String> {
    let text = Text { beside };
    match paths {
        [folder] if folder.is_dir() => text.of_folder(folder),
        [file] if file.extension().is_some_and(|ending| ending == "json") => text.of_transforms(file),
        [left, right] if left.is_file() && right.is_file() => text.of_pair([left, right]),
        _ => {
            let missing = paths.iter().find(|path| !path.exists());
            let path = missing.or(paths.first()).map_or(Path::new(""), PathBuf::as_path);
            let reason = if missing.is_some() { "there is no such file or folder" } else { "it is no scene" };
            Err(InputError::file(path, format!("{reason}; give {KNOWN}")))
        }
    }
}

/// The text of a scene file that stands in a folder.
struct Text<'a> {
    beside: &'a Path,
}

/// An image with its camera, and what its `depth` says.
struct Placed<'a> {
    frame: &'a Frame,
    camera: Camera,
    image: PathBuf,
    depth: Option<PathBuf>,
}

impl Text<'_> {
    fn of_folder(&self, folder: &Path) -> Described<String> {
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
        if let Some(text) = self.of_numbered(folder)? {
            return Ok(text);
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
    fn path(&self, path: &Path) -> Described<String> {
        let absolute = || std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let written = match path.strip_prefix(self.beside) {
            Ok(inside) => inside.to_owned(),
            Err(_) => absolute(),
        };
        let text = written.to_str().ok_or_else(|| {
            InputError::file(path, "a scene file is text in UTF-8, and this path is not; rename it")
        })?;
        Ok(toml::Value::String(text.into()).to_string())
    }

    fn of_pair(&self, photographs: [&Path; 2]) -> Described<String> {
        same_size(photographs)?;
        let mut text =
            "# A rectified pair: the left photograph, and the right one. Its disparities are found from \
                        them.\n"
                .to_string();
        for (position, photograph) in photographs.into_iter().enumerate() {
            self.view_of_rig(&mut text, photograph, position, None)?;
        }
        Ok(text + HALF_WAY)
    }

    /// A view of a rig, with the file of its disparities if there is one.
    fn view_of_rig(
        &self,
        text: &mut String,
        photograph: &Path,
        position: usize,
        map: Option<&Path>,
    ) -> Described<()> {
        let image = self.path(photograph)?;
        let map = map.map_or(Ok("\"matched\"".into()), |map| self.path(map))?;
        let _ = write!(text, "\n[[view]]\nimage = {image}\nposition = {position}.0\ndisparity = {map}\n");
        Ok(())
    }

    /// A pair of Middlebury of 2014 and later.
    fn of_calibrated_pair(&self, folder: &Path) -> Described<String> {
        let calibration = self.path(&folder.join("calib.txt"))?;
        let mut text =
            format!("# A pair of the Middlebury benchmark, with its calibration.\ncalib = {calibration}\n");
        let photographs = [0, 1].map(|position| folder.join(format!("im{position}.png")));
        same_size([&photographs[0], &photographs[1]])?;
        for (position, photograph) in photographs.iter().enumerate() {
            let maps = ["", "GT"].map(|end| folder.join(format!("disp{position}{end}.pfm")));
            let map = maps.iter().find(|map| map.is_file());
            self.view_of_rig(&mut text, photograph, position, map.map(PathBuf::as_path))?;
        }
        Ok(text + HALF_WAY)
    }

    /// Two numbered views of Middlebury before 2014, those with maps that are farthest apart.
    fn of_numbered(&self, folder: &Path) -> Described<Option<String>> {
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
        same_size([left.0, right.0])?;
        let mut text = "# Two views of a set of Middlebury.\n".to_string();
        if let Some((scale, share)) = scale_of(left, right)? {
            let _ = write!(
                text,
                "# With this scale the views agree in depth and colour at {:.0} % of the points.\ndisparity_scale = {scale:?}\n",
                100.0 * share
            );
        }
        for (position, (image, map)) in [left, right].into_iter().enumerate() {
            self.view_of_rig(&mut text, image, position, Some(map))?;
        }
        Ok(Some(text + HALF_WAY))
    }

    fn of_model(&self, folder: &Path, model: &Path) -> Described<String> {
        let list = read_model(model)?;
        let above = workspace(model).unwrap_or(folder);
        let images = [above, folder, model].map(|place| place.join("images"));
        let images = images.iter().find(|images| images.is_dir()).ok_or_else(|| {
            InputError::file(folder, "the photographs of the COLMAP model are looked for in a folder `images` beside it, which is not there")
        })?;
        let head = format!("# Views of a COLMAP model.\ncolmap = {}\n", self.path(model)?);
        self.of_list(head, &list, |frame| {
            let name = frame.image.to_string_lossy();
            let maps = above.join("stereo/depth_maps");
            let maps = ["geometric", "photometric"].map(|kind| maps.join(format!("{name}.{kind}.bin")));
            (images.join(&frame.image), maps.into_iter().find(|map| map.is_file()))
        })
    }

    fn of_transforms(&self, file: &Path) -> Described<String> {
        let list = read_transforms(file)?;
        let beside = file.parent().unwrap_or(Path::new(""));
        let head = format!("# Frames of transforms.json.\ntransforms = {}\n", self.path(file)?);
        self.of_list(head, &list, |frame| {
            (beside.join(&frame.image), frame.depth.as_ref().map(|depth| beside.join(depth)))
        })
    }

    /// Views of general cameras; `files` are the photograph and the depth map of a frame.
    fn of_list(
        &self,
        head: String,
        list: &CameraList,
        files: impl Fn(&Frame) -> (PathBuf, Option<PathBuf>),
    ) -> Described<String> {
        let mut there = Vec::new();
        for frame in &list.frames {
            let (image, depth) = files(frame);
            if image.is_file() {
                let fallback = if frame.has_size() { (0, 0) } else { read_image(&image)?.size() };
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
        let apart = |a: &Placed<'_>, b: &Placed<'_>| (a.camera.centre() - b.camera.centre()).norm();
        let others = there.iter().filter(|other| apart(other, first) > 0.0);
        let second = others.min_by(|a, b| apart(a, first).total_cmp(&apart(b, first))).unwrap_or(first);
        let camera = first
            .camera
            .towards(&second.camera, 0.5)
            .map_err(|source| InputError::file(list.path(), format!("the virtual camera: {source}")))?;
        let names = [first, second].map(|placed| Quoted(&placed.frame.image).to_string());
        let count = there.len();
        there.sort_by(|a, b| {
            let distance = |placed: &Placed<'_>| (placed.camera.centre() - camera.centre()).norm();
            distance(a).total_cmp(&distance(b))
        });
        there.truncate(MOST_VIEWS);
        let mut text = head;
        if count > there.len() {
            let _ =
                writeln!(text, "# The {MOST_VIEWS} of {count} views that are nearest to the virtual camera.");
        }
        for placed in &there {
            self.view_of_camera(&mut text, placed)?;
        }
        let _ = write!(
            text,
            "\n# Half-way between {} and {}; camera_of = \"..\" takes the camera of an image instead.\n[virtual]\ncamera = [\n",
            names[0], names[1]
        );
        for row in camera.matrix().row_iter() {
            let numbers: Vec<String> = row.iter().map(|v| format!("{v:?}")).collect();
            let _ = writeln!(text, "  [{}],", numbers.join(", "));
        }
        Ok(text + "]\n")
    }

    fn view_of_camera(&self, text: &mut String, placed: &Placed<'_>) -> Described<()> {
        let image = self.path(&placed.image)?;
        let depth = placed.depth.as_ref().map_or(Ok("\"matched\"".into()), |depth| self.path(depth))?;
        let _ = write!(text, "\n[[view]]\nimage = {image}\ndepth = {depth}\n");
        if placed.depth.as_ref().is_some_and(|depth| depth.extension().is_some_and(|ending| ending == "png"))
        {
            text.push_str("depth_scale = 1000.0\n");
        }
        Ok(())
    }
}

const HALF_WAY: &str = "\n[virtual]\nposition = 0.5\n";

/// The folder with `sparse` and `stereo` above a model.
fn workspace(model: &Path) -> Option<&Path> {
    model.ancestors().take(3).find(|folder| folder.join("images").is_dir())
}

/// The files in a folder, in the order of their names.
fn files(folder: &Path) -> Described<Vec<PathBuf>> {
    let listed = std::fs::read_dir(folder).map_err(|e| InputError::file(folder, e.to_string()))?;
    let mut files: Vec<PathBuf> =
        listed.filter_map(|entry| Some(entry.ok()?.path())).filter(|path| path.is_file()).collect();
    files.sort();
    Ok(files)
}

fn photographs(folder: &Path) -> Described<Vec<PathBuf>> {
    let is_photograph = |path: &PathBuf| {
        let ending = path.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase);
        ending.is_some_and(|ending| PHOTOGRAPHS.contains(&ending.as_str()))
    };
    Ok(files(folder)?.into_iter().filter(is_photograph).collect())
}

/// The photographs of a rectified rig have one size.
fn same_size([left, right]: [&Path; 2]) -> Described<()> {
    let sizes = [image_size(left)?, image_size(right)?];
    if sizes[0] == sizes[1] {
        return Ok(());
    }
    let [left, right] = [left, right].map(|path| Quoted(path).to_string());
    Err(InputError::Sizes { left, right, sizes })
}

/// The scale of two maps of whole numbers with which most points agree, and the share of these; `None` for
/// floats, which are pixels.
fn scale_of(left: (&Path, &Path), right: (&Path, &Path)) -> Described<Option<(f64, f64)>> {
    let mut views = Vec::new();
    for (image, map) in [left, right] {
        let (width, height, stored) = read_map(map)?;
        views.push((read_image(image)?, (width, height), stored, map));
    }
    if views.iter().any(|view| view.3.extension().is_some_and(|ending| ending == "pfm")) {
        return Ok(None);
    }
    let mut best: Option<(f64, f64)> = None;
    for scale in SCALES {
        let maps: Vec<DepthMap> = views
            .iter()
            .map(|(image, size, stored, path)| {
                let map = DepthMap::new(*size, stored.clone(), scale, Measure::Disparity);
                let fitting = map.and_then(|map| map.fits(image.size(), 1).map(|()| map));
                fitting.map_err(|e| InputError::file(path, e))
            })
            .collect::<Result<_, _>>()?;
        let view = |k: usize| RectifiedView { image: &views[k].0, map: &maps[k], camera: k as f64 };
        let share = Agreement::of(&[view(0), view(1)]).worst().map_or(0.0, |pair| pair.share);
        if best.is_none_or(|(_, most)| share > most) {
            best = Some((scale, share));
        }
    }
    Ok(best)
}
