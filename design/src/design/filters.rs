//! The synthesis filters as the matrix F(z) of their polyphase components, `f_i[p + j M] = F_j[p, i]`.

use super::DesignError;
use crate::lti::peak::{resonances, stable_poles};
use crate::lti::{FirMatrix, FrequencyResponse, StateSpace};
use hybank_core::bank::{self, Bank, SynthesisFilters};
use hybank_linalg::{CMat, Complex, Mat};

impl FirMatrix {
    /// The polyphase components of filters `taps[i][n] = f_i[n]`.
    pub fn polyphase(taps: &[Vec<f64>], ratio: usize) -> Self {
        let lags = taps.iter().map(|f| f.len().div_ceil(ratio)).max().unwrap_or(0).max(1);
        let tap = |i: usize, n: usize| taps[i].get(n).copied().unwrap_or(0.0);
        (0..lags).map(|j| Mat::from_fn(ratio, taps.len(), |p, i| tap(i, p + j * ratio))).collect()
    }

    /// The first `length` samples of each impulse response: the inverse of [`polyphase`](Self::polyphase).
    pub fn impulse_responses(&self, length: usize) -> Vec<Vec<f64>> {
        let (ratio, channels) = self.shape();
        let tap = |i: usize, n: usize| self.lags()[n / ratio][(n % ratio, i)];
        (0..channels).map(|i| (0..length).map(|n| tap(i, n)).collect()).collect()
    }
}

/// F of a bank, prepared for many frequencies.
pub(crate) enum FilterResponse {
    /// A polynomial in z^-1.
    Polynomial(FirMatrix),
    /// A recursion, and its poles.
    Recursive {
        /// F(z).
        response: FrequencyResponse,
        /// In the plane of z.
        poles: Vec<Complex<f64>>,
    },
}

impl FilterResponse {
    /// Of the filters of a bank.
    ///
    /// # Errors
    /// [`DesignError::Lti`] for unstable filters.
    pub(crate) fn new(filters: &SynthesisFilters, ratio: usize) -> Result<Self, DesignError> {
        Ok(match filters {
            SynthesisFilters::Fir(taps) => Self::Polynomial(FirMatrix::polyphase(taps, ratio)),
            SynthesisFilters::StateSpace(_) => {
                let system = lifted(filters, ratio);
                let poles = stable_poles(&system)?;
                Self::Recursive { response: FrequencyResponse::new(&system), poles }
            }
        })
    }

    /// F at e^{jw}, w in radians per slow period.
    pub(crate) fn at(&self, w: f64) -> CMat {
        match self {
            Self::Polynomial(fir) => fir.response(w),
            Self::Recursive { response, .. } => response.at_frequency(w),
        }
    }

    /// Slow periods after which the response to a sample is over, for FIR filters; 1 for a recursion.
    pub(crate) fn lags(&self) -> usize {
        if let Self::Polynomial(fir) = self { fir.lags().len() } else { 1 }
    }

    /// The poles of a recursion, which has delay chains among its states too.
    pub(crate) fn poles(&self) -> &[Complex<f64>] {
        if let Self::Recursive { poles, .. } = self { poles } else { &[] }
    }

    /// Angles of the resonances of a recursion.
    pub(crate) fn resonances(&self) -> Vec<f64> {
        resonances(self.poles())
    }
}

/// F(z) of a bank as one system: N slow samples in and M fast samples out per slow period.
///
/// # Panics
/// For matrices that form no system: see [`Bank::check`].
pub fn lifted(filters: &SynthesisFilters, ratio: usize) -> StateSpace {
    match filters {
        SynthesisFilters::Fir(taps) => FirMatrix::polyphase(taps, ratio).state_space(),
        SynthesisFilters::StateSpace(block) => from_block(block, ratio),
    }
}

