//! Searches for the certificate of the upper end: a solution of the bounded-real Riccati equation at a gamma
//! slightly above the norm.
//!
//! Double precision finds it for most banks. After steep filters, whose samples are nearly dependent, the
//! error is a small difference of large numbers; the equation is then solved in 256 bits, and in 512 where
//! these do not do either.

use super::enclosed_norm::EnclosedGains;
use super::{leading_direction, witness};
use crate::design::DesignError;
use crate::design::limits::{MAX_LONG_STATES, Stop};
use crate::lti::gramian::{controllability_root, observability_root};
use crate::lti::peak::hinf_norm;
use crate::lti::{GramianCoordinates, LtiError, StateSpace, bounded_real_riccati};
use hybank_core::bank::{Certificate, GainWitness};
use hybank_linalg::{Complex, Mat, power_of_two};
use hybank_verify::arithmetic::dense::{cholesky, product, riccati_limit, select, solve, symmetric};
use hybank_verify::arithmetic::{BigFloat, Float, Float512};
use hybank_verify::verify::enclosed::PreciseErrorSystem;
use hybank_verify::verify::{EnclosedErrorSystem, Midpoint, ZERO_NORM};
use nalgebra::DMatrix as Matrix;

/// What the search for a certificate tolerates.
struct Settings {
    /// Part of the excess that white noise on the states may take there: it leaves nearly all to the
    /// certificate.
    noise_share_of_excess: f64,
    /// Noise added to every state in the choice of coordinates, relative to the root of gamma and its
    /// excess (and of the number of states). With it no direction is unobservable. The noise would raise
    /// the norm by only a hundredth of the excess.
    state_noise: f64,
    /// Relative distance of the enclosed gain at the peak from the norm above which double precision does
    /// not resolve the norm.
    resolved_norm_gap: f64,
}

/// Of every search.
const SETTINGS: Settings =
    Settings { noise_share_of_excess: 1e-3, state_noise: 0.1, resolved_norm_gap: 1e-7 };

/// Relative excesses over the computed norm at which the search tries to find a certificate, smallest
/// first.
pub(super) const EXCESSES: [f64; 8] = [1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1];
/// The relative excesses that are tried in double precision before more bits are used.
const FINE_EXCESSES: usize = 3;
/// Words of 64 bits of the numbers that are tried: 256 bits, and 512.
const FEWER_WORDS: usize = 4;
const MORE_WORDS: usize = 8;
/// The relative excesses that are tried in 256 and in 512 bits.
const LONG_EXCESSES: [f64; 3] = [1e-7, 1e-5, 1e-3];
/// The same in units of `ZERO_NORM`, for norms that are zero up to rounding.
const ZERO_NORM_EXCESSES: [f64; 3] = [1.0, 1e2, 1e4];
/// Weights on all states, relative to the excess.
const STATE_WEIGHTS: [f64; 2] = [1e-1, 1e-4];
/// Significant digits of the certificate's numbers in the file.
const DIGITS: [usize; 4] = [9, 12, 15, 17];
/// Significant digits of the corrections.
const CORRECTION_DIGITS: [usize; 2] = [9, 17];
/// Maximum number of states of an error system for which the search tries to find a certificate. It needs
/// eigenvalues of matrices twice as large.
const MAX_SEARCHED_STATES: usize = 512;

