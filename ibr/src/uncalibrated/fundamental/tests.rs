use super::*;
use crate::uncalibrated::Point;
use nalgebra::{Matrix3x4, Rotation3, Vector3};

/// A metric pair, deterministic points in front of it, and their images.
pub(crate) struct Synthetic {
    pub(crate) cameras: [Matrix3x4<f64>; 3],
    pub(crate) points: Vec<Vector3<f64>>,
}

impl Synthetic {
    pub(crate) fn new(count: usize, flat: bool) -> Self {
        let k = Matrix3::new(800.0, 0.0, 320.0, 0.0, 800.0, 240.0, 0.0, 0.0, 1.0);
        let camera = |turn: f64, c: [f64; 3]| {
            let r = Rotation3::from_euler_angles(0.02, turn, -0.01);
            let mut rt = Matrix3x4::zeros();
            rt.fixed_columns_mut::<3>(0).copy_from(r.matrix());
            rt.set_column(3, &(-(r * Vector3::from(c))));
            k * rt
        };
        let cameras = [
            camera(0.05, [-0.6, 0.0, 0.0]),
            camera(-0.06, [0.7, 0.1, 0.1]),
            camera(0.0, [0.05, -0.05, 0.05]),
        ];
        let point = |i: usize| {
            let part = |k: usize| ((i * k + 3) % 997) as f64 / 997.0 - 0.5;
            let (x, y) = (3.0 * part(389), 2.0 * part(631));
            let depth = if flat { 6.0 + 0.3 * x - 0.2 * y } else { 6.0 + 2.5 * part(277) };
            Vector3::new(x, y, depth)
        };
        Self { cameras, points: (0..count).map(point).collect() }
    }

    pub(crate) fn image(&self, camera: usize, point: usize) -> Point {
        let p = self.cameras[camera] * self.points[point].push(1.0);
        p.xy() / p.z
    }

    pub(crate) fn matches(&self) -> Vec<Match> {
        let both = |j| Match { first: self.image(0, j), second: self.image(1, j) };
        (0..self.points.len()).map(both).collect()
    }
}

#[test]
fn exact_matches_give_the_exact_matrix() {
    let matches = Synthetic::new(60, false).matches();
    let f = eight_point(&matches).unwrap();
    assert!(matches.iter().all(|m| sampson(&f, m).sqrt() < 1e-7));
    assert!(f.determinant().abs() < 1e-12);
}

#[test]
fn outliers_are_found_and_the_seed_decides() {
    let mut matches = Synthetic::new(120, false).matches();
    for i in (0..120).step_by(3) {
        matches[i].second += Point::new(20.0 + i as f64, 35.0 - 0.7 * i as f64);
    }
    let found = robust(&matches, 1).unwrap();
    let good = |i: &usize| !i.is_multiple_of(3);
    assert_eq!(found.inliers.iter().filter(|i| good(i)).count(), 80);
    assert!(found.inliers.iter().filter(|i| !good(i)).count() <= 3, "{:?}", found.inliers);
    assert_eq!(found, robust(&matches, 1).unwrap());
}

#[test]
fn planes_rotations_and_few_matches_are_refused() {
    let scene = Synthetic::new(50, true);
    assert!(matches!(robust(&scene.matches(), 1), Err(GeometryError::Planar { .. })));
    let mut noisy = scene.matches();
    for (i, m) in noisy.iter_mut().enumerate() {
        m.second += Point::new(0.2 * ((i % 5) as f64 - 2.0) / 2.0, 0.2 * ((i % 3) as f64 - 1.0));
    }
    assert!(matches!(robust(&noisy, 1), Err(GeometryError::Planar { .. })));
    let few = &Synthetic::new(7, false).matches();
    assert_eq!(robust(few, 1), Err(GeometryError::TooFew { what: "matches", found: 7, needed: 8 }));
    let mut broken = Synthetic::new(20, false).matches();
    broken[4].first.x = f64::NAN;
    assert!(!robust(&broken, 1).unwrap().inliers.contains(&4));
    let same = vec![Match { first: Point::new(1.0, 2.0), second: Point::new(3.0, 4.0) }; 30];
    assert!(robust(&same, 1).is_err());
}
