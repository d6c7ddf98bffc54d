//! An enclosure of the error system of a bank. It is built once and serves to check any number of
//! witnesses.

use super::ball::{self, Ball};
use super::causal::{CausalPlant, Precision, Recursion};
use super::covariance::{Covariance, TapSamples};
use super::error_system::{self, BlockForm, error_system};
use super::front_ends::FrontEnds;
use super::slow_period::SlowPeriod;
use super::spectrum;
use super::system::{EnclosedSystem, Midpoint};
use super::timeline::{SamplingInstant, delay_periods, timeline};
use super::{
    BoundedBanks, MAX_STATES, Strictness, Verified, VerifyError, fir_length, lower, statements, upper,
};
use crate::arithmetic::{DoubleDouble, Float512, Number};
use crate::bank::{
    Bank, CausalWitness, Certificate, DualWitness, Gamma, LowerProof, Proof, SynthesisFilters,
};
use crate::linalg::CMat;
use crate::units::Timeline;
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
    short: OnceLock<Option<CausalPlant<DoubleDouble>>>,
    long: OnceLock<Option<CausalPlant<Float512>>>,
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
            short: OnceLock::new(),
            long: OnceLock::new(),
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

    /// Whole slow periods by which sample `j` is taken before sample `i`, if the two are multiples of each
    /// other up to that delay.
    fn periods_between(&self, i: usize, j: usize) -> Option<f64> {
        let (a, b) = (self.samples[i], self.samples[j]);
        let periods = a.time.periods_since(b.time, self.bank.ratio);
        periods.filter(|_| a.filter == b.filter)
    }

    /// Whether two samples are always multiples of each other.
    fn same(&self, i: usize, j: usize) -> bool {
        self.periods_between(i, j) == Some(0.0)
    }

    /// Whether two samples are multiples of each other up to a delay by whole slow periods.
    fn same_later(&self, i: usize, j: usize) -> bool {
        self.periods_between(i, j).is_some()
    }

    /// The channels that are not `equal` to one that is kept before them.
    fn first_channels(&self, equal: impl Fn(usize, usize) -> bool) -> Vec<usize> {
        let m = self.bank.ratio;
        let mut kept: Vec<usize> = Vec::new();
        for i in 0..self.bank.frame_samples() {
            if kept.iter().all(|&j| !equal(m + i, m + j)) {
                kept.push(i);
            }
        }
        kept
    }

    /// Rows of the measured samples that a causal bank needs: of samples that are multiples of each other up
    /// to whole slow periods, only the newest.
    fn newest_samples(&self) -> Vec<usize> {
        let mut rows: Vec<usize> = (self.bank.ratio..self.samples.len()).collect();
        let time = |s: usize| self.samples[s].time;
        rows.sort_by(|&i, &j| time(j).compare(time(i)));
        let mut kept: Vec<usize> = Vec::new();
        for row in rows {
            if kept.iter().all(|&newer| !self.same_later(newer, row)) {
                kept.push(row);
            }
        }
        kept.sort_unstable();
        kept
    }

    /// Whether `certificate` proves its gamma. Only one with a correction is tried in 512 bits.
    pub fn certifies(&self, certificate: &Certificate) -> bool {
        let long = !certificate.correction.is_empty() && self.states() <= MAX_CORRECTED_STATES;
        let factor = [&certificate.factor[..], &certificate.correction[..]];
        upper::proves(&self.equations, certificate.gamma, factor)
            || long && upper::proves(self.long_equations(), certificate.gamma, factor)
    }

    /// The error system in 512 bits.
    pub(super) fn long_equations(&self) -> &EnclosedSystem<Float512> {
        self.long_equations.get_or_init(|| {
            error_system(self.long_period(), &BlockForm::new(&self.bank.filters, self.bank.ratio))
        })
    }

    /// A proven lower bound of ||K||, from the gain at a frequency; in 512 bits where 106 do not resolve it.
    pub fn attains(&self, witness: &DualWitness) -> Option<f64> {
        self.gain_at(witness).0
    }

    /// The gain at a frequency, rounded down; `None` where neither arithmetic resolves it.
    pub(crate) fn resolved_gain(&self, witness: &DualWitness) -> Option<f64> {
        let (gain, is_resolved) = self.gain_at(witness);
        gain.filter(|_| is_resolved)
    }

    /// A lower bound of the gain at a frequency, and whether it is the gain up to rounding.
    fn gain_at(&self, witness: &DualWitness) -> (Option<f64>, bool) {
        let (filters, ratio) = (&self.bank.filters, self.bank.ratio);
        let short = lower::square_of_gain(&self.period, filters, ratio, witness);
        if is_resolved(&short) || self.states() > MAX_CORRECTED_STATES {
            return (lower::root(short), is_resolved(&short));
        }
        let long = lower::square_of_gain(self.long_period(), filters, ratio, witness);
        (lower::root(long), is_resolved(&long))
    }

    /// A proven lower bound for any bank on these front ends, causal or not.
    pub fn noncausal_bound(&self, witness: &DualWitness) -> Option<f64> {
        let channels = self.first_channels(|i, j| self.same_later(i, j));
        lower::unexplained(&self.period, self.bank.ratio, &channels, witness)
    }

    /// The channels that are not multiples of one before them.
    pub(crate) fn distinct_channels(&self) -> Vec<usize> {
        self.first_channels(|i, j| self.same(i, j))
    }

    /// A proven lower bound for FIR banks as long as this one.
    pub fn fir_bound(&self, witnesses: &[DualWitness]) -> Option<f64> {
        let SynthesisFilters::Fir(taps) = &self.bank.filters else { return None };
        let channels = self.distinct_channels();
        let (ratio, length) = (self.bank.ratio, taps[0].len());
        let short = || fir_length::of_length(&self.period, ratio, &channels, length, witnesses);
        let long = || fir_length::of_length(self.long_period(), ratio, &channels, length, witnesses);
        if witnesses.is_empty() { None } else { short().or_else(long) }
    }

    /// The slow period in 512 bits.
    pub(super) fn long_period(&self) -> &SlowPeriod<Float512> {
        self.long_period.get_or_init(|| SlowPeriod::new(&self.front_ends, &self.timeline, &self.samples))
    }

    /// Runs the recursion for causal banks at `gamma` over `periods` slow periods.
    pub fn causal_recursion(&self, gamma: f64, periods: usize, precision: Precision) -> Recursion {
        let (m, measured) = (self.bank.ratio, || self.newest_samples());
        match precision {
            Precision::Short => {
                let plant = self.short.get_or_init(|| CausalPlant::new(&self.period, m, &measured()));
                plant.as_ref().map_or(Recursion::Undecided, |plant| plant.recursion(gamma, periods))
            }
            Precision::Long => {
                let plant = self.long.get_or_init(|| CausalPlant::new(self.long_period(), m, &measured()));
                plant.as_ref().map_or(Recursion::Undecided, |plant| plant.recursion(gamma, periods))
            }
        }
    }

    /// Whether the recursion refutes `gamma` for causal banks within `periods` slow periods.
    fn refuted(&self, gamma: f64, periods: usize) -> bool {
        let shown = |precision| self.causal_recursion(gamma, periods, precision);
        [Precision::Short, Precision::Long]
            .into_iter()
            .any(|precision| matches!(shown(precision), Recursion::Refuted { .. }))
    }

    /// The error system in double precision, as [`EnclosedSystem::midpoint`].
    pub(crate) fn midpoint(&self) -> Option<Midpoint> {
        self.equations.midpoint()
    }

    /// K K* at a point of the unit circle, rounded to double precision after every cancellation; of small
    /// systems in 512 bits where 106 do not resolve it.
    pub(crate) fn error_gram(&self, half: [f64; 2]) -> CMat {
        let (filters, ratio) = (&self.bank.filters, self.bank.ratio);
        let short = lower::error_gram(&self.period, filters, ratio, half);
        if spectrum::is_resolved(&short, UNRESOLVED) || self.states() > MAX_LONG_GRAM_STATES {
            return spectrum::nearest(&short);
        }
        spectrum::nearest(&lower::error_gram(self.long_period(), filters, ratio, half))
    }

    /// Computes the bounds that the witnesses of `proof` prove, and compares the stated `gamma` with them.
    ///
    /// # Errors
    /// [`VerifyError`] naming the first mismatch.
    pub(crate) fn judge(
        &self,
        gamma: &Gamma,
        proof: &Proof,
        strictness: Strictness,
    ) -> Result<Verified, VerifyError> {
        let proven = self.proven(proof)?;
        statements::compare(gamma, &proven, self.scale(), strictness)?;
        Ok(proven)
    }

    /// The bounds that the witnesses of `proof` prove.
    ///
    /// # Errors
    /// [`VerifyError`] naming the witness that does not prove its bound.
    pub fn proven(&self, proof: &Proof) -> Result<Verified, VerifyError> {
        let certificate = proof.upper.as_ref().ok_or(VerifyError::NoCertificate)?;
        let (found, states, upper) = (certificate.factor.len(), self.states(), certificate.gamma);
        if found != states {
            return Err(VerifyError::CertificateSize { found, states });
        }
        let attained =
            self.attains(&certificate.peak).ok_or(VerifyError::Void { place: "proof.upper.peak" })?;
        if !self.certifies(certificate) {
            return Err(VerifyError::NotProven { gamma: upper });
        }
        let noncausal = match &proof.noncausal {
            Some(witness) => {
                self.noncausal_bound(witness).ok_or(VerifyError::Void { place: "proof.noncausal" })?
            }
            None => 0.0,
        };
        let (bound, banks) = self.lower_bound(proof.lower.as_ref())?;
        let (lower, lower_banks) =
            if bound > noncausal { (bound, banks) } else { (noncausal, BoundedBanks::Any) };
        Ok(Verified { lower, lower_banks, upper, attained, noncausal, states })
    }

    fn lower_bound(&self, proof: Option<&LowerProof>) -> Result<(f64, BoundedBanks), VerifyError> {
        match proof {
            None => Ok((0.0, BoundedBanks::Any)),
            Some(LowerProof::Fir(witnesses)) => {
                let bound = self.fir_bound(witnesses).ok_or(VerifyError::Void { place: "proof.lower" })?;
                Ok((bound, BoundedBanks::FirOfThisLength))
            }
            Some(LowerProof::Causal(CausalWitness { gamma, periods })) => {
                if self.refuted(*gamma, *periods) {
                    Ok((*gamma, BoundedBanks::Causal))
                } else {
                    Err(VerifyError::NotRefuted { gamma: *gamma, periods: *periods })
                }
            }
        }
    }
}

