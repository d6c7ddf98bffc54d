//! Searches for the proof of a worst case over a box: the diagonal D and the certificates of its two norms.

use super::upper::{EXCESSES, TrialGamma, Units, certificate, in_doubles};
use crate::design::DesignError;
use crate::design::filters::FilterResponse;
use crate::design::limits::Stop;
use crate::lti::peak::hinf_norm;
use crate::lti::{FrequencyResponse, StateSpace};
use hybank_core::bank::{Bank, BoxProof, Certificate, NormBound, Proof};
use hybank_core::spec::{ErrorBox, Spec};
use hybank_linalg::CMat;
use hybank_verify::verify::{self, EnclosedBox, EnclosedErrorSystem, EnclosedSystem, Midpoint};
use std::f64::consts::PI;

/// Frequencies at which the scales are chosen. They only decide how close the bound is.
const FREQUENCIES: usize = 41;

/// A worst case with its proof.
struct WorstCase {
    bound: f64,
    proof: BoxProof,
}

/// Adds the worst case over the box of its spec to a bank that carries a proof. The bank stays as it is
/// where none is proven, or where it has no box.
///
/// # Errors
/// As [`worst_case`].
pub(in crate::design) fn attach_box_proof(bank: &mut Bank, stop: &Stop) -> Result<(), DesignError> {
    let errors = bank.spec.as_ref().and_then(Spec::error_box);
    let Some((errors, Proof { upper, .. })) = errors.zip(bank.proof.clone()) else { return Ok(()) };
    let WorstCase { bound, proof } = proven(bank, &errors, &upper, stop)?;
    bank.gamma.worst_case = Some(bound);
    bank.proof = Some(Proof { upper, worst_case: Some(proof) });
    Ok(())
}

/// A proven bound of the norm of `bank` over `errors`.
///
/// # Errors
/// [`DesignError::Verify`] for a box that does not fit the bank; [`DesignError::NotCertified`] if a
/// certificate was not found; [`DesignError::Stopped`] if `stop` ended the search.
pub(in crate::design) fn worst_case(bank: &Bank, errors: &ErrorBox, stop: &Stop) -> Result<f64, DesignError> {
    let error = EnclosedErrorSystem::new(bank)?;
    let carried = bank.proof.as_ref().map(|proof| &proof.upper);
    let nominal = match carried.filter(|carried| error.certifies(carried)) {
        Some(carried) => carried.clone(),
        None => certificate(&error, stop)?,
    };
    Ok(proven(bank, errors, &nominal, stop)?.bound)
}

/// The worst case of a bank whose norm `nominal` certifies.
fn proven(
    bank: &Bank,
    errors: &ErrorBox,
    nominal: &Certificate,
    stop: &Stop,
) -> Result<WorstCase, DesignError> {
    let proof = box_proof(bank, errors, stop)?;
    let states = nominal.factor.len();
    let bound = verify::worst_case(bank, errors, nominal, &proof)?;
    Ok(WorstCase { bound: bound.ok_or(DesignError::NotCertified { states, failure: None })?, proof })
}

/// The proof of what the errors of `errors` add to the norm of `bank`.
fn box_proof(bank: &Bank, errors: &ErrorBox, stop: &Stop) -> Result<BoxProof, DesignError> {
    let enclosed = EnclosedBox::new(bank, errors)?;
    let slopes = enclosed.slopes(&vec![1.0; enclosed.samples().len()]);
    let scales = Responses::new(bank, enclosed.samples(), &slopes)?.scales();
    let filters = norm_bound(&enclosed.filters(&scales), stop)?;
    let slopes = norm_bound(&enclosed.slopes(&scales), stop)?;
    Ok(BoxProof { scales, filters, slopes })
}

/// The bound of the norm of `system` with the least excess, of those tried until `stop` is due, that passes.
fn norm_bound(system: &EnclosedSystem, stop: &Stop) -> Result<NormBound, DesignError> {
    let states = system.order();
    let not_certified = |failure| DesignError::NotCertified { states, failure };
    let raw = system.midpoint().ok_or_else(|| not_certified(None))?;
    let largest = hinf_norm(&state_space(&raw))?.gain;
    let units = Units::of(&raw, largest)?;
    let (middle, norm) = (units.of_one(&raw), largest / units.reference);
    let mut failure = None;
    for excess in EXCESSES {
        if stop.is_due() {
            return Err(DesignError::Stopped);
        }
        let level = TrialGamma { norm, excess: excess * norm };
        let passes = |factor| {
            let bound = NormBound { norm: level.gamma() * units.reference, factor: units.factor(factor) };
            system.certifies(&bound).then_some(bound)
        };
        match in_doubles(&middle, level, passes) {
            Ok(Some(found)) => return Ok(found),
            Ok(None) => {}
            Err(failed) => failure = failure.or(Some(Box::new(failed))),
        }
    }
    Err(not_certified(failure))
}

fn state_space(system: &Midpoint) -> StateSpace {
    let Midpoint { a, b, c, d } = system.clone();
    StateSpace::new(a, b, c, d)
}

/// F and the uncertain rows at some frequencies.
struct Responses {
    /// A column for each row: that of its sample.
    filters: Vec<CMat>,
    rows: Vec<CMat>,
}

impl Responses {
    fn new(bank: &Bank, samples: &[usize], slopes: &EnclosedSystem) -> Result<Self, DesignError> {
        let states = slopes.order();
        let middle = slopes.midpoint().ok_or(DesignError::NotCertified { states, failure: None })?;
        let (filters, rows) =
            (FilterResponse::new(&bank.filters, bank.ratio)?, FrequencyResponse::new(&state_space(&middle)));
        let frequencies = (0..FREQUENCIES).map(|k| PI * k as f64 / (FREQUENCIES - 1) as f64);
        let (filters, rows) =
            frequencies.map(|w| (filters.at(w).select_columns(samples), rows.at_frequency(w))).unzip();
        Ok(Self { filters, rows })
    }