/// The certificate with the least gamma, of those tried until `stop` is due, that passes.
pub(super) fn certificate(error: &EnclosedErrorSystem<'_>, stop: &Stop) -> Result<Certificate, DesignError> {
    if error.states() > MAX_SEARCHED_STATES {
        return Err(DesignError::NotSearched { states: error.states(), limit: MAX_SEARCHED_STATES });
    }
    let states = error.states();
    let raw = error.midpoint().ok_or(DesignError::NotCertified { states, failure: None })?;
    let units = Units::of(&raw, error.scale())?;
    let middle = units.of_one(&raw);
    let system = StateSpace::new(middle.a.clone(), middle.b.clone(), middle.c.clone(), middle.d.clone());
    let peak = hinf_norm(&system)?;
    let response = system.response_at(Complex::from_polar(1.0, peak.frequency));
    let mut peak_witness = witness(peak.frequency, &leading_direction(&response)?);
    let mut norm = peak.gain;
    let floor = ZERO_NORM * error.scale() / units.reference;
    let shown = error.attains(&peak_witness).unwrap_or(0.0) / units.reference;
    if norm > floor
        && (shown - norm).abs() > SETTINGS.resolved_norm_gap * norm
        && let Some((gain, enclosed)) = EnclosedGains(error).peak(None)?
    {
        (norm, peak_witness) = (gain / units.reference, enclosed);
    }
    let search = Certifier { error, units: &units, middle: &middle, peak: peak_witness };
    let level = |excess: &f64| TrialGamma { norm, excess: excess * norm.max(floor) };
    let mut failure = None;
    let mut in_doubles = |excess: &f64| {
        if stop.is_due() {
            return None;
        }
        search.in_doubles(level(excess)).unwrap_or_else(|failed| {
            failure.get_or_insert(Box::new(failed));
            None
        })
    };
    let is_zero = norm <= floor;
    let (fine, coarse) =
        if is_zero { (&ZERO_NORM_EXCESSES[..], &[][..]) } else { EXCESSES.split_at(FINE_EXCESSES) };
    let long = || {
        let excesses = if is_zero { ZERO_NORM_EXCESSES } else { LONG_EXCESSES };
        let long = search.in_512_bits()?;
        let mut tried = excesses.iter().take_while(|_| !stop.is_due());
        tried.find_map(|excess| {
            let level = level(excess);
            search.of_long::<FEWER_WORDS>(&long, level).or_else(|| search.of_long::<MORE_WORDS>(&long, level))
        })
    };
    let found = fine.iter().find_map(&mut in_doubles).or_else(long);
    found.or_else(|| coarse.iter().find_map(&mut in_doubles)).ok_or_else(|| match stop.is_due() {
        true => DesignError::Stopped,
        false => DesignError::NotCertified { states, failure },
    })
}

/// A gamma that is tried.
#[derive(Debug, Clone, Copy)]
pub(super) struct TrialGamma {
    pub(super) norm: f64,
    pub(super) excess: f64,
}

impl TrialGamma {
    /// The gamma that is proven.
    pub(super) fn gamma(self) -> f64 {
        self.norm + self.excess
    }

    /// The level of the Riccati equation.
    fn middle(self) -> f64 {
        self.norm + 0.5 * self.excess
    }
}

/// What is certified.
struct Certifier<'a> {
    error: &'a EnclosedErrorSystem<'a>,
    units: &'a Units,
    /// The system in these units.
    middle: &'a Midpoint,
    peak: GainWitness,
}

impl Certifier<'_> {
    /// The certificate of these numbers in units of one, if it proves its gamma.
    fn passes(
        &self,
        level: TrialGamma,
        factor: Vec<Vec<f64>>,
        correction: Vec<Vec<f64>>,
    ) -> Option<Certificate> {
        let gamma = level.gamma() * self.units.reference;
        let [factor, correction] = [factor, correction].map(|rows| self.units.factor(rows));
        let found = Certificate { gamma, peak: self.peak.clone(), factor, correction };
        self.error.certifies(&found).then_some(found)
    }

    fn in_doubles(&self, level: TrialGamma) -> Result<Option<Certificate>, DesignError> {
        in_doubles(self.middle, level, |factor| self.passes(level, factor, Vec::new()))
    }

    /// `None` for many states.
    fn in_512_bits(&self) -> Option<LongSystem> {
        if self.error.states() > MAX_LONG_STATES {
            return None;
        }
        let energy = observability_root(&self.middle.a, &self.middle.c).ok()?.norm_squared();
        Some(LongSystem { error: self.units.of_long(&self.error.in_512_bits()), energy })
    }

    /// In numbers of so many words, R as two doubles per entry where one does not do.
    fn of_long<const WORDS: usize>(&self, long: &LongSystem, level: TrialGamma) -> Option<Certificate> {
        let noise = SETTINGS.noise_share_of_excess * level.excess;
        let [factor, correction] = long.root::<WORDS>(level.middle(), noise)?;
        let passes = |correction| self.passes(level, factor.clone(), correction);
        let corrected = || CORRECTION_DIGITS.iter().find_map(|&digits| passes(rounded(&correction, digits)));
        passes(Vec::new()).or_else(corrected)
    }
}

