//! Preconditioning for eigenvalue routines: permutation to block triangular form, then diagonal balancing
//! of each block.
//!
//! The error of a backward stable routine is relative to the norm of the matrix. If states have units that
//! differ by many decades, or one part drives another through a large gain, that norm may be far larger
//! than the eigenvalues. Both steps keep the eigenvalues exactly: block triangular form by a permutation,
//! and a diagonal similarity by powers of two (Osborne 1960; Parlett and Reinsch 1969).

use super::Mat;
use nalgebra::{ComplexField, DMatrix};

/// Bits of a word of a set.
const WORD: usize = u64::BITS as usize;
/// Sweeps over the rows of a matrix before [`scales`] gives up improving it.
const MAX_SWEEPS: usize = 100;
/// A factor is used only if it reduces the sum of a row and its column below this fraction.
const WORTHWHILE: f64 = 0.95;

/// The power of two near to `x` on a logarithmic scale; 1 for zero, NaN and infinity. Halves and roots of
/// halves are common, so the border between two powers lies away from round numbers. Otherwise rounding,
/// and with it the time unit, would decide.
pub fn power_of_two(x: f64) -> f64 {
    if x > 0.0 && x.is_finite() { (x.log2() + 0.2).round().clamp(-1000.0, 1000.0).exp2() } else { 1.0 }
}

/// A balanced diagonal block.
pub(super) struct Balanced<T> {
    pub(super) matrix: DMatrix<T>,
    /// The largest scale over the smallest: the condition of the change of coordinates.
    pub(super) condition: f64,
}

/// Matrices that together have the eigenvalues of `m`: the diagonal blocks of its block triangular form,
/// each balanced.
pub(super) fn balanced_blocks<T: ComplexField<RealField = f64>>(m: &DMatrix<T>) -> Vec<Balanced<T>> {
    let block = |states: &Vec<usize>| {
        balanced(&DMatrix::from_fn(states.len(), states.len(), |i, j| m[(states[i], states[j])].clone()))
    };
    loops(m).iter().map(block).collect()
}

fn balanced<T: ComplexField<RealField = f64>>(m: &DMatrix<T>) -> Balanced<T> {
    let scales = scales(m.map(|x| x.modulus()));
    let matrix = m.map_with_location(|i, j, x| x.scale(scales[j] / scales[i]));
    // Moduli at both ends of double precision may ask for scales beyond it.
    if matrix.iter().any(|x| !x.clone().is_finite()) {
        return Balanced { matrix: m.clone(), condition: 1.0 };
    }
    let (least, most) = scales.iter().fold((f64::INFINITY, 0.0f64), |(a, b), &x| (a.min(x), b.max(x)));
    Balanced { matrix, condition: most / least }
}

/// The states in groups that drive one another in a loop: the strongly connected components of the graph in
/// which state j drives state i where m[i, j] is not zero. In this order a permuted `m` is block triangular
/// up to the order of the groups.
fn loops<T: ComplexField>(m: &DMatrix<T>) -> Vec<Vec<usize>> {
    let n = m.nrows();
    let drivers = drivers(m);
    let drives = |j: usize, i: usize| drivers[i][j / WORD] >> (j % WORD) & 1 == 1;
    let mut grouped = vec![false; n];
    let mut groups = Vec::new();
    for i in 0..n {
        if !grouped[i] {
            let group: Vec<usize> = (i..n).filter(|&j| j == i || drives(i, j) && drives(j, i)).collect();
            group.iter().for_each(|&j| grouped[j] = true);
            groups.push(group);
        }
    }
    groups
}

/// For each state the set of states that drive it, directly or through others, as bits (Warshall 1962).
fn drivers<T: ComplexField>(m: &DMatrix<T>) -> Vec<Vec<u64>> {
    let n = m.nrows();
    let mut sets = vec![vec![0u64; n.div_ceil(WORD)]; n];
    for (j, column) in m.column_iter().enumerate() {
        for (set, _) in sets.iter_mut().zip(&column).filter(|(_, x)| !x.is_zero()) {
            set[j / WORD] |= 1 << (j % WORD);
        }
    }
    for k in 0..n {
        let through = sets[k].clone();
        for set in sets.iter_mut().filter(|set| set[k / WORD] >> (k % WORD) & 1 == 1) {
            set.iter_mut().zip(&through).for_each(|(word, more)| *word |= more);
        }
    }
    sets
}

