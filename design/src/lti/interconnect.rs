//! Interconnections of systems.
//!
//! The elementary systems ([`StateSpace::gain`], [`StateSpace::delays`], [`StateSpace::delay_line`],
//! [`StateSpace::fir`]) and their connections. States of the first operand come first. Nothing is reduced:
//! states that cancel stay, and each entry of the result is an entry of an operand or one product of two of
//! them, so that no digits are lost. Systems whose numbers of inputs and outputs do not fit each other are a
//! fault of the caller, and end in a panic.

use super::StateSpace;
use hybank_linalg::Mat;
use nalgebra::DVector;
use std::ops::Range;

impl StateSpace {
    /// The static system y = `d` u, without states.
    pub(crate) fn gain(d: Mat) -> Self {
        let (p, m) = d.shape();
        Self { a: Mat::zeros(0, 0), b: Mat::zeros(0, m), c: Mat::zeros(p, 0), d }
    }

    /// `diag(z^-k_1, z^-k_2, ..)`: output i is input i, `steps[i]` steps later. The states of a delay are
    /// ordered from the newest sample to the oldest.
    pub(crate) fn delays(steps: &[usize]) -> Self {
        let shift = |n: usize| Mat::from_fn(n, n, |i, j| f64::from(u8::from(i == j + 1)));
        let first = |n: usize| Mat::from_fn(n, 1, |i, _| f64::from(u8::from(i == 0)));
        let last = |n: usize| Mat::from_fn(1, n, |_, j| f64::from(u8::from(j + 1 == n)));
        let direct = |i: usize, j: usize| f64::from(u8::from(i == j && steps[i] == 0));
        Self {
            a: diagonal(steps, shift),
            b: diagonal(steps, first),
            c: diagonal(steps, last),
            d: Mat::from_fn(steps.len(), steps.len(), direct),
        }
    }

    /// The present and the past `steps` samples of `width` inputs u: `[u[k - steps]; ..; u[k - 1]; u[k]]`.
    /// The states are the past inputs, the oldest first.
    pub(crate) fn delay_line(width: usize, steps: usize) -> Self {
        let order = width * steps;
        let ahead = |i: usize, j: usize| f64::from(u8::from(j == i + width));
        Self {
            a: Mat::from_fn(order, order, ahead),
            b: Mat::from_fn(order, width, |i, j| ahead(i, order + j)),
            c: Mat::identity(order + width, order),
            d: Mat::from_fn(order + width, width, |i, j| f64::from(u8::from(i == order + j))),
        }
    }

    /// `next`, which has an input for each output, driven by this system: the transfer function
    /// `N(z) G(z)`.
    pub(crate) fn series(&self, next: &Self) -> Self {
        Self {
            a: hybank_linalg::from_blocks(&[
                &[&self.a, &Mat::zeros(self.order(), next.order())],
                &[&(&next.b * &self.c), &next.a],
            ]),
            b: hybank_linalg::vstack(&[&self.b, &(&next.b * &self.d)]),
            c: hybank_linalg::hstack(&[&(&next.d * &self.c), &next.c]),
            d: &next.d * &self.d,
        }
    }

    /// `[G; N G_o]`: this system with all its outputs, and below them those of `next`, which the given
    /// `outputs` o drive. Both use the same state of this system, which the result contains once.
    pub(crate) fn cascade(&self, outputs: Range<usize>, next: &Self) -> Self {
        let driven = self.select_outputs(outputs).series(next);
        let unread = Mat::zeros(self.outputs(), next.order());
        Self {
            c: hybank_linalg::from_blocks(&[&[&self.c, &unread], &[&driven.c]]),
            d: hybank_linalg::vstack(&[&self.d, &driven.d]),
            ..driven
        }
    }

    /// `T G`: each output a combination of the former ones.
    pub(crate) fn map_outputs(&self, gain: &Mat) -> Self {
        Self { a: self.a.clone(), b: self.b.clone(), c: gain * &self.c, d: gain * &self.d }
    }

    /// `G T`: each input a combination of new ones.
    pub(crate) fn map_inputs(&self, gain: &Mat) -> Self {
        Self { a: self.a.clone(), b: &self.b * gain, c: self.c.clone(), d: &self.d * gain }
    }

    /// `G diag(gains)`.
    pub(crate) fn scale_inputs(&self, gains: &[f64]) -> Self {
        self.map_inputs(&Mat::from_diagonal(&DVector::from_column_slice(gains)))
    }

    /// `diag(gains) G`.
    pub(crate) fn scale_outputs(&self, gains: &[f64]) -> Self {
        self.map_outputs(&Mat::from_diagonal(&DVector::from_column_slice(gains)))
    }

    /// The same system with the given outputs only, in that order; an output may be taken twice.
    pub(crate) fn select_outputs(&self, outputs: impl IntoIterator<Item = usize>) -> Self {
        let rows: Vec<usize> = outputs.into_iter().collect();
        let (c, d) = (self.c.select_rows(&rows), self.d.select_rows(&rows));
        Self { a: self.a.clone(), b: self.b.clone(), c, d }
    }

    /// The given states only, in that order, the others held at zero. With all states given this is a
    /// change of their order, which keeps the transfer function.
    pub(crate) fn select_states(&self, states: impl IntoIterator<Item = usize>) -> Self {
        let kept: Vec<usize> = states.into_iter().collect();
        Self {
            a: self.a.select_rows(&kept).select_columns(&kept),
            b: self.b.select_rows(&kept),
            c: self.c.select_columns(&kept),
            d: self.d.clone(),
        }
    }
}

/// The diagonal of blocks of the given sizes.
fn diagonal(sizes: &[usize], block: impl Fn(usize) -> Mat) -> Mat {
    let blocks: Vec<Mat> = sizes.iter().map(|&n| block(n)).collect();
    hybank_linalg::block_diagonal(&blocks.iter().collect::<Vec<_>>())
}

#[cfg(test)]
mod tests;
