//! The checked filters.

use crate::arithmetic::LongBall;
use hybank_core::spec::FilterSpec;
use hybank_core::units::{RadiansPerFastPeriod, Seconds};
use hybank_linalg::{Complex, Mat};
use std::ops::Deref;

use super::realise::{Chain, output_energy, with_unit_states};
use super::section::Realisation;
use super::{AnalogError, MAX_GAIN, MAX_NORMALISED_POLE, MIN_DAMPING_RATIO, MIN_GAIN, MIN_NORMALISED_POLE};

/// A stable, proper, real filter in normalised time t' = t/h.
///
/// State equations dx/dt' = a x + b f, out = c x + d f with a: n x n, b: n x 1, c: 1 x n, all dimensionless.
/// The gain is that of the written filter: Phi'(s') = Phi(s'/h). Two filters are equal when their normalised
/// poles, zeros and gains are (for state-space forms: their matrices), in whatever form they were written.
#[derive(Debug, Clone, PartialEq)]
pub struct StableFilter {
    chain: Chain<f64>,
    poles: Vec<Complex<f64>>,
    realisation: Realisation<f64>,
}

impl StableFilter {
    /// Checks `filter`, which may have a direct term, and realises it in normalised time t' = t / h, with
    /// h = `fast_period`.
    ///
    /// # Errors
    /// As [`StrictlyProper::new`].
    pub fn new(filter: &FilterSpec, fast_period: Seconds) -> Result<Self, AnalogError> {
        filter.check_proper()?;
        Self::driven_by(None, filter, fast_period)
    }

    /// Of a filter whose written form has been checked; the states have unit energy for white noise through
    /// `signal`.
    fn driven_by(signal: Option<&Self>, filter: &FilterSpec, h: Seconds) -> Result<Self, AnalogError> {
        if !(h.0.is_finite() && h.0 > 0.0) {
            return Err(AnalogError::FastPeriod { value: h });
        }
        let chain = Chain::new(filter, h)?;
        let mut poles = Vec::new();
        for block in &chain.blocks {
            poles.extend(block.poles()?);
        }
        poles.iter().try_for_each(|&pole| check_pole(pole, h))?;
        if !chain.gain.is_normal() {
            return Err(AnalogError::GainOutOfRange { value: chain.gain });
        }
        let realisation = with_unit_states(signal.map(|signal| &signal.realisation), &chain.realise());
        Self { chain, poles, realisation }.transmitting()
    }

    /// g with Phi = g times `other`, if the two have the same poles and zeros.
    pub fn ratio_to(&self, other: &Self) -> Option<f64> {
        let ratio = self.chain.gain / other.chain.gain;
        (self.chain.blocks == other.chain.blocks && ratio.is_normal()).then_some(ratio)
    }

    /// Refuses a filter whose response is zero, out of range or not a number where its poles are.
    fn transmitting(self) -> Result<Self, AnalogError> {
        let probes = self.poles.iter().map(|p| p.norm()).chain([0.0]);
        let largest = probes.map(|w| self.response(RadiansPerFastPeriod(w)).norm()).fold(0.0, f64::max);
        let sum: f64 = self.realisation.a.iter().chain(&self.realisation.b).chain(&self.realisation.c).sum();
        if !(largest.is_finite() && sum.is_finite()) {
            return Err(AnalogError::GainOutOfRange { value: self.chain.gain });
        }
        if largest == 0.0 {
            return Err(AnalogError::NoTransmission);
        }
        if (MIN_GAIN..=MAX_GAIN).contains(&largest) {
            Ok(self)
        } else {
            Err(AnalogError::GainOutOfRange { value: largest })
        }
    }

    /// a, n x n.
    pub fn a(&self) -> &Mat {
        &self.realisation.a
    }

    /// b, n x 1.
    pub fn b(&self) -> &Mat {
        &self.realisation.b
    }

    /// c, 1 x n.
    pub fn c(&self) -> &Mat {
        &self.realisation.c
    }

    /// d, the direct term; 0 for a [`StrictlyProper`] filter.
    pub fn d(&self) -> f64 {
        self.realisation.d
    }