/// The diagonal D of powers of two for which off-diagonal rows and columns of the same index of D^-1 m D
/// are alike in 1-norm, of a matrix `m` of moduli.
///
/// nalgebra's `balance_parlett_reinsch` does the same in the 2-norm, but it rounds scales at powers of two
/// and knows no bound on its sweeps.
pub(super) fn scales(mut m: Mat) -> Vec<f64> {
    let mut scales = vec![1.0; m.nrows()];
    for _ in 0..MAX_SWEEPS {
        let mut changed = false;
        for (i, scale) in scales.iter_mut().enumerate() {
            let factor = equalising(&m, i);
            if factor != 1.0 {
                changed = true;
                m.column_mut(i).scale_mut(factor);
                m.row_mut(i).scale_mut(1.0 / factor);
                *scale *= factor;
            }
        }
        if !changed {
            break;
        }
    }
    scales
}

/// The factor for column `i`, and its inverse for row `i`, that makes both alike; 1 if it would gain almost
/// nothing.
fn equalising(m: &Mat, i: usize) -> f64 {
    let off_diagonal = |k: &usize| *k != i;
    let row: f64 = (0..m.ncols()).filter(off_diagonal).map(|k| m[(i, k)]).sum();
    let column: f64 = (0..m.nrows()).filter(off_diagonal).map(|k| m[(k, i)]).sum();
    let factor = if column > 0.0 { power_of_two((row / column).sqrt()) } else { 1.0 };
    if column * factor + row / factor < WORTHWHILE * (column + row) { factor } else { 1.0 }
}

/// Powers of two by which to divide the states of x+ = a x + b u, y = c x, so that the gains into each
/// state and out of it are alike. Of b and c only the proportions count: their sizes change with the units
/// of u and y, which must not affect the scaling of a.
pub fn state_scales(a: &Mat, b: &Mat, c: &Mat) -> Vec<f64> {
    let n = a.nrows();
    let share = |part: f64, whole: f64| if part > 0.0 { part / whole } else { 0.0 };
    let (all_in, all_out) = (b.norm(), c.norm());
    // All inputs are one state that drives, all outputs one that is driven.
    let mut joint = Mat::zeros(n + 2, n + 2);
    joint.view_mut((0, 0), (n, n)).copy_from(&a.abs());
    for i in 0..n {
        joint[(i, n)] = share(b.row(i).norm(), all_in);
        joint[(n + 1, i)] = share(c.column(i).norm(), all_out);
    }
    let mut scales = scales(joint);
    scales.truncate(n);
    scales
}

#[cfg(test)]
mod tests {
    use crate::{Complex, Mat, eigenvalues, eigenvalues_c, spectral_radius, to_complex};

    /// A delay line of `n` states, driven with `gain` by a stable pair of states.
    fn driven_line(n: usize, gain: f64) -> Mat {
        let mut m = Mat::zeros(n + 2, n + 2);
        m.view_mut((0, 0), (2, 2)).copy_from_slice(&[0.6, 0.4, -0.5, 0.6]);
        (m[(2, 0)], m[(2, 1)]) = (gain, 0.3 * gain);
        (3..n + 2).for_each(|i| m[(i, i - 1)] = 1.0);
        m
    }

    #[test]
    fn a_gain_between_parts_does_not_move_the_eigenvalues() {
        let radius = (0.36f64 + 0.2).sqrt();
        for gain in [1e-300, 1e-9, 1.0, 1e9, 1e18, 1e300] {
            for n in [1, 2, 9, 40] {
                let m = driven_line(n, gain);
                let found = spectral_radius(&m).unwrap();
                assert!((found - radius).abs() < 1e-14, "{n} states after a gain of {gain:e}: {found}");
                // The other way round, and complex.
                let found = spectral_radius(&m.transpose()).unwrap();
                assert!((found - radius).abs() < 1e-14, "{n} states before {gain:e}: {found}");
                let values = eigenvalues_c(&to_complex(&m)).unwrap();
                assert_eq!(values.iter().filter(|z| z.norm() == 0.0).count(), n);
            }
        }
    }

