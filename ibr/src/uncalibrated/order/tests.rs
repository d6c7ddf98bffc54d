//! Random pairs of cameras: how often the order is wrong, and how often it is undecided.

use super::*;
use crate::uncalibrated::Point;
use crate::uncalibrated::canonical::canonical_pair;
use crate::uncalibrated::fundamental::eight_point;
use crate::uncalibrated::random::dice::Dice;
use crate::uncalibrated::triangulate::triangulate;
use nalgebra::{Rotation3, Vector3};

const SIZE: (usize, usize) = (640, 480);

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    SideBySide,
    Cropped,
    SlightlyCropped,
    UnequalFocal,
}

/// The votes on one pair, and the true sign.
fn pair(kind: Kind, seed: u64) -> Option<(Vec<Vote>, f64)> {
    let dice = &mut Dice::new(seed);
    let focal = 640.0 * dice.within(0.7, 2.0);
    let ratio = if kind == Kind::UnequalFocal { 2.0_f64.powf(dice.within(-0.75, 0.75)) } else { 1.0 };
    let off = match kind {
        Kind::Cropped => 0.15 * 640.0,
        Kind::SlightlyCropped => 0.05 * 640.0,
        _ => 0.0,
    };
    let depth = dice.within(4.0, 10.0);
    let relief = dice.within(0.15, 0.5);
    let baseline = depth * dice.within(0.05, 0.2);
    let turn = baseline / depth * dice.within(0.0, 1.2);
    let mut camera = |c: [f64; 3], yaw: f64, focal: f64| {
        let (cx, cy) = (319.5 + dice.within(-off, off), 239.5 + dice.within(-off, off));
        let k = Matrix3::new(focal, 0.0, cx, 0.0, focal, cy, 0.0, 0.0, 1.0);
        let (pitch, roll) = (0.02 * dice.normal(), 0.02 * dice.normal());
        let r = Rotation3::from_euler_angles(pitch, yaw, roll);
        let mut m = Matrix3x4::zeros();
        m.fixed_columns_mut::<3>(0).copy_from(r.matrix());
        m.set_column(3, &-(r * Vector3::from(c)));
        k * m
    };
    let cameras = [
        camera([-baseline / 2.0, 0.0, 0.0], turn / 2.0, focal),
        camera([baseline / 2.0, 0.05 * baseline, 0.05 * baseline], -turn / 2.0, ratio * focal),
    ];
    let (mut matches, mut truth) = (Vec::new(), Vec::new());
    for _ in 0..2000 {
        let z = depth * (1.0 + relief * dice.within(-1.0, 1.0));
        let reach = 0.6 * 640.0 / focal * z;
        let x = Vector4::new(dice.within(-reach, reach), dice.within(-reach, reach), z, 1.0);
        let see = |c: &Matrix3x4<f64>| {
            let p = c * x;
            Point::new(p.x / p.z, p.y / p.z)
        };
        let seen = cameras.each_ref().map(see);
        let inside = |p: &Point| p.x > 0.0 && p.x < 639.0 && p.y > 0.0 && p.y < 479.0;
        if seen.iter().all(inside) && matches.len() < 100 {
            let mut noisy = |p: Point| p + Point::new(dice.normal(), dice.normal()) * 0.3;
            matches.push(Match { first: noisy(seen[0]), second: noisy(seen[1]) });
            truth.push((cameras[0] * x).z);
        }
    }
    if matches.len() < 60 {
        return None;
    }
    let f = eight_point(&matches).ok()?;
    let found = canonical_pair(&f, &matches).ok()?;
    let mut projective =
        [found.first.inverse() * found.cameras[0], found.second.inverse() * found.cameras[1]];
    let mut points: Vec<Vector4<f64>> = matches
        .iter()
        .map(|m| {
            let (a, b) = (found.first.apply(&m.first), found.second.apply(&m.second));
            triangulate(&[(&found.cameras[0], a), (&found.cameras[1], b)])
        })
        .collect::<Option<_>>()?;
    chirality::orient(&mut projective, &mut points, |_, _| true);
    // The truth: chi against the true 1 / d.
    let rows: Vec<[f64; 4]> = matches
        .iter()
        .zip(&truth)
        .map(|(m, d)| [depth / d, m.first.x / 500.0, m.first.y / 500.0, 1.0])
        .collect();
    let chi: Vec<f64> = points.iter().map(|p| chirality::chi(&projective[0], p)).collect();
    let sign = hybank_linalg::small::least_squares(&rows, &chi)?[0].signum();
    Some((votes(&f, &matches, &points, &projective[0], [SIZE; 2]), sign))
}

/// Few pairs are wrong and some are decided, in every run a few of them; HYBANK_TRIALS=120 makes
/// ten times as many.
#[test]
fn few_orders_are_wrong() {
    for (kind, most) in [
        (Kind::SideBySide, 0.005),
        (Kind::UnequalFocal, 0.005),
        (Kind::SlightlyCropped, 0.005),
        (Kind::Cropped, 0.01),
    ] {
        let found: Vec<(f64, f64, f64)> = trials::trials(12)
            .filter_map(|seed| pair(kind, seed))
            .filter_map(|(votes, truth)| mean_sign(&votes).map(|(mean, agreement)| (mean, agreement, truth)))
            .collect();
        for least in [0.75, 0.85, 0.9, 0.95, 0.97, 0.98, 0.99] {
            let decided = found.iter().filter(|f| f.1 >= least);
            let wrong = decided.clone().filter(|f| f.0 * f.2 < 0.0).count();
            println!("{kind:?}: agreement {least}: {} decided, {wrong} wrong", decided.count());
        }
        let decided = found.iter().filter(|f| f.1 >= LEAST_AGREEMENT);
        let wrong = decided.clone().filter(|f| f.0 * f.2 < 0.0).count();
        let (all, decided) = (found.len() as f64, decided.count() as f64);
        println!("{kind:?}: {all} pairs, {decided} decided, {wrong} of them wrong");
        assert!(wrong as f64 <= most * all && decided > 0.05 * all, "{kind:?}: {wrong} {decided} of {all}");
    }
}

/// The bit does not depend on the projective frame.
#[test]
fn the_frame_does_not_matter() {
    let scene = crate::uncalibrated::fundamental::tests::Synthetic::new(50, false);
    let matches = scene.matches();
    let f = eight_point(&matches).unwrap();
    for last in [[0.02, 0.03, 0.05, 1.0], [0.02, 0.03, -0.4, 1.0]] {
        for mirror in [1.0, -1.0] {
            let mut h = nalgebra::Matrix4::from_diagonal(&[mirror, 1.0, 1.0, 1.0].into());
            h.set_row(3, &nalgebra::RowVector4::from_row_slice(&last));
            let mut cameras = scene.cameras.map(|c| c * h.try_inverse().unwrap());
            let mut points: Vec<_> = scene.points.iter().map(|p| h * p.push(1.0)).collect();
            chirality::orient(&mut cameras, &mut points, |_, _| true);
            let order = Order::of(&f, &matches, &points, &cameras[0], [(641, 481); 2]).unwrap();
            assert_eq!(order.hand.sign(), h.determinant().signum(), "{last:?} {mirror}");
            assert!(order.agreement > 0.75, "{order:?}");
        }
    }
}
