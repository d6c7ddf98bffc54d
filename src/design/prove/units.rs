//! Units for the search for a certificate. They make the search independent of the gains of the front ends.
//!
//! With xi = T eta, T diagonal, and e counted in units of s, a P that proves ||K|| <= gamma for [A, J; C,
//! L] is T Q T' where Q proves ||K|| / s <= gamma / s for [T^-1 A T, T^-1 J; C T / s, L / s].

use crate::linalg::{Mat, power_of_two};
use crate::lti::LtiError;
use crate::lti::gramian::controllability_root;
use crate::verify::Midpoint;

/// Units of states and references. They are powers of two, so that a change of units rounds nothing.
pub(super) struct Units {
    pub(super) states: Vec<f64>,
    /// Unit of the reference samples, and so of gamma.
    pub(super) reference: f64,
}

impl Units {
    /// Units near the standard deviations of the states and near the size `scale` of the reference samples.
    ///
    /// # Errors
    /// [`LtiError::IterationLimit`] if the system is not stable.
    pub(super) fn of(system: &Midpoint, scale: f64) -> Result<Self, LtiError> {
        let root = controllability_root(&system.a, &system.b)?;
        let states = root.row_iter().map(|row| power_of_two(row.norm())).collect();
        Ok(Self { states, reference: power_of_two(scale) })
    }

    /// The system in these units.
    pub(super) fn of_one(&self, system: &Midpoint) -> Midpoint {
        let entry = |m: &Mat, row: &dyn Fn(usize) -> f64, column: &dyn Fn(usize) -> f64| {
            Mat::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] / row(i) * column(j))
        };
        let (state, reference, input) =
            (|i: usize| self.states[i], |_: usize| self.reference, |_: usize| 1.0);
        Midpoint {
            a: entry(&system.a, &state, &state),
            b: entry(&system.b, &state, &input),
            c: entry(&system.c, &reference, &state),
            d: entry(&system.d, &reference, &input),
        }
    }

    /// Converts rows of R from these units to those of the file.
    pub(super) fn factor(&self, rows: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        let scaled = |(row, unit): (Vec<f64>, &f64)| row.into_iter().map(|x| x * unit).collect();
        rows.into_iter().zip(&self.states).map(scaled).collect()
    }
}