/// What `passes` makes of the first rows of R for `middle` that it accepts.
pub(super) fn in_doubles<T>(
    middle: &Midpoint,
    level: TrialGamma,
    passes: impl Fn(Vec<Vec<f64>>) -> Option<T>,
) -> Result<Option<T>, DesignError> {
    let noise = SETTINGS.state_noise * (level.excess * level.gamma()).sqrt();
    let riccati = Riccati::new(middle, noise)?;
    let tried = |weight: &f64| {
        let factor = riccati.factor(level.middle(), weight * level.excess)?;
        DIGITS.iter().find_map(|&digits| passes(rounded(&factor, digits)))
    };
    Ok(STATE_WEIGHTS.iter().find_map(tried))
}

/// Rows with so many significant digits.
fn rounded(rows: &[Vec<f64>], digits: usize) -> Vec<Vec<f64>> {
    let places = digits - 1;
    let round = |x: &f64| format!("{x:.places$e}").parse().unwrap_or(*x);
    rows.iter().map(|row| row.iter().map(round).collect()).collect()
}

/// The bounded-real Riccati equation of the transposed error system, in coordinates in which its
/// controllability Gramian (the observability Gramian of the system) is the identity.
struct Riccati {
    a: Mat,
    b: Mat,
    c: Mat,
    d: Mat,
    /// From the states to the coordinates.
    inverse: Mat,
}

impl Riccati {
    /// Coordinates for the system with a total of `noise` added to the states.
    fn new(middle: &Midpoint, noise: f64) -> Result<Self, DesignError> {
        let Midpoint { a, b, c, d } = middle;
        let (n, m) = (a.nrows(), c.nrows());
        let state_noise = Mat::from_diagonal_element(n, n, noise / (n.max(1) as f64).sqrt());
        let inputs = hybank_linalg::hstack(&[&c.transpose(), &state_noise]);
        let k = GramianCoordinates::new(&a.transpose(), &inputs, 0.0)?;
        let outputs = k.b.columns(0, m).into_owned();
        Ok(Self { c: b.tr_mul(&k.basis), a: k.a, b: outputs, d: d.transpose(), inverse: k.inverse })
    }

    /// Rows of R with P = R R' at `gamma`, with a weight on all states that keeps the inequality strictly
    /// feasible.
    fn factor(&self, gamma: f64, weight: f64) -> Option<Vec<Vec<f64>>> {
        let p = bounded_real_riccati(&self.a, &self.b, &self.c, &self.d, gamma, weight)?;
        let half = hybank_linalg::cholesky(&p).ok()?;
        let root = hybank_linalg::lq_factor(&(self.inverse.tr_mul(&half) * gamma.sqrt()));
        Some((0..root.nrows()).map(|i| root.row(i).iter().take(i + 1).copied().collect()).collect())
    }
}

/// The error system in 512 bits, in units of one.
struct LongSystem {
    error: PreciseErrorSystem,
    /// Of noise of unit density on all states, in e.
    energy: f64,
}

