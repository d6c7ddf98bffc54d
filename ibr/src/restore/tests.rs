//! Damaged maps of the synthetic scene against its exact depth.

use super::*;
use crate::camera::Camera;
use crate::depth::Measure;
use crate::image::Image;
use crate::synthetic::{SyntheticScene, rig_camera, rig_disparity};
use crate::uncalibrated::random::dice::Dice;

const SIZE: (usize, usize) = (240, 180);

struct Shot {
    image: Image,
    depth: DepthMap,
    disparity: DepthMap,
    camera: Camera,
}

fn shots() -> [Shot; 2] {
    [0.0, 1.0].map(|position| {
        let camera = Camera::metric(rig_camera(position, SIZE), false).unwrap();
        let (image, depth) = SyntheticScene::default().view(&camera, SIZE);
        let disparity = rig_disparity(&depth, SIZE.0);
        Shot { image, depth, disparity, camera }
    })
}

fn changed(map: &DepthMap, seed: u64, change: impl Fn(f32, &mut Dice) -> f32) -> DepthMap {
    let dice = &mut Dice::new(seed);
    let values = map.data().iter().map(|v| change(*v, dice)).collect();
    DepthMap::new(map.size(), values, 1.0, map.measure()).unwrap()
}

/// The restored disparities of both views.
fn restored(shots: &[Shot; 2], maps: &[DepthMap; 2]) -> Vec<Restored> {
    let view = |i: usize| View { image: &shots[i].image, map: &maps[i], camera: i as f64 };
    restore(&[view(0), view(1)])
}

