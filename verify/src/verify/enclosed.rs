//! An enclosure of the error system of a bank. It is built once and serves to check any number of
//! certificates.

use super::ball::{self, Ball};
use super::error_system::{self, BlockForm, error_system};
use super::front_ends::FrontEnds;
use super::slow_period::SlowPeriod;
use super::system::{EnclosedSystem, Midpoint};
use super::timeline::{SamplingInstant, delay_periods, timeline};
use super::{MAX_STATES, Strictness, Verified, VerifyError, gain, statements};
use crate::arithmetic::{ComplexBall, Float, Float512};
use hybank_core::bank::{Bank, Certificate, GainWitness, Gamma};
use hybank_core::units::Timeline;
use hybank_linalg::{CMat, Complex};
use nalgebra::DMatrix;
use std::sync::OnceLock;

/// Radius of the square of a gain, relative to it, above which it is computed in 512 bits.
const UNRESOLVED: f64 = 1e-9;
/// Maximum number of states of an error system that is computed in 512 bits: some seconds for a certificate.
const MAX_CORRECTED_STATES: usize = 128;
/// The same where gains are computed at hundreds of frequencies: some seconds for all.
const MAX_LONG_GRAM_STATES: usize = 48;

/// The error system of a bank, enclosed.
#[derive(Debug, Clone)]
pub struct EnclosedErrorSystem<'a> {
    pub(super) bank: &'a Bank,
    front_ends: FrontEnds,
    samples: Vec<SamplingInstant>,
    timeline: Timeline,
    pub(super) period: SlowPeriod,
    equations: EnclosedSystem,
    long_equations: OnceLock<EnclosedSystem<Float512>>,
    long_period: OnceLock<SlowPeriod<Float512>>,
}

impl<'a> EnclosedErrorSystem<'a> {
    /// Encloses the error system of `bank`.
    ///
    /// # Errors
    /// [`VerifyError::NoSpec`], [`VerifyError::FrontEnd`], [`VerifyError::TooManyFilters`],
    /// [`VerifyError::TooLarge`].
    pub fn new(bank: &'a Bank) -> Result<Self, VerifyError> {
        let (front_ends, samples) = FrontEnds::new(bank)?;
        front_ends.check_work(samples.len())?;
        let analog = front_ends.order();
        let timeline = timeline(&samples, bank.ratio)?;
        let states = error_system::order(analog, &delay_periods(&timeline), &bank.filters, bank.ratio);
        if states > MAX_STATES {
            return Err(VerifyError::TooLarge { states });
        }
        let period = SlowPeriod::new(&front_ends, &timeline, &samples);
        let equations = error_system(&period, &BlockForm::new(&bank.filters, bank.ratio));
        Ok(Self {
            bank,
            front_ends,
            samples,
            timeline,
            period,
            equations,
            long_equations: OnceLock::new(),
            long_period: OnceLock::new(),
        })
    }

    /// Number of states of the error system, the order of P.
    pub fn states(&self) -> usize {
        self.equations.order()
    }

    /// Root of the energy that the input of one slow period contributes to the reference samples. A gamma
    /// is small if it is small relative to this.
    pub fn scale(&self) -> f64 {
        let n = self.period.order();
        (n..n + self.bank.ratio).map(|i| self.period.gram[(i, i)].nearest()).sum::<f64>().sqrt()
    }

    /// Whether `certificate` proves its gamma. Only one with a correction is tried in 512 bits.
    pub fn certifies(&self, certificate: &Certificate) -> bool {
        let long = !certificate.correction.is_empty() && self.states() <= MAX_CORRECTED_STATES;
        let factor = [&certificate.factor[..], &certificate.correction[..]];
        self.equations.proves(certificate.gamma, factor)
            || long && self.long_equations().proves(certificate.gamma, factor)
    }

    /// The error system in 512 bits.
    fn long_equations(&self) -> &EnclosedSystem<Float512> {
        self.long_equations.get_or_init(|| {
            error_system(self.long_period(), &BlockForm::new(&self.bank.filters, self.bank.ratio))
        })
    }

    /// A proven lower bound of ||K||, from the gain at a frequency; in 512 bits where 106 do not resolve it.
    pub fn attains(&self, witness: &GainWitness) -> Option<f64> {
        self.gain_at(witness).0
    }

    /// The gain at a frequency, rounded down; `None` where neither arithmetic resolves it.
    pub fn resolved_gain(&self, witness: &GainWitness) -> Option<f64> {
        let (gain, is_resolved) = self.gain_at(witness);
        gain.filter(|_| is_resolved)
    }