    #[test]
    fn units_of_the_states_do_not_move_the_eigenvalues() {
        // (x - 0.9)(x - 0.5)(x + 0.7) as a companion matrix, in units that differ by 24 decades.
        let m = Mat::from_row_slice(3, 3, &[0.7, 0.53, -0.315, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        let units = [1e12, 1.0, 1e-12];
        let scaled = Mat::from_fn(3, 3, |i, j| m[(i, j)] * units[i] / units[j]);
        let mut found: Vec<Complex<f64>> = eigenvalues(&scaled).unwrap();
        found.sort_by(|a, b| a.re.total_cmp(&b.re));
        for (z, want) in found.iter().zip([-0.7, 0.5, 0.9]) {
            assert!((z - Complex::new(want, 0.0)).norm() < 1e-14, "{z} is {want}");
        }
    }

    #[test]
    fn loops_that_drive_one_another_are_blocks_of_their_own() {
        // Two rotations, the one driving the other with 1e12: no state is free of loops, but the two parts
        // are.
        let mut m = Mat::zeros(4, 4);
        for (at, angle) in [(0, 0.3f64), (2, 1.1)] {
            let (s, c) = angle.sin_cos();
            m.view_mut((at, at), (2, 2)).copy_from_slice(&[0.9 * c, 0.9 * s, -0.9 * s, 0.9 * c]);
        }
        m[(2, 1)] = 1e12;
        for z in eigenvalues(&m).unwrap() {
            assert!((z.norm() - 0.9).abs() < 1e-13, "{z}");
        }
    }

    #[test]
    fn long_loops_are_scaled_too() {
        // x^n = a^n; the first loop drives the second one, which is in other units.
        let n = 30;
        let mut m = Mat::zeros(2 * n, 2 * n);
        for (start, a) in [(0, 0.9), (n, 0.6)] {
            (0..n).for_each(|i| m[(start + i, start + (i + n - 1) % n)] = a);
        }
        m[(n, n - 1)] = 1e9;
        // The larger state drives with its inverse.
        m.row_mut(n + 7).scale_mut(1e12);
        m.column_mut(n + 7).scale_mut(1e-12);
        let values = eigenvalues(&m).unwrap();
        let count = |a: f64| values.iter().filter(|z| (z.norm() - a).abs() < 1e-13).count();
        assert_eq!((count(0.9), count(0.6)), (n, n), "{values:?}");
    }

    #[test]
    fn gains_at_the_ends_of_double_precision_do_no_harm() {
        let mut m = Mat::zeros(10, 10);
        for at in (0..10).step_by(2) {
            m.view_mut((at, at), (2, 2)).copy_from_slice(&[0.0, 1e-100, -1e-110, 0.0]);
        }
        (1..9).step_by(2).for_each(|i| m[(i + 1, i)] = 1e300);
        for z in eigenvalues(&m).unwrap() {
            assert!((z.norm() / 1e-105 - 1.0).abs() < 1e-12, "{z}");
        }
    }

    #[test]
    fn the_trace_is_kept_on_dense_and_diagonal_matrices() {
        let dense = Mat::from_fn(7, 7, |i, j| (1.3 * (i * 7 + j) as f64).sin());
        let diagonal = Mat::from_fn(5, 5, |i, j| if i == j { i as f64 - 2.0 } else { 0.0 });
        for m in [dense, diagonal, Mat::zeros(3, 3), Mat::zeros(0, 0)] {
            let sum: Complex<f64> = eigenvalues(&m).unwrap().iter().sum();
            assert!((sum - Complex::new(m.trace(), 0.0)).norm() < 1e-13);
            assert_eq!(eigenvalues(&m).unwrap().len(), m.nrows());
        }
    }
}
