//! Rows of a rectified rig that are not at one height.

use super::{BETTER, LEAST, Shown, Sighting, middle, slope, step_of, weighed};
use crate::depth::Origin;
use crate::image::{Image, cubic_weights};
use crate::propagate::{Viewpoint, nearest};
use crate::scene::SourceView;
use crate::surfaces::DepthTest;

const ROUNDS: usize = 8;

/// Farthest that rows are shifted.
const FARTHEST: f64 = 8.0;

/// Shifts the rows of the views to the height that most have; the root mean square shift.
pub(super) fn level(views: &mut [SourceView<f64>]) -> Option<f64> {
    let greys: Vec<Image> = views.iter().map(|view| view.image.to_grey()).collect();
    let mut shifts = vec![0.0; views.len()];
    for view in 1..views.len() {
        let shown: Vec<_> = views.iter().map(SourceView::view).collect();
        let Some(other) = nearest(&shown, view, 0..view) else { continue };
        shifts[view] = shifts[other] + between(views, &greys, [other, view]).unwrap_or(0.0);
    }
    let height = usual(&shifts)?;
    shifts.iter_mut().for_each(|shift| *shift -= height);
    let moved = (shifts.iter().map(|s| s * s).sum::<f64>() / shifts.len() as f64).sqrt();
    if moved < LEAST {
        return None;
    }
    let beside = views.iter_mut().zip(shifts).filter(|(_, shift)| *shift != 0.0);
    beside.for_each(|(view, shift)| shifted(view, shift));
    Some(moved)
}

/// The shift that is nearest to all others; of two that of the first view, which has the exposure of all
/// too.
fn usual(shifts: &[f64]) -> Option<f64> {
    let away = |shift: &&f64| shifts.iter().map(|other| (other - *shift).abs()).sum::<f64>();
    shifts.iter().min_by(|a, b| away(a).total_cmp(&away(b))).copied()
}

/// By how many rows the second view shows points lower than the first; `None` where the photographs fit as
/// they are.
fn between(views: &[SourceView<f64>], greys: &[Image], pair: [usize; 2]) -> Option<f64> {
    let mut shift = 0.0;
    let before = middle(&weighed(&sightings(views, greys, pair, shift)?).0);
    for _ in 0..ROUNDS {
        let sightings = sightings(views, greys, pair, shift)?;
        let (differences, weights) = weighed(&sightings);
        let all = || sightings.iter().zip(&differences).zip(&weights);
        let square: f64 = all().map(|((s, _), w)| w * s.slopes[0] * s.slopes[0]).sum();
        let product: f64 = all().map(|((s, d), w)| w * s.slopes[0] * d).sum();
        shift = (shift - product / square.max(f64::MIN_POSITIVE)).clamp(-FARTHEST, FARTHEST);
    }
    let after = middle(&weighed(&sightings(views, greys, pair, shift)?).0);
    (shift.abs() >= LEAST && after < BETTER * before).then_some(shift)
}

fn sightings(
    views: &[SourceView<f64>],
    greys: &[Image],
    [from, to]: [usize; 2],
    shift: f64,
) -> Option<Vec<Sighting<1>>> {
    let (view, other, step) = (&views[from], &views[to], step_of(&views[from].image));
    let (width, height) = view.image.size();
    let map = view.camera.map_to(&other.camera);
    let sighting = |(x, y): (usize, usize)| {
        let (u, v, there) = map(x as f64, y as f64, f64::from(view.map.row(y)[x]));
        let v = v + shift;
        let q = other.image.pixel_at(u, v)?;
        let is_shown = DepthTest::are_one_point(there as f32, other.map.data()[q], &other.map);
        let (value, slope) = (greys[to].value_at(u, v, 0), slope(&greys[to], u, v));
        let values = [greys[from].data()[y * width + x], value];
        let is_shown = is_shown && value.is_finite() && slope[1].is_finite();
        Some(is_shown.then_some(Sighting { values, slopes: [slope[1]] }))
    };
    let pixels = (0..height).step_by(step).flat_map(|y| (0..width).step_by(step).map(move |x| (x, y)));
    Shown::of(pixels.filter_map(sighting)).enough()
}

/// Moves the rows of a view up: image by cubic interpolation, map by the nearest row.
fn shifted(view: &mut SourceView<f64>, shift: f64) {
    let ((width, height), channels) = (view.image.size(), view.image.channels());
    let (mut image, mut map) = (view.image.clone(), Vec::with_capacity(width * height));
    let clamped = |y: f64| y.clamp(0.0, height as f64 - 1.0) as usize;
    for (y, row) in image.data_mut().chunks_exact_mut(width * channels).enumerate() {
        let from = y as f64 + shift;
        let weights = cubic_weights((from - from.floor()) as f32);
        let rows = [-1.0, 0.0, 1.0, 2.0].map(|k| view.image.row(clamped(from.floor() + k)));
        for (i, value) in row.iter_mut().enumerate() {
            *value = rows.iter().zip(weights).map(|(row, weight)| weight * row[i]).sum::<f32>();
        }
        map.extend_from_slice(view.map.row(clamped(from.round())));
    }
    view.image = image;
    // What was filled in stays so; a row more or less does not matter.
    let map = view.map.with_values((width, height), map);
    view.map = map.with_origins(&view.map, &[], Origin::Known);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::synthetic::{SyntheticScene, rig_camera, rig_disparity};

    const SIZE: (usize, usize) = (160, 120);

    /// A rig whose second camera looks so many pixels too high.
    fn views(rows: f64) -> Vec<SourceView<f64>> {
        let view = |(place, rows): (f64, f64)| {
            let mut matrix = rig_camera(place, SIZE);
            matrix[(1, 2)] += rows;
            let camera = Camera::metric(matrix, false).unwrap();
            let (image, depth) = SyntheticScene::default().view(&camera, SIZE);
            SourceView { image, map: rig_disparity(&depth, SIZE.0), camera: place }
        };
        [(0.0, 0.0), (1.0, rows)].map(view).to_vec()
    }

    #[test]
    fn the_height_of_most_views_counts() {
        assert_eq!((usual(&[0.0, 1.0]), usual(&[0.0, 1.0, 1.0])), (Some(0.0), Some(1.0)));
    }

    #[test]
    fn rows_of_another_height_are_found() {
        for rows in [1.0, -0.4] {
            let mut wrong = views(rows);
            let moved = level(&mut wrong).expect("a shift");
            assert!((moved - f64::abs(rows) / f64::sqrt(2.0)).abs() < 0.05, "{rows}: {moved}");
            assert_eq!(level(&mut wrong), None);
            // The first view stays.
            assert!(wrong[0] == views(rows)[0]);
        }
        assert_eq!(level(&mut views(0.0)), None);
    }
}
