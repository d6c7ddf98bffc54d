//! Cameras and points from all views together: points are triangulated from every view that shows them, and
//! a bundle adjustment fits cameras and points to all positions.

use crate::uncalibrated::Point;
use crate::uncalibrated::bundle::{Bundle, Observation};
use crate::uncalibrated::normalise::Normalisation;
use crate::uncalibrated::triangulate::triangulate;
use nalgebra::{Matrix3x4, Vector4};

/// Adjustments, at most: after each the positions that fit are chosen again.
const ROUNDS: usize = 8;

const FEWEST_PHOTOGRAPHS: usize = 2;

const FEWEST_POSITIONS: usize = 12;

/// Points of tracks with their positions in each image, those that do not fit left out.
#[derive(PartialEq)]
pub(super) struct Cloud {
    pub(super) points: Vec<Vector4<f64>>,
    pub(super) seen: Vec<Vec<Option<Point>>>,
}

/// Triangulates all tracks and adjusts cameras and points until the same positions fit; the last column is
/// the virtual view. Positions farther than `threshold` pixels from their point are taken as mistakes of the
/// tracker.
pub(super) fn adjust(cameras: &mut [Matrix3x4<f64>], tracks: &[Vec<Option<Point>>], threshold: f64) -> Cloud {
    let scales: Vec<Normalisation> =
        (0..cameras.len()).map(|i| Normalisation::of(tracks.iter().filter_map(|t| t[i].as_ref()))).collect();
    let mut cloud = intersect(cameras, &scales, tracks, threshold);
    for _ in 0..ROUNDS {
        let is_seen =
            |i: usize| cloud.seen.iter().filter(|seen| seen[i].is_some()).count() >= FEWEST_POSITIONS;
        if !(0..cameras.len()).all(is_seen) {
            return cloud;
        }
        let mut bundle = bundle(cameras, &cloud);
        if bundle.adjust(threshold).is_none() {
            return cloud;
        }
        cameras.copy_from_slice(&bundle.cameras);
        let next = intersect(cameras, &scales, tracks, threshold);
        let is_same = next.seen == cloud.seen;
        cloud = next;
        if is_same {
            break;
        }
    }
    cloud
}

fn bundle(cameras: &[Matrix3x4<f64>], cloud: &Cloud) -> Bundle {
    let of_point = |(point, seen): (usize, &Vec<Option<Point>>)| {
        let sight =
            |(camera, image): (usize, &Option<Point>)| Some(Observation { camera, point, image: (*image)? });
        seen.iter().enumerate().filter_map(sight).collect::<Vec<_>>()
    };
    let observations = cloud.seen.iter().enumerate().flat_map(of_point).collect();
    Bundle { cameras: cameras.to_vec(), points: cloud.points.clone(), observations }
}

/// The points of all tracks that at least two photographs show.
fn intersect(
    cameras: &[Matrix3x4<f64>],
    scales: &[Normalisation],
    tracks: &[Vec<Option<Point>>],
    threshold: f64,
) -> Cloud {
    let normal: Vec<Matrix3x4<f64>> = cameras.iter().zip(scales).map(|(c, t)| t.matrix() * c).collect();
    let mut cloud = Cloud { points: Vec::new(), seen: Vec::new() };
    for track in tracks {
        let mut seen = track.clone();
        if let Some(point) = consistent(&normal, scales, &mut seen, threshold) {
            cloud.points.push(point);
            cloud.seen.push(seen);
        }
    }
    cloud
}

/// The point of a track. The position that fits least is left out until all fit.
fn consistent(
    normal: &[Matrix3x4<f64>],
    scales: &[Normalisation],
    seen: &mut [Option<Point>],
    threshold: f64,
) -> Option<Vector4<f64>> {
    let photographs = seen.len() - 1;
    loop {
        if seen[..photographs].iter().flatten().count() < FEWEST_PHOTOGRAPHS {
            return None;
        }
        let observed: Vec<(usize, Point)> =
            seen.iter().enumerate().filter_map(|(i, p)| Some((i, scales[i].apply(&(*p)?)))).collect();
        let point = triangulate(&observed.iter().map(|(i, p)| (&normal[*i], *p)).collect::<Vec<_>>())?;
        let miss = |(i, p): &(usize, Point)| {
            let q = normal[*i] * point;
            (*i, (q.xy() / q.z - p).norm() / scales[*i].scale())
        };
        let worst = observed.iter().map(miss).max_by(|a, b| a.1.total_cmp(&b.1))?;
        if worst.1 <= threshold {
            return Some(point);
        }
        seen[worst.0] = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::uncalibrated::fundamental::tests::Synthetic;

    /// Cameras that are a little wrong come back, up to the frame: the points project to their images. A
    /// false position is left out.
    #[test]
    fn cameras_and_points_fit_all_images() {
        let scene = Synthetic::new(60, false);
        let mut tracks: Vec<Vec<Option<Point>>> =
            (0..60).map(|j| (0..3).map(|i| Some(scene.image(i, j))).collect()).collect();
        let mut cameras = scene.cameras.to_vec();
        cameras[1][(0, 3)] += 0.002 * cameras[1].norm() / 100.0;
        tracks[7][2] = Some(Point::new(5.0, 5.0));
        let cloud = adjust(&mut cameras, &tracks, 3.0);
        assert!(cloud.points.len() >= 59, "{}", cloud.points.len());
        let squares: Vec<f64> = cloud
            .points
            .iter()
            .zip(&cloud.seen)
            .flat_map(|(x, seen)| seen.iter().enumerate().filter_map(move |(i, p)| Some((x, i, (*p)?))))
            .map(|(x, i, p)| {
                let q = cameras[i] * x;
                (q.xy() / q.z - p).norm_squared()
            })
            .collect();
        let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        assert!(rms < 0.05, "{rms}");
        assert!(cloud.seen.iter().all(|seen| seen[2] != Some(Point::new(5.0, 5.0))));
    }
}
