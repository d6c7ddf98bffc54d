//! How many aliases a band holds.

use super::spectra::Band;
use crate::linalg::hermitian_eigenvalues;

/// An eigenvalue counts as an alias if it exceeds the noise by this factor. Of bands of 16 bins and more the
/// largest eigenvalue of pure noise stays below four times the smallest quarter of all.
const ABOVE_NOISE: f64 = 10.0;

/// The number of occupied aliases of each band: eigenvalues above the noise and above `least` times the
/// largest. A band in which all N eigenvalues count is of no use, and so is one in which none does: 0 for
/// both.
pub(super) fn occupied(bands: &[Band], least: f64) -> Vec<usize> {
    let values: Vec<Vec<f64>> = bands.iter().map(descending).collect();
    let mut noise: Vec<f64> = values.iter().filter_map(|values| values.last().copied()).collect();
    noise.sort_by(f64::total_cmp);
    let floor = noise.get(noise.len() / 4).copied().unwrap_or(0.0).max(0.0);
    let count = |values: &Vec<f64>| {
        let limit = (ABOVE_NOISE * floor).max(least * values.first().copied().unwrap_or(0.0));
        let above = values.iter().filter(|&&value| value > limit).count();
        if above < values.len() { above } else { 0 }
    };
    values.iter().map(count).collect()
}

/// Eigenvalues, largest first; none if they cannot be computed.
pub(super) fn descending(band: &Band) -> Vec<f64> {
    let mut values = hermitian_eigenvalues(&band.matrix).unwrap_or_default();
    values.sort_by(|a, b| b.total_cmp(a));
    values
}
