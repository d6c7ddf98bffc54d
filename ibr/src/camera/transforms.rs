//! Camera files of neural rendering (`transforms.json` of NeRF, instant-ngp and nerfstudio).
//!
//! `transform_matrix` maps camera coordinates to the world: x to the right, y up, z backwards (OpenGL). The
//! rows y and z of its inverse therefore change their sign. Pixel centres are half-integers there, so the
//! principal point is shifted by half a pixel on reading.

use super::list::{CameraList, Frame, Inner, portable};
use crate::files::{self, CHECK_THE_PATH, InputError};
use hybank_core::messages::{Quoted, of_json};
use nalgebra::{Matrix3, Matrix3x4, Matrix4};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Most columns or rows of an image, and the largest focal length in pixels.
const LARGEST: f64 = 1e6;

#[derive(Deserialize)]
struct FileSpec {
    #[serde(flatten)]
    inner: Inner,
    camera_model: Option<String>,
    frames: Vec<FrameSpec>,
}

#[derive(Deserialize)]
struct FrameSpec {
    file_path: String,
    depth_file_path: Option<String>,
    mask_path: Option<String>,
    camera_model: Option<String>,
    transform_matrix: Vec<[f64; 4]>,
    #[serde(flatten)]
    inner: Inner,
}

/// Reads a file.
///
/// # Errors
/// [`InputError`], with the line or the frame.
pub fn read_transforms(path: &Path) -> Result<CameraList, InputError> {
    parse_transforms(&files::read_text(path, CHECK_THE_PATH)?, path)
}

/// The same from the text of the file; `path` appears in messages.
///
/// ```
/// use hybank_ibr::camera::transforms::parse_transforms;
/// let text = r#"{"w": 640, "h": 480, "fl_x": 500.0, "frames": [{"file_path": "images/0001.png",
///     "transform_matrix": [[1, 0, 0, 2], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}]}"#;
/// let list = parse_transforms(text, "transforms.json".as_ref())?;
/// let (frame, _) = list.find("0001")?;
/// let listed = list.camera(frame, (640, 480))?;
/// assert_eq!((listed.size, listed.camera.centre().x), ((640, 480), 2.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`InputError`].
pub fn parse_transforms(text: &str, path: &Path) -> Result<CameraList, InputError> {
    let json = |reason: String| InputError::file(path, reason);
    let file: FileSpec = serde_json::from_str(text).map_err(|e| json(of_json(&e.to_string())))?;
    check_model(file.camera_model.as_deref()).map_err(json)?;
    if file.frames.is_empty() {
        return Err(json("`frames` is empty: there is no image".into()));
    }
    let one = |(id, spec): (u64, FrameSpec)| {
        let at = || format!(": frame {id} (\"{}\")", Quoted(&spec.file_path));
        let fault = |reason: String| InputError::content(path, at(), reason);
        check_model(spec.camera_model.as_deref()).map_err(fault)?;
        let inner = spec.inner.or(&file.inner).checked().map_err(fault)?;
        let pose = world_to_camera(&spec.transform_matrix).map_err(fault)?;
        let [depth, mask] =
            [spec.depth_file_path, spec.mask_path].map(|path| path.map(|path| portable(&path)));
        Ok(Frame { image: image_path(&spec.file_path), depth, mask, id, pose, inner })
    };
    let frames = (1..).zip(file.frames).map(one).collect::<Result<_, InputError>>()?;
    Ok(CameraList::new(path.into(), frames))
}

