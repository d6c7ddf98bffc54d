//! Searches for certificates and witnesses that prove a bank's gammas. They prove nothing by themselves:
//! [`crate::verify`] checks them.

mod causal;
mod certificate;
mod long_filters;
mod long_riccati;
mod units;

use super::merging::Repeats;
use super::methods::DualPoint;
use super::plant::LiftedPlant;
use super::{DesignError, analysis};
use crate::bank::{Bank, DualWitness, Gamma, LowerProof, Proof, SynthesisFilters};
use crate::linalg::{self, CMat, Complex, Mat, power_of_two};
use crate::lti::FrequencyResponse;
use crate::spec::Method;
use crate::verify::{EnclosedErrorSystem, Strictness, Verified};
pub(super) use causal::SEARCHED_PERIODS;
use certificate::certificate;
pub(super) use certificate::{MAX_LONG_STATES, MAX_SEARCHED_STATES};
pub(super) use long_filters::MOST_LONG_TAPS;
use long_filters::{Direction, RIDGES};

/// Directions with less than this share of the dual's weight are ignored.
const NEGLIGIBLE: f64 = 1e-9;
/// Maximum number of witnesses.
const MAX_WITNESSES: usize = 64;
/// Directions of tap space with less effect than this, relative to the strongest, are not used.
const RANK: f64 = 1e-13;
/// Relative distance below the designer's bound at which a proven bound still counts as its proof.
const SHORTFALL: f64 = 0.5e-6;
/// Relative distance from the upper end within which a bound for FIR banks is not searched further for error
/// systems of more than [`MANY_STATES`]: the finite horizon takes a minute there.
const NEAR: f64 = 1e-3;
const MANY_STATES: usize = 48;
/// Relative distance of a stated lower bound below the proven one: another machine may round an approximate
/// inverse differently.
const STATED_BELOW: f64 = 1e-12;

/// A gamma that is proven, not only computed.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Certified {
    /// ||K|| is less than this.
    pub gamma: f64,
    /// ||K|| is at least this.
    pub attained: f64,
    /// Order of P.
    pub states: usize,
}

/// Proves the bank's norm from both sides; see [`crate::verify`] for how.
///
/// # Errors
/// As [`super::analyze`]; [`DesignError::NotCertified`] if no certificate was found.
pub fn certify(bank: &Bank) -> Result<Certified, DesignError> {
    let error = EnclosedErrorSystem::new(bank)?;
    let upper = certificate(&error, bank)?;
    let proof = Proof { upper: Some(upper), ..Proof::default() };
    let Verified { upper, attained, states, .. } = error.judge(&proof, Strictness::NotRefuted)?;
    Ok(Certified { gamma: upper, attained, states })
}

/// Searches for witnesses of the bank's gammas. Returns the proof and the bounds that it proves.
///
/// `dual` is the dual solution of an FIR design. It proves the lower end if the noncausal bound does not.
///
/// # Errors
/// As [`super::analyze`]; [`DesignError::NotCertified`] if no certificate was found;
/// [`DesignError::Verify`] if the proof refutes a gamma of the bank.
pub(crate) fn prove(bank: &Bank, dual: &[DualPoint]) -> Result<(Proof, Verified), DesignError> {
    let error = EnclosedErrorSystem::new(bank)?;
    let upper = certificate(&error, bank)?;
    let witness = noncausal_witness(bank)?;
    let noncausal = error.noncausal_bound(&witness);
    let above = noncausal.unwrap_or(0.0);
    let explained = bank.gamma.lower.is_some_and(|stated| above >= stated * (1.0 - SHORTFALL));
    let lower = if explained { None } else { lower_proof(&error, bank, dual, (above, upper.gamma))? };
    let proof = Proof { upper: Some(upper), lower, noncausal: noncausal.map(|_| witness) };
    let verified = error.judge(&proof, Strictness::NotRefuted)?;
    Ok((proof, verified))
}

/// Adds a proof to `bank` and sets the gammas to the proven bounds. The computed norm does not change.
///
/// # Errors
/// As [`prove`]; `bank` is then unchanged.
pub(crate) fn attach_proof(bank: &mut Bank, dual: &[DualPoint]) -> Result<Verified, DesignError> {
    let (proof, verified) = prove(bank, dual)?;
    let stated = |proven: f64| Some(proven * (1.0 - STATED_BELOW));
    bank.gamma = Gamma {
        upper: Some(verified.upper),
        lower: stated(verified.lower),
        noncausal: stated(verified.noncausal),
        ..bank.gamma
    };
    bank.proof = Some(proof);
    Ok(verified)
}

