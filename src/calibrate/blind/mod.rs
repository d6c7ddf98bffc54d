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
mod single;
mod spectra;
#[cfg(test)]
mod tests;

use super::CalibrationSettings;
use super::error::CalibrateError;
use super::estimates::{Fitted, WORST_CONDITION};
use super::fit::{ChannelParameter, FittedValues};
use super::model::{ChannelModel, ChannelValues};
use super::record::{Record, longest_run};
use super::warning::CalibrationWarning;
use crate::linalg::least_squares::{LeastSquares, Minimum, NoMinimum, NormalEquations, StepLimits, minimise};
use crate::linalg::solve;
use crate::sine_fit::Estimate;
use likelihood::{band_score, lowest_aliases};
use single::bands_within;
pub(super) use single::{SingleBand, unexplained_in_order};
use spectra::occupied;
pub(super) use spectra::{Spectra, SpectralBand};
use std::ops::RangeInclusive;

/// Least number of frames in a row.
const LEAST_FRAMES: usize = 256;
/// The iteration ends when every step is below this share of its standard deviation.
const SMALL_STEP: f64 = 1e-3;
/// Largest step of a delay in fast periods: a quarter of the period of the highest frequency below pi.
const LARGEST_STEP: f64 = 0.5;
/// Eigenvalues below this share of the largest count as noise: at first, when wrong delays smear the phases
/// within a band, and once the delays are known.
const FIRST_LEAST: f64 = 1e-3;
const FINAL_LEAST: f64 = 1e-6;
/// A logarithm of a gain or of a cut-off beyond this is lost.
const FARTHEST_LOGARITHM: f64 = 3.0;

/// Bands whose aliases were found.
struct Occupied {
    band: SpectralBand,
    aliases: Vec<i32>,
}

/// Share of the power that is left where captures without noise agree with delays.
const AGREEING_SHARE: f64 = 1e-6;
/// A wrong delay leaves so many times as much.
const CLEARLY_MORE: f64 = 100.0;

/// The data of a blind fit.
pub(super) struct Blind<'a> {
    model: &'a ChannelModel,
    spectra: Spectra,
    frames: usize,
    /// Bands with more aliases are left out.
    most_aliases: usize,
}

/// The maximum of the likelihood, or the way to it.
pub(super) struct Maximum<'a> {
    blind: &'a Blind<'a>,
    point: ChannelValues,
    /// The bands that are used, by their frequency, and the number of their aliases. They stay the same ones
    /// while the point moves; only their phases follow it.
    used: Vec<(f64, usize)>,
    /// Of the lower and of the upper half of the used bands.
    halves: [NormalEquations; 2],
    /// Mean noise of the used bands, per sample.
    noise: f64,
}

impl LeastSquares for Maximum<'_> {
    type Error = CalibrateError;
    const MOST_STEPS: usize = 60;
    const WORST_CONDITION: f64 = WORST_CONDITION;

    fn equations(&mut self) -> Result<NormalEquations, CalibrateError> {
        let none = NormalEquations::new(self.point.parameters.len());
        (self.halves, self.noise) = ([none.clone(), none.clone()], 0.0);
        let model = self.blind.model;
        let bands = self.blind.spectra.bands(&self.point.delays).into_iter();
        let used = bands.filter_map(|band| Some((self.used.iter().find(|used| used.0 == band.w)?.1, band)));
        let (count, mut scored) = (self.used.len(), 0);
        for (number, (aliases, band)) in used.enumerate() {
            let aliases = lowest_aliases(model, band.w, aliases);
            let Some(score) = band_score(model, &self.point, &band, &aliases) else { continue };
            add(&mut self.halves[usize::from(2 * number >= count)], &score.equations);
            self.noise += score.noise;
            scored += 1;
        }
        self.noise /= scored.max(1) as f64;
        let mut all = none;
        self.halves.iter().for_each(|half| add(&mut all, half));
        Ok(all)
    }

    /// A point is lost when a delay is more than a slow period and the spread of all delays from its
    /// nominal.
    fn advance(&mut self, step: &[f64]) -> bool {
        self.point.advance(step);
        let model = self.blind.model;
        let far = model.ratio as f64 + model.delays.iter().copied().fold(0.0, f64::max);
        let is_near = |(delay, nominal): (&f64, &f64)| (delay - nominal).abs() <= far;
        let mut logarithms = self.point.ln_gains.iter().chain(&self.point.ln_cutoffs);
        self.point.delays.iter().zip(&model.delays).all(is_near)
            && logarithms.all(|x| x.abs() < FARTHEST_LOGARITHM)
    }

    fn limits(&self, k: usize, sigma: f64) -> StepLimits {
        let is_delay = self.point.parameters[k].kind == ChannelParameter::Delay;
        let largest = if is_delay { LARGEST_STEP } else { f64::INFINITY };
        StepLimits { largest, negligible: SMALL_STEP * sigma }
    }

    fn error(&self, why: NoMinimum) -> CalibrateError {
        why.into()
    }
}

