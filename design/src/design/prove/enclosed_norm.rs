//! The norm of a bank in the arithmetic of `verify`, where double precision does not resolve the error.

use super::{frequency, half, leading_direction, witness};
use crate::design::DesignError;
use crate::design::limits::MAX_LONG_STATES;
use crate::lti::StateSpace;
use crate::lti::peak::{Peak, hinf_norm, hinf_norm_with_response, resonances, stable_poles};
use hybank_core::bank::{Bank, GainWitness, Gamma};
use hybank_linalg::{CMat, Complex};
use hybank_verify::verify::{EnclosedErrorSystem, Midpoint, ZERO_NORM};
use std::f64::consts::PI;

/// Distances from the peak in doubles at which the enclosed gain is computed, in radians: from the rounding
/// of a frequency to the width of a wide resonance.
const PEAK_OFFSETS: [f64; 6] = [1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3];

/// Whether a norm is zero up to rounding, so that more digits gain nothing.
pub(super) fn is_zero(norm: f64, error: &EnclosedErrorSystem<'_>) -> bool {
    norm <= ZERO_NORM * error.scale()
}

/// `computed`, the norm of `bank` in double precision, if its gain is the enclosed one at that frequency;
/// otherwise the largest enclosed gain. Where the enclosure does not resolve the peak, or is not possible,
/// double precision stands.
///
/// # Errors
/// [`DesignError::Lti`] for unstable filters.
pub(in crate::design) fn resolved_norm(bank: &Bank, computed: Peak) -> Result<Peak, DesignError> {
    let Ok(error) = EnclosedErrorSystem::new(bank) else { return Ok(computed) };
    let gains = EnclosedGains(&error);
    let there = gains.at(computed.frequency)?;
    let differs =
        there.is_some_and(|(gain, _)| (gain - computed.gain).abs() > Gamma::NORM_ACCURACY * computed.gain);
    if !differs || is_zero(computed.gain, &error) {
        return Ok(computed);
    }
    let found = gains.peak(bank.proof.as_ref().map(|proof| frequency(&proof.upper.peak)))?;
    Ok(found.map_or(computed, |(gain, peak)| Peak { gain, frequency: frequency(&peak) }))
}

/// Gains of an enclosed error system.
pub(super) struct EnclosedGains<'a>(pub(super) &'a EnclosedErrorSystem<'a>);

impl EnclosedGains<'_> {
    /// The largest gain with its witness. Double precision and a `hint` suggest frequencies; in systems that
    /// are not large every gain is enclosed. `None` if the gain at the peak in double precision is not
    /// resolved.
    pub(super) fn peak(&self, hint: Option<f64>) -> Result<Option<(f64, GainWitness)>, DesignError> {
        let Some(Midpoint { a, b, c, d }) = self.0.midpoint() else { return Ok(None) };
        let system = StateSpace::new(a, b, c, d);
        let computed = hinf_norm(&system)?.frequency;
        let Some(there) = self.at(computed)? else { return Ok(None) };
        if self.0.states() > MAX_LONG_STATES {
            return Ok(Some(there));
        }
        let grid = grid(&system, computed, hint)?;
        let found = hinf_norm_with_response(&system, &|frequency| self.response(frequency), grid)?;
        let other = self.at(found.frequency)?;
        Ok(other.filter(|(gain, _)| *gain > there.0).or(Some(there)))
    }

    /// The gain at a frequency, rounded down, with its witness; `None` where it is zero or not resolved.
    pub(super) fn at(&self, frequency: f64) -> Result<Option<(f64, GainWitness)>, DesignError> {
        let peak = witness(frequency, &leading_direction(&self.response(frequency))?);
        let gain = self.0.resolved_gain(&peak).filter(|gain| *gain > 0.0);
        Ok(gain.map(|gain| (gain, peak)))
    }

    /// A matrix X with X X* = K K* at a frequency; zero where K K* has no decomposition.
    fn response(&self, frequency: f64) -> CMat {
        let gram = self.0.error_gram(half(frequency));
        let Ok(svd) = hybank_linalg::svd(&gram) else { return CMat::zeros(gram.nrows(), 1) };
        CMat::from_fn(svd.u.nrows(), svd.s.len(), |i, k| svd.u[(i, k)] * Complex::from(svd.s[k].sqrt()))
    }
}

/// Frequencies that show all peaks: the level sets of small gains are rounding errors.
fn grid(system: &StateSpace, computed: f64, hint: Option<f64>) -> Result<Vec<f64>, DesignError> {
    let beside = PEAK_OFFSETS.iter().flat_map(|distance| [computed - distance, computed + distance]);
    let mut frequencies = resonances(&stable_poles(system)?);
    frequencies
        .extend(beside.chain([computed]).chain(hint).filter(|frequency| (0.0..=PI).contains(frequency)));
    frequencies.sort_by(f64::total_cmp);
    let split = |ends: &[f64]| {
        let part = 0.25 * (ends[1] - ends[0]);
        [0, 1, 2, 3].map(|k| ends[0] + part * f64::from(k))
    };
    Ok(frequencies.windows(2).flat_map(split).chain(frequencies.last().copied()).collect())
}
