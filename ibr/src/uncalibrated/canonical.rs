//! Weak calibration: a pair of projective cameras that has the given fundamental matrix.

use super::normalise::Normalisation;
use super::{GeometryError, Match, homogeneous};
use hybank_linalg::small;
use nalgebra::{Matrix3, Matrix3x4, Vector3};

/// Pi_1 = \[I | 0\] and Pi_2 = \[\[e'\]_x F + e' a^T | e'\] in normalised image coordinates.
///
/// a is chosen so that the plane homography \[e'\]_x F + e' a^T maps the matches best: with a = 0 the left
/// part of Pi_2 is singular and its pixels have no viewing rays.
#[derive(Debug, Clone, PartialEq)]
pub struct CanonicalPair {
    /// Normalisation of the first image.
    pub first: Normalisation,
    /// Normalisation of the second image.
    pub second: Normalisation,
    /// The cameras in normalised coordinates.
    pub cameras: [Matrix3x4<f64>; 2],
}

/// The canonical pair of F (in pixels) for the matches that agree with it.
///
/// # Errors
/// [`GeometryError::Numerical`] when the epipole or the plane cannot be computed.
pub fn canonical_pair(f: &Matrix3<f64>, matches: &[Match]) -> Result<CanonicalPair, GeometryError> {
    let first = Normalisation::of(matches.iter().map(|m| &m.first));
    let second = Normalisation::of(matches.iter().map(|m| &m.second));
    let f = second.inverse().transpose() * f * first.inverse();
    let f = f / f.norm();
    let (u, _, _) = small::svd3(&f).ok_or(GeometryError::Numerical { what: "epipole" })?;
    let epipole: Vector3<f64> = u.column(2).into_owned();
    let base = epipole.cross_matrix() * f;
    let a = best_plane(&base, &epipole, matches, &first, &second)
        .ok_or(GeometryError::Numerical { what: "reference plane" })?;
    let mut one = Matrix3x4::zeros();
    one.fixed_columns_mut::<3>(0).copy_from(&Matrix3::identity());
    let mut two = Matrix3x4::zeros();
    two.fixed_columns_mut::<3>(0).copy_from(&(base + epipole * a.transpose()));
    two.set_column(3, &epipole);
    Ok(CanonicalPair { first, second, cameras: [one, two] })
}

/// a minimising sum |x' x (B x + e' (a . x))|^2: three unknowns, two independent rows per match.
fn best_plane(
    base: &Matrix3<f64>,
    epipole: &Vector3<f64>,
    matches: &[Match],
    first: &Normalisation,
    second: &Normalisation,
) -> Option<Vector3<f64>> {
    let (mut rows, mut rhs) = (Vec::new(), Vec::new());
    for m in matches {
        let (x, y) = (homogeneous(&first.apply(&m.first)), homogeneous(&second.apply(&m.second)));
        let (fixed, along) = (y.cross(&(base * x)), y.cross(epipole));
        for k in 0..3 {
            rows.push([along[k] * x.x, along[k] * x.y, along[k] * x.z]);
            rhs.push(-fixed[k]);
        }
    }
    small::least_squares(&rows, &rhs)
}

#[cfg(test)]
mod tests {
    use super::super::fundamental::eight_point;
    use super::super::fundamental::tests::Synthetic;
    use super::*;

    #[test]
    fn the_pair_has_the_given_matrix_and_rays() {
        let matches = Synthetic::new(50, false).matches();
        let f = eight_point(&matches).unwrap();
        let pair = canonical_pair(&f, &matches).unwrap();
        let two = &pair.cameras[1];
        let (m, e): (Matrix3<f64>, Vector3<f64>) = (two.fixed_columns::<3>(0).into(), two.column(3).into());
        let back = pair.second.matrix().transpose() * (e.cross_matrix() * m) * pair.first.matrix();
        let back = back / back.norm();
        let sign = if back.dot(&f) < 0.0 { -1.0 } else { 1.0 };
        assert!((back * sign - f).norm() < 1e-9, "{back} {f}");
        assert!(m.determinant().abs() > 1e-3 * m.norm().powi(3), "{}", m.determinant());
    }
}
