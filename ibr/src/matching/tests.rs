use super::*;
use crate::camera::Camera;
use crate::synthetic::{SyntheticScene, rig_camera, rig_disparity};

const SIZE: (usize, usize) = (160, 120);

fn cameras() -> [Camera; 3] {
    [0.0, 1.0, 2.0].map(|position| Camera::metric(rig_camera(position, SIZE), false).unwrap())
}

/// The maps of all photographs.
fn depths<P: Viewpoint>(
    photographs: &[Photograph<'_, P>],
    measure: Measure,
) -> Result<Vec<DepthMap>, MatchError> {
    let found = super::depths(photographs, measure, &vec![true; photographs.len()])?;
    Ok(found.into_iter().flatten().collect())
}

/// One that is wanted has the map that it has among all.
#[test]
fn the_map_of_one_photograph_is_found() {
    let cameras = cameras();
    let shots = cameras.map(|camera| SyntheticScene::default().view(&camera, SIZE));
    let views = [0, 1, 2].map(|k| Photograph { image: &shots[k].0, camera: cameras[k] });
    let one = super::depths(&views, Measure::Depth, &[false, true, false]).unwrap();
    let all = depths(&views, Measure::Depth).unwrap();
    assert!(one[0].is_none() && one[2].is_none() && one[1].as_ref() == Some(&all[1]));
}

/// Median of the differences of known values, and their share.
fn errors(found: &DepthMap, truth: &DepthMap, measure: Measure) -> (f32, f64) {
    let values = found.data().iter().zip(truth.data()).filter(|(f, _)| !f.is_nan());
    let mut errors: Vec<f32> =
        values.map(|(f, t)| (measure.parallax(*f) - measure.parallax(*t)).abs()).collect();
    errors.sort_by(f32::total_cmp);
    (errors[errors.len() / 2], errors.len() as f64 / found.data().len() as f64)
}

#[test]
fn disparities_of_a_pair_are_found() {
    let shots = cameras().map(|camera| SyntheticScene::default().view(&camera, SIZE));
    let views = [0, 1].map(|k| Photograph { image: &shots[k].0, camera: k as f64 });
    let found = depths(&views, Measure::Disparity).unwrap();
    for (found, shot) in found.iter().zip(&shots) {
        let (error, share) = errors(found, &rig_disparity(&shot.1, SIZE.0), Measure::Disparity);
        assert!(error < 0.3 && share > 0.75, "{error} {share}");
    }
    let in_one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(in_one_thread.install(|| depths(&views, Measure::Disparity)).unwrap(), found);
}

#[test]
fn depths_of_general_cameras_are_found() {
    let cameras = cameras();
    let shots = cameras.map(|camera| SyntheticScene::default().view(&camera, SIZE));
    let view = |k: usize| Photograph { image: &shots[k].0, camera: cameras[k] };
    let found = depths(&[view(0), view(1), view(2)], Measure::Depth).unwrap();
    for (found, shot) in found.iter().zip(&shots) {
        let (error, share) = errors(found, &shot.1, Measure::Depth);
        let middle = 1.0 / shot.1.middle().unwrap();
        assert!(error < 0.05 * middle && share > 0.75, "{error} of {middle} {share}");
    }
}

#[test]
fn photographs_that_cannot_be_matched_are_named() {
    let image = Image::filled(64, 48, 1, 100.0);
    let view = |camera: f64| Photograph { image: &image, camera };
    for alone in [&[view(0.0)][..], &[view(1.0), view(1.0)]] {
        assert_eq!(depths(alone, Measure::Disparity).unwrap_err(), MatchError::Alone(0));
    }
    let dice = &mut crate::uncalibrated::random::dice::Dice::new(3);
    let mut noise = || {
        let data = (0..64 * 48).map(|_| 100.0 + 50.0 * dice.normal() as f32).collect();
        Image::new(64, 48, 1, data).unwrap()
    };
    let (a, b) = (noise(), noise());
    let views = [Photograph { image: &a, camera: 0.0 }, Photograph { image: &b, camera: 1.0 }];
    assert!(matches!(depths(&views, Measure::Disparity), Err(MatchError::Unlike(_))));
    // One that shows nothing of the others harms none that can be matched.
    let shots = cameras().map(|camera| SyntheticScene::default().view(&camera, SIZE).0);
    let blank = Image::filled(SIZE.0, SIZE.1, 1, 100.0);
    let view = |image, camera| Photograph { image, camera };
    let views = [view(&shots[0], 0.0), view(&shots[1], 1.0), view(&shots[2], 2.0), view(&blank, 9.0)];
    let found = super::depths(&views, Measure::Disparity, &[true, false, false, false]).unwrap();
    let alone = super::depths(&views[..3], Measure::Disparity, &[true, false, false]).unwrap();
    assert!(found[0].is_some() && found[..3] == alone[..]);
}

/// The nearest of all, but none from nearly the same place.
#[test]
fn the_nearest_with_a_baseline_are_matched() {
    assert_eq!(nearest(&[0.0, 3.0, 0.001, 1.1, 1.0]), [4, 3]);
    assert_eq!(nearest(&[f64::NAN, f64::INFINITY, 0.0, 2.0]), [3, 1]);
    assert!(nearest(&[0.0, 0.0]).is_empty());
}
