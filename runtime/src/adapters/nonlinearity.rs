//! The static nonlinearity of a converter.

use crate::Sample;

/// Samples this share of a cell below its beginning belong to it: those that a file has rounded.
const CELL_TOLERANCE: f64 = 1.0 / 64.0;

/// What the samples x of a converter contain beside the signal, relative to full scale.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(
        untagged,
        expecting = "a list of coefficients [a_2, a_3, ..], or { table = [..] } with an entry for each code"
    )
)]
pub enum Nonlinearity {
    /// a_2, a_3, ..: the sum of a_k T_k(x) with Chebyshev's polynomials, which keep the value of the end
    /// beyond -1 .. 1. A converter without coefficients is straight.
    Polynomial(Vec<f64>),
    /// One value for each of n cells of equal width from -1 to 1: of a converter of B bits with n = 2^B that
    /// of each code.
    Table {
        /// e_0 .. e_(n-1); x has e_c with c = floor((x + 1) n / 2 + 1/64), at the ends for what is beyond.
        table: Vec<f64>,
    },
}

impl Default for Nonlinearity {
    /// Of a straight converter.
    fn default() -> Self {
        Self::Polynomial(Vec::new())
    }
}

impl Nonlinearity {
    /// Whether there is none.
    pub fn is_straight(&self) -> bool {
        self.values().is_empty()
    }

    /// Its coefficients, or the entries of its table.
    pub fn values(&self) -> &[f64] {
        match self {
            Self::Polynomial(values) | Self::Table { table: values } => values,
        }
    }

    /// What a sample x contains.
    pub fn at(&self, x: f64) -> f64 {
        match self {
            Self::Polynomial(coefficients) => polynomial(coefficients.iter().copied(), x),
            Self::Table { table } => table.get(Self::cell(table.len(), x)).copied().unwrap_or(0.0),
        }
    }

    /// The cell of a sample, of so many; 0 for what is no number.
    pub fn cell(count: usize, x: f64) -> usize {
        let cell = (x + 1.0) * 0.5 * count as f64 + CELL_TOLERANCE;
        // A number below 0 becomes 0.
        (cell as usize).min(count.saturating_sub(1))
    }
}

/// The sum of a_k T_k(x) from k = 2 on by Clenshaw's recurrence, at the ends of -1 .. 1 for what is beyond.
pub(super) fn polynomial<T: Sample>(coefficients: impl DoubleEndedIterator<Item = T>, x: T) -> T {
    let one = T::from_f64(1.0);
    let x = if x > one { one } else { x };
    let x = if x < T::from_f64(-1.0) { T::from_f64(-1.0) } else { x };
    let (zero, twice) = (T::from_f64(0.0), x + x);
    let next = |(b1, b2): (T, T), a: T| (a + twice * b1 - b2, b1);
    let sums = coefficients.rev().fold((zero, zero), next);
    // a_1 and a_0 are zero.
    let (b1, b2) = next(sums, zero);
    x * b1 - b2
}