/// A proof of a lower bound within `interval`: by the dual solution of an FIR design, or else by a finite
/// horizon over which every causal bank has a larger error.
fn lower_proof(
    error: &EnclosedErrorSystem<'_>,
    bank: &Bank,
    dual: &[DualPoint],
    interval: (f64, f64),
) -> Result<Option<LowerProof>, DesignError> {
    let bound = bank.method == Method::Fir && !dual.is_empty();
    let mut witnesses = if bound { binding_witnesses(bank, dual)? } else { Vec::new() };
    let mut reached = error.fir_bound(&witnesses).unwrap_or(0.0);
    let suffices = |reached: f64| bank.gamma.lower.is_none_or(|stated| reached >= stated * (1.0 - SHORTFALL));
    for ridge in RIDGES.into_iter().filter(|_| bound) {
        if suffices(reached) {
            break;
        }
        let longer = long_witnesses(error, bank, dual, ridge)?;
        let bound = error.fir_bound(&longer).unwrap_or(0.0);
        if bound > reached {
            (witnesses, reached) = (longer, bound);
        }
    }
    let enough = suffices(reached) || (error.states() > MANY_STATES && reached >= interval.1 * (1.0 - NEAR));
    let causal = if reached > interval.0 && enough { None } else { causal::witness(error, interval) };
    Ok(match causal {
        Some(witness) if witness.gamma > reached => Some(LowerProof::Causal(witness)),
        _ => (reached > interval.0).then_some(LowerProof::Fir(witnesses)),
    })
}

/// The frequency and direction in which the largest part of the reference samples cannot be estimated from
/// the samples.
fn noncausal_witness(bank: &Bank) -> Result<DualWitness, DesignError> {
    let merged = analysis::bank_problem(bank)?.merge_channels(Repeats::AtWholePeriods).of_unit_size()?;
    let plant = LiftedPlant::new(&merged.problem)?;
    let (n, m) = (plant.channels(), plant.ratio());
    let frequency = plant.noncausal_bound()?.frequency;
    let l = linalg::lq_factor(&FrequencyResponse::new(plant.system()).at_frequency(frequency));
    let rest = l.ncols().saturating_sub(n);
    let part = if rest == 0 { CMat::zeros(m, 1) } else { l.view((n, n), (m, rest)).into_owned() };
    Ok(witness(frequency, &leading_direction(&part)?))
}

/// The left singular vector of the largest singular value.
fn leading_direction(response: &CMat) -> Result<CMat, DesignError> {
    Ok(linalg::svd(response)?.u.columns(0, 1).into_owned())
}

fn witness(frequency: f64, reference: &CMat) -> DualWitness {
    let (s, c) = (0.5 * frequency).sin_cos();
    DualWitness { half: [c, s], reference: pairs(reference), measured: Vec::new() }
}

fn pairs(column: &CMat) -> Vec<[f64; 2]> {
    // Adding 0.0 turns negative zeros into positive ones, for the file.
    column.iter().map(|z| [z.re + 0.0, z.im + 0.0]).collect()
}

/// Witnesses that bound all FIR banks of the bank's length, with the directions and frequencies of the dual
/// solution.
///
/// For given directions a, consider the taps of least sum of ||a* K||^2. Their error is orthogonal to every
/// change of the taps, and this error gives the witnesses. Identical channels count once.
fn binding_witnesses(bank: &Bank, dual: &[DualPoint]) -> Result<Vec<DualWitness>, DesignError> {
    let SynthesisFilters::Fir(taps) = &bank.filters else { return Ok(Vec::new()) };
    let merged = analysis::bank_problem(bank)?.merge_channels(Repeats::AtOneInstant);
    let units = merged.problem.measurement_units()?;
    let merged = merged.of_unit_size()?;
    let plant = LiftedPlant::new(&merged.problem)?;
    let parts = &merged.shares;
    let directions = directions(dual)?;
    let mut served = Service::new(&plant, &directions, taps[0].len());
    served.solve()?;
    // The first channel of each group carries the group's weight.
    let group = |i: usize| parts[i].representative;
    let first = |i: usize| (0..i).all(|before| group(before) != group(i));
    let spread = |column: CMat| -> Vec<[f64; 2]> {
        let weight =
            |i: usize| if first(i) { column[group(i)] * units[group(i)] } else { Complex::new(0.0, 0.0) };
        (0..parts.len()).map(weight).map(|z| [-z.re, -z.im]).collect()
    };
    let directions = directions.iter().enumerate();
    Ok(directions
        .map(|(t, (omega, a))| DualWitness { measured: spread(served.estimate(t)), ..witness(*omega, a) })
        .collect())
}

/// The same in 512 bits; none if they are out of reach.
fn long_witnesses(
    error: &EnclosedErrorSystem<'_>,
    bank: &Bank,
    dual: &[DualPoint],
    ridge: f64,
) -> Result<Vec<DualWitness>, DesignError> {
    let SynthesisFilters::Fir(taps) = &bank.filters else { return Ok(Vec::new()) };
    let all: Vec<Direction> = directions(dual)?
        .iter()
        .map(|(omega, a)| witness(*omega, a))
        .map(|DualWitness { half, reference, .. }| Direction { half, reference })
        .collect();
    let channels = error.distinct_channels();
    let (sizes, gamma) = ((taps[0].len(), bank.ratio), bank.gamma.norm.unwrap_or(0.0));
    let found = long_filters::witnesses(error, &all, (&channels, taps.len()), sizes, (gamma, ridge));
    Ok(found.unwrap_or_default())
}

