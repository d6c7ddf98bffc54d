//! Small corrections of general cameras by photometric least squares over all views.
//!
//! Camera i takes the motion X + w_i x (X - C_i) + t_i before it projects. A point that view i shows by its
//! depth then moves in view j by J_j (w_j x (X - C_j) + t_j - w_i x (X - C_i) - t_i), with J_j the
//! derivative of the projection. The brightness that view j shows there must be that of view i. The
//! corrections are the least ones: what moves all cameras alike does not show.

use super::{BETTER, LEAST, Shown, Sighting, middle, slope, step_of, weighed};
use crate::camera::Camera;
use crate::depth::FAR;
use crate::image::Image;
use crate::propagate::Viewpoint;
use crate::scene::SourceView;
use crate::surfaces::DepthTest;
use nalgebra::{DMatrix, DVector, Matrix2x3, Matrix4, Rotation3, SVector, Vector3};
use rayon::prelude::*;

/// Other views with which each one is compared: the nearest.
const OTHERS: usize = 3;

const ROUNDS: usize = 6;

/// Parameters of a pair of cameras: turn and shift of each.
const PAIR: usize = 12;

/// Weight of the whole correction, as a share of what the photographs say of it.
const DAMPING: f64 = 1e-3;

type Pair = [usize; 2];

/// The cameras that the photographs fit better, and the displacement in pixels that they take out; `None`
/// where there is nothing to correct.
pub(super) fn refined(views: &[SourceView<Camera>]) -> Option<(Vec<Camera>, f64)> {
    let greys: Vec<Image> = views.par_iter().map(|view| view.image.to_grey()).collect();
    let pairs = pairs(views);
    let mut cameras: Vec<Camera> = views.iter().map(|view| view.camera).collect();
    let mut total = DVector::zeros(6 * views.len());
    let before = difference(views, &greys, &pairs, &cameras)?;
    for _ in 0..ROUNDS {
        let step = step(views, &greys, &pairs, &cameras, &total)?;
        total += &step;
        for (k, camera) in cameras.iter_mut().enumerate() {
            *camera = moved(camera, &step.fixed_rows::<6>(6 * k).into_owned())?;
        }
    }
    let after = difference(views, &greys, &pairs, &cameras)?;
    let displacement = displacement(views, &pairs, &cameras);
    (displacement >= LEAST && after < BETTER * before).then_some((cameras, displacement))
}

/// Each view with the nearest others.
fn pairs(views: &[SourceView<Camera>]) -> Vec<Pair> {
    let of = |view: usize| {
        let away = |other: &usize| views[*other].camera.distance(&views[view].camera);
        let mut others: Vec<usize> = (0..views.len()).filter(|other| away(other) > 0.0).collect();
        others.sort_by(|a, b| away(a).total_cmp(&away(b)));
        others.into_iter().take(OTHERS).map(move |other| [view, other]).collect::<Vec<_>>()
    };
    (0..views.len()).flat_map(of).collect()
}

/// What one view shows of points of another, with the derivatives by the motions of both; `None` if it is
/// too little.
fn sightings(
    views: &[SourceView<Camera>],
    greys: &[Image],
    [from, to]: Pair,
    cameras: &[Camera],
) -> Option<Vec<Sighting<PAIR>>> {
    let (view, other, step) = (&views[from], &views[to], step_of(&views[from].image));
    let (width, height) = view.image.size();
    let map = cameras[from].relative_to(&cameras[to]);
    let sighting = |(x, y): (usize, usize)| {
        let (p, depth) = (y * width + x, view.map.row(y)[x]);
        if view.map.is_guessed(p) || depth.is_nan() || depth >= FAR {
            return None;
        }
        let (u, v, there) = map.map(x as f64, y as f64, f64::from(depth));
        let q = other.image.pixel_at(u, v)?;
        let is_shown = !other.map.is_guessed(q)
            && DepthTest::are_one_point(there as f32, other.map.data()[q], &other.map);
        let values = [greys[from].data()[p], greys[to].value_at(u, v, 0)];
        let slope = slope(&greys[to], u, v);
        let point = cameras[from].unproject(x as f64, y as f64, f64::from(depth));
        let slopes = slopes(slope, &point, [u, v, there], &cameras[from], &cameras[to]);
        let is_finite = values[1].is_finite() && slopes.iter().all(|v| v.is_finite());
        Some((is_shown && is_finite).then_some(Sighting { values, slopes }))
    };
    let pixels = (0..height).step_by(step).flat_map(|y| (0..width).step_by(step).map(move |x| (x, y)));
    Shown::of(pixels.filter_map(sighting)).enough()
}

/// Change of the brightness in the second view by turn and shift of the first and of the second camera.
fn slopes(
    slope: [f64; 2],
    point: &Vector3<f64>,
    [u, v, depth]: [f64; 3],
    from: &Camera,
    to: &Camera,
) -> [f64; PAIR] {
    let m = to.m();
    let projection = Matrix2x3::from_fn(|i, k| (m[(i, k)] - [u, v][i] * m[(2, k)]) / depth);
    let of_point = (nalgebra::RowVector2::from(slope) * projection).transpose();
    // g . (w x a) = w . (a x g).
    let [first, second] = [from, to].map(|camera| (point - camera.centre()).cross(&of_point));
    std::array::from_fn(|k| match k {
        0..3 => -first[k],
        3..6 => -of_point[k - 3],
        6..9 => second[k - 6],
        _ => of_point[k - 9],
    })
}

