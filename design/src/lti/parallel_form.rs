//! Coordinates in which a recursion needs the fewest operations: parallel sections.

use super::gramian::{controllability_root, observability_root};
use super::{LtiError, StateSpace};
use hybank_linalg::{CMat, Complex, Mat};

/// Maximum condition number of the eigenvectors for parallel sections. Where sections cancel one another,
/// their rounding errors are magnified by up to this number.
const CONDITION_LIMIT: f64 = 1e4;

/// The system as parallel sections: `a` block-diagonal with a real pole alone, or a conjugate pair s + jw,
/// s - jw as [[s, w], [-w, s]], and exact zeros elsewhere. Pairs come first, each kind by falling modulus.
/// In each section the traces of the controllability and the observability Gramian are equal up to a power
/// of 16. So for white input no state is much larger or smaller than its effect on the output.
///
/// `None` if the eigenvectors are nearly dependent (repeated and close poles).
///
/// # Errors
/// [`LtiError`] if the system is not stable or its eigenvectors cannot be computed.
pub(crate) fn parallel_form(system: &StateSpace) -> Result<Option<StateSpace>, LtiError> {
    let modes = modes(system.a())?;
    // Complex poles of a real matrix come in pairs. If rounding has separated a pair, there is no real
    // basis.
    if modes.iter().map(Mode::order).sum::<usize>() != system.order() {
        return Ok(None);
    }
    let basis = basis(&modes, system.order());
    let condition = hybank_linalg::singular_values(&basis)?;
    if condition
        .first()
        .zip(condition.last())
        .is_some_and(|(most, least)| most.is_nan() || *most > CONDITION_LIMIT * least)
    {
        return Ok(None);
    }
    let (b, c) = (hybank_linalg::solve(&basis, system.b()), system.c() * basis);
    sections(&modes, b, c, system.d().clone()).map(Some)
}

/// A real pole, or the one of a conjugate pair above the real axis, with its eigenvector.
struct Mode {
    pole: Complex<f64>,
    vector: CMat,
}

impl Mode {
    /// States of its section.
    fn order(&self) -> usize {
        if self.pole.im == 0.0 { 1 } else { 2 }
    }
}

fn modes(a: &Mat) -> Result<Vec<Mode>, LtiError> {
    let (poles, vectors) = hybank_linalg::eigen(a)?;
    let upper = poles.iter().enumerate().filter(|(_, pole)| pole.im >= 0.0);
    let mode =
        |(k, &pole): (usize, &Complex<f64>)| Mode { pole, vector: CMat::from_columns(&[vectors.column(k)]) };
    let mut modes: Vec<Mode> = upper.map(mode).collect();
    modes.sort_by(|p, q| q.order().cmp(&p.order()).then(q.pole.norm().total_cmp(&p.pole.norm())));
    Ok(modes)
}

/// Real and imaginary parts of the eigenvectors, each turned so that the two are orthogonal, and scaled to
/// unit length together.
fn basis(modes: &[Mode], n: usize) -> Mat {
    let mut basis = Mat::zeros(n, n);
    let mut next = 0;
    for mode in modes {
        let square: Complex<f64> = mode.vector.iter().map(|v| v * v).sum();
        let turn = Complex::from_polar(1.0 / mode.vector.norm(), -0.5 * square.arg());
        for (i, entry) in mode.vector.iter().enumerate() {
            let parts = [(entry * turn).re, (entry * turn).im];
            basis.row_mut(i).columns_mut(next, mode.order()).copy_from_slice(&parts[..mode.order()]);
        }
        next += mode.order();
    }
    basis
}

fn sections(modes: &[Mode], mut b: Mat, mut c: Mat, d: Mat) -> Result<StateSpace, LtiError> {
    let n = b.nrows();
    let mut a = Mat::zeros(n, n);
    let mut first = 0;
    for mode in modes {
        let (order, Complex { re, im }) = (mode.order(), mode.pole);
        let block = Mat::from_row_slice(2, 2, &[re, im, -im, re]).view((0, 0), (order, order)).into_owned();
        let scale =
            equalising(&block, &b.rows(first, order).into_owned(), &c.columns(first, order).into_owned())?;
        b.rows_mut(first, order).scale_mut(1.0 / scale);
        c.columns_mut(first, order).scale_mut(scale);
        a.view_mut((first, first), (order, order)).copy_from(&block);
        first += order;
    }
    Ok(StateSpace::new(a, b, c, d))
}