impl LongSystem {
    /// Rows of a lower triangular R with P = R R' at the level `gamma`, and of what rounding to doubles
    /// takes from it. The noise on the states adds about `noise` to the norm. `None` if there is no such P.
    fn root<const WORDS: usize>(&self, gamma: f64, noise: f64) -> Option<[Vec<Vec<f64>>; 2]> {
        let equation = LongRiccati::<WORDS>::new(&self.error, 2.0 * gamma * noise / self.energy);
        let root = cholesky(&equation.limit(gamma)?)?;
        let rows = |entry: &dyn Fn(BigFloat<WORDS>) -> f64| -> Vec<Vec<f64>> {
            (0..root.nrows()).map(|i| (0..=i).map(|j| entry(root[(i, j)])).collect()).collect()
        };
        Some([rows(&|x| x.nearest()), rows(&|x| (x - BigFloat::from(x.nearest())).nearest())])
    }
}

/// The bounded-real Riccati equation in numbers of more bits.
///
/// With xi+ = A xi + J u, e = C xi + L u and the Gram matrix S of u, the least P at the level gamma is the
/// limit from P = 0 of
///
/// ```text
/// P+ = A P A' + J S J' + N - T' Re^-1 T,   T = C P A' + L S J',   Re = C P C' + L S L' - gamma^2 I.
/// ```
///
/// N is white noise on the states. It makes the inequality of the certificate strict. The limit is that of
/// P+ = F P (I + G P)^-1 F' + H with F = A - T' Re^-1 C, G = C' Re^-1 C and H = P+, all at P = 0.
struct LongRiccati<const WORDS: usize> {
    a: Matrix<BigFloat<WORDS>>,
    c: Matrix<BigFloat<WORDS>>,
    /// J S J' + N.
    input_gram: Matrix<BigFloat<WORDS>>,
    /// L S J'.
    cross: Matrix<BigFloat<WORDS>>,
    /// L S L'.
    direct: Matrix<BigFloat<WORDS>>,
}

impl<const WORDS: usize> LongRiccati<WORDS> {
    /// With white noise of the variance `noise` on each state.
    fn new(error: &PreciseErrorSystem, noise: f64) -> Self {
        let n = error.system.ncols();
        let (states, outputs): (Vec<usize>, Vec<usize>) =
            ((0..n).collect(), (n..error.system.nrows()).collect());
        let system = error.system.map(Float512::rounded);
        let gram = error.input_gram.map(Float512::rounded);
        let mut input_gram = select(&gram, &states, &states);
        (0..n).for_each(|i| input_gram[(i, i)] += BigFloat::from(noise));
        Self {
            a: select(&system, &states, &states),
            c: select(&system, &outputs, &states),
            input_gram,
            cross: select(&gram, &outputs, &states),
            direct: select(&gram, &outputs, &outputs),
        }
    }

    /// P at the level `gamma`; `None` if the recursion has no limit.
    fn limit(&self, gamma: f64) -> Option<Matrix<BigFloat<WORDS>>> {
        let Self { a, c, input_gram, cross, direct } = self;
        let mut re = direct.clone();
        (0..re.nrows()).for_each(|i| re[(i, i)] -= BigFloat::from(gamma) * BigFloat::from(gamma));
        let (weighted_c, weighted_t) = (solve(&re, c)?, solve(&re, cross)?);
        let f = a - product(&cross.transpose(), &weighted_c);
        let g = symmetric(&product(&c.transpose(), &weighted_c));
        let h = symmetric(&(input_gram - product(&cross.transpose(), &weighted_t)));
        riccati_limit(&f, &g, &h)
    }
}

/// Units of states and references, which make the search independent of the gains of the front ends. They
/// are powers of two, so that a change of units rounds nothing.
///
/// With xi = T eta, T diagonal, and e counted in units of s, a P that proves ||K|| <= gamma for [A, J; C,
/// L] is T Q T' where Q proves ||K|| / s <= gamma / s for [T^-1 A T, T^-1 J; C T / s, L / s].
pub(super) struct Units {
    states: Vec<f64>,
    /// Unit of the reference samples, and so of gamma.
    pub(super) reference: f64,
}

