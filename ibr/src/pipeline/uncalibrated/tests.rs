//! Random pairs of ray-traced photographs: how often the order of depth is wrong in the end, and how often
//! it is called undecided.

use super::*;
use crate::camera::Camera;
use crate::synthetic::SyntheticScene;
use crate::uncalibrated::chirality::{self, Handedness};
use crate::uncalibrated::random::dice::Dice;
use hybank_linalg::small;
use nalgebra::{Matrix3, Matrix3x4, Rotation3, Vector3};

const SIZE: (usize, usize) = (240, 180);

/// Noise of the positions of tracks, in pixels.
const NOISE: f64 = 0.3;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    SideBySide,
    /// Principal points up to 15 % of the width beside the middle.
    Cropped,
    /// Focal lengths of ratio 0.6 to 1.7.
    UnequalFocal,
}

/// Two cameras that look at the middle of the scene, about.
fn cameras(kind: Kind, dice: &mut Dice) -> [Camera; 2] {
    let side = SIZE.0 as f64;
    let focal = side * dice.within(0.8, 1.8);
    let ratio = if kind == Kind::UnequalFocal { 2.0_f64.powf(dice.within(-0.75, 0.75)) } else { 1.0 };
    let off = if kind == Kind::Cropped { 0.15 * side } else { 0.0 };
    let baseline = dice.within(0.3, 1.1);
    let turn = baseline / 6.0 * dice.within(0.0, 1.2);
    [(-0.5, focal), (0.5, ratio * focal)].map(|(side_of, focal)| {
        let (cx, cy) = (119.5 + dice.within(-off, off), 89.5 + dice.within(-off, off));
        let k = Matrix3::new(focal, 0.0, cx, 0.0, focal, cy, 0.0, 0.0, 1.0);
        let (pitch, roll) = (0.02 * dice.normal(), 0.02 * dice.normal());
        let r = Rotation3::from_euler_angles(pitch, -turn * side_of, roll);
        let mut m = Matrix3x4::zeros();
        m.fixed_columns_mut::<3>(0).copy_from(r.matrix());
        m.set_column(3, &-(r * Vector3::new(baseline * side_of, 0.05 * side_of * baseline, 0.0)));
        Camera::metric(k * m, false).unwrap()
    })
}

/// What decided the order of a pair, and whether it is right; none if the views share too little.
fn outcome(kind: Kind, seed: u64) -> Option<(OrderBy, bool)> {
    let mut dice = Dice::new(seed);
    let cameras = cameras(kind, &mut dice);
    let scene = SyntheticScene::varied(seed);
    let shots = cameras.map(|c| scene.view(&c, SIZE));
    let (mut tracks, mut depths) = (Vec::new(), Vec::new());
    for _ in 0..1500 {
        let (x, y) = (dice.within(1.0, 238.0).round(), dice.within(1.0, 178.0).round());
        let at = |x: f64, y: f64, i: usize| f64::from(shots[i].1.row(y as usize)[x as usize]);
        let depth = at(x, y, 0);
        let (u, v, there) = cameras[0].relative_to(&cameras[1]).map(x, y, depth);
        if !(u > 0.0 && v > 0.0 && u < 239.0 && v < 179.0 && tracks.len() < 150) {
            continue;
        }
        if (at(u.round(), v.round(), 1) / there - 1.0).abs() < 0.02 {
            let mut noisy = |x: f64, y: f64| Point::new(x + NOISE * dice.normal(), y + NOISE * dice.normal());
            tracks.push(vec![Some(noisy(x, y)), Some(noisy(u, v))]);
            depths.push(depth);
        }
    }
    let images = [&shots[0].0, &shots[1].0];
    let target = Target::Tracks(tracks.iter().map(|t| t[1]).collect());
    let mut found = reconstruction::reconstruct(&images, &tracks, &target, 1).ok()?;
    let grey = images.map(|image| image.to_grey());
    let surfaces = [0, 1].map(|view| Surface::of(view, SIZE, view, &grey, &found));
    let (by_calibrations, advantage) = (found.hand, Advantage::of(&images, &surfaces, &found));
    decide(&images, &surfaces, &mut found);
    // The truth: chi of the first camera against the true 1 / d.
    let (mut rows, mut chi) = (Vec::new(), Vec::new());
    for (point, seen) in found.points.iter().zip(&found.seen) {
        let j = tracks.iter().position(|t| t[0] == seen[0])?;
        let p = seen[0]?;
        rows.push([6.0 / depths[j], p.x / 200.0, p.y / 200.0, 1.0]);
        chi.push(chirality::chi(&found.cameras[0], point));
    }
    let slope = small::least_squares(&rows, &chi)?[0];
    let truth = Handedness::from_slope(&found.cameras[0], slope);
    println!(
        "{kind:?} {seed}: calibrations {:.3} {}, colours {:.2} grey levels, {:.1} deviations, {} pixels {}",
        found.geometry.order_agreement,
        by_calibrations == truth,
        advantage.mean().abs(),
        advantage.deviations().abs(),
        advantage.count,
        (advantage.mean() > 0.0) == (truth == Handedness::Kept)
    );
    Some((found.geometry.order_by, truth == found.hand))
}

/// Few pairs are wrong and not called undecided: in every run one of each kind, HYBANK_TRIALS=300
/// makes 300.
#[test]
fn few_orders_are_wrong_in_the_end() {
    let seeds = trials::trials(1);
    for kind in [Kind::SideBySide, Kind::Cropped, Kind::UnequalFocal] {
        let found: Vec<(OrderBy, bool)> = seeds.clone().filter_map(|seed| outcome(kind, seed)).collect();
        let count = |by: OrderBy, right: bool| found.iter().filter(|f| **f == (by, right)).count();
        for by in [OrderBy::Calibrations, OrderBy::Colours, OrderBy::Both, OrderBy::Nothing] {
            println!("{kind:?}, by {by:?}: {} right, {} wrong", count(by, true), count(by, false));
        }
        let wrong = found.iter().filter(|(by, right)| *by != OrderBy::Nothing && !right).count();
        let allowed = (0.005 * found.len() as f64).floor();
        assert!(!found.is_empty() && wrong as f64 <= allowed, "{kind:?}: {wrong} of {}", found.len());
    }
}
