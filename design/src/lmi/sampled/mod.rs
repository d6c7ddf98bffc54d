//! The sampled worst-case norm problem, which FIR design solves.
//!
//! Over real taps `F_0 .. F_{J-1}` (each M x N) minimise
//!
//! ```text
//! gamma = max_l sigma_max(K_l),   K_l = W_l - sum_j e^{-i omega_l j} F_j H_l
//! ```
//!
//! with given complex `W_l` (M x q), `H_l` (N x q) at frequencies `omega_l`. Row p of the taps has its own
//! number of lags `J_p <= J`. Conjugate symmetry makes frequencies in `[0, pi]` enough for real filters.
//! Several scenarios with the same taps are further points.
//!
//! The method: an LQ factorisation at each point splits `K_l K_l* = (W1 - F H1)(W1 - F H1)* + G` into a
//! part that depends on the taps and a constant. With `t = gamma^2` each point is one small LMI
//!
//! ```text
//! [ t I - G_l   K1_l ]
//! [ K1_l*       I    ]  >= 0,
//! ```
//!
//! solved by a primal-dual predictor-corrector iteration in the HKM direction. Its Newton matrix is Toeplitz
//! plus Hankel in the lags for each pair of taps, so it is summed at the cost of one product per pair of
//! rows. The data are shifted and scaled by the least-squares solution first, which makes `t` of order one
//! whatever the size of gamma. The dual iterate is then turned into a lower bound that is computed from the
//! original data alone (`lower_bound`).
//!
//! Sources: Vandenberghe and Boyd, "Semidefinite programming", SIAM Review 38 (1996); Helmberg,
//! Rendl, Vanderbei, Wolkowicz, SIAM J. Optim. 6 (1996), Kojima, Shindoh, Hara, SIAM J. Optim. 7
//! (1997) and Monteiro, SIAM J. Optim. 7 (1997) for the direction; Mehrotra, SIAM J. Optim. 2 (1992)
//! for the step.
//!
//! ```
//! use hybank_linalg::{CMat, Complex};
//! use hybank_design::lmi::FINEST_GAP;
//! use hybank_design::lmi::sampled::{
//!     FrequencyPoint, MeanSquareObjective, SampledProblem, mean_square_under_cap, minimise,
//! };
//! // Three taps F that undo an echo of half the size: the least maximum of |1 - F (1 + z^-1 / 2)| is 1/8.
//! let scalar = |x| CMat::from_element(1, 1, x);
//! let point = |l: u32| {
//!     let omega = f64::from(l) * std::f64::consts::PI / 32.0;
//!     FrequencyPoint { omega, w: scalar(Complex::ONE), h: scalar(1.0 + 0.5 * Complex::cis(-omega)) }
//! };
//! let problem = SampledProblem::new((0..=32).map(point).collect(), vec![3]);
//! let best = minimise(&problem, FINEST_GAP, &|| false)?;
//! assert!((best.gamma - 0.125).abs() < 1e-8 && best.lower <= best.gamma);
//! assert!((best.taps.lags()[1][(0, 0)] + 0.5).abs() < 1e-6);
//! // A looser cap on the maximum gives a smaller mean square.
//! let (square, cap) = (MeanSquareObjective::noiseless(vec![1.0 / 33.0; 33], 1), 1.1 * best.gamma);
//! let found = mean_square_under_cap(&problem, &square, cap, &best.taps, FINEST_GAP, &|| false)?;
//! assert!(found.is_some_and(|found| found.gamma <= cap && found.mean_square < 0.125 * 0.125));
//! # Ok::<(), hybank_linalg::LinalgError>(())
//! ```

mod basis;
mod blocks;
mod bound;
mod fourier;
mod interior;
mod mean_square;
mod newton;
mod prepare;
mod problem;
mod quadratic;
mod worst_case;

#[cfg(test)]
pub(crate) use bound::lower_bound;
#[cfg(test)]
pub(crate) use mean_square::least_squares;
pub use mean_square::{CappedMeanSquare, mean_square_under_cap};
pub use problem::{FrequencyPoint, MeanSquareObjective, SampledProblem};
pub use worst_case::{Solution, minimise};

#[cfg(test)]
mod tests;