/// Camera models without more distortion than is read.
const STRAIGHT: [&str; 6] = ["OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "PERSPECTIVE"];

fn check_model(model: Option<&str>) -> Result<(), String> {
    match model.filter(|model| !STRAIGHT.contains(model)) {
        Some(model) => Err(format!(
            "camera_model \"{}\" is not supported (supported are {}); undistort the images first",
            Quoted(model),
            STRAIGHT.join(", ")
        )),
        None => Ok(()),
    }
}

/// The path of an image; the synthetic scenes of NeRF leave the extension out.
fn image_path(name: &str) -> PathBuf {
    let path = portable(name);
    if path.extension().is_some() { path } else { PathBuf::from(format!("{}.png", path.display())) }
}

pub(super) fn world_to_camera(rows: &[[f64; 4]]) -> Result<Matrix3x4<f64>, String> {
    if !(3..=4).contains(&rows.len()) {
        return Err(format!("transform_matrix has {} rows: it needs 3 or 4", rows.len()));
    }
    let below = [0.0, 0.0, 0.0, 1.0];
    if rows.get(3).is_some_and(|last| *last != below) {
        return Err("the last row of transform_matrix is not 0, 0, 0, 1".into());
    }
    let to_world = Matrix4::from_fn(|i, j| rows.get(i).map_or(below[j], |row| row[j]));
    if to_world.iter().any(|v| !v.is_finite()) {
        return Err("transform_matrix has numbers that are not finite".into());
    }
    let turn = to_world.fixed_view::<3, 3>(0, 0).into_owned();
    let scale = turn.norm() / 3.0_f64.sqrt();
    let skew = (turn.transpose() * turn - Matrix3::identity() * scale * scale).norm();
    if !(scale > 0.0 && skew <= 1e-2 * scale * scale && turn.determinant() > 0.0) {
        return Err("the left part of transform_matrix is not a rotation".into());
    }
    let inverse = to_world.try_inverse().ok_or("transform_matrix has no inverse")?;
    // Right, down and forwards from right, up and backwards; a scale of the world does not turn rays.
    let signs = [scale, -scale, -scale];
    Ok(Matrix3x4::from_fn(|i, j| signs[i] * inverse[(i, j)]))
}

impl Inner {
    /// The parameters of the frame, and those of the file where it has none.
    fn or(self, file: &Self) -> Self {
        macro_rules! first_of {
            ($($key:ident),*) => { Self { $($key: self.$key.or(file.$key)),* } };
        }
        first_of!(
            camera_angle_x,
            camera_angle_y,
            fl_x,
            fl_y,
            cx,
            cy,
            w,
            h,
            k1,
            k2,
            k3,
            k4,
            p1,
            p2,
            is_fisheye
        )
    }

    pub(super) fn checked(self) -> Result<Self, String> {
        let bends = [("k3", self.k3), ("k4", self.k4)];
        if self.is_fisheye == Some(true) || bends.iter().any(|(_, k)| k.is_some_and(|k| k != 0.0)) {
            return Err("the lens has more than k1, k2, p1 and p2; undistort the images first".into());
        }
        if self.fl_x.is_none() && self.camera_angle_x.is_none() {
            return Err("there is neither `fl_x` nor `camera_angle_x`, which give the focal length".into());
        }
        let whole = |v: f64| (1.0..=LARGEST).contains(&v) && v.fract() == 0.0;
        let positive = |v: f64| v > 0.0 && v <= LARGEST;
        let angle = |v: f64| v > 1e-6 && v < std::f64::consts::PI;
        let check = |name: &str, given: Option<f64>, holds: fn(f64) -> bool, rule: &str| match given
            .filter(|value| !holds(*value))
        {
            Some(value) => Err(format!("{name} = {value}: it must be {rule}")),
            None => Ok(()),
        };
        check("w", self.w, whole, "a whole number of pixels")?;
        check("h", self.h, whole, "a whole number of pixels")?;
        check("fl_x", self.fl_x, positive, "a positive number of pixels")?;
        check("fl_y", self.fl_y, positive, "a positive number of pixels")?;
        check("camera_angle_x", self.camera_angle_x, angle, "between 0 and pi (radians)")?;
        check("camera_angle_y", self.camera_angle_y, angle, "between 0 and pi (radians)")?;
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    /// A model in a frame is refused as one of the whole file, and backslashes part folders.
    #[test]
    fn frames_have_models_and_paths_of_windows() {
        let text = |model: &str| {
            format!(
                r#"{{"w": 4, "h": 4, "fl_x": 5, "frames": [{{"file_path": "a\\b.png", "depth_file_path": "d\\b.png",
                "camera_model": "{model}", "transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]}}]}}"#
            )
        };
        let list = parse_transforms(&text("OPENCV"), Path::new("t.json")).unwrap();
        let frame = &list.frames[0];
        assert_eq!((&frame.image, frame.depth.as_deref()), (&"a/b.png".into(), Some(Path::new("d/b.png"))));
        let refused = parse_transforms(&text("OPENCV_FISHEYE"), Path::new("t.json")).unwrap_err().to_string();
        assert!(refused.contains("frame 1") && refused.contains("OPENCV_FISHEYE"), "{refused}");
    }

    const FILE: &str = r#"{
        "camera_angle_x": 1.5707963267948966, "w": 200, "h": 100, "k1": 0.0,
        "frames": [
            {"file_path": "./train/r_0", "transform_matrix":
                [[1, 0, 0, 2], [0, 1, 0, 3], [0, 0, 1, 4], [0, 0, 0, 1]]},
            {"file_path": "b.jpg", "depth_file_path": "b.png", "fl_x": 50, "fl_y": 60, "cx": 90.5, "cy": 40.5,
             "transform_matrix": [[0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]]}
        ]
    }"#;

    fn read(text: &str) -> Result<CameraList, String> {
        parse_transforms(text, Path::new("t.json")).map_err(|e| e.to_string())
    }

    /// A camera at (2, 3, 4) that looks along -z: right is +x, up is +y. The focal length is half the width.
    #[test]
    fn open_gl_axes_become_pixels() {
        let file = read(FILE).unwrap();
        let frame = file.find("train/r_0.png").unwrap().0;
        let found = file.camera(frame, (7, 7)).unwrap();
        assert_eq!(found.size, (200, 100));
        let (x, y, depth) = found.camera.project(&Vector3::new(3.0, 3.5, 2.0));
        assert!((depth - 2.0).abs() < 1e-12 && (x - (99.5 + 50.0)).abs() < 1e-9, "{x} {depth}");
        assert!((y - (49.5 - 25.0)).abs() < 1e-9, "{y}");
        // The second looks along -x of the world: its z axis, which points backwards, is +x.
        let second = file.find("images/b.png").unwrap().0;
        assert_eq!(second.depth.as_deref(), Some(Path::new("b.png")));
        let camera = file.camera(second, (7, 7)).unwrap().camera;
        let (x, y, depth) = camera.project(&Vector3::new(-5.0, 1.0, -1.0));
        assert!((depth - 5.0).abs() < 1e-12, "{depth}");
        assert!((x - (90.0 + 10.0)).abs() < 1e-9 && (y - (40.0 - 12.0)).abs() < 1e-9, "{x} {y}");
    }

    #[test]
    fn a_size_that_the_file_lacks_is_that_of_the_image() {
        let file = read(&FILE.replace("\"w\": 200, \"h\": 100,", "")).unwrap();
        let found = file.camera(&file.frames[0], (64, 48)).unwrap();
        let (x, y, _) = found.camera.project(&Vector3::new(2.0, 3.0, 0.0));
        assert_eq!((found.size, x, y), ((64, 48), 31.5, 23.5));
    }

    #[test]
    fn faults_are_named_with_their_frames() {
        for (from, to, words) in [
            ("\"frames\"", "\"frame\"", "the key frames is missing"),
            ("[0, 0, 1, 4]", "[0, 0, 1, 1e999]", "line"),
            ("[0, 0, 1, 4]", "[0, 0, 9, 4]", "frame 1 (\"./train/r_0\"): the left part"),
            ("[0, 0, 0, 1]]},", "[0, 0, 1, 1]]},", "last row"),
            (", [0, 0, 0, 1]]},", ", [0, 0, 0, 1], [0, 0, 0, 1]]},", "5 rows"),
            ("\"k1\": 0.0", "\"k3\": 0.1", "undistort"),
            ("\"k1\": 0.0", "\"camera_model\": \"OPENCV_FISHEYE\"", "OPENCV_FISHEYE"),
            ("\"w\": 200", "\"w\": 0.5", "w = 0.5"),
            ("\"camera_angle_x\": 1.57", "\"camera_angle_x\": 9.57", "camera_angle_x = 9.57"),
            ("\"camera_angle_x\"", "\"angle\"", "neither `fl_x`"),
            ("\"fl_x\": 50", "\"fl_x\": -50", "fl_x = -50"),
        ] {
            let message = read(&FILE.replacen(from, to, 1)).unwrap_err();
            assert!(message.starts_with("t.json") && message.contains(words), "{to}: {message}");
        }
        assert!(read(r#"{"fl_x": 1, "frames": []}"#).unwrap_err().contains("empty"));
    }
}