/// The next step of all parameters; `total` are those so far.
fn step(
    views: &[SourceView<Camera>],
    greys: &[Image],
    pairs: &[Pair],
    cameras: &[Camera],
    total: &DVector<f64>,
) -> Option<DVector<f64>> {
    let count = total.len();
    let part = |pair: &Pair| {
        let (mut matrix, mut right) = (DMatrix::zeros(PAIR, PAIR), DVector::zeros(PAIR));
        if let Some(sightings) = sightings(views, greys, *pair, cameras) {
            let (differences, weights) = weighed(&sightings);
            for ((s, difference), weight) in sightings.iter().zip(differences).zip(weights) {
                let row = SVector::<f64, PAIR>::from(s.slopes);
                matrix += weight * row * row.transpose();
                right -= weight * difference * row;
            }
        }
        (matrix, right)
    };
    let parts: Vec<(DMatrix<f64>, DVector<f64>)> = pairs.par_iter().map(part).collect();
    let mut matrix = DMatrix::<f64>::zeros(count, count);
    let mut right = DVector::<f64>::zeros(count);
    for (pair, (own, side)) in pairs.iter().zip(&parts) {
        let at = |k: usize| 6 * pair[k / 6] + k % 6;
        for k in 0..PAIR {
            (0..PAIR).for_each(|l| matrix[(at(k), at(l))] += own[(k, l)]);
            right[at(k)] += side[k];
        }
    }
    for k in 0..count {
        let damping = DAMPING * matrix[(k, k)];
        matrix[(k, k)] += damping.max(f64::MIN_POSITIVE);
        right[k] -= damping * total[k];
    }
    Some(matrix.cholesky()?.solve(&right)).filter(|step| step.iter().all(|v| v.is_finite()))
}

/// A camera that takes a motion, turn and shift, before it projects.
fn moved(camera: &Camera, motion: &SVector<f64, 6>) -> Option<Camera> {
    let (turn, shift): (Vector3<f64>, Vector3<f64>) =
        (motion.fixed_rows::<3>(0).into_owned(), motion.fixed_rows::<3>(3).into_owned());
    let (rotation, centre) = (Rotation3::from_scaled_axis(turn), camera.centre());
    let mut whole = Matrix4::identity();
    whole.fixed_view_mut::<3, 3>(0, 0).copy_from(rotation.matrix());
    whole.fixed_view_mut::<3, 1>(0, 3).copy_from(&(centre - rotation * centre + shift));
    camera.with_matrix(camera.matrix() * whole)
}

/// The median difference between photographs, mean over the pairs.
fn difference(
    views: &[SourceView<Camera>],
    greys: &[Image],
    pairs: &[Pair],
    cameras: &[Camera],
) -> Option<f64> {
    let of_pair = |pair: &Pair| Some(middle(&weighed(&sightings(views, greys, *pair, cameras)?).0));
    let all: Vec<f64> = pairs.par_iter().filter_map(of_pair).collect();
    (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64)
}

/// Root mean square displacement of points in other views by new cameras, in pixels.
fn displacement(views: &[SourceView<Camera>], pairs: &[Pair], cameras: &[Camera]) -> f64 {
    let mut squares = Vec::new();
    for [from, to] in pairs {
        let map = &views[*from].map;
        let (width, step) = (map.width(), 4 * step_of(&views[*from].image));
        let ways =
            [views[*from].camera.relative_to(&views[*to].camera), cameras[*from].relative_to(&cameras[*to])];
        let known = map.data().iter().enumerate().filter(|(p, d)| {
            **d < FAR && (p % width).is_multiple_of(step) && (p / width).is_multiple_of(step)
        });
        for (p, depth) in known {
            let [(a, b, _), (c, d, _)] =
                ways.map(|way| way.map((p % width) as f64, (p / width) as f64, f64::from(*depth)));
            squares.extend(Some((c - a).powi(2) + (d - b).powi(2)).filter(|square| square.is_finite()));
        }
    }
    (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::{SyntheticScene, rig_camera};

    const SIZE: (usize, usize) = (160, 120);

    fn views(errors: [[f64; 6]; 3]) -> (Vec<SourceView<Camera>>, Vec<Camera>) {
        let right: Vec<Camera> =
            [0.0, 0.5, 1.0].map(|place| Camera::metric(rig_camera(place, SIZE), false).unwrap()).to_vec();
        let view = |(camera, error): (&Camera, [f64; 6])| {
            let (image, map) = SyntheticScene::default().view(camera, SIZE);
            SourceView { image, map, camera: moved(camera, &SVector::from(error)).unwrap() }
        };
        (right.iter().zip(errors).map(view).collect(), right)
    }

    /// Errors of several tenths of a pixel fall to a quarter; what is left is what photographs of 160 pixels
    /// show.
    #[test]
    fn errors_of_poses_are_taken_out() {
        let errors = [[0.004, -0.003, 0.0, 0.0, 0.0, 0.0], [0.0; 6], [-0.002, 0.004, 0.003, 0.0, 0.01, 0.0]];
        let (views, right) = views(errors);
        let pairs = pairs(&views);
        let wrong = displacement(&views, &pairs, &right);
        let (cameras, moved) = refined(&views).expect("a correction");
        let found: Vec<SourceView<Camera>> = views
            .iter()
            .zip(&cameras)
            .map(|(view, camera)| SourceView { camera: *camera, ..view.clone() })
            .collect();
        let left = displacement(&found, &pairs, &right);
        assert!(
            wrong > 0.4 && left < wrong / 4.0 && (moved / wrong - 1.0).abs() < 0.3,
            "{wrong} {left} {moved}"
        );
    }

    #[test]
    fn exact_cameras_stay() {
        assert!(refined(&views([[0.0; 6]; 3]).0).is_none());
        assert!(refined(&views([[0.0; 6]; 3]).0[..1]).is_none());
    }
}