fn add(sum: &mut NormalEquations, other: &NormalEquations) {
    sum.gram += &other.gram;
    sum.projection += &other.projection;
}

impl<'a> Blind<'a> {
    /// Of the longest run of frames that no record lacks; bands with more than so many aliases are left out.
    pub(super) fn new(
        model: &'a ChannelModel,
        records: &[Record],
        most_aliases: usize,
    ) -> Result<Self, CalibrateError> {
        let (first, frames) = longest_run(records);
        if frames < LEAST_FRAMES {
            return Err(CalibrateError::TooShort { frames, needed: LEAST_FRAMES });
        }
        let captures: Vec<&[f64]> = records.iter().map(|r| &r.samples[first..first + frames]).collect();
        let spectra = Spectra::new(&captures, &model.delays, model.ratio);
        Ok(Self { model, spectra, frames, most_aliases })
    }

    /// The estimates at the maximum of the likelihood near the nominal values, with the warnings that their
    /// intervals call for.
    pub(super) fn fit(&self, settings: CalibrationSettings) -> Result<Fitted, CalibrateError> {
        let CalibrationSettings { fit, reference } = settings;
        let first = self.ascended(ChannelValues::nominal(self.model, fit, reference), FIRST_LEAST)?.0;
        let (maximum, minimum) = self.ascended(first.point, FINAL_LEAST)?;
        let factor = self.spectra.variance_factor;
        let disagreement = maximum.disagreement(factor);
        let offsets = fit.offset.then(|| maximum.offsets(reference));
        let mut fitted = Fitted::new(maximum.point, minimum.inverse * factor, self.frames);
        let misfit = disagreement.and_then(|(squares, freedom)| fitted.widen(squares, freedom));
        fitted.warnings.extend(misfit.map(|misfit| CalibrationWarning::BandsDisagree { misfit }));
        fitted.offsets = offsets;
        Ok(fitted)
    }

    fn bands(&self, delays: &[f64], least: f64) -> Vec<Occupied> {
        let bands = self.spectra.bands(delays);
        let counts = occupied(&bands, least);
        let of = |(band, count): (SpectralBand, usize)| {
            let aliases = lowest_aliases(self.model, band.w, count);
            (1..=self.most_aliases).contains(&count).then_some(Occupied { band, aliases })
        };
        bands.into_iter().zip(counts).filter_map(of).collect()
    }

    fn ascended(&self, point: ChannelValues, least: f64) -> Result<(Maximum<'_>, Minimum), CalibrateError> {
        let used = self.bands(&point.delays, least);
        let used: Vec<(f64, usize)> = used.iter().map(|used| (used.band.w, used.aliases.len())).collect();
        if used.is_empty() {
            return Err(CalibrateError::AllAliasesOccupied { channels: self.model.channels() });
        }
        let none = NormalEquations::new(0);
        let mut maximum = Maximum { blind: self, point, used, halves: [none.clone(), none], noise: 0.0 };
        let minimum = minimise(&mut maximum)?;
        Ok((maximum, minimum))
    }

    /// Bands that hold one alias, as the channels of the spec would show it, to compare so many orders of
    /// the channels.
    pub(super) fn single_bands(&self, orders: usize) -> Vec<SingleBand> {
        let bands = self.bands(&self.model.delays, FIRST_LEAST);
        let aliases = self.zones();
        let products = orders * aliases.clone().count() * self.model.channels();
        let every = bands.len().div_ceil(bands_within(products)).max(1);
        let nominal = self.nominal();
        let of = |used: Occupied| SingleBand::new(self.model, &nominal, &used.band, aliases.clone());
        bands.into_iter().step_by(every).filter_map(of).collect()
    }

