//! Delays and gains from any signal, by the Whittle likelihood of the slow spectral matrix.
//!
//! At the slow frequency W the captures show the aliases nu_k = (W + 2 pi k) / M of the analog signal. Their
//! spectral matrix, N x N, is
//!
//! ```text
//! R(W) = A(W) S(W) A(W)* + s(W) I,      A_ik = g_i Phi_i(j nu_k / c_i) e^{-j nu_k D_i}
//! ```
//!
//! over the occupied aliases. Where they are fewer than the channels, A leaves directions that hold noise
//! only, whatever the signal is, and these determine the ratios of A's rows. Signal S and noise s of each
//! band of frequencies are free, so the weight of a band follows from its noise. The eigenvalues of its
//! matrix show which aliases it holds: p large ones are the p aliases of lowest frequency, as a signal after
//! low-passes has them.
//!
//! Fisher scoring finds the maximum; the inverse of the Fisher information is the covariance of the
//! estimates.
//!
//! Sources: P. Whittle, *The analysis of multiple stationary time series*, J. R. Stat. Soc. B 15, 1953; P.
//! Stoica and A. Nehorai, *Performance study of conditional and unconditional direction-of-arrival
//! estimation*, IEEE Trans. ASSP 38(10), 1990, for the score with S and s eliminated.

mod likelihood;
mod occupancy;
mod spectra;
#[cfg(test)]
mod tests;

use super::error::CalibrateError;
use super::estimates::{Fitted, covariance};
use super::model::Model;
use super::parameters::{Fit, Kind, Point};
use super::record::{Record, longest_run};
use super::remark::Remark;
use crate::linalg::{CMat, Complex, Mat, solve};
use likelihood::{Score, band_score, complement, lowest_aliases, noise_power, steering};
use occupancy::occupied;
pub(super) use spectra::{Band, Spectra};
use std::f64::consts::TAU;

/// Least number of frames in a row.
const LEAST_FRAMES: usize = 256;
/// Most Fisher scoring steps.
const MOST_STEPS: usize = 60;
/// The iteration ends when every step is below this share of its standard deviation.
const SMALL_STEP: f64 = 1e-3;
/// Largest step of a delay in fast periods: a quarter of the period of the highest frequency below pi.
const LARGEST_STEP: f64 = 0.5;
/// Eigenvalues below this share of the largest count as noise: at first, when wrong delays smear the phases
/// within a band, and once the delays are known.
const FIRST_LEAST: f64 = 1e-3;
const FINAL_LEAST: f64 = 1e-6;
/// Bands whose aliases were found.
struct Occupied {
    band: Band,
    aliases: Vec<i32>,
}

/// The data of a blind fit.
pub(super) struct Blind<'a> {
    model: &'a Model,
    spectra: Spectra,
    frames: usize,
    /// Bands with more aliases are left out.
    most_aliases: usize,
}

/// The maximum of the likelihood.
pub(super) struct Maximum {
    pub(super) point: Point,
    /// Of all bands.
    score: Score,
    /// Of the lower and of the upper half of the used bands.
    halves: [Score; 2],
    /// Mean noise of the used bands, per sample.
    noise: f64,
}

impl<'a> Blind<'a> {
    /// Of the longest run of frames that no record lacks.
    pub(super) fn new(model: &'a Model, records: &[Record]) -> Result<Self, CalibrateError> {
        let (first, frames) = longest_run(records);
        if frames < LEAST_FRAMES {
            return Err(CalibrateError::TooShort { frames, needed: LEAST_FRAMES });
        }
        let captures: Vec<&[f64]> = records.iter().map(|r| &r.samples[first..first + frames]).collect();
        let delays: Vec<f64> = model.delays.iter().map(|delay| delay.0).collect();
        let spectra = Spectra::new(&captures, &delays, model.ratio);
        Ok(Self { model, spectra, frames, most_aliases: usize::MAX })
    }

    /// As [`Blind::new`], of bands with one alias only.
    pub(super) fn of_single_aliases(model: &'a Model, records: &[Record]) -> Result<Self, CalibrateError> {
        Ok(Self { most_aliases: 1, ..Self::new(model, records)? })
    }

    /// The maximum of the likelihood near the nominal values.
    pub(super) fn maximise(&self, fit: Fit, reference: usize) -> Result<Maximum, CalibrateError> {
        let mut point = Point::nominal(self.model, fit, reference);
        self.ascend(&mut point, FIRST_LEAST)?;
        self.ascend(&mut point, FINAL_LEAST)
    }

