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
const LEAST_REDUCTION: f64 = 0.95;

/// The power of two near to `x` on a logarithmic scale; 1 for zero, NaN and infinity. Halves and roots of
/// halves are common, so the border between two powers lies away from round numbers. Otherwise rounding,
/// and with it the time unit, would decide.
pub fn power_of_two(x: f64) -> f64 {
    if x > 0.0 && x.is_finite() { (x.log2() + 0.2).round().clamp(-1000.0, 1000.0).exp2() } else { 1.0 }
}

/// Matrices that together have the eigenvalues of `m`: the diagonal blocks of its block triangular form,
/// each balanced.
pub(super) fn balanced_blocks<T: ComplexField<RealField = f64>>(m: &DMatrix<T>) -> Vec<DMatrix<T>> {
    let block = |states: &Vec<usize>| {
        balanced(&DMatrix::from_fn(states.len(), states.len(), |i, j| m[(states[i], states[j])].clone()))
    };
    loops(m).iter().map(block).collect()
}

fn balanced<T: ComplexField<RealField = f64>>(m: &DMatrix<T>) -> DMatrix<T> {
    let scales = scales(m.map(|x| x.modulus()));
    let matrix = m.map_with_location(|i, j, x| x.scale(scales[j] / scales[i]));
    // Moduli at both ends of double precision may ask for scales beyond it.
    if matrix.iter().any(|x| !x.clone().is_finite()) { m.clone() } else { matrix }
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
    if column * factor + row / factor < LEAST_REDUCTION * (column + row) { factor } else { 1.0 }
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
