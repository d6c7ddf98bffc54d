//! Peak gains over the unit circle: the H-infinity norm, and the peak of the part of the references that
//! measurements cannot explain.
//!
//! Both are the maximum over w of sigma_max(L_z(w)). The LQ factorisation of the response [G_y; G_z] = [L_y
//! 0; L_zy L_z] Q separates the part L_zy of the references z that the measurements y explain. Without
//! measurements L_z is G_z, and the peak is the H-infinity norm.
//!
//! Method: level sets (Boyd & Balakrishnan 1990, Bruinsma & Steinbuch 1990). gamma is the gain at some
//! frequency exactly where G G* - gamma^2 J, J = diag(0, I), is singular; after a Cayley transform these
//! are the imaginary eigenvalues of one Hamiltonian matrix (`hamiltonian`). Eigenvalues only *suggest*
//! frequencies. Each reported value is evaluated from the response itself and refined between its
//! neighbours (`refine`).

mod hamiltonian;
mod refine;
mod search;

use super::{FrequencyResponse, LtiError, StateSpace};
use crate::linalg::{self, CMat, Complex};
use search::Search;
use std::f64::consts::PI;

/// Relative accuracy of the returned peak.
pub const PEAK_ACCURACY: f64 = 1e-9;
/// Distances from the angle of a pole, relative to the distance of the pole from the unit circle.
const WIDTHS: [f64; 5] = [-1.5, -0.5, 0.0, 0.5, 1.5];

/// A peak gain and where it is attained.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak {
    /// The largest gain, with relative accuracy [`PEAK_ACCURACY`]. It is attained at `frequency`, so it is
    /// never too large.
    pub gain: f64,
    /// Radians per step, in [0, pi].
    pub frequency: f64,
}

/// The H-infinity norm of a stable system with its peak frequency.
pub fn hinf_norm(system: &StateSpace) -> Result<Peak, LtiError> {
    unexplained_peak(system, 0)
}

/// max over w of sigma_max of the part of the references (rows from `measurements` on) that no
/// combination of the measurements (the first rows) explains, causal or not:
/// G_z (I - G_y* (G_y G_y*)^+ G_y).
pub fn unexplained_peak(system: &StateSpace, measurements: usize) -> Result<Peak, LtiError> {
    let poles = stable_poles(system)?;
    let system = system.compress_inputs();
    let response = FrequencyResponse::new(&system);
    Search::new(&system, measurements, &|w| response.at_frequency(w), resonances(&poles)).run()
}

/// The H-infinity norm of a system that is known to be stable, with a response that is cheaper than its
/// own: `response(w)` has the singular values of G(e^{jw}), and `initial` are frequencies where it may be
/// large (see [`resonances`]).
pub fn hinf_norm_with_response(
    system: &StateSpace,
    response: &dyn Fn(f64) -> CMat,
    initial: Vec<f64>,
) -> Result<Peak, LtiError> {
    Search::new(&system.compress_inputs(), 0, response, initial).run()
}

/// The peaks of a stable system above `level`: at least one in each frequency interval in which the gain
/// exceeds it.
pub fn peaks_above(system: &StateSpace, level: f64) -> Result<Vec<Peak>, LtiError> {
    let poles = stable_poles(system)?;
    let system = system.compress_inputs();
    let response = FrequencyResponse::new(&system);
    Search::new(&system, 0, &|w| response.at_frequency(w), resonances(&poles)).all_above(level)
}

/// The poles of a stable system.
///
/// # Errors
/// [`LtiError::Unstable`] if one of them is not inside the unit circle.
pub fn stable_poles(system: &StateSpace) -> Result<Vec<Complex<f64>>, LtiError> {
    let poles = linalg::eigenvalues(system.a())?;
    let radius = poles.iter().map(|pole| pole.norm()).fold(0.0, f64::max);
    if radius >= 1.0 { Err(LtiError::Unstable { radius }) } else { Ok(poles) }
}

/// Angles of the poles that may cause a peak, and angles near them at multiples of the pole's distance from
/// the unit circle, which is the width of its resonance.
pub fn resonances(poles: &[Complex<f64>]) -> Vec<f64> {
    let near = poles.iter().filter(|p| p.im >= 0.0 && p.norm() > 0.5);
    let about = |p: &Complex<f64>| WIDTHS.map(|width| p.arg() + width * (1.0 - p.norm()));
    near.flat_map(about).filter(|w| (0.0..=PI).contains(w)).collect()
}

/// The gain at one frequency: see [`unexplained_peak`].
pub fn unexplained_gain(response: &CMat, measurements: usize) -> Result<f64, LtiError> {
    let references = response.nrows() - measurements;
    if references == 0 || response.ncols() == 0 {
        return Ok(0.0);
    }
    if measurements == 0 {
        return Ok(linalg::largest_singular_value_c(response)?);
    }
    let l = linalg::lq_factor_c(response);
    if l.ncols() <= measurements {
        return Ok(0.0);
    }
    let rest = l.view((measurements, measurements), (references, l.ncols() - measurements)).into_owned();
    Ok(linalg::largest_singular_value_c(&rest)?)
}

impl Peak {
    /// The same peak with its frequency brought into [0, pi].
    fn folded(self) -> Self {
        let w = self.frequency.rem_euclid(2.0 * PI);
        Self { gain: self.gain, frequency: w.min(2.0 * PI - w) }
    }
}

#[cfg(test)]
mod tests;
