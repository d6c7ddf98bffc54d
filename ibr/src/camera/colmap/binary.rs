//! COLMAP binary models: `cameras.bin` and `images.bin`, little-endian.
//!
//! ```text
//! cameras.bin  count u64; per camera: id u32, model i32, width u64, height u64, parameters f64 ..
//! images.bin   count u64; per image: id u32, qw qx qy qz tx ty tz f64, camera id u32, name up to a 0 byte,
//!              count of points u64, per point: x f64, y f64, point id i64
//! ```

use super::{Fault, Pose, inner, pose};
use crate::camera::list::Inner;
use std::collections::BTreeMap;

/// Names and numbers of parameters of the models, by their numbers.
const MODELS: [(&str, usize); 11] = [
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12),
    ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12),
];

/// Bytes of one point of an image.
const POINT: u64 = 24;

/// The cameras by their ids.
pub(super) fn cameras(bytes: &[u8]) -> Result<BTreeMap<u64, Inner>, Fault> {
    records(bytes, |rest| {
        let id = u64::from(u32::from_le_bytes(take(rest)?));
        let number = i32::from_le_bytes(take(rest)?);
        let size = [side(rest, "width")?, side(rest, "height")?];
        let known = usize::try_from(number).ok().and_then(|n| MODELS.get(n));
        let (name, count) = known.ok_or_else(|| format!("camera model {number} is not known"))?;
        let parameters = (0..*count).map(|_| float(rest)).collect::<Result<Vec<f64>, String>>()?;
        Ok((id, inner(name, size.into(), &parameters)?))
    })
    .map(|all| all.into_iter().collect())
}

/// The images with their numbers from 1.
pub(super) fn images(bytes: &[u8]) -> Result<Vec<Pose>, Fault> {
    let found = records(bytes, |rest| {
        let id = u64::from(u32::from_le_bytes(take(rest)?));
        let mut seven = [0.0; 7];
        for value in &mut seven {
            *value = float(rest)?;
        }
        let camera = u64::from(u32::from_le_bytes(take(rest)?));
        let end = rest.iter().position(|b| *b == 0).ok_or_else(cut_short)?;
        let name = String::from_utf8_lossy(&rest[..end]).into_owned();
        *rest = &rest[end + 1..];
        let points = u64::from_le_bytes(take(rest)?).saturating_mul(POINT);
        let skip = usize::try_from(points).ok().filter(|n| *n <= rest.len()).ok_or_else(cut_short)?;
        *rest = &rest[skip..];
        Ok(Pose { at: 0, id, camera, pose: pose(seven)?, name })
    })?;
    Ok((1..).zip(found).map(|(at, found)| Pose { at, ..found }).collect())
}

/// As many records as the file states.
pub(super) fn records<T>(
    mut rest: &[u8],
    mut one: impl FnMut(&mut &[u8]) -> Result<T, String>,
) -> Result<Vec<T>, Fault> {
    let count = u64::from_le_bytes(take(&mut rest).map_err(|reason| (1, reason))?);
    // The count is not trusted with memory: a record has bytes, and a file that lacks them ends the loop.
    let mut found = Vec::new();
    for k in 0..count {
        found.push(one(&mut rest).map_err(|reason| (k as usize + 1, reason))?);
    }
    Ok(found)
}

fn cut_short() -> String {
    "the file ends within this record".into()
}

pub(super) fn take<const N: usize>(rest: &mut &[u8]) -> Result<[u8; N], String> {
    let (head, tail) = rest.split_first_chunk::<N>().ok_or_else(cut_short)?;
    *rest = tail;
    Ok(*head)
}

pub(super) fn float(rest: &mut &[u8]) -> Result<f64, String> {
    Ok(f64::from_le_bytes(take(rest)?))
}

fn side(rest: &mut &[u8], name: &str) -> Result<usize, String> {
    let value = u64::from_le_bytes(take(rest)?);
    usize::try_from(value).map_err(|_| format!("the {name} is {value}"))
}

#[cfg(test)]
mod tests {
    use super::super::{parse_model, read_model};

    /// The same model in both formats.
    fn model() -> (Vec<u8>, Vec<u8>, &'static str, &'static str) {
        let mut cameras = 2_u64.to_le_bytes().to_vec();
        let mut camera = |id: u32, model: i32, size: [u64; 2], parameters: &[f64]| {
            cameras.extend(id.to_le_bytes());
            cameras.extend(model.to_le_bytes());
            size.iter().for_each(|v| cameras.extend(v.to_le_bytes()));
            parameters.iter().for_each(|v| cameras.extend(v.to_le_bytes()));
        };
        camera(7, 1, [640, 480], &[500.0, 510.0, 320.5, 240.5]);
        camera(9, 2, [100, 50], &[80.0, 50.0, 25.0, 0.05]);
        let mut images = 2_u64.to_le_bytes().to_vec();
        let mut image = |id: u32, seven: [f64; 7], camera: u32, name: &str, points: u64| {
            images.extend(id.to_le_bytes());
            seven.iter().for_each(|v| images.extend(v.to_le_bytes()));
            images.extend(camera.to_le_bytes());
            images.extend(name.as_bytes());
            images.push(0);
            images.extend(points.to_le_bytes());
            images.extend(vec![5; 24 * points as usize]);
        };
        image(1, [1.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0], 7, "a b.png", 2);
        image(2, [0.8, 0.0, 0.6, 0.0, 0.0, 0.0, 0.5], 9, "sub/c.jpg", 0);
        let text = (
            "7 PINHOLE 640 480 500 510 320.5 240.5\n9 SIMPLE_RADIAL 100 50 80 50 25 0.05\n",
            "1 1 0 0 0 1 2 3 7 a b.png\n\n2 0.8 0 0.6 0 0 0 0.5 9 sub/c.jpg\n\n",
        );
        (cameras, images, text.0, text.1)
    }

    #[test]
    fn both_formats_give_the_same_model() {
        let (cameras, images, cameras_text, images_text) = model();
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("cameras.bin"), cameras).unwrap();
        std::fs::write(dir.path().join("images.bin"), images).unwrap();
        let want = parse_model(cameras_text, images_text, dir.path()).unwrap();
        assert_eq!(read_model(dir.path()).unwrap().frames, want.frames);
        assert_eq!(want.frames.len(), 2);
    }

    #[test]
    fn damaged_files_are_named() {
        let (cameras, images, ..) = model();
        let message = |cameras: &[u8], images: &[u8]| {
            let dir = tempfile::tempdir().unwrap();
            std::fs::write(dir.path().join("cameras.bin"), cameras).unwrap();
            std::fs::write(dir.path().join("images.bin"), images).unwrap();
            read_model(dir.path()).unwrap_err().to_string()
        };
        let cut = message(&cameras[..cameras.len() - 3], &images);
        assert!(
            cut.contains("cameras.bin") && cut.contains("record 2") && cut.contains("ends within"),
            "{cut}"
        );
        let cut = message(&cameras, &images[..100]);
        assert!(cut.contains("images.bin") && cut.contains("ends within"), "{cut}");
        let mut unknown = cameras.clone();
        unknown[12] = 99;
        assert!(message(&unknown, &images).contains("camera model 99"));
        let mut endless = cameras.clone();
        endless[..8].copy_from_slice(&u64::MAX.to_le_bytes());
        assert!(message(&endless, &images).contains("record 3"));
        for length in 0..images.len() {
            assert!(!message(&cameras, &images[..length]).is_empty());
        }
    }
}