    /// D: the root of the ratio of the largest sizes of a column and of its row.
    fn scales(&self) -> Vec<f64> {
        let of = |i: usize| {
            let column = self.filters.iter().map(|filters| filters.column(i).norm()).fold(0.0, f64::max);
            let row = self.rows.iter().map(|rows| rows.row(i).norm()).fold(f64::MIN_POSITIVE, f64::max);
            (column / row).sqrt().max(f64::MIN_POSITIVE)
        };
        (0..self.rows[0].nrows()).map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hybank_linalg::{Complex, singular_values, solve};
    use std::f64::consts::TAU;

    type C = Complex<f64>;

    /// Converters that sample a band after Butterworth filters; frequencies in shares of the fast rate.
    struct System {
        delays: &'static [f64],
        band: f64,
        order: u32,
        cutoff: f64,
    }

    const EIGHT: [f64; 8] = [0.0, 1.224, 1.703, 3.193, 4.178, 4.981, 5.882, 6.867];
    const ALIASES: i32 = 40;
    /// What is outside of the band, in amplitude, and the noise that keeps least squares regular, in power.
    const OUTSIDE: f64 = 1e-3;
    const NOISE: f64 = 1e-6;

    impl System {
        fn response(&self, nu: f64) -> C {
            let n = self.order;
            let pole =
                |k: u32| C::from_polar(TAU * self.cutoff, PI * f64::from(2 * k + n + 1) / f64::from(2 * n));
            let own: C = (0..n).map(|k| -pole(k) / (C::new(0.0, nu) - pole(k))).product();
            // The product of the n poles times (-1)^n is the n-th power of the cut-off.
            own * if nu.abs() <= TAU * self.band { 1.0 } else { OUTSIDE }
        }

        /// The filters of least squares, and the derivatives of the rows of samples by their delays.
        fn at(&self, omega: f64) -> (CMat, CMat) {
            let m = self.delays.len();
            let nu = |k: usize| (omega + TAU * f64::from(k as i32 - ALIASES)) / m as f64;
            let row = |time: f64, k: usize| self.response(nu(k)) * C::from_polar(1.0, nu(k) * time);
            let count = (2 * ALIASES + 1) as usize;
            let reference = CMat::from_fn(m, count, |p, k| row(p as f64, k));
            let samples = CMat::from_fn(m, count, |i, k| row(-self.delays[i], k));
            let mut gram = &samples * samples.adjoint();
            let noise = gram.trace() * (NOISE / m as f64);
            (0..m).for_each(|i| gram[(i, i)] += noise);
            let slopes = samples.map_with_location(|_, k, x| x * C::new(0.0, -nu(k)));
            (solve(&gram, &(&samples * reference.adjoint())).adjoint(), slopes)
        }
    }

    /// The largest gain of F diag(+-1) H' over all signs and the frequencies of `all`.
    fn attained(all: &Responses) -> f64 {
        let n = all.rows[0].nrows();
        let gain = |corner: usize| {
            let sign = |i: usize| C::from(if corner >> i & 1 == 1 { -1.0 } else { 1.0 });
            let product = |(f, h): (&CMat, &CMat)| f.map_with_location(|_, i, x| x * sign(i)) * h;
            let gains =
                all.filters.iter().zip(&all.rows).map(|pair| singular_values(&product(pair)).unwrap()[0]);
            gains.fold(0.0, f64::max)
        };
        (0..1 << (n - 1)).map(gain).fold(0.0, f64::max)
    }

    /// The product of the two norms with these scales.
    fn product(all: &Responses, scales: &[f64]) -> f64 {
        let norm = |m: CMat| singular_values(&m).unwrap()[0];
        let columns = all.filters.iter().map(|f| norm(f.map_with_location(|_, j, x| x / scales[j])));
        let rows = all.rows.iter().map(|h| norm(h.map_with_location(|i, _, x| x * scales[i])));
        columns.fold(0.0, f64::max) * rows.fold(0.0, f64::max)
    }

    /// By numpy from the same aliases: what is attained, and the product of the norms over it with the
    /// scales of the mean ratio of sizes, than which these are no worse.
    #[test]
    fn the_product_of_two_norms_is_close_to_what_is_attained() {
        let systems = [
            (System { delays: &[3.0, 2.0, 1.0, 0.0], band: 0.45, order: 4, cutoff: 0.4 }, 3.794_540, 1.0000),
            (System { delays: &[1.2, 0.6], band: 0.4, order: 2, cutoff: 0.3 }, 3.580_940, 1.0001),
            (System { delays: &[2.95, 2.1, 1.3, 0.0], band: 0.4, order: 4, cutoff: 0.3 }, 3.291_689, 1.3156),
            (System { delays: &EIGHT, band: 0.4, order: 4, cutoff: 0.35 }, 8.605_662, 1.1206),
        ];
        for (system, known, ratio) in systems {
            let frequencies = (0..101).map(|k| PI * (f64::from(k) + 0.5) / 101.0);
            let (filters, rows) = frequencies.map(|w| system.at(w)).unzip();
            let all = Responses { filters, rows };
            let attained = attained(&all);
            assert!((attained / known - 1.0).abs() < 1e-6, "{attained} {known}");
            let found = product(&all, &all.scales()) / attained;
            assert!(found >= 1.0 - 1e-9 && found < ratio + 1e-4, "{found} {ratio}");
        }
    }
}
