//! Depth from a mesh: what a camera sees of its triangles, by a z-buffer.

mod ply;

use super::{DepthError, DepthMap, Measure};
use crate::camera::Camera;
use crate::files::{self, CHECK_THE_PATH, InputError};
use nalgebra::Vector3;
use std::path::Path;

/// Triangles are cut off nearer to the camera than this share of the depth of their farthest corner.
const NEAREST: f64 = 1e-3;

/// Triangles with their corners; without triangles a cloud of points.
#[derive(Debug, Clone, Default)]
pub(crate) struct Mesh {
    corners: Vec<Vector3<f64>>,
    triangles: Vec<[usize; 3]>,
}

/// A corner in the image: column, row, and the inverse of its depth, which is affine there.
type Shown = Vector3<f64>;

impl Mesh {
    /// Reads a PLY file.
    pub(crate) fn read(path: &Path) -> Result<Self, InputError> {
        ply::decode(&files::read_bytes(path, CHECK_THE_PATH)?)
            .map_err(|reason| InputError::file(path, reason))
    }

    /// Adds a polygon with these corners as triangles.
    fn add_polygon(&mut self, corners: &[f64]) {
        let number = |k: usize| corners[k] as usize;
        self.triangles.extend((2..corners.len()).map(|k| [number(0), number(k - 1), number(k)]));
    }

    fn checked(self) -> Result<Self, String> {
        let count = self.corners.len();
        if let Some(corner) = self.triangles.iter().flatten().find(|corner| **corner >= count) {
            return Err(format!("a face has corner {corner}, but there are {count}, counted from 0"));
        }
        match self.corners.iter().any(|corner| corner.iter().all(|v| v.is_finite())) {
            true => Ok(self),
            false => Err("there is no vertex with x, y and z".into()),
        }
    }

    /// The depths that a camera sees, unknown where it sees nothing.
    pub(crate) fn depths(&self, camera: &Camera, size: (usize, usize)) -> Result<DepthMap, DepthError> {
        let mut buffer = Buffer { size, inverse: vec![0.0; size.0 * size.1] };
        let straight = camera.without_lens();
        for triangle in &self.triangles {
            buffer.add(&straight, &triangle.map(|k| self.corners[k]));
        }
        let points = if self.triangles.is_empty() { self.corners.as_slice() } else { &[] };
        points.iter().for_each(|point| buffer.add_point(&straight, point));
        let depth = |p: usize| {
            let (x, y) = ((p % size.0) as f64, (p / size.0) as f64);
            // Where a lens bends, the ray of the pixel falls beside it in the straight camera.
            let (x, y, _) = straight.project(&camera.unproject(x, y, 1.0));
            buffer.at(x, y).map_or(f32::NAN, |inverse| (1.0 / inverse) as f32)
        };
        DepthMap::new(size, (0..size.0 * size.1).map(depth).collect(), 1.0, Measure::Depth)
    }
}

struct Buffer {
    size: (usize, usize),
    /// Inverse depths, 0 where nothing is.
    inverse: Vec<f64>,
}

impl Buffer {
    fn index(&self, x: f64, y: f64) -> Option<usize> {
        let is_inside = x > -0.5 && y > -0.5 && x < self.size.0 as f64 - 0.5 && y < self.size.1 as f64 - 0.5;
        is_inside.then(|| (y + 0.5) as usize * self.size.0 + (x + 0.5) as usize)
    }

    fn at(&self, x: f64, y: f64) -> Option<f64> {
        self.index(x, y).map(|p| self.inverse[p]).filter(|inverse| *inverse > 0.0)
    }

    fn add_point(&mut self, camera: &Camera, point: &Vector3<f64>) {
        let (x, y, depth) = camera.project(point);
        if let Some(p) = self.index(x, y).filter(|_| depth > 0.0) {
            self.inverse[p] = self.inverse[p].max(1.0 / depth);
        }
    }

    fn add(&mut self, camera: &Camera, corners: &[Vector3<f64>; 3]) {
        let before = before(camera, corners);
        let shown = |point: &Vector3<f64>| {
            let (x, y, depth) = camera.project(point);
            Shown::new(x, y, 1.0 / depth)
        };
        let shown: Vec<Shown> = before.iter().map(shown).collect();
        (2..shown.len()).for_each(|k| self.fill(&[shown[0], shown[k - 1], shown[k]]));
    }

    fn fill(&mut self, corners: &[Shown; 3]) {
        let side = |a: &Shown, b: &Shown, x: f64, y: f64| (b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x);
        let [a, b, c] = corners;
        let area = side(a, b, c.x, c.y);
        if !(area.abs() > 0.0 && area.is_finite()) {
            return;
        }
        let range = |values: [f64; 3], length: usize| {
            let least = values.into_iter().fold(f64::INFINITY, f64::min).ceil().max(0.0);
            let most = values.into_iter().fold(f64::NEG_INFINITY, f64::max).floor() + 1.0;
            least as usize..(most.max(0.0) as usize).min(length)
        };
        for y in range([a.y, b.y, c.y], self.size.1) {
            for x in range([a.x, b.x, c.x], self.size.0) {
                let (column, row) = (x as f64, y as f64);
                let shares = [(b, c), (c, a), (a, b)].map(|(p, q)| side(p, q, column, row) / area);
                if shares.iter().all(|share| *share >= 0.0) {
                    let inverse = shares[0] * a.z + shares[1] * b.z + shares[2] * c.z;
                    let known = &mut self.inverse[y * self.size.0 + x];
                    *known = known.max(inverse);
                }
            }
        }
    }
}