/// Whether the square of a gain is known to [`UNRESOLVED`].
fn is_resolved<F: Number>(square: &Ball<F>) -> bool {
    square.radius() <= UNRESOLVED * square.nearest()
}

/// Real and imaginary part.
pub(crate) type ComplexParts = [DMatrix<Float512>; 2];

/// An error system xi+ = A xi + J u, e = C xi + L u with the Gram matrix S of u.
pub(crate) struct PreciseErrorSystem {
    /// [A; C], (n + M) x n.
    pub(crate) system: DMatrix<Float512>,
    /// [J; L] S [J; L]'.
    pub(crate) input_gram: DMatrix<Float512>,
}

/// The error system and second moments of its samples in 512 bits, for the search for certificates and for
/// witnesses of long filters. Only their midpoints: the proof does not use them.
impl EnclosedErrorSystem<'_> {
    /// The error system in 512 bits.
    pub(crate) fn in_512_bits(&self) -> PreciseErrorSystem {
        let error = self.long_equations();
        PreciseErrorSystem { system: midpoints(&error.system), input_gram: midpoints(&error.input_gram()) }
    }

    /// The point z of the unit circle that `half` names, 1 x 1, and the Gram matrix at it: that of the M
    /// reference samples and the samples of the `channels`.
    pub(crate) fn precise_gram(&self, half: [f64; 2], channels: &[usize]) -> [ComplexParts; 2] {
        let m = self.bank.ratio;
        let z = spectrum::unit(half);
        let rows: Vec<usize> = (0..m).chain(channels.iter().map(|i| m + i)).collect();
        let gram = ball::select(&spectrum::gram(self.long_period(), z), &rows, &rows);
        [DMatrix::from_element(1, 1, z), gram].map(|of| [of.map(|x| x.re.mid()), of.map(|x| x.im.mid())])
    }

    /// Covariance of the samples of the `channels` over `lags` slow periods, for white noise of unit density
    /// at the input, the channels of the latest period first; and the correlations of the M reference
    /// samples (rows) with these.
    pub(crate) fn precise_covariance(
        &self,
        channels: &[usize],
        lags: usize,
    ) -> Option<[DMatrix<Float512>; 2]> {
        let (period, ratio) = (self.long_period(), self.bank.ratio);
        let covariance = Covariance::new(period)?;
        let samples = TapSamples { ratio, channels, lags };
        let own = covariance.of_taps(period, samples);
        Some([own, covariance.with_reference(period, samples)].map(|m| midpoints(&m)))
    }
}

fn midpoints(m: &ball::Matrix<Float512>) -> DMatrix<Float512> {
    m.map(Ball::mid)
}
