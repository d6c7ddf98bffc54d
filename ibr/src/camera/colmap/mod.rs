//! COLMAP models as camera input: `cameras` and `images` of one folder, as text or binary.
//!
//! COLMAP puts pixel centres at half-integers; [`CameraList::camera`] shifts the principal point.

mod binary;
mod points;

pub(crate) use points::{ScenePoint, read_points};

use super::list::{CameraList, Frame, Inner, portable};
use crate::files::{self, CHECK_THE_PATH, InputError};
use hybank_core::messages::{Number, Quoted};
use nalgebra::{Isometry3, Matrix3x4, Quaternion, UnitQuaternion};
use std::collections::BTreeMap;
use std::path::Path;

/// What to do if a file of a model cannot be opened.
const FILES: &str = "a COLMAP model has cameras.txt and images.txt, or cameras.bin and images.bin";

/// Where COLMAP puts models in its folders.
pub(crate) const PLACES: [&str; 6] =
    ["sparse/0", "sparse", "0", "dense/0/sparse", "dense/sparse", "colmap/sparse/0"];

/// Reads the model in `folder`: the text files if cameras.txt is there, else the binary ones if cameras.bin
/// is.
///
/// Accepts pinhole models and models with up to two radial and two tangential coefficients of the lens.
/// Images of other models have to be undistorted first, so these are refused.
///
/// # Errors
/// [`InputError`], with file and line or record.
pub fn read_model(folder: &Path) -> Result<CameraList, InputError> {
    if !is_model(folder) {
        return Err(no_model(folder));
    }
    if !folder.join("cameras.txt").exists() && folder.join("cameras.bin").exists() {
        let load = |name: &str| files::read_bytes(&folder.join(name), FILES);
        let (cameras, images) = (load("cameras.bin")?, load("images.bin")?);
        return join(folder, "bin", ": record ", binary::cameras(&cameras), binary::images(&images));
    }
    let load = |name: &str| files::read_text(&folder.join(name), FILES);
    parse_model(&load("cameras.txt")?, &load("images.txt")?, folder)
}

/// The names of all files of a model, in both formats.
pub(crate) fn model_files() -> impl Iterator<Item = String> {
    let names = ["cameras", "images", "points3D", "rigs", "frames"];
    names.into_iter().flat_map(|name| ["txt", "bin"].map(|ending| format!("{name}.{ending}")))
}

/// Whether a folder has the file of cameras, in one of the formats.
pub(crate) fn is_model(folder: &Path) -> bool {
    ["cameras.txt", "cameras.bin"].iter().any(|name| folder.join(name).is_file())
}

/// That there is no model in a folder, with those that are in folders below it.
fn no_model(folder: &Path) -> InputError {
    let below = PLACES.iter().map(|place| folder.join(place)).filter(|place| is_model(place));
    let below: Vec<String> = below.map(|place| Quoted(place).to_string()).collect();
    let remedy = match (below.is_empty(), folder.is_file(), folder.exists()) {
        (false, ..) => format!("name the folder with the model: {}", below.join(" or ")),
        (_, true, _) => "it is a file; name the folder that holds it".into(),
        (_, _, true) => FILES.into(),
        _ => format!("there is no such folder; {CHECK_THE_PATH}"),
    };
    let reason = format!("there is neither cameras.txt nor cameras.bin: {remedy}");
    InputError::file(folder, reason)
}

/// The same from the texts of the two files; `folder` appears in messages.
///
/// # Errors
/// [`InputError`].
pub fn parse_model(cameras: &str, images: &str, folder: &Path) -> Result<CameraList, InputError> {
    join(folder, "txt", ":", parse_cameras(cameras), parse_images(images))
}

/// The images with their cameras, from what the two files in a folder say; `at` is before the
/// number of a line or a record in messages.
fn join(
    folder: &Path,
    ending: &str,
    at: &str,
    cameras: Result<BTreeMap<u64, Inner>, Fault>,
    images: Result<Vec<Pose>, Fault>,
) -> Result<CameraList, InputError> {
    let path = |name: &str| folder.join(format!("{name}.{ending}"));
    let fault =
        |name: &str, (place, reason): Fault| InputError::content(&path(name), format!("{at}{place}"), reason);
    let cameras = cameras.map_err(|e| fault("cameras", e))?;
    let images = images.map_err(|e| fault("images", e))?;
    let mut frames = BTreeMap::new();
    for Pose { at, id, camera, pose, name } in images {
        let unlisted =
            || format!("image \"{}\" has camera {camera}, which the cameras do not list", Quoted(&name));
        let inner = *cameras.get(&camera).ok_or_else(|| fault("images", (at, unlisted())))?;
        let image = portable(&name);
        frames.insert(name, Frame { image, depth: None, mask: None, id, pose, inner });
    }
    Ok(CameraList::new(path("images"), frames.into_values().collect()))
}