/// Refuses unstable filters: their output would grow to infinity without a message.
///
/// # Errors
/// [`DesignError::UnstableBank`]; [`DesignError::Linalg`] if the eigenvalues do not converge.
pub fn check_stable(bank: &Bank) -> Result<(), DesignError> {
    let SynthesisFilters::StateSpace(_) = &bank.filters else { return Ok(()) };
    match lifted(&bank.filters, bank.ratio).spectral_radius()? {
        radius if radius < 1.0 => Ok(()),
        radius => Err(DesignError::UnstableBank { radius }),
    }
}

fn from_block(block: &bank::StateMatrices, ratio: usize) -> StateSpace {
    let (n, channels) = (block.a.len(), block.d.first().map_or(0, Vec::len));
    let matrix = |rows: &[Vec<f64>], r: usize, c: usize| Mat::from_fn(r, c, |i, j| rows[i][j]);
    StateSpace::new(
        matrix(&block.a, n, n),
        matrix(&block.b, n, channels),
        matrix(&block.c, ratio, n),
        matrix(&block.d, ratio, channels),
    )
}

/// A system as a bank holds it: lists of rows.
pub fn to_block(system: &StateSpace) -> bank::StateMatrices {
    let rows = |m: &Mat| m.row_iter().map(|row| row.iter().copied().collect()).collect();
    bank::StateMatrices { a: rows(system.a()), b: rows(system.b()), c: rows(system.c()), d: rows(system.d()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polyphase_components_are_the_samples_at_their_places() {
        let taps = vec![vec![1.0, 2.0, 3.0, 4.0, 5.0], vec![6.0]];
        let fir = FirMatrix::polyphase(&taps, 2);
        let lags = fir.lags();
        assert_eq!(lags.len(), 3);
        assert_eq!(
            (lags[0][(1, 0)], lags[2][(0, 0)], lags[0][(0, 1)], lags[2][(1, 0)]),
            (2.0, 5.0, 6.0, 0.0)
        );
        let back = fir.impulse_responses(5);
        assert_eq!(back, vec![vec![1.0, 2.0, 3.0, 4.0, 5.0], vec![6.0, 0.0, 0.0, 0.0, 0.0]]);
    }

    #[test]
    fn the_lifted_system_answers_an_impulse_with_the_taps() {
        let taps = vec![vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0], vec![-1.0, 0.5, 0.25]];
        for ratio in [1, 2, 3, 7, 9] {
            let filters = SynthesisFilters::Fir(taps.clone());
            let system = lifted(&filters, ratio);
            for (i, filter) in taps.iter().enumerate() {
                let mut x = system.b().column(i).into_owned();
                let mut answer: Vec<f64> = system.d().column(i).iter().copied().collect();
                while answer.len() < 12 {
                    answer.extend((system.c() * &x).iter());
                    x = system.a() * x;
                }
                let want = (0..answer.len()).map(|n| filter.get(n).copied().unwrap_or(0.0));
                assert_eq!(answer, want.collect::<Vec<_>>(), "ratio {ratio}, channel {i}");
            }
            // Conversion to the matrices of a bank file and back changes nothing.
            let stored = SynthesisFilters::StateSpace(to_block(&system));
            assert_eq!(lifted(&stored, ratio), system);
        }
    }

    #[test]
    fn unstable_recursions_are_refused_and_fir_banks_never_are() {
        let block = |pole: f64| bank::StateMatrices {
            a: vec![vec![pole]],
            b: vec![vec![1.0]],
            c: vec![vec![1.0]],
            d: vec![vec![0.0]],
        };
        let bank = |pole| Bank::bare(SynthesisFilters::StateSpace(block(pole)), 1);
        assert_eq!(check_stable(&bank(-0.99)), Ok(()));
        assert_eq!(check_stable(&bank(-1.25)), Err(DesignError::UnstableBank { radius: 1.25 }));
        assert_eq!(check_stable(&Bank::bare(SynthesisFilters::Fir(vec![vec![9.0]]), 1)), Ok(()));
    }
}