impl Units {
    /// Units near the standard deviations of the states and near the size `scale` of the reference samples.
    ///
    /// # Errors
    /// [`LtiError::IterationLimit`] if the system is not stable.
    pub(super) fn of(system: &Midpoint, scale: f64) -> Result<Self, LtiError> {
        let root = controllability_root(&system.a, &system.b)?;
        let states = root.row_iter().map(|row| power_of_two(row.norm())).collect();
        Ok(Self { states, reference: power_of_two(scale) })
    }

    /// The system in these units.
    pub(super) fn of_one(&self, system: &Midpoint) -> Midpoint {
        let entry = |m: &Mat, row: &dyn Fn(usize) -> f64, column: &dyn Fn(usize) -> f64| {
            Mat::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] / row(i) * column(j))
        };
        let (state, reference, input) =
            (|i: usize| self.states[i], |_: usize| self.reference, |_: usize| 1.0);
        Midpoint {
            a: entry(&system.a, &state, &state),
            b: entry(&system.b, &state, &input),
            c: entry(&system.c, &reference, &state),
            d: entry(&system.d, &reference, &input),
        }
    }

    /// Converts rows of R from these units to those of the file.
    pub(super) fn factor(&self, rows: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        let scaled = |(row, unit): (Vec<f64>, &f64)| row.into_iter().map(|x| x * unit).collect();
        rows.into_iter().zip(&self.states).map(scaled).collect()
    }

    /// The system in 512 bits in these units.
    fn of_long(&self, error: &PreciseErrorSystem) -> PreciseErrorSystem {
        let unit = |i: usize| Float512::from(*self.states.get(i).unwrap_or(&self.reference));
        let PreciseErrorSystem { system, input_gram } = error;
        let system =
            Matrix::from_fn(system.nrows(), system.ncols(), |i, j| system[(i, j)] * unit(j) / unit(i));
        let gram = |i: usize, j: usize| input_gram[(i, j)] / unit(i) / unit(j);
        PreciseErrorSystem {
            system,
            input_gram: Matrix::from_fn(input_gram.nrows(), input_gram.ncols(), gram),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// x+ = a x + u, e = x: with N = 0 the equation is P = a^2 P + 1 + a^2 P^2 / (g^2 - P), or
    /// P^2 - (1 + g^2 (1 - a^2)) P + g^2 = 0 with the norm 1 / (1 - a).
    fn one_pole<const WORDS: usize>(gamma: f64) -> Option<f64> {
        let number = |rows: usize, columns: usize, entries: &[f64]| {
            Matrix::from_fn(rows, columns, |i, j| Float512::from(entries[i * columns + j]))
        };
        let error = PreciseErrorSystem {
            system: number(2, 1, &[0.5, 1.0]),
            input_gram: number(2, 2, &[1.0, 0.0, 0.0, 0.0]),
        };
        Some(LongRiccati::<WORDS>::new(&error, 0.0).limit(gamma)?[(0, 0)].nearest())
    }

    #[test]
    fn one_pole_has_its_quadratic_root() {
        roots_are_those_of_the_quadratic::<FEWER_WORDS>();
        roots_are_those_of_the_quadratic::<MORE_WORDS>();
    }

    fn roots_are_those_of_the_quadratic<const WORDS: usize>() {
        for gamma in [2.0 * (1.0 + 1e-12), 2.1, 10.0_f64] {
            let b = 1.0 + 0.75 * gamma * gamma;
            let exact = 2.0 * gamma * gamma / (b + (b * b - 4.0 * gamma * gamma).sqrt());
            let p = one_pole::<WORDS>(gamma).unwrap();
            assert!((p / exact - 1.0).abs() < 1e-5, "{gamma}: {p} {exact}");
        }
        let below = one_pole::<WORDS>(1.9);
        assert!(below.is_none_or(|p| !(0.0..=1.9 * 1.9).contains(&p)), "{below:?}");
    }
}