    fn bands(&self, point: &Point, least: f64) -> Vec<Occupied> {
        let bands = self.spectra.bands(&point.delays);
        let counts = occupied(&bands, least);
        let held = |(band, count): (Band, usize)| {
            let aliases = lowest_aliases(band.w, count);
            Occupied { band, aliases }
        };
        let with_signal =
            bands.into_iter().zip(counts).filter(|&(_, count)| (1..=self.most_aliases).contains(&count));
        with_signal.map(held).collect()
    }

    fn ascend(&self, point: &mut Point, least: f64) -> Result<Maximum, CalibrateError> {
        let counted = self.bands(point, least);
        let chosen: Vec<usize> = counted.iter().map(|held| held.aliases.len()).collect();
        if chosen.is_empty() {
            return Err(CalibrateError::AllAliasesOccupied { channels: self.model.channels() });
        }
        let centres: Vec<f64> = counted.iter().map(|held| held.band.w).collect();
        for _ in 0..MOST_STEPS {
            // The bands stay the same ones while the point moves; only their phases follow it.
            let bands = self.spectra.bands(&point.delays).into_iter();
            let bands = bands.filter_map(|band| {
                let at = centres.iter().position(|&w| w == band.w)?;
                Some(Occupied { aliases: lowest_aliases(band.w, chosen[at]), band })
            });
            let maximum = self.scored(point, bands.collect());
            let (step, sigma) = self.step(&maximum.score)?;
            let delays = point.parameters.iter().zip(step.iter()).filter(|(p, _)| p.kind == Kind::Delay);
            let largest = delays.map(|(_, x)| x.abs()).fold(0.0, f64::max);
            let factor = if largest > LARGEST_STEP { LARGEST_STEP / largest } else { 1.0 };
            if step.iter().zip(&sigma).all(|(x, sigma)| x.abs() < SMALL_STEP * sigma) {
                return Ok(maximum);
            }
            point.advance(step.iter().map(|x| factor * x));
            if !self.is_near(point) {
                break;
            }
        }
        Err(CalibrateError::NoConvergence { steps: MOST_STEPS })
    }

    /// A point is lost when a delay is more than a slow period and the spread of all delays from its
    /// nominal.
    fn is_near(&self, point: &Point) -> bool {
        let nominal = self.model.delays.iter().map(|delay| delay.0);
        let spread = self.model.delays.iter().map(|delay| delay.0).fold(0.0, f64::max);
        let far = self.model.ratio as f64 + spread;
        point.delays.iter().zip(nominal).all(|(delay, nominal)| (delay - nominal).abs() <= far)
            && point.ln_gains.iter().chain(&point.ln_cutoffs).all(|x| x.abs() < 3.0)
    }

    fn scored(&self, point: &Point, bands: Vec<Occupied>) -> Maximum {
        let zero = || Score::zero(point.parameters.len());
        let mut halves = [zero(), zero()];
        let (mut noise, mut used) = (0.0, 0);
        let count = bands.len();
        for (number, held) in bands.iter().enumerate() {
            let Some(score) = band_score(self.model, point, &held.band, &held.aliases) else { continue };
            halves[usize::from(2 * number >= count)].add(&score);
            let a = steering(self.model, point, held.band.w, &held.aliases);
            noise +=
                complement(&a).map_or(0.0, |(p, _)| noise_power(&held.band.matrix, &p, held.aliases.len()));
            used += 1;
        }
        let mut score = zero();
        halves.iter().for_each(|half| score.add(half));
        Maximum { point: point.clone(), score, halves, noise: noise / used.max(1) as f64 }
    }

    /// The scoring step and the standard deviations.
    fn step(&self, score: &Score) -> Result<(Mat, Vec<f64>), CalibrateError> {
        let covariance = covariance(&score.information).ok_or(CalibrateError::NotIdentifiable)?;
        let sigma = (0..covariance.nrows()).map(|k| covariance[(k, k)].sqrt()).collect();
        Ok((covariance * &score.gradient, sigma))
    }

    /// The bands that hold one alias, with the phases of the nominal delays removed.
    pub(super) fn single_bands(&self) -> Vec<Band> {
        let nominal = Point::nominal(self.model, Fit::default(), 0);
        self.bands(&nominal, FIRST_LEAST).into_iter().map(|held| held.band).collect()
    }