/// The power of two by which to divide the states of a section for Gramians of equal trace.
fn equalising(a: &Mat, b: &Mat, c: &Mat) -> Result<f64, LtiError> {
    let ratio = (controllability_root(a, b)?.norm() / observability_root(a, c)?.norm()).sqrt();
    Ok(if ratio.is_normal() { ratio.log2().round().exp2() } else { 1.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn system(a: Mat) -> StateSpace {
        let n = a.nrows();
        let b = Mat::from_fn(n, 2, |i, j| 1.0 + ((i + 3 * j) as f64).sin());
        let c = Mat::from_fn(3, n, |i, j| ((2 * i + j) as f64).cos());
        StateSpace::new(a, b, c, Mat::from_fn(3, 2, |i, j| (i * 2 + j) as f64))
    }

    /// Largest difference of the responses, by LU at each frequency, relative to the larger one.
    fn gap(a: &StateSpace, b: &StateSpace) -> f64 {
        let at = |w: f64| {
            let z = Complex::from_polar(1.0, w);
            let (p, q) = (a.response_at(z), b.response_at(z));
            (&p - &q).norm() / p.norm()
        };
        (0..=40).map(|k| at(f64::from(k) * std::f64::consts::PI / 40.0)).fold(0.0, f64::max)
    }

    /// `blocks` rotated by a fixed well-conditioned change of coordinates.
    fn hidden(blocks: &Mat) -> Mat {
        let n = blocks.nrows();
        let t = Mat::from_fn(n, n, |i, j| f64::from(u8::from(i == j)) * 2.0 + ((i * n + j) as f64).sin());
        &t * blocks * hybank_linalg::inverse(&t)
    }

    fn is_parallel(a: &Mat) -> bool {
        let n = a.nrows();
        let mut i = 0;
        let mut all = true;
        while i < n {
            let pair = i + 1 < n && a[(i, i + 1)] != 0.0;
            all &= !pair || (a[(i, i)] == a[(i + 1, i + 1)] && a[(i, i + 1)] == -a[(i + 1, i)]);
            let size = 1 + usize::from(pair);
            let outside = |j: &usize| !(i..i + size).contains(j);
            all &= (i..i + size).all(|row| (0..n).filter(outside).all(|j| a[(row, j)] == 0.0));
            i += size;
        }
        all
    }

    #[test]
    fn distinct_poles_become_sections() {
        for n in 1..14 {
            let raw = Mat::from_fn(n, n, |i, j| ((i * 37 + j * 11 + 5 * n) as f64).sin());
            let given = system(&raw * (0.97 / hybank_linalg::spectral_radius(&raw).unwrap()));
            let made = parallel_form(&given).unwrap().unwrap();
            assert!(is_parallel(made.a()), "{}", made.a());
            assert!(gap(&given, &made) < 1e-12, "{n}: {:e}", gap(&given, &made));
        }
    }

    #[test]
    fn poles_from_fast_to_slow_keep_their_digits() {
        let moduli = [1.0 - 1e-9, 0.999, 0.5, -0.7, 1e-3, -1e-6, 1e-12];
        let given = system(hidden(&Mat::from_diagonal(&nalgebra::DVector::from_row_slice(&moduli))));
        let made = parallel_form(&given).unwrap().unwrap();
        assert!(is_parallel(made.a()) && gap(&given, &made) < 1e-6, "{:e}", gap(&given, &made));
        let off_dc = |z: Complex<f64>| (given.response_at(z) - made.response_at(z)).norm();
        assert!(off_dc(Complex::new(0.0, 1.0)) < 1e-12, "only the pole at one magnifies rounding");
    }

    #[test]
    fn sections_are_equally_large_on_both_sides() {
        let a = Mat::from_row_slice(3, 3, &[0.5, 0.8, 0.0, -0.8, 0.5, 0.0, 0.0, 0.0, 0.3]);
        let b = Mat::from_column_slice(3, 1, &[1e30, 1e30, 1e-40]);
        let c = Mat::from_row_slice(1, 3, &[1e-25, 0.0, 1e40]);
        let made = parallel_form(&StateSpace::new(a, b, c, Mat::zeros(1, 1))).unwrap().unwrap();
        for (first, size) in [(0, 2), (2, 1)] {
            let a = made.a().view((first, first), (size, size)).into_owned();
            let p = controllability_root(&a, &made.b().rows(first, size).into_owned()).unwrap().norm();
            let c = made.c().columns(first, size).transpose();
            let q = controllability_root(&a.transpose(), &c).unwrap().norm();
            assert!((0.49..=2.05).contains(&(p / q)), "{p} {q}");
        }
    }

    #[test]
    fn repeated_poles_are_no_sections() {
        // Jordan blocks: real, nearly (a split of 1e-9), and a pair twice.
        let jordan = |n: usize, pole: f64, split: f64| {
            Mat::from_fn(n, n, |i, j| match () {
                () if i == j => pole + i as f64 * split,
                () if j == i + 1 => 1.0,
                () => 0.0,
            })
        };
        let pair = [0.6, 0.5, 1.0, 0.0, -0.5, 0.6, 0.0, 1.0, 0.0, 0.0, 0.6, 0.5, 0.0, 0.0, -0.5, 0.6];
        for blocks in [
            jordan(2, 0.5, 0.0),
            jordan(4, 0.8, 0.0),
            jordan(3, -0.7, 1e-9),
            Mat::from_row_slice(4, 4, &pair),
        ] {
            let given = system(hidden(&blocks));
            assert_eq!(parallel_form(&given).unwrap(), None, "{blocks}");
        }
    }

    #[test]
    fn equal_poles_with_eigenvectors_of_their_own_stay_right() {
        let given = system(Mat::from_diagonal_element(5, 5, 0.75));
        let made = parallel_form(&given).unwrap().unwrap();
        assert!(is_parallel(made.a()) && gap(&given, &made) < 1e-14);
    }

    /// A single delay is a section. The eigenvectors of a longer delay line are all the same one.
    #[test]
    fn delay_lines_are_no_sections() {
        for n in 1..18 {
            let given = system(Mat::from_fn(n, n, |i, j| f64::from(u8::from(i == j + 1))));
            assert_eq!(parallel_form(&given).unwrap().is_some(), n == 1, "{n}");
        }
    }

    #[test]
    fn no_state_is_no_trouble() {
        let empty = StateSpace::new(Mat::zeros(0, 0), Mat::zeros(0, 2), Mat::zeros(3, 0), Mat::zeros(3, 2));
        assert_eq!(parallel_form(&empty).unwrap(), Some(empty.clone()));
    }
}