/// What is wrong with a file, with the number of the line or the record from 1.
type Fault = (usize, String);

/// Lines with content, with their numbers.
fn content(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines().enumerate().map(|(i, l)| (i + 1, l.trim())).filter(|(_, l)| !l.starts_with('#'))
}

fn number<T: std::str::FromStr>(word: Option<&str>, name: &str) -> Result<T, String> {
    let word = word.ok_or_else(|| format!("the {name} is missing"))?;
    word.parse().map_err(|_| format!("the {name} \"{}\" is not a number", Quoted(word)))
}

/// CAMERA_ID MODEL WIDTH HEIGHT PARAMS...
fn parse_cameras(text: &str) -> Result<BTreeMap<u64, Inner>, Fault> {
    let lines = content(text).filter(|(_, l)| !l.is_empty());
    lines.map(|(i, line)| parse_camera(line).map_err(|reason| (i, reason))).collect()
}

fn parse_camera(line: &str) -> Result<(u64, Inner), String> {
    let mut words = line.split_whitespace();
    let id = number(words.next(), "camera id")?;
    let model = words.next().ok_or("the camera model is missing")?;
    let size = (number(words.next(), "width")?, number(words.next(), "height")?);
    let parameters =
        words.map(|w| number(Some(w), "camera parameter")).collect::<Result<Vec<f64>, String>>()?;
    Ok((id, inner(model, size, &parameters)?))
}

/// A camera from the name of its model and its parameters.
fn inner(model: &str, size: (usize, usize), parameters: &[f64]) -> Result<Inner, String> {
    // Focal lengths first (one or two), then the principal point, then distortion.
    let (focal, most) = match model {
        "SIMPLE_PINHOLE" => (1, 0),
        "PINHOLE" => (2, 0),
        "SIMPLE_RADIAL" => (1, 1),
        "RADIAL" => (1, 2),
        "OPENCV" | "FULL_OPENCV" => (2, 4),
        other => {
            return Err(format!(
                "camera model {} is not supported (supported are SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, and FULL_OPENCV without k3 to k6); undistort the images first",
                Quoted(other)
            ));
        }
    };
    let [fx, .., cx, cy] = parameters.get(..focal + 2).ok_or("camera parameters are missing")? else {
        return Err("camera parameters are missing".into());
    };
    let fy = parameters[focal - 1];
    let (bends, beyond) = parameters[focal + 2..].split_at(most.min(parameters.len() - focal - 2));
    if let Some(value) = beyond.iter().find(|v| **v != 0.0) {
        return Err(format!(
            "the {model} camera has an unsupported coefficient ({}); undistort the images first",
            Number(*value)
        ));
    }
    if size.0 == 0 || size.1 == 0 {
        return Err(format!("the image has {} x {} pixels: both sides must be positive", size.0, size.1));
    }
    let bend = |i: usize| bends.get(i).copied();
    Ok(Inner {
        fl_x: Some(*fx),
        fl_y: Some(fy),
        cx: Some(*cx),
        cy: Some(*cy),
        w: Some(size.0 as f64),
        h: Some(size.1 as f64),
        k1: bend(0),
        k2: bend(1),
        p1: bend(2),
        p2: bend(3),
        ..Inner::default()
    })
}

/// An image of a model.
struct Pose {
    /// Its line or record.
    at: usize,
    id: u64,
    /// The id of its camera.
    camera: u64,
    /// World to camera.
    pose: Matrix3x4<f64>,
    name: String,
}

/// Two lines per image: IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then its points, which are ignored.
fn parse_images(text: &str) -> Result<Vec<Pose>, Fault> {
    let mut lines = content(text);
    let mut poses = Vec::new();
    while let Some((i, line)) = lines.next() {
        if line.is_empty() {
            continue;
        }
        poses.push(parse_image(i, line).map_err(|reason| (i, reason))?);
        lines.next();
    }
    Ok(poses)
}

fn parse_image(at: usize, line: &str) -> Result<Pose, String> {
    let mut words = line.split_whitespace();
    let id = number(words.next(), "image id")?;
    let mut seven = [0.0; 7];
    for (value, name) in seven.iter_mut().zip(["QW", "QX", "QY", "QZ", "TX", "TY", "TZ"]) {
        *value = number(words.next(), name)?;
    }
    let camera = number(words.next(), "camera id")?;
    let name = words.collect::<Vec<_>>().join(" ");
    if name.is_empty() {
        return Err("the name of the image is missing".into());
    }
    Ok(Pose { at, id, camera, pose: pose(seven)?, name })
}