    /// n, the number of states and of poles.
    pub fn order(&self) -> usize {
        self.realisation.a.nrows()
    }

    /// Phi'(j w), from poles and zeros where the filter has them.
    pub fn response(&self, w: RadiansPerFastPeriod) -> Complex<f64> {
        let s = Complex::new(0.0, w.0);
        self.chain
            .blocks
            .iter()
            .fold(self.chain.gain.into(), |value: Complex<f64>, block| value * block.response(s))
    }

    /// The n poles p' = p h, real and imaginary part in rad per fast period.
    pub fn poles(&self) -> &[Complex<f64>] {
        &self.poles
    }

    /// The power of the output of `front_end` for white noise of unit density through this filter:
    /// ||Phi W||_2^2 in normalised time.
    pub fn power_through(&self, front_end: &StrictlyProper) -> f64 {
        output_energy(&self.realisation.then(&front_end.realisation))
    }
}

/// A front end Phi: a [`StableFilter`] without direct term. Channels with equal filters can share one state.
///
/// Source: thesis section 5.2 asks for exactly these properties (rational, stable, strictly proper).
#[derive(Debug, Clone, PartialEq)]
pub struct StrictlyProper(StableFilter);

impl Deref for StrictlyProper {
    type Target = StableFilter;

    fn deref(&self) -> &StableFilter {
        &self.0
    }
}

impl StrictlyProper {
    /// Checks `filter` and realises it in normalised time t' = t / h, with h = `fast_period`.
    ///
    /// # Errors
    /// [`AnalogError`]: a fast period that is not positive and finite; a written form that violates a rule;
    /// poles that are unstable, without conjugate or outside
    /// [`MIN_NORMALISED_POLE`]`..=`[`MAX_NORMALISED_POLE`]; a response that is zero at all frequencies or
    /// beyond double precision.
    pub fn new(filter: &FilterSpec, fast_period: Seconds) -> Result<Self, AnalogError> {
        Self::driven_by(None, filter, fast_period)
    }

    /// As [`StrictlyProper::new`]; the states are scaled for the input `signal` in place of white noise.
    ///
    /// # Errors
    /// As [`StrictlyProper::new`].
    pub fn driven_by(
        signal: Option<&StableFilter>,
        filter: &FilterSpec,
        fast_period: Seconds,
    ) -> Result<Self, AnalogError> {
        filter.check()?;
        StableFilter::driven_by(signal, filter, fast_period).map(Self)
    }

    /// Phi(s / `factor`): every pole and zero times a positive number.
    pub fn with_cutoff_scaled(&self, factor: f64) -> Self {
        let Self(StableFilter { chain, poles, realisation }) = self;
        Self(StableFilter {
            chain: chain.stretched(factor),
            poles: poles.iter().map(|pole| pole * factor).collect(),
            realisation: realisation.stretched(factor),
        })
    }
}

/// The state equations of a written filter that has been realised as a [`StableFilter`], enclosed: those of
/// the filter as it is written, with states of about unit energy for the input `signal` or white noise.
///
/// # Errors
/// As [`StrictlyProper::new`].
pub fn enclosed(
    signal: Option<&Realisation<LongBall>>,
    filter: &FilterSpec,
    h: Seconds,
) -> Result<Realisation<LongBall>, AnalogError> {
    let realisation = Chain::new(filter, h)?.realise();
    Ok(with_unit_states(signal.map(Realisation::rounded).as_ref(), &realisation))
}

/// The rules for a pole, given in rad per fast period; errors name it in rad/s.
fn check_pole(pole: Complex<f64>, h: Seconds) -> Result<(), AnalogError> {
    let (re, im, normalised) = (pole.re / h.0, pole.im / h.0, pole.norm());
    // Written so that NaN is refused too.
    if !(-pole.re >= MIN_DAMPING_RATIO * normalised && pole.re < 0.0) {
        return Err(AnalogError::Unstable { re, im });
    }
    if !(MIN_NORMALISED_POLE..=MAX_NORMALISED_POLE).contains(&normalised) {
        let normalised = RadiansPerFastPeriod(normalised);
        return Err(AnalogError::PoleOutOfRange { re, im, normalised });
    }
    Ok(())
}