/// The heaviest directions of a dual with their frequencies; the square of their length is their weight.
fn directions(dual: &[DualPoint]) -> Result<Vec<(f64, CMat)>, DesignError> {
    let mut all = Vec::new();
    for point in dual {
        let svd = linalg::svd(&point.weight)?;
        let scaled = |k: usize| svd.u.columns(k, 1) * Complex::new(svd.s[k].sqrt(), 0.0);
        all.extend((0..svd.s.len()).map(|k| (svd.s[k], point.omega, scaled(k))));
    }
    all.sort_by(|x, y| y.0.total_cmp(&x.0));
    let total: f64 = all.iter().map(|(weight, ..)| weight).sum();
    let heavy = all.into_iter().take(MAX_WITNESSES).take_while(|(weight, ..)| *weight > NEGLIGIBLE * total);
    Ok(heavy.map(|(_, omega, a)| (omega, a)).collect())
}

/// The least-squares problem of the taps for given directions a and frequencies: min over taps of sum |a*
/// (W - F H)|^2.
struct Service<'a> {
    directions: &'a [(f64, CMat)],
    channels: usize,
    ratio: usize,
    length: usize,
    /// For each direction the lower triangular root of the measured samples' Gram matrix, and a* W in its
    /// coordinates.
    targets: Vec<(CMat, CMat)>,
    taps: Vec<f64>,
}

impl<'a> Service<'a> {
    fn new(plant: &LiftedPlant, directions: &'a [(f64, CMat)], length: usize) -> Self {
        let response = FrequencyResponse::new(plant.system());
        let (n, m) = (plant.channels(), plant.ratio());
        let target = |(omega, a): &(f64, CMat)| {
            let l = linalg::lq_factor(&response.at_frequency(*omega));
            let k = n.min(l.ncols());
            (l.view((0, 0), (n, k)).into_owned(), l.view((n, 0), (m, k)).ad_mul(a))
        };
        let targets = directions.iter().map(target).collect();
        Self { directions, channels: n, ratio: m, length, targets, taps: Vec::new() }
    }

    /// The contribution of a unit tap at time n to F* a, for one direction.
    fn turn(&self, direction: usize, n: usize) -> Complex<f64> {
        let (omega, a) = &self.directions[direction];
        a[n % self.ratio] * Complex::from_polar(1.0, omega * (n / self.ratio) as f64)
    }

    /// F* a of the taps found.
    fn estimate(&self, direction: usize) -> CMat {
        let sum = |i: usize| {
            (0..self.length).map(|n| self.turn(direction, n) * self.taps[i * self.length + n]).sum()
        };
        CMat::from_fn(self.channels, 1, |i, _| sum(i))
    }

    /// The taps of the least sum of squares; if they are not unique, those of least norm.
    fn solve(&mut self) -> Result<(), DesignError> {
        let rows: usize = self.targets.iter().map(|(root, _)| 2 * root.ncols()).sum();
        let mut map = Mat::zeros(rows, self.channels * self.length);
        let mut right = Mat::zeros(rows, 1);
        let mut row = 0;
        for (t, (root, target)) in self.targets.iter().enumerate() {
            for k in 0..root.ncols() {
                (right[(row, 0)], right[(row + 1, 0)]) = (target[k].re, target[k].im);
                for n in 0..self.length {
                    let turn = self.turn(t, n);
                    for i in 0..self.channels {
                        let z = root[(i, k)].conj() * turn;
                        (map[(row, i * self.length + n)], map[(row + 1, i * self.length + n)]) = (z.re, z.im);
                    }
                }
                row += 2;
            }
        }
        // Each channel has its own unit, so that weak channels are not lost to rounding.
        let units = self.units(&map);
        map.column_iter_mut().zip(&units).for_each(|(mut column, unit)| column.unscale_mut(*unit));
        let svd = linalg::svd(&map)?;
        let floor = RANK * svd.s.first().copied().unwrap_or(0.0);
        let mut taps = Mat::zeros(map.ncols(), 1);
        // The second pass corrects the rounding errors of the first.
        for _ in 0..2 {
            let mut part = svd.u.tr_mul(&(&right - &map * &taps));
            part.iter_mut().zip(&svd.s).for_each(|(x, &s)| *x = if s > floor { *x / s } else { 0.0 });
            taps += &svd.v * part;
        }
        self.taps = taps.iter().zip(&units).map(|(tap, unit)| tap / unit).collect();
        Ok(())
    }

    /// For each tap the power of two that is near the largest effect of any tap of its channel.
    fn units(&self, map: &Mat) -> Vec<f64> {
        let channel = |i: usize| map.columns(i * self.length, self.length).amax();
        (0..self.channels).flat_map(|i| vec![power_of_two(channel(i)); self.length]).collect()
    }
}
