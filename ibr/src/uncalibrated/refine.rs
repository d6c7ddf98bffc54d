//! What refinements of cameras and points have in common: the derivatives of an image, and the descent.

use super::Point;
use nalgebra::{Matrix3x4, SMatrix, Vector4};

const STEPS: usize = 100;
/// The cost has converged when a step lowers it by less than this share.
const CONVERGED: f64 = 1e-10;
/// Mean cost that rounding leaves, square pixels.
const EXACT: f64 = 1e-22;
/// First, least and largest damping, as a share of the diagonal.
const DAMPING: (f64, f64, f64) = (1e-4, 1e-12, 1e8);

/// Levenberg and Marquardt: damped steps while they lower a mean cost, and whether none does any more.
/// `None` if the start has no cost.
pub(super) fn descend<T>(
    start: T,
    cost: impl Fn(&T) -> Option<f64>,
    moved: impl Fn(&T, f64) -> Option<T>,
) -> Option<(T, bool)> {
    let (mut least, mut found) = (cost(&start)?, start);
    let mut damping = DAMPING.0;
    for _ in 0..STEPS {
        let next = moved(&found, damping).and_then(|next| Some((cost(&next)?, next)));
        match next.filter(|(cost, _)| *cost < least) {
            Some((cost, next)) => {
                let converged = least - cost < CONVERGED * least || cost < EXACT;
                (found, least, damping) = (next, cost, (0.1 * damping).max(DAMPING.1));
                if converged {
                    return Some((found, true));
                }
            }
            None if damping > DAMPING.2 => return Some((found, true)),
            None => damping *= 10.0,
        }
    }
    Some((found, false))
}

/// How far a point is seen from its image, and the derivatives of the image by the camera, row by row, and
/// by the point; not finite in the focal plane.
pub(super) fn reprojection(
    camera: &Matrix3x4<f64>,
    point: &Vector4<f64>,
    seen: &Point,
) -> (Point, SMatrix<f64, 2, 12>, SMatrix<f64, 2, 4>) {
    let p = camera * point;
    let at = p.xy() / p.z;
    let by_camera = SMatrix::from_fn(|r, k| match k {
        8.. => -at[r] * point[k - 8] / p.z,
        _ if k / 4 == r => point[k % 4] / p.z,
        _ => 0.0,
    });
    let by_point = SMatrix::from_fn(|r, c| (camera[(r, c)] - at[r] * camera[(2, c)]) / p.z);
    (seen - at, by_camera, by_point)
}