    /// The share of the power that one alias per band leaves unexplained if capture i is channel `order[i]`,
    /// with the nominal values and whichever alias fits a band best. NaN without bands.
    pub(super) fn unexplained_in_order(&self, bands: &[Band], order: &[usize]) -> f64 {
        let m = self.model.ratio as f64;
        let reach = self.model.ratio as i32;
        let delay = |i: usize| self.model.delays[i].0;
        let left = |band: &Band, alias: i32| {
            let turn = TAU * f64::from(alias);
            let column = CMat::from_fn(order.len(), 1, |i, _| {
                let c = order[i];
                let phase = turn * delay(c) + band.w * (delay(c) - delay(i));
                let gain = Complex::from_polar(self.model.gains[c], -phase / m);
                self.model.response(c, (band.w + turn) / m, 0.0) * gain
            });
            let explained = (column.adjoint() * &band.matrix * &column)[(0, 0)].re / column.norm_squared();
            band.count as f64 * (band.matrix.trace().re - explained)
        };
        let best = |band: &Band| (-reach..=reach).map(|k| left(band, k)).fold(f64::INFINITY, f64::min);
        let power = |band: &Band| band.count as f64 * band.matrix.trace().re;
        bands.iter().map(best).sum::<f64>() / bands.iter().map(power).sum::<f64>()
    }

    /// The power that one alias per band leaves unexplained: with the nominal values and whichever alias
    /// fits a band best, and at the maximum.
    pub(super) fn unexplained(&self, maximum: &Maximum) -> (f64, f64) {
        let nominal = Point::nominal(self.model, Fit::default(), 0);
        let reach = self.model.ratio as i32;
        let left = |point: &Point, band: &Band, alias: i32| {
            let a = steering(self.model, point, band.w, &[alias]);
            complement(&a).map_or(0.0, |(p, _)| band.count as f64 * (p * &band.matrix).trace().re)
        };
        let held = self.bands(&maximum.point, FIRST_LEAST);
        let at_nominal = self.spectra.bands(&nominal.delays).into_iter();
        let same = at_nominal.filter(|band| held.iter().any(|held| held.band.w == band.w));
        let best = |band: Band| {
            (-reach..=reach).map(|alias| left(&nominal, &band, alias)).fold(f64::INFINITY, f64::min)
        };
        let found = held.iter().map(|held| left(&maximum.point, &held.band, held.aliases[0]));
        (same.map(best).sum(), found.sum())
    }

    /// The estimates at the maximum, with the remarks that their intervals call for.
    pub(super) fn finish(
        &self,
        maximum: &Maximum,
        reference: usize,
        fit: Fit,
    ) -> Result<Fitted, CalibrateError> {
        let factor = self.spectra.variance_factor;
        let covariance =
            covariance(&maximum.score.information).ok_or(CalibrateError::NotIdentifiable)? * factor;
        let mut fitted = Fitted::new(maximum.point.clone(), covariance);
        let misfit =
            maximum.disagreement(factor).and_then(|(squares, freedom)| fitted.widen(squares, freedom));
        fitted.remarks.extend(misfit.map(|misfit| Remark::BandsDisagree { misfit }));
        if fit.offset {
            fitted.offsets = Some(self.offsets(maximum, reference));
        }
        fitted.frames = self.frames;
        Ok(fitted)
    }

    /// o_i and its standard deviation. The signal's own mean is not known, so the reference keeps its
    /// offset.
    fn offsets(&self, maximum: &Maximum, reference: usize) -> Vec<(f64, f64)> {
        let (point, means) = (&maximum.point, &self.spectra.means);
        let constant = |i: usize| point.gain(i, self.model) * self.model.response(i, 0.0, 0.0).re;
        let signal = means[reference] - self.model.offsets[reference];
        let sigma = (2.0 * maximum.noise * self.spectra.mean_variance).sqrt();
        let offset = |i: usize| match i == reference {
            true => (self.model.offsets[reference], 0.0),
            false => (means[i] - signal * constant(i) / constant(reference), sigma),
        };
        (0..self.model.channels()).map(offset).collect()
    }
}

impl Maximum {
    /// By how much the estimates of the two halves of the bands differ: d' (C1 + C2)^-1 d and its degrees of
    /// freedom. `None` where a half alone does not determine the parameters.
    fn disagreement(&self, factor: f64) -> Option<(f64, usize)> {
        let [lower, upper] = &self.halves;
        let (c1, c2) = (covariance(&lower.information)?, covariance(&upper.information)?);
        let difference = &c1 * &lower.gradient - &c2 * &upper.gradient;
        let squares = difference.dot(&solve(&((c1 + c2) * factor), &difference));
        squares.is_finite().then_some((squares, difference.len()))
    }
}

/// Calibrates from any signal that leaves fewer aliases occupied than there are channels.
///
/// # Errors
/// [`CalibrateError`]: too few frames in a row, all aliases occupied, parameters that the signal does not
/// tell apart, no convergence.
pub(super) fn fit(
    model: &Model,
    records: &[Record],
    fit: Fit,
    reference: usize,
) -> Result<Fitted, CalibrateError> {
    let blind = Blind::new(model, records)?;
    let maximum = blind.maximise(fit, reference)?;
    blind.finish(&maximum, reference, fit)
}