/// The part of a triangle that lies before a camera: a polygon.
fn before(camera: &Camera, corners: &[Vector3<f64>; 3]) -> Vec<Vector3<f64>> {
    let depth = |point: &Vector3<f64>| camera.project(point).2;
    let nearest = NEAREST * corners.iter().map(depth).fold(0.0, f64::max);
    let mut polygon = Vec::new();
    for (from, to) in [(0, 1), (1, 2), (2, 0)].map(|(i, k)| (&corners[i], &corners[k])) {
        let (here, there) = (depth(from) - nearest, depth(to) - nearest);
        if here > 0.0 {
            polygon.push(*from);
        }
        if here * there < 0.0 {
            polygon.push(from + (to - from) * (here / (here - there)));
        }
    }
    polygon
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3x4;

    const SIZE: (usize, usize) = (40, 30);

    fn camera() -> Camera {
        let matrix = Matrix3x4::new(30.0, 0.0, 19.5, 0.0, 0.0, 30.0, 14.5, 0.0, 0.0, 0.0, 1.0, 0.0);
        Camera::metric(matrix, false).unwrap()
    }

    /// A floor that goes on behind the camera: its depth follows from the row, and above the horizon is
    /// nothing.
    #[test]
    fn a_floor_is_cut_off_at_the_camera() {
        let corners = [[-900.0, 2.0, -50.0], [900.0, 2.0, -50.0], [0.0, 2.0, 900.0]].map(Vector3::from);
        let floor = Mesh { corners: corners.into(), triangles: vec![[0, 1, 2]] };
        let map = floor.depths(&camera(), SIZE).unwrap();
        for p in 0..SIZE.0 * SIZE.1 {
            let want = 60.0 / ((p / SIZE.0) as f64 - 14.5);
            match want > 0.0 {
                true => assert!((f64::from(map.data()[p]) / want - 1.0).abs() < 1e-5, "{p}"),
                false => assert!(map.data()[p].is_nan(), "{p}"),
            }
        }
    }

    /// A near square before a far one, and the same as points.
    #[test]
    fn the_nearest_surface_is_seen() {
        let square = |half: f64, depth: f64| {
            [[-half, -half], [half, -half], [half, half], [-half, half]]
                .map(|[x, y]| Vector3::new(x, y, depth))
        };
        let mut mesh = Mesh { corners: [square(9.0, 8.0), square(0.5, 4.0)].concat(), triangles: vec![] };
        mesh.add_polygon(&[0.0, 1.0, 2.0, 3.0]);
        mesh.add_polygon(&[4.0, 5.0, 6.0, 7.0]);
        let map = mesh.depths(&camera(), SIZE).unwrap();
        assert_eq!((map.unknown(), map.row(15)[20], map.row(2)[2]), (0, 4.0, 8.0));
        let near = map.data().iter().filter(|depth| **depth == 4.0).count();
        assert_eq!(near, 8 * 8);
        let cloud = Mesh { corners: square(0.5, 4.0).into(), triangles: vec![] };
        assert_eq!(cloud.depths(&camera(), SIZE).unwrap().unknown(), SIZE.0 * SIZE.1 - 4);
    }

    #[test]
    fn text_and_both_orders_of_bytes_are_read() {
        let header = |format: &str| {
            format!(
                "ply\nformat {format} 1.0\ncomment c\nelement vertex 3\nproperty float x\nproperty double y\nproperty short z\nelement face 1\nproperty list uchar int vertex_index\nend_header\n"
            )
        };
        let text = header("ascii") + "0.5 1 -2\n1 2 3\n4 5 6\n3 0 1 2\n";
        let want = ply::decode(text.as_bytes()).unwrap();
        assert_eq!((want.corners[0], &want.triangles[..]), (Vector3::new(0.5, 1.0, -2.0), &[[0, 1, 2]][..]));
        for (format, is_little) in [("binary_little_endian", true), ("binary_big_endian", false)] {
            let mut bytes = header(format).into_bytes();
            let mut put = |number: &[u8]| match is_little {
                true => bytes.extend(number),
                false => bytes.extend(number.iter().rev()),
            };
            for corner in &want.corners {
                put(&(corner.x as f32).to_le_bytes());
                put(&corner.y.to_le_bytes());
                put(&(corner.z as i16).to_le_bytes());
            }
            put(&[3]);
            (0..3_i32).for_each(|k| put(&k.to_le_bytes()));
            let found = ply::decode(&bytes).unwrap();
            assert_eq!((found.corners, found.triangles), (want.corners.clone(), want.triangles.clone()));
            assert!(ply::decode(&bytes[..bytes.len() - 1]).unwrap_err().contains("face 0 of 1"));
        }
        assert!(ply::decode(b"obj").unwrap_err().contains("no PLY"));
        let empty = "ply\nformat ascii 1.0\nelement vertex 99999999999\nend_header\n";
        assert!(ply::decode(empty.as_bytes()).unwrap_err().contains("has no property"));
        let beyond = text.replace("3 0 1 2", "3 0 1 9");
        assert!(ply::decode(beyond.as_bytes()).unwrap_err().contains("corner 9"));
    }
}