/// Root mean square error, without the largest hundredth: outlines.
fn error(map: &DepthMap, exact: &DepthMap) -> f64 {
    let mut squares: Vec<f64> =
        map.data().iter().zip(exact.data()).map(|(a, b)| f64::from(a - b).powi(2)).collect();
    squares.sort_by(f64::total_cmp);
    squares.truncate(squares.len() * 99 / 100);
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

#[test]
fn exact_maps_keep_their_bits() {
    let shots = shots();
    let maps = shots.each_ref().map(|shot| shot.disparity.clone());
    for (restored, map) in restored(&shots, &maps).iter().zip(&maps) {
        assert!(restored.map == *map && restored.outliers == 0.0, "{}", restored.outliers);
    }
}

#[test]
fn outliers_are_found_and_replaced() {
    let shots = shots();
    let wild = |v: f32, dice: &mut Dice| {
        if dice.within(0.0, 1.0) < 0.05 { dice.within(8.0, 25.0) as f32 } else { v }
    };
    let maps = [0, 1].map(|i| changed(&shots[i].disparity, 5 + i as u64, wild));
    for (restored, shot) in restored(&shots, &maps).iter().zip(&shots) {
        // Some are as good as right.
        assert!((0.035..0.055).contains(&restored.outliers), "{}", restored.outliers);
        let left = error(&restored.map, &shot.disparity);
        assert!(left < 0.1, "{left}");
    }
}

/// Discs of wrong values, nearer and farther than what is there. Each value has neighbours that agree with
/// it.
#[test]
fn clusters_of_outliers_are_found() {
    let shots = shots();
    let maps = [0, 1].map(|i| {
        let dice = &mut Dice::new(31 + i as u64);
        let mut data = shots[i].disparity.data().to_vec();
        for _ in 0..40 {
            let (x, y) = (dice.within(4.0, 236.0) as usize, dice.within(4.0, 176.0) as usize);
            let wrong = dice.within(6.0, 28.0) as f32;
            let inside = |dx: usize, dy: usize| dx.abs_diff(3).pow(2) + dy.abs_diff(3).pow(2) <= 9;
            for (dx, dy) in (0..49).map(|k| (k % 7, k / 7)).filter(|(dx, dy)| inside(*dx, *dy)) {
                data[(y + dy - 3) * SIZE.0 + x + dx - 3] = wrong;
            }
        }
        DepthMap::new(SIZE, data, 1.0, Measure::Disparity).unwrap()
    });
    for (i, restored) in restored(&shots, &maps).iter().enumerate() {
        let [before, left] = [&maps[i], &restored.map].map(|map| error(map, &shots[i].disparity));
        println!("{before:.3}, left {left:.3}, {:.3} rejected", restored.outliers);
        assert!(left < before / 4.0, "{before} {left}");
    }
}

/// Of 3 % of the disparities a twentieth is wrong. Views that are made dense together vote on them.
#[test]
fn wrong_samples_are_left_out_of_dense_maps() {
    let shots = shots();
    let sampled = |share: f64| {
        let maps = [0, 1].map(|i| {
            changed(&shots[i].disparity, 40 + i as u64, |v, dice| {
                let (chosen, is_wrong) = (dice.within(0.0, 1.0) < 0.03, dice.within(0.0, 1.0) < share);
                let wrong = dice.within(6.0, 28.0) as f32;
                if !chosen {
                    f32::NAN
                } else if is_wrong {
                    wrong
                } else {
                    v
                }
            })
        });
        let view = |i: usize| View { image: &shots[i].image, map: &maps[i], camera: i as f64 };
        let together = dense(&[view(0), view(1)]);
        let alone = [0, 1].map(|i| dense(&[view(i)]).remove(0));
        [&together[..], &alone[..]].map(|maps| {
            [0, 1]
                .map(|i| error(maps[i].as_ref().expect("a dense map"), &shots[i].disparity))
                .iter()
                .sum::<f64>()
        })
    };
    let ([right, _], [together, alone]) = (sampled(0.0), sampled(0.05));
    assert!(together < 0.6 * alone && right < together, "{right} {together} {alone}");
}

/// Samples in the left half only: what lies farther to the right is a guess.
#[test]
fn depths_far_from_samples_are_guesses() {
    let shots = shots();
    let map =
        changed(&shots[0].disparity, 50, |v, dice| if dice.within(0.0, 1.0) < 0.04 { v } else { f32::NAN });
    let is_left = |p: usize| p % SIZE.0 < 120;
    let of = |data: Vec<f32>| DepthMap::new(SIZE, data, 1.0, Measure::Depth).unwrap();
    let data = map.data().iter().enumerate().map(|(p, v)| if is_left(p) { 100.0 / v } else { f32::NAN });
    let half = of(data.collect());
    let map = of(map.data().iter().map(|v| 100.0 / v).collect());
    let guessed = |map: &DepthMap, from: usize, to: usize| {
        let view = View { image: &shots[0].image, map, camera: 0.0 };
        let dense = dense(&[view]).remove(0).unwrap();
        let pixels = || (0..SIZE.0 * SIZE.1).filter(|p| (from..to).contains(&(p % SIZE.0)));
        pixels().filter(|p| dense.is_guessed(*p)).count() as f64 / pixels().count() as f64
    };
    let found = [guessed(&half, 0, 115), guessed(&half, 160, 240), guessed(&map, 0, 240)];
    assert!(found[0] < 0.01 && found[1] > 0.99 && found[2] < 0.01, "{found:?}");
}

/// The same by reciprocal depths of general cameras.
#[test]
fn outliers_of_depths_are_found() {
    let shots = shots();
    let wild = |v: f32, dice: &mut Dice| {
        if dice.within(0.0, 1.0) < 0.05 { dice.within(3.0, 12.0) as f32 } else { v }
    };
    let maps = [0, 1].map(|i| changed(&shots[i].depth, 5 + i as u64, wild));
    let view = |i: usize| View { image: &shots[i].image, map: &maps[i], camera: shots[i].camera };
    for (restored, shot) in restore(&[view(0), view(1)]).iter().zip(&shots) {
        let left = error(&restored.map, &shot.depth);
        assert!((0.03..0.055).contains(&restored.outliers) && left < 0.05, "{} {left}", restored.outliers);
    }
}

/// Means of five columns give most pixels beside an edge a value of neither side.
#[test]
fn blurred_outlines_become_sharp() {
    let shots = shots();
    let maps = shots.each_ref().map(|shot| {
        let (map, width) = (&shot.disparity, SIZE.0);
        let at = |p: usize, k: usize| map.row(p / width)[(p % width + k).saturating_sub(2).min(width - 1)];
        let mean = |p: usize| (0..5).map(|k| at(p, k)).sum::<f32>() / 5.0;
        DepthMap::new(SIZE, (0..map.data().len()).map(mean).collect(), 1.0, Measure::Disparity).unwrap()
    });
    for ((shot, map), restored) in shots.iter().zip(&maps).zip(restored(&shots, &maps)) {
        let wrong = |map: &DepthMap| {
            let pairs = map.data().iter().zip(shot.disparity.data());
            pairs.filter(|(found, exact)| (*found - *exact).abs() > 0.5).count()
        };
        let (before, after) = (wrong(map), wrong(&restored.map));
        assert!(before > 300 && 3 * after < 2 * before, "{before} {after}");
    }
}

/// Noise of the same deviation in both maps, which the lookups measure, falls to less than a third.
#[test]
fn noise_is_removed() {
    let shots = shots();
    for deviation in [0.3, 1.0] {
        let maps = [0, 1].map(|i| {
            changed(&shots[i].disparity, 9 + i as u64, |v, dice| v + (deviation * dice.normal()) as f32)
        });
        for (restored, shot) in restored(&shots, &maps).iter().zip(&shots) {
            let left = error(&restored.map, &shot.disparity);
            println!("{deviation}: measured {:.3}, left {left:.3}", restored.error);
            assert!((0.8..1.2).contains(&(restored.error / deviation)) && left < deviation / 3.0, "{left}");
        }
    }
}

/// A line one pixel wide is not a set of outliers, nor is a single pixel that the other view confirms.
#[test]
fn thin_things_are_kept() {
    let near = |x: usize, y: usize, shift: usize| (x + shift == 100) || (x + shift, y) == (60, 40);
    let thin = [0, 10].map(|shift| {
        let data = (0..SIZE.0 * SIZE.1).map(|p| if near(p % SIZE.0, p / SIZE.0, shift) { 10.0 } else { 2.0 });
        DepthMap::new(SIZE, data.collect(), 1.0, Measure::Disparity).unwrap()
    });
    let image = [0, 10].map(|shift| {
        let data = (0..SIZE.0 * SIZE.1).map(|p| {
            let (x, y) = (p % SIZE.0, p / SIZE.0);
            if near(x, y, shift) { 200.0 } else { 60.0 + 20.0 * ((x + shift / 5) as f32 * 0.7).sin() }
        });
        Image::new(SIZE.0, SIZE.1, 1, data.collect()).unwrap()
    });
    let view = |i: usize| View { image: &image[i], map: &thin[i], camera: i as f64 };
    for (restored, map) in restore(&[view(0), view(1)]).iter().zip(&thin) {
        assert!(restored.map == *map, "{}", restored.outliers);
    }
}

/// By definition: the others of a group, or all others if a view is alone in its group, at equal distances.
#[test]
fn few_of_many_views_vote() {
    for groups in [vec![0, 0, 2, 0, 4, 4], vec![0; 40], (0..23).collect(), vec![0]] {
        let found = outliers::voters(&groups);
        for (index, found) in found.iter().enumerate() {
            let others = || (0..groups.len()).filter(|other| *other != index);
            let mut wanted: Vec<usize> = others().filter(|other| groups[*other] == groups[index]).collect();
            if wanted.is_empty() {
                wanted = others().collect();
            }
            let wanted: Vec<usize> =
                wanted.iter().copied().step_by(wanted.len().div_ceil(8).max(1)).collect();
            assert_eq!(*found, wanted, "{groups:?} {index}");
        }
    }
}

/// An error of a disparity displaces a point by as much, times the distance of the cameras; a relative error
/// of a depth by its disparity.
#[test]
fn errors_of_depth_are_displacements() {
    let [first, second] = shots();
    let rig = View { image: &first.image, map: &first.disparity, camera: 0.0 };
    let found = displacement(&rig, &0.4);
    assert!((found - 0.16).abs() < 1e-9, "{found}");
    let general = View { image: &first.image, map: &first.depth, camera: first.camera };
    let disparity = f64::from(first.disparity.middle().unwrap());
    let ratio = displacement(&general, &second.camera) / disparity.powi(2);
    assert!((0.8..1.6).contains(&ratio), "{ratio}");
}