    /// The power that one alias per band leaves unexplained: with the nominal values and whichever alias
    /// fits a band best, and at the maximum.
    pub(super) fn unexplained(&self, found: &ChannelValues) -> (f64, f64) {
        let nominal = self.nominal();
        let left = |point: &ChannelValues, band: &SpectralBand, alias: i32| {
            band.unexplained(&self.model.steering(point, band.w, &[alias]))
        };
        let used = self.bands(&found.delays, FIRST_LEAST);
        let at_nominal = self.spectra.bands(&nominal.delays).into_iter();
        let same = at_nominal.filter(|band| used.iter().any(|used| used.band.w == band.w));
        let before = same.map(|band| self.least_over_aliases(|alias| left(&nominal, &band, alias))).sum();
        (before, used.iter().map(|used| left(found, &used.band, used.aliases[0])).sum())
    }

    /// True if bands of one alias agree with the nominal delays, and would not if any of these were wrong by
    /// `moved` fast periods. The likelihood of a signal with next to no noise has no maximum that is found.
    pub(super) fn tells_delays(&self, moved: f64) -> bool {
        let nominal = self.nominal();
        let power: f64 = self.bands(&nominal.delays, FIRST_LEAST).iter().map(|used| used.band.power()).sum();
        let left = self.left_at(&nominal);
        let mut others = (0..self.model.channels()).flat_map(|i| [(i, -moved), (i, moved)]);
        left <= AGREEING_SHARE * power
            && others.all(|(i, moved)| {
                let mut point = nominal.clone();
                point.delays[i] += moved;
                self.left_at(&point) > CLEARLY_MORE * left
            })
    }

    /// The power that one alias per band leaves at a point, whichever alias fits a band best.
    fn left_at(&self, point: &ChannelValues) -> f64 {
        let left = |used: &Occupied| {
            let Occupied { band, .. } = used;
            self.least_over_aliases(|alias| band.unexplained(&self.model.steering(point, band.w, &[alias])))
        };
        self.bands(&point.delays, FIRST_LEAST).iter().map(left).sum()
    }

    fn nominal(&self) -> ChannelValues {
        ChannelValues::nominal(self.model, FittedValues::default(), 0)
    }

    fn least_over_aliases(&self, left: impl Fn(i32) -> f64) -> f64 {
        self.zones().map(left).fold(f64::INFINITY, f64::min)
    }

    /// The aliases k that a band may hold: up to the fast rate.
    fn zones(&self) -> RangeInclusive<i32> {
        let reach = self.model.ratio as i32;
        -reach..=reach
    }
}

impl Maximum<'_> {
    /// By how much the estimates of the two halves of the bands differ: d' (C1 + C2)^-1 d and its degrees of
    /// freedom. `None` where a half alone does not determine the parameters.
    fn disagreement(&self, factor: f64) -> Option<(f64, usize)> {
        let [lower, upper] = &self.halves;
        let [c1, c2] = [lower.inverse(WORST_CONDITION).ok()?, upper.inverse(WORST_CONDITION).ok()?];
        let difference = &c1 * &lower.projection - &c2 * &upper.projection;
        let squares = difference.dot(&solve(&((c1 + c2) * factor), &difference));
        squares.is_finite().then_some((squares, difference.len()))
    }

    /// o_i. The signal's own mean is not known, so the reference keeps its offset.
    fn offsets(&self, reference: usize) -> Vec<Estimate<f64>> {
        let Blind { model, spectra, .. } = self.blind;
        let constant = |i: usize| self.point.gain(i, model) * model.response(i, 0.0, 0.0).re;
        let signal = spectra.means[reference] - model.offsets[reference];
        let sigma = (2.0 * self.noise * spectra.mean_variance).sqrt();
        let offset = |i: usize| match i == reference {
            true => Estimate { value: model.offsets[reference], sigma: 0.0 },
            false => {
                let value = spectra.means[i] - signal * constant(i) / constant(reference);
                Estimate { value, sigma }
            }
        };
        (0..model.channels()).map(offset).collect()
    }
}
