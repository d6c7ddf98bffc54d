//! What becomes of pixels whose depth no map knows.

use super::SourceView;
use crate::depth::{DepthMap, FAR, Measure, fill_unknown};
use crate::propagate::{View, Viewpoint};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// What unknown depths are taken for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Unknown {
    /// Far away where they look like a sky, else filled.
    #[default]
    Auto,
    /// Far away: behind everything.
    Far,
    /// Filled from their neighbours.
    Fill,
    /// Left out.
    Drop,
}

/// Least share of the pixels that a sky has.
const LEAST_SKY: f64 = 0.005;

/// Other views that are asked whether a region is a sky, at most.
const ASKED: usize = 4;

/// Pixels of a region of which other views are asked one, in rows and columns.
const STEP: usize = 3;

/// Gives unknown depths of full maps what they are taken for; the number of pixels that are far away then.
pub(super) fn resolve<P: Viewpoint>(views: &mut [SourceView<P>], unknown: Unknown) -> usize {
    let regions: Vec<Vec<usize>> = match unknown {
        Unknown::Drop => return 0,
        Unknown::Fill => vec![Vec::new(); views.len()],
        Unknown::Far => views.par_iter().map(|view| unknown_pixels(&view.map)).collect(),
        Unknown::Auto => {
            let shown: Vec<View<'_, P>> = views.iter().map(SourceView::view).collect();
            (0..shown.len()).into_par_iter().map(|index| sky(&shown, index)).collect()
        }
    };
    let full = views.par_iter_mut().zip(&regions).filter(|(view, _)| !view.map.is_scattered());
    full.for_each(|(view, far)| {
        fill_unknown(&mut view.map);
        view.map.set_far(far);
    });
    regions.iter().map(Vec::len).sum()
}

fn unknown_pixels(map: &DepthMap) -> Vec<usize> {
    (0..map.data().len()).filter(|p| map.data()[*p].is_nan()).collect()
}

/// The unknown pixels of a view that lie in a sky: regions at the upper border, whose directions other
/// views do not know either. What is unknown because other cameras did not see it, they see at other
/// places.
fn sky<P: Viewpoint>(views: &[View<'_, P>], index: usize) -> Vec<usize> {
    let map = views[index].map;
    if map.measure() != Measure::Depth || map.is_scattered() {
        return Vec::new();
    }
    let least = (LEAST_SKY * map.data().len() as f64) as usize;
    let regions = regions_above(map).into_iter();
    regions.filter(|region| region.len() > least && is_sky(views, index, region)).flatten().collect()
}

/// The regions of unknown pixels that touch the upper border.
fn regions_above(map: &DepthMap) -> Vec<Vec<usize>> {
    let ((width, height), mut seen) = (map.size(), vec![false; map.data().len()]);
    let mut regions = Vec::new();
    for start in 0..width {
        let (mut region, mut left) = (Vec::new(), vec![start]);
        while let Some(p) = left.pop() {
            if map.data()[p].is_nan() && !std::mem::replace(&mut seen[p], true) {
                region.push(p);
                let (x, y) = (p % width, p / width);
                left.extend((x > 0).then(|| p - 1).into_iter().chain((x + 1 < width).then_some(p + 1)));
                left.extend(
                    (y > 0).then(|| p - width).into_iter().chain((y + 1 < height).then_some(p + width)),
                );
            }
        }
        regions.push(region);
    }
    regions
}

/// Whether most of a region is unknown in the nearest other views too, if it is far away.
fn is_sky<P: Viewpoint>(views: &[View<'_, P>], index: usize, region: &[usize]) -> bool {
    let View { map, camera, .. } = &views[index];
    let width = map.width();
    let mut others: Vec<usize> = (0..views.len()).filter(|other| *other != index).collect();
    let away = |other: &usize| views[*other].camera.distance(camera);
    others.sort_by(|a, b| away(a).total_cmp(&away(b)));
    let (mut unknown, mut known) = (0, 0);
    for other in others.into_iter().take(ASKED).map(|other| &views[other]) {
        let to_other = camera.map_to(&other.camera);
        let some =
            region.iter().filter(|p| (*p % width).is_multiple_of(STEP) && (*p / width).is_multiple_of(STEP));
        for p in some {
            let (u, v, depth) = to_other((p % width) as f64, (p / width) as f64, f64::from(FAR));
            let Some(q) = other.image.pixel_at(u, v).filter(|_| depth > 0.0) else { continue };
            if other.map.data()[q].is_nan() { unknown += 1 } else { known += 1 }
        }
    }
    unknown >= known
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::image::Image;
    use nalgebra::Matrix3x4;

    const SIZE: (usize, usize) = (40, 30);

    /// Two cameras side by side, ten units apart; the ground is known below row 12, and what hides from one
    /// of them is unknown at the left border.
    fn views(unknown: impl Fn(usize, usize) -> bool) -> [SourceView<Camera>; 2] {
        [0.0, 10.0].map(|x| {
            let matrix = Matrix3x4::new(30.0, 0.0, 20.0, -30.0 * x, 0.0, 30.0, 15.0, 0.0, 0.0, 0.0, 1.0, 0.0);
            let value = |p: usize| if unknown(p % SIZE.0, p / SIZE.0) { 0.0 } else { 50.0 };
            let map = DepthMap::new(SIZE, (0..1200).map(value).collect(), 1.0, Measure::Depth).unwrap();
            SourceView {
                image: Image::filled(40, 30, 1, 9.0),
                map,
                camera: Camera::metric(matrix, false).unwrap(),
            }
        })
    }

    #[test]
    fn a_sky_is_far_away_and_holes_are_filled() {
        let mut sky = views(|x, y| y < 12 || (x == 7 && y == 20));
        assert_eq!(resolve(&mut sky, Unknown::Auto), 2 * 12 * 40);
        assert_eq!((sky[0].map.data()[5], sky[0].map.data()[20 * 40 + 7]), (FAR, 50.0));
        assert!(!sky[0].map.is_guessed(5) && sky[0].map.is_guessed(20 * 40 + 7));
        // A stripe at the left border, which the other view knows.
        let mut stripe = views(|x, _| x < 4);
        stripe[1].map = views(|_, _| false)[1].map.clone();
        assert_eq!(resolve(&mut stripe, Unknown::Auto), 0);
        assert_eq!(stripe[0].map.unknown(), 0);
    }

    #[test]
    fn what_is_asked_for_is_done() {
        let stripe = || views(|x, _| x < 4);
        let mut far = stripe();
        assert_eq!((resolve(&mut far, Unknown::Far), far[1].map.data()[0]), (240, FAR));
        let mut left = stripe();
        assert_eq!((resolve(&mut left, Unknown::Drop), left[0].map.unknown()), (0, 120));
    }
}
