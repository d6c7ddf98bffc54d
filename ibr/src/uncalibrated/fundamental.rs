//! The fundamental matrix: normalised eight-point algorithm within RANSAC.
//!
//! R. Hartley, A. Zisserman, "Multiple View Geometry in Computer Vision", 2nd ed., chapter 11.

use super::normalise::Normalisation;
use super::random::consensus;
use super::{EPIPOLAR, GeometryError, Match, homogeneous};
use hybank_linalg::small;
use nalgebra::Matrix3;

/// Below this ratio of the second smallest to the largest singular value the matches do not determine F.
const DEGENERATE: f64 = 1e-7;
/// Share of the matches that a homography may explain before the scene counts as planar.
const PLANAR_SHARE: f64 = 0.95;
/// Rounds of refitting on the inliers.
const ROUNDS: usize = 5;

/// F with x'^T F x = 0, and the matches that agree with it.
#[derive(Debug, Clone, PartialEq)]
pub struct Fundamental {
    /// The matrix, of rank two and unit norm.
    pub matrix: Matrix3<f64>,
    /// Indices of the matches within the threshold, increasing.
    pub inliers: Vec<usize>,
    /// Root mean square Sampson distance of the inliers in pixels.
    pub rms: f64,
}

/// Square of the Sampson distance of a match from F, in square pixels.
pub fn sampson(f: &Matrix3<f64>, m: &Match) -> f64 {
    let (x, y) = (homogeneous(&m.first), homogeneous(&m.second));
    let (fx, fty) = (f * x, f.tr_mul(&y));
    let slope = fx.xy().norm_squared() + fty.xy().norm_squared();
    y.dot(&fx).powi(2) / slope
}

/// F of all the matches by the normalised eight-point algorithm.
///
/// # Errors
/// [`GeometryError::TooFew`] below 8 matches, [`GeometryError::Degenerate`] when they leave F undetermined.
pub fn eight_point(matches: &[Match]) -> Result<Matrix3<f64>, GeometryError> {
    if matches.len() < 8 {
        return Err(GeometryError::TooFew { what: "matches", found: matches.len(), needed: 8 });
    }
    let (s, t) = normalisations(matches);
    let row = |m: &Match| {
        let (a, b) = (s.apply(&m.first), t.apply(&m.second));
        [b.x * a.x, b.x * a.y, b.x, b.y * a.x, b.y * a.y, b.y, a.x, a.y, 1.0]
    };
    let rows: Vec<[f64; 9]> = matches.iter().map(row).collect();
    let failed = || GeometryError::Numerical { what: "fundamental matrix" };
    let (f, values) = small::least_vector(&rows).ok_or_else(failed)?;
    let ratio = values[7] / values[0];
    if ratio < DEGENERATE {
        return Err(GeometryError::Degenerate { what: "fundamental matrix", ratio });
    }
    let f = Matrix3::from_row_slice(f.as_slice());
    let (u, mut sigma, v) = small::svd3(&f).ok_or_else(failed)?;
    sigma[2] = 0.0;
    let f = t.matrix().transpose() * u * Matrix3::from_diagonal(&sigma.into()) * v.transpose() * s.matrix();
    Ok(f / f.norm())
}

fn normalisations(matches: &[Match]) -> (Normalisation, Normalisation) {
    let first = Normalisation::of(matches.iter().map(|m| &m.first));
    (first, Normalisation::of(matches.iter().map(|m| &m.second)))
}

fn inliers(f: &Matrix3<f64>, matches: &[Match]) -> Vec<usize> {
    (0..matches.len()).filter(|i| sampson(f, &matches[*i]) < EPIPOLAR * EPIPOLAR).collect()
}

fn chosen(matches: &[Match], indices: &[usize]) -> Vec<Match> {
    indices.iter().map(|i| matches[*i]).collect()
}

/// F by RANSAC over samples of eight, refitted on the inliers until their set is stable; the same seed gives
/// the same bits.
///
/// # Errors
/// [`GeometryError`]: fewer than 8 matches or inliers, planar matches.
pub fn robust(matches: &[Match], seed: u64) -> Result<Fundamental, GeometryError> {
    if matches.len() < 8 {
        return Err(GeometryError::TooFew { what: "matches", found: matches.len(), needed: 8 });
    }
    let best = consensus::<8>(matches.len(), seed, |sample| {
        Some(inliers(&eight_point(&chosen(matches, &sample)).ok()?, matches))
    });
    if best.len() < 8 {
        refuse_planes(matches)?;
        let (what, inliers, matches) = ("fundamental matrix", best.len(), matches.len());
        return Err(GeometryError::NoConsensus { what, inliers, matches, threshold: EPIPOLAR });
    }
    refuse_planes(&chosen(matches, &best))?;
    refit(matches, best)
}

fn refit(matches: &[Match], mut set: Vec<usize>) -> Result<Fundamental, GeometryError> {
    let mut matrix = eight_point(&chosen(matches, &set))?;
    for _ in 0..ROUNDS {
        let next = inliers(&matrix, matches);
        if next == set || next.len() < 8 {
            break;
        }
        set = next;
        matrix = eight_point(&chosen(matches, &set))?;
    }
    let squares: f64 = set.iter().map(|i| sampson(&matrix, &matches[*i])).sum();
    let rms = (squares / set.len() as f64).sqrt();
    Ok(Fundamental { matrix, inliers: set, rms })
}

/// Refuses matches that one homography explains: a planar scene, or a camera that only rotated.
fn refuse_planes(matches: &[Match]) -> Result<(), GeometryError> {
    let Some(h) = homography(matches) else { return Ok(()) };
    let explained = matches.iter().filter(|m| transfer(&h, m) < EPIPOLAR * EPIPOLAR).count();
    if explained as f64 >= PLANAR_SHARE * matches.len() as f64 {
        return Err(GeometryError::Planar { explained, matches: matches.len() });
    }
    Ok(())
}

fn transfer(h: &Matrix3<f64>, m: &Match) -> f64 {
    let p = h * homogeneous(&m.first);
    (p.xy() / p.z - m.second).norm_squared()
}

/// The homography that maps all first points to the second ones best, by the normalised DLT.
fn homography(matches: &[Match]) -> Option<Matrix3<f64>> {
    let (s, t) = normalisations(matches);
    let rows = matches.iter().flat_map(|m| {
        let (a, b) = (s.apply(&m.first), t.apply(&m.second));
        [
            [a.x, a.y, 1.0, 0.0, 0.0, 0.0, -b.x * a.x, -b.x * a.y, -b.x],
            [0.0, 0.0, 0.0, a.x, a.y, 1.0, -b.y * a.x, -b.y * a.y, -b.y],
        ]
    });
    let (h, _) = small::least_vector(&rows.collect::<Vec<_>>())?;
    Some(t.inverse() * Matrix3::from_row_slice(h.as_slice()) * s.matrix())
}

#[cfg(test)]
pub(crate) mod tests;