/// \[R | t\] from a quaternion (scalar first) and a translation.
fn pose([w, x, y, z, t @ ..]: [f64; 7]) -> Result<Matrix3x4<f64>, String> {
    let q = Quaternion::new(w, x, y, z);
    if q.norm() < 1e-9 {
        return Err("the rotation quaternion is 0".into());
    }
    let pose = Isometry3::from_parts(t.into(), UnitQuaternion::from_quaternion(q));
    Ok(pose.to_matrix().fixed_rows::<3>(0).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Lens;
    use nalgebra::Vector3;

    fn folder(cameras: &str, images: &str) -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("cameras.txt"), cameras).unwrap();
        std::fs::write(dir.path().join("images.txt"), images).unwrap();
        dir
    }

    #[test]
    fn a_model_becomes_cameras() {
        let dir = folder(
            "# cameras\n1 PINHOLE 640 480 500 510 320.5 240.5\n2 SIMPLE_RADIAL 100 50 80 50 25 0\n",
            "# images\n1 1 0 0 0 1 2 3 1 a b.png\n10 20 -1 30 40 7\n\
             2 0.7071067811865476 0 0.7071067811865476 0 0 0 0 2 sub/c.jpg\n\n",
        );
        let model = read_model(dir.path()).unwrap();
        let names: Vec<_> = model.frames.iter().map(|frame| frame.image.display().to_string()).collect();
        assert_eq!(names, ["a b.png", "sub/c.jpg"]);
        let [a, c] = [0, 1].map(|k| model.camera(&model.frames[k], (0, 0)).unwrap());
        assert_eq!(a.size, (640, 480));
        let want = Matrix3x4::new(
            500.0,
            0.0,
            320.0,
            500.0 + 960.0,
            0.0,
            510.0,
            240.0,
            1020.0 + 720.0,
            0.0,
            0.0,
            1.0,
            3.0,
        );
        assert!((a.camera.matrix() - want).norm() < 1e-9);
        // A quarter turn about y: the camera looks along -x.
        let (_, _, depth) = c.camera.project(&Vector3::new(-2.0, 0.0, 0.0));
        assert!((depth - 2.0).abs() < 1e-12);
    }

    #[test]
    fn distortion_becomes_a_lens() {
        let images = "1 1 0 0 0 0 0 0 1 a.png\n\n";
        for (line, radial, tangential) in [
            ("1 SIMPLE_RADIAL 64 48 50 32.5 24.5 0.1", [0.1, 0.0], [0.0; 2]),
            ("1 RADIAL 64 48 50 32.5 24.5 0.1 -0.02", [0.1, -0.02], [0.0; 2]),
            ("1 OPENCV 64 48 50 50 32.5 24.5 0.1 -0.02 0.003 0.004", [0.1, -0.02], [0.003, 0.004]),
            ("1 FULL_OPENCV 64 48 50 50 32.5 24.5 0.1 0 0 0.004 0 0 0 0", [0.1, 0.0], [0.0, 0.004]),
        ] {
            let model = parse_model(line, images, Path::new("m")).unwrap();
            let lens = Lens::new([50.0; 2], [32.0, 24.0], radial, tangential);
            let want = lens.record(nalgebra::Vector2::new(32.0 + 10.0, 24.0 - 5.0)).unwrap();
            let (x, y, _) =
                model.camera(&model.frames[0], (0, 0)).unwrap().camera.project(&Vector3::new(1.0, -0.5, 5.0));
            assert!((x - want.x).abs() < 1e-12 && (y - want.y).abs() < 1e-12, "{line}: {x} {y} {want}");
        }
    }

    #[test]
    fn faults_are_named_with_their_lines() {
        let message =
            |cameras: &str, images: &str| read_model(folder(cameras, images).path()).unwrap_err().to_string();
        let fine = "1 SIMPLE_PINHOLE 10 10 5 5 5\n";
        assert!(
            message("1 FULL_OPENCV 10 10 5 5 5 5 0 0 0 0 0.1\n", "")
                .contains("unsupported coefficient (0.1)")
        );
        assert!(message("1 PINHOLE 10 10 5 5 5 5 0.2\n", "").contains("unsupported coefficient (0.2)"));
        assert!(message("\n1 FOV 10 10 5 5 5 5 1\n", "").contains("cameras.txt:2: camera model FOV"));
        assert!(message("1 PINHOLE 10 10 5\n", "").contains("missing"));
        assert!(message("1 PINHOLE 10 0 5 5 5 5\n", "").contains("10 x 0 pixels"));
        assert!(message(fine, "1 1 0 0 0 0 0 x 1 a.png\n\n").contains("images.txt:1: the TZ \"x\""));
        assert!(message(fine, "1 1 0 0 0 0 0 0 9 a.png\n\n").contains("camera 9"));
        assert!(message(fine, "1 0 0 0 0 0 0 0 1 a.png\n\n").contains("quaternion"));
        let empty = tempfile::tempdir().unwrap();
        assert!(read_model(empty.path()).unwrap_err().to_string().contains("cameras.txt"));
    }
}
