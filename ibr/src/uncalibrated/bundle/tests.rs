//! Bundle adjustment against exact data, differences, and the number of free directions.

use super::*;
use crate::uncalibrated::fundamental::tests::Synthetic;
use crate::uncalibrated::random::dice::Dice;
use crate::uncalibrated::refine::reprojection;

const NOISE: f64 = 0.5;

/// All points in all three cameras, in a projective frame.
fn exact(count: usize) -> Bundle {
    let scene = Synthetic::new(count, false);
    let h =
        Matrix4::new(1.0, 0.2, -0.1, 0.3, 0.0, 0.9, 0.3, -0.2, 0.1, -0.3, 1.2, 0.4, 0.05, -0.02, 0.1, 0.8);
    let inverse = h.try_inverse().unwrap();
    let sight = |(point, camera)| Observation { camera, point, image: scene.image(camera, point) };
    Bundle {
        cameras: scene.cameras.iter().map(|c| c * inverse).collect(),
        points: scene.points.iter().map(|x| h * x.push(1.0)).collect(),
        observations: (0..count).flat_map(|p| (0..3).map(move |c| (p, c))).map(sight).collect(),
    }
}

fn disturb(bundle: &mut Bundle, share: f64, dice: &mut Dice) {
    for camera in &mut bundle.cameras {
        // In rows of about one size: of the normalised image.
        let norms = [0, 1, 2].map(|r| camera.row(r).norm());
        *camera += Matrix3x4::from_fn(|r, _| share * norms[r] * dice.normal());
    }
    for point in &mut bundle.points {
        let norm = point.norm();
        *point += Vector4::from_fn(|_, _| share * norm * dice.normal());
    }
}

fn image(bundle: &Bundle, o: &Observation) -> Point {
    let p = bundle.cameras[o.camera] * bundle.points[o.point];
    p.xy() / p.z
}

/// Root mean square distance of the images of a bundle from those of another.
fn distance(a: &Bundle, b: &Bundle) -> f64 {
    let squares: f64 = a.observations.iter().map(|o| (image(a, o) - image(b, o)).norm_squared()).sum();
    (squares / a.observations.len() as f64).sqrt()
}

#[test]
fn exact_images_are_recovered() {
    let (truth, mut dice) = (exact(40), Dice::new(3));
    let mut found = truth.clone();
    disturb(&mut found, 3e-3, &mut dice);
    let start = distance(&found, &truth);
    let done = found.adjust(1e3).unwrap();
    assert!(start > 1.0 && done, "{start}");
    assert!(distance(&found, &truth) < 1e-9, "{:e}", distance(&found, &truth));
}

/// The least-squares images of noisy data err by the part of the noise that lies in the tangent space: its
/// variance times the number of free directions, 11 for each camera and 3 for each point without the 15 of
/// the frame. That is the Cramer-Rao bound, and the rest of the noise is the residual.
#[test]
fn noisy_images_err_by_the_cramer_rao_bound() {
    let (truth, mut dice) = (exact(60), Dice::new(4));
    let (mut error, mut rest, trials) = (0.0, 0.0, 10);
    for _ in 0..trials {
        let mut found = truth.clone();
        for o in &mut found.observations {
            o.image += Point::new(NOISE * dice.normal(), NOISE * dice.normal());
        }
        disturb(&mut found, 1e-3, &mut dice);
        assert!(found.adjust(1e3).unwrap());
        error += distance(&found, &truth).powi(2) * 180.0;
        rest += found.observations.iter().map(|o| (image(&found, o) - o.image).norm_squared()).sum::<f64>();
    }
    let (free, numbers) = (3.0 * 11.0 + 60.0 * 3.0 - 15.0, 360.0);
    let unit = NOISE * NOISE * f64::from(trials);
    assert!((error / unit / free - 1.0).abs() < 0.08, "{} {free}", error / unit);
    assert!((rest / unit / (numbers - free) - 1.0).abs() < 0.1, "{} {}", rest / unit, numbers - free);
}

#[test]
fn mistakes_hardly_count() {
    let (truth, mut dice) = (exact(60), Dice::new(5));
    let mut found = truth.clone();
    for (k, o) in found.observations.iter_mut().enumerate() {
        let large = if k % 23 == 0 { 25.0 } else { 0.0 };
        o.image += Point::new(0.2 * dice.normal() + large, 0.2 * dice.normal() - large);
    }
    let (mut plain, mut robust) = (found.clone(), found);
    plain.adjust(1e3).unwrap();
    robust.adjust(1.0).unwrap();
    let good = |b: &Bundle| {
        let sights = b.observations.iter().enumerate().filter(|(k, _)| k % 23 != 0);
        sights.map(|(_, o)| (image(b, o) - image(&truth, o)).norm_squared()).sum::<f64>()
    };
    assert!(good(&robust) < 0.05 * good(&plain), "{} {}", good(&robust), good(&plain));
}

#[test]
fn the_derivatives_are_those_of_differences() {
    let (bundle, mut dice) = (exact(5), Dice::new(6));
    let (problem, (cameras, points)) = Frame::of(&bundle).unwrap().normalised(&bundle, 1.0);
    let h = 1e-6;
    for sight in &problem.observations {
        let (camera, point) = (cameras[sight.camera], points[sight.point]);
        let (_, by_camera, by_point) = reprojection(&camera, &point, &sight.image);
        let step = Matrix3x4::from_fn(|_, _| dice.normal());
        let ahead = Vector4::from_fn(|_, _| dice.normal());
        let change = |t: f64| reprojection(&(camera + step * t), &(point + ahead * t), &sight.image).0;
        // The residual falls when the image moves.
        let found = (change(-h) - change(h)) / (2.0 * h);
        let rows = nalgebra::SVector::<f64, 12>::from_fn(|k, _| step[(k / 4, k % 4)]);
        let want = by_camera * rows + by_point * ahead;
        assert!((found - want).norm() < 1e-6 * want.norm().max(1.0), "{found} {want}");
    }
}

/// From anywhere: bad starts, few points, points seen once, a camera that sees nothing.
#[test]
fn it_is_never_worse_than_its_start() {
    let mut dice = Dice::new(7);
    for trial in 0..30 {
        let mut found = exact(4 + trial);
        found.observations.retain(|_| dice.within(0.0, 1.0) > 0.3);
        disturb(&mut found, 0.02 * f64::from(trial as u8 % 7), &mut dice);
        let start = found.clone();
        let cost = |b: &Bundle| -> f64 {
            let squares = b.observations.iter().map(|o| (image(b, o) - o.image).norm_squared());
            squares.map(|square| (square / 4.0).ln_1p()).sum()
        };
        match found.adjust(2.0) {
            // The cost of exact images is that of rounding.
            Some(_) => {
                let (after, before) = (cost(&found), cost(&start));
                assert!(after <= before * (1.0 + 1e-9) + 1e-20, "{after} {before}");
            }
            None => assert_eq!(found, start),
        }
        assert!(
            found
                .cameras
                .iter()
                .zip(&start.cameras)
                .all(|(a, b)| a.iter().all(|v| v.is_finite()) && (a.norm() / b.norm() - 1.0).abs() < 1e-9)
        );
    }
}

#[test]
fn what_is_no_bundle_is_left_alone() {
    let mut wrong = exact(10);
    wrong.observations[3].camera = 7;
    let before = wrong.clone();
    assert_eq!(wrong.adjust(1.0), None);
    assert_eq!(wrong, before);
    let mut broken = exact(10);
    broken.points[2].x = f64::NAN;
    assert_eq!(broken.adjust(1.0), None);
}