    /// A lower bound of the gain at a frequency, and whether it is the gain up to rounding.
    fn gain_at(&self, witness: &GainWitness) -> (Option<f64>, bool) {
        let (filters, ratio) = (&self.bank.filters, self.bank.ratio);
        let short = gain::square_of_gain(&self.period, filters, ratio, witness);
        if is_resolved(&short) || self.states() > MAX_CORRECTED_STATES {
            return (gain::root(short), is_resolved(&short));
        }
        let long = gain::square_of_gain(self.long_period(), filters, ratio, witness);
        (gain::root(long), is_resolved(&long))
    }

    /// The slow period in 512 bits.
    fn long_period(&self) -> &SlowPeriod<Float512> {
        self.long_period.get_or_init(|| SlowPeriod::new(&self.front_ends, &self.timeline, &self.samples))
    }

    /// The error system in double precision, as [`EnclosedSystem::midpoint`].
    pub fn midpoint(&self) -> Option<Midpoint> {
        self.equations.midpoint()
    }

    /// K K* at a point of the unit circle, rounded to double precision after every cancellation; of small
    /// systems in 512 bits where 106 do not resolve it.
    pub fn error_gram(&self, half: [f64; 2]) -> CMat {
        let (filters, ratio) = (&self.bank.filters, self.bank.ratio);
        let short = gain::error_gram(&self.period, filters, ratio, half);
        if is_gram_resolved(&short) || self.states() > MAX_LONG_GRAM_STATES {
            return nearest(&short);
        }
        nearest(&gain::error_gram(self.long_period(), filters, ratio, half))
    }

    /// The bounds that `certificate` proves, compared with the stated `gamma`.
    ///
    /// # Errors
    /// [`VerifyError`] naming the first mismatch.
    pub fn judge(
        &self,
        gamma: &Gamma,
        certificate: &Certificate,
        strictness: Strictness,
    ) -> Result<Verified, VerifyError> {
        let proven = self.proven(certificate)?;
        statements::compare(gamma, &proven, self.scale(), strictness)?;
        Ok(proven)
    }

    /// The bounds that `certificate` proves.
    ///
    /// # Errors
    /// [`VerifyError`] naming the part that does not prove its bound.
    pub fn proven(&self, certificate: &Certificate) -> Result<Verified, VerifyError> {
        let (found, states, upper) = (certificate.factor.len(), self.states(), certificate.gamma);
        if found != states {
            return Err(VerifyError::CertificateSize { found, states });
        }
        let attained =
            self.attains(&certificate.peak).ok_or(VerifyError::Void { place: "proof.upper.peak" })?;
        if !self.certifies(certificate) {
            return Err(VerifyError::NotProven { gamma: upper });
        }
        Ok(Verified { upper, attained, states })
    }
}

/// Whether the radii stay below the share [`UNRESOLVED`] of the largest entry.
fn is_gram_resolved<F: Float>(m: &DMatrix<ComplexBall<F>>) -> bool {
    let parts = || m.iter().flat_map(|x| [x.re, x.im]);
    let largest = parts().map(|x| x.nearest().abs()).fold(0.0, f64::max);
    parts().all(|x| x.radius() <= UNRESOLVED * largest)
}

/// The nearest doubles to the midpoints.
fn nearest<F: Float>(m: &DMatrix<ComplexBall<F>>) -> CMat {
    m.map(|x| Complex::new(x.re.nearest(), x.im.nearest()))
}

/// Whether the square of a gain is known to [`UNRESOLVED`].
fn is_resolved<F: Float>(square: &Ball<F>) -> bool {
    square.radius() <= UNRESOLVED * square.nearest()
}

/// An error system xi+ = A xi + J u, e = C xi + L u with the Gram matrix S of u.
pub struct PreciseErrorSystem {
    /// [A; C], (n + M) x n.
    pub system: DMatrix<Float512>,
    /// [J; L] S [J; L]'.
    pub input_gram: DMatrix<Float512>,
}

impl EnclosedErrorSystem<'_> {
    /// The error system in 512 bits, for the search for certificates. Only its midpoints: the proof does not
    /// use them.
    pub fn in_512_bits(&self) -> PreciseErrorSystem {
        let error = self.long_equations();
        PreciseErrorSystem { system: midpoints(&error.system), input_gram: midpoints(&error.input_gram()) }
    }
}

fn midpoints(m: &ball::Matrix<Float512>) -> DMatrix<Float512> {
    m.map(Ball::mid)
}
