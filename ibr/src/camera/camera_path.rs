//! Camera paths of nerfstudio's viewer (`camera_path.json`): virtual cameras without photographs.
//!
//! nerfstudio moves and scales the world before it trains. Where `dataparser_transforms.json`, which says
//! how, lies beside the path, the cameras are taken back to the world of the photographs.

use super::list::{CameraList, Frame, Inner};
use super::transforms::world_to_camera;
use crate::files::{self, CHECK_THE_PATH, InputError};
use hybank_core::messages::{Quoted, of_json};
use nalgebra::Matrix4;
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::path::Path;

/// The file that says how nerfstudio moved the world.
const MOVED: &str = "dataparser_transforms.json";

#[derive(Deserialize)]
struct PathSpec {
    camera_type: Option<String>,
    render_width: f64,
    render_height: f64,
    camera_path: Vec<PoseSpec>,
}

#[derive(Deserialize)]
struct PoseSpec {
    /// Rows of a 4 x 4 matrix, one after the other.
    camera_to_world: Vec<f64>,
    /// Vertical angle of view in degrees.
    fov: f64,
}

#[derive(Deserialize)]
struct MovedSpec {
    transform: Vec<[f64; 4]>,
    scale: f64,
}

/// Whether a text is a camera path.
pub(super) fn is_path(text: &str) -> bool {
    #[derive(Deserialize)]
    struct Probe {
        #[serde(rename = "camera_path")]
        _path: IgnoredAny,
    }
    serde_json::from_str::<Probe>(text).is_ok()
}

/// The cameras of a path, named by their numbers from 1.
pub(super) fn parse_path(text: &str, path: &Path) -> Result<CameraList, InputError> {
    let wrong = |reason: String| InputError::file(path, reason);
    let spec: PathSpec = serde_json::from_str(text).map_err(|e| wrong(of_json(&e.to_string())))?;
    if let Some(kind) = spec.camera_type.filter(|kind| kind != "perspective") {
        return Err(wrong(format!("camera_type \"{}\" is not supported; choose perspective", Quoted(kind))));
    }
    if spec.camera_path.is_empty() {
        return Err(wrong("`camera_path` is empty: there is no camera".into()));
    }
    let to_world = to_world(path)?;
    let (w, h) = (spec.render_width, spec.render_height);
    let frame = |(id, pose): (u64, &PoseSpec)| {
        let fault = |reason: String| InputError::content(path, format!(": camera {id}"), reason);
        let rows: Vec<[f64; 4]> = pose.camera_to_world.as_chunks::<4>().0.to_vec();
        let (Ok(rows), true) = (<[[f64; 4]; 4]>::try_from(rows), pose.camera_to_world.len() == 16) else {
            let count = pose.camera_to_world.len();
            return Err(fault(format!("camera_to_world has {count} numbers: a 4 x 4 matrix has 16")));
        };
        if !(pose.fov > 0.0 && pose.fov < 180.0) {
            return Err(fault(format!("fov = {}: it must be between 0 and 180 degrees", pose.fov)));
        }
        let there = to_world * Matrix4::from_fn(|i, j| rows[i][j]);
        let rows: Vec<[f64; 4]> = (0..4).map(|i| std::array::from_fn(|j| there[(i, j)])).collect();
        let focal = Some(0.5 * h / (0.5 * pose.fov.to_radians()).tan());
        let inner = Inner { fl_x: focal, fl_y: focal, w: Some(w), h: Some(h), ..Inner::default() };
        let inner = inner.checked().map_err(fault)?;
        let pose = world_to_camera(&rows).map_err(fault)?;
        Ok(Frame { image: format!("{id:04}").into(), depth: None, mask: None, id, pose, inner })
    };
    let frames = (1..).zip(&spec.camera_path).map(frame).collect::<Result<_, InputError>>()?;
    Ok(CameraList::new(path.into(), frames))
}

/// From the world of a path to that of the photographs.
fn to_world(path: &Path) -> Result<Matrix4<f64>, InputError> {
    let file = path.with_file_name(MOVED);
    if !file.is_file() {
        return Ok(Matrix4::identity());
    }
    let text = files::read_text(&file, CHECK_THE_PATH)?;
    let wrong = |reason: String| InputError::file(&file, reason);
    let MovedSpec { transform, scale } =
        serde_json::from_str(&text).map_err(|e| wrong(of_json(&e.to_string())))?;
    let below = [0.0, 0.0, 0.0, 1.0];
    let moved = Matrix4::from_fn(|i, j| transform.get(i).map_or(below[j], |row| row[j]));
    let moved = Matrix4::new_scaling(scale) * moved;
    moved.try_inverse().ok_or_else(|| wrong("`transform` times `scale` has no inverse".into()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn path(pose: &str) -> String {
        format!(
            r#"{{"render_width": 200, "render_height": 100, "camera_path": [{{"camera_to_world": {pose}, "fov": 90}}]}}"#
        )
    }

    /// A camera at (2, 3, 4) that looks along -z, in a world that was halved and moved by 1 before.
    #[test]
    fn cameras_are_those_of_the_photographs() {
        let text = path("[1, 0, 0, 1.5, 0, 1, 0, 2, 0, 0, 1, 2.5, 0, 0, 0, 1]");
        assert!(is_path(&text) && !is_path("{}"));
        let dir = tempfile::tempdir().unwrap();
        let moved = r#"{"transform": [[1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 1]], "scale": 0.5}"#;
        std::fs::write(dir.path().join(MOVED), moved).unwrap();
        let list = parse_path(&text, &dir.path().join("camera_path.json")).unwrap();
        let found = list.camera(list.find("0001").unwrap().0, (1, 1)).unwrap();
        assert_eq!(found.size, (200, 100));
        assert!((found.camera.centre() - Vector3::new(2.0, 3.0, 4.0)).norm() < 1e-12);
        // The focal length is half the height.
        let (x, y, depth) = found.camera.project(&Vector3::new(3.0, 3.5, 2.0));
        assert!((x - 99.5 - 25.0).abs() < 1e-9 && (y - 49.5 + 12.5).abs() < 1e-9, "{x} {y}");
        assert!((depth - 2.0).abs() < 1e-12);
    }

    #[test]
    fn faults_are_named_with_their_cameras() {
        let read = |text: &str| parse_path(text, Path::new("p.json")).unwrap_err().to_string();
        assert!(read(&path("[1, 2, 3]")).contains("camera 1: camera_to_world has 3 numbers"));
        let turned = path("[9, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]");
        assert!(read(&turned).contains("not a rotation"));
        let text = path("[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]");
        assert!(read(&text.replace("90", "190")).contains("fov = 190"));
        assert!(read(&text.replace("200", "0.5")).contains("w = 0.5"));
    }
}
