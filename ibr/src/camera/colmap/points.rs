//! The points of a COLMAP model: `points3D`, as text or binary.
//!
//! ```text
//! points3D.txt  POINT3D_ID X Y Z R G B ERROR, then IMAGE_ID POINT2D_IDX of each image that shows it
//! points3D.bin  count u64; per point: id u64, x y z f64, r g b u8, error f64, count of images u64,
//!               per image: id u32, index u32
//! ```

use super::{Fault, binary, content, is_model, no_model, number};
use crate::files::{self, InputError};
use nalgebra::Vector3;
use std::path::Path;

/// A point of the scene.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ScenePoint {
    /// Where it is.
    pub(crate) position: Vector3<f64>,
    /// The images that show it, by the numbers that the model gives them.
    pub(crate) images: Vec<u64>,
}

/// What to do if the file cannot be opened.
const FILES: &str = "depth = \"points\" needs points3D.txt or points3D.bin beside the cameras of the model";

/// Reads the points of the model in `folder`: the text file if it is there, else the binary one.
///
/// # Errors
/// [`InputError`] with the line or the record.
pub(crate) fn read_points(folder: &Path) -> Result<Vec<ScenePoint>, InputError> {
    if !is_model(folder) {
        return Err(no_model(folder));
    }
    let (text, bytes) = (folder.join("points3D.txt"), folder.join("points3D.bin"));
    if !text.exists() && bytes.exists() {
        let file = files::read_bytes(&bytes, FILES)?;
        let fault = |(record, reason)| InputError::content(&bytes, format!(": record {record}"), reason);
        return binary_points(&file).map_err(fault);
    }
    let file = files::read_text(&text, FILES)?;
    let point = |(line, words): (usize, &str)| {
        parse_point(words).map_err(|reason| InputError::content(&text, format!(":{line}"), reason))
    };
    content(&file).filter(|(_, line)| !line.is_empty()).map(point).collect()
}

fn parse_point(line: &str) -> Result<ScenePoint, String> {
    let mut words = line.split_whitespace().skip(1);
    let mut coordinate = |name: &str| finite(number(words.next(), name)?);
    let position = Vector3::new(coordinate("X")?, coordinate("Y")?, coordinate("Z")?);
    // Colours and the error.
    let images = words.skip(4).step_by(2).map(|word| number(Some(word), "image id"));
    Ok(ScenePoint { position, images: images.collect::<Result<_, _>>()? })
}

fn finite(value: f64) -> Result<f64, String> {
    if value.is_finite() { Ok(value) } else { Err(format!("the coordinate {value} is not finite")) }
}

fn binary_points(bytes: &[u8]) -> Result<Vec<ScenePoint>, Fault> {
    binary::records(bytes, |rest| {
        let _: [u8; 8] = binary::take(rest)?;
        let mut coordinate = || finite(binary::float(rest)?);
        let position = Vector3::new(coordinate()?, coordinate()?, coordinate()?);
        let _: [u8; 11] = binary::take(rest)?;
        let count = u64::from_le_bytes(binary::take(rest)?);
        let image = |_| {
            let id = u32::from_le_bytes(binary::take(rest)?);
            binary::take::<4>(rest).map(|_| u64::from(id))
        };
        Ok(ScenePoint { position, images: (0..count).map(image).collect::<Result<_, String>>()? })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_formats_have_the_same_points() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        std::fs::write(at("cameras.txt"), "").unwrap();
        let text = "# points\n7 1.5 -2 3e1 9 9 9 0.4 12 0 3 5\n8 0 0 1 9 9 9 0.1\n";
        let want = vec![
            ScenePoint { position: Vector3::new(1.5, -2.0, 30.0), images: vec![12, 3] },
            ScenePoint { position: Vector3::new(0.0, 0.0, 1.0), images: Vec::new() },
        ];
        let mut bytes = 2_u64.to_le_bytes().to_vec();
        for (id, point) in [7_u64, 8].iter().zip(&want) {
            bytes.extend(id.to_le_bytes());
            point.position.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
            bytes.extend([9; 3]);
            bytes.extend(0.4_f64.to_le_bytes());
            bytes.extend((point.images.len() as u64).to_le_bytes());
            point.images.iter().for_each(|id| bytes.extend([(*id as u32).to_le_bytes(), [0; 4]].concat()));
        }
        std::fs::write(at("points3D.bin"), &bytes).unwrap();
        assert_eq!(read_points(dir.path()).unwrap(), want);
        std::fs::write(at("points3D.txt"), text).unwrap();
        assert_eq!(read_points(dir.path()).unwrap(), want);
        for (text, words) in
            [("1 2 x 3", "points3D.txt:1: the Y \"x\""), ("\n1 2 3 nan", "txt:2: the coordinate NaN")]
        {
            std::fs::write(at("points3D.txt"), text).unwrap();
            let message = read_points(dir.path()).unwrap_err().to_string();
            assert!(message.contains(words), "{message}");
        }
        std::fs::remove_file(at("points3D.txt")).unwrap();
        std::fs::write(at("points3D.bin"), &bytes[..60]).unwrap();
        assert!(read_points(dir.path()).unwrap_err().to_string().contains("record 1"));
        std::fs::remove_file(at("points3D.bin")).unwrap();
        assert!(read_points(dir.path()).unwrap_err().to_string().contains("points3D.txt or points3D.bin"));
    }
}
