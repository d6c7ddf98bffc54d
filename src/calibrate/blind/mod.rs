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
//! matrix show how many aliases it holds: p large ones are the p aliases in the band of the signal, or next
//! to it, of these those of lowest frequency.
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

use super::CalibrationSettings;
use super::error::CalibrateError;
use super::estimates::{Fitted, WORST_CONDITION, pooled};
use super::fit::{ChannelParameter, FittedValues};
use super::model::{ChannelModel, ChannelValues};
use super::record::{Acquisition, longest_run};
use super::warning::CalibrationWarning;
use crate::linalg::Complex;
use crate::linalg::least_squares::{LeastSquares, Minimum, NoMinimum, NormalEquations, StepLimits, minimise};
use crate::sine_fit::Estimate;
use crate::spec::HALF_WIDTH;
use likelihood::band_score;
use single::bands_within;
pub(super) use single::{SingleBand, unexplained_in_order};
use spectra::{LOWEST_BINS, occupied};
pub(super) use spectra::{Spectra, SpectralBand};
use std::ops::RangeInclusive;

/// Least number of frames in a row.
const LEAST_FRAMES: usize = 256;
/// The iteration ends when every step is below this share of its standard deviation: the first one only
/// shows which aliases there are.
const FIRST_SMALL_STEP: f64 = 0.3;
const FINAL_SMALL_STEP: f64 = 1e-3;
/// Largest step of a delay in fast periods: a quarter of the period of the highest frequency below pi.
const LARGEST_STEP: f64 = 0.5;
/// Eigenvalues below this share of the largest count as noise: at first, when wrong delays smear the phases
/// within a band, and once the delays are known.
const FIRST_LEAST: f64 = 1e-3;
const FINAL_LEAST: f64 = 1e-6;
/// The columns of the data differ from the model clearly if they do so this many times as much as the noise
/// explains.
const DOUBTFUL_MISFIT: f64 = 1.2;
/// Offsets whose intervals are so many times as wide as those of noise alone are hidden by the signal.
const HIDDEN_RATIO: f64 = 3.0;
/// A logarithm of a gain or of a cut-off beyond this is lost.
const FARTHEST_LOGARITHM: f64 = 3.0;

/// Bands whose aliases were found.
struct Occupied {
    /// Among the bands of all acquisitions.
    index: usize,
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
    /// Of each acquisition.
    spectra: Vec<Spectra>,
    frames: usize,
    /// Bands with more aliases are left out.
    most_aliases: usize,
}

/// The maximum of the likelihood, or the way to it.
pub(super) struct Maximum<'a> {
    blind: &'a Blind<'a>,
    point: ChannelValues,
    /// The number of aliases of each band of all acquisitions, 0 for those that are not used. They stay the
    /// same ones while the point moves; only their phases follow it.
    used: Vec<usize>,
    /// How far the bands are from the model: chi squared, and its degrees of freedom.
    squares: f64,
    freedom: usize,
    /// Mean noise of the used bands, per sample.
    noise: f64,
    /// Share of its standard deviation below which a step is small.
    small_step: f64,
}

impl LeastSquares for Maximum<'_> {
    type Error = CalibrateError;
    const MOST_STEPS: usize = 60;
    const WORST_CONDITION: f64 = WORST_CONDITION;

    fn equations(&mut self) -> Result<NormalEquations, CalibrateError> {
        let mut all = NormalEquations::new(self.point.parameters.len());
        (self.squares, self.freedom, self.noise) = (0.0, 0, 0.0);
        let model = self.blind.model;
        let bands = self.blind.all_bands(&self.point.delays);
        let mut scored = 0;
        for (&aliases, band) in self.used.iter().zip(bands).filter(|(aliases, _)| **aliases > 0) {
            let aliases = model.occupied_aliases(band.w, aliases);
            let Some(score) = band_score(model, &self.point, &band, &aliases) else { continue };
            all.gram += &score.equations.gram;
            all.projection += &score.equations.projection;
            self.noise += score.noise;
            self.squares += score.squares;
            self.freedom += score.freedom;
            scored += 1;
        }
        self.noise /= scored.max(1) as f64;
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
        StepLimits { largest, negligible: self.small_step * sigma }
    }

    fn error(&self, why: NoMinimum) -> CalibrateError {
        why.into()
    }
}

impl<'a> Blind<'a> {
    /// Of the longest run of frames of each acquisition that no record lacks; bands with more than so many
    /// aliases are left out.
    pub(super) fn new(
        model: &'a ChannelModel,
        acquisitions: &[Acquisition<'_>],
        most_aliases: usize,
    ) -> Result<Self, CalibrateError> {
        let count = acquisitions.len();
        let run = |Acquisition { name, records }: &Acquisition<'_>| {
            let (first, frames) = longest_run(records);
            if frames < LEAST_FRAMES {
                let short = CalibrateError::TooShort { frames, needed: LEAST_FRAMES };
                return Err(short.within(name, count));
            }
            let captures: Vec<&[f64]> = records.iter().map(|r| &r.samples[first..first + frames]).collect();
            Ok((frames, Spectra::new(&captures, &model.delays, model.ratio)))
        };
        let all: Vec<(usize, Spectra)> = acquisitions.iter().map(run).collect::<Result<_, _>>()?;
        let frames = all.iter().map(|(frames, _)| frames).sum();
        Ok(Self {
            model,
            spectra: all.into_iter().map(|(_, spectra)| spectra).collect(),
            frames,
            most_aliases,
        })
    }

    /// The estimates at the maximum of the likelihood near the nominal values, with the warnings that their
    /// intervals call for.
    pub(super) fn fit(&self, settings: CalibrationSettings) -> Result<Fitted, CalibrateError> {
        let CalibrationSettings { fit, reference } = settings;
        let first = self
            .ascended(ChannelValues::nominal(self.model, fit, reference), FIRST_LEAST, FIRST_SMALL_STEP)?
            .0;
        let (maximum, minimum) = self.ascended(first.point, FINAL_LEAST, FINAL_SMALL_STEP)?;
        let factor = self.spectra.iter().map(|spectra| spectra.variance_factor).fold(1.0, f64::max);
        let (squares, freedom) = (maximum.squares / factor, maximum.freedom);
        let offsets = fit.offset.then(|| maximum.offsets(reference));
        let folded = offsets.as_ref().and_then(|offsets| maximum.folded(offsets));
        let mut fitted = Fitted::new(maximum.point, minimum.inverse * factor, self.frames);
        let misfit = fitted.widen(squares, freedom.saturating_sub(fitted.point.parameters.len()));
        let misfit = misfit.filter(|&misfit| misfit > DOUBTFUL_MISFIT);
        fitted.warnings.extend(misfit.map(|misfit| CalibrationWarning::BandsDisagree { misfit }));
        fitted.warnings.extend(folded);
        fitted.offsets = offsets;
        Ok(fitted)
    }

    fn all_bands(&self, delays: &[f64]) -> impl Iterator<Item = SpectralBand> {
        self.spectra.iter().flat_map(move |spectra| spectra.bands(delays))
    }

    fn bands(&self, delays: &[f64], least: f64) -> Vec<Occupied> {
        let counted = self.spectra.iter().flat_map(|spectra| {
            let bands = spectra.bands(delays);
            let counts = occupied(&bands, least);
            bands.into_iter().zip(counts)
        });
        let of = |(index, (band, count)): (usize, (SpectralBand, usize))| {
            let aliases = self.model.occupied_aliases(band.w, count);
            (1..=self.most_aliases).contains(&count).then_some(Occupied { index, band, aliases })
        };
        counted.enumerate().filter_map(of).collect()
    }

    fn ascended(
        &self,
        point: ChannelValues,
        least: f64,
        small_step: f64,
    ) -> Result<(Maximum<'_>, Minimum), CalibrateError> {
        let occupied = self.bands(&point.delays, least);
        let mut used = vec![0; self.spectra.iter().map(Spectra::band_count).sum()];
        occupied.iter().for_each(|one| used[one.index] = one.aliases.len());
        if occupied.is_empty() {
            return Err(CalibrateError::AllAliasesOccupied { channels: self.model.channels() });
        }
        let mut maximum =
            Maximum { blind: self, point, used, squares: 0.0, freedom: 0, noise: 0.0, small_step };
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
        let at_nominal = self.all_bands(&nominal.delays).enumerate();
        let same = at_nominal.filter(|(index, _)| used.iter().any(|used| used.index == *index));
        let before =
            same.map(|(_, band)| self.least_over_aliases(|alias| left(&nominal, &band, alias))).sum();
        (before, used.iter().map(|used| left(found, &used.band, used.aliases[0])).sum())
    }

    /// True if bands of one alias agree with the nominal delays, and would not if any of these were wrong by
    /// `moved` fast periods. The likelihood of a signal with next to no noise has no maximum that is found.
    pub(super) fn determines_delays(&self, moved: f64) -> bool {
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
    /// o_i. The signal's own mean is not known, so the reference keeps its offset, and an offset follows
    /// from the difference y = x_i - x_r c_i / c_r, of which the signal near 0 Hz is gone. What noise and
    /// aliases of 0 Hz, at multiples of the slow rate, leave of it is a stationary sequence, so the density
    /// of its lowest frequencies is that at 0 Hz and gives the variance of its mean.
    fn offsets(&self, reference: usize) -> Vec<Estimate<f64>> {
        let Blind { model, spectra, .. } = self.blind;
        let of_spectra = |i: usize| spectra.iter().map(move |spectra| self.offset(spectra, i, reference));
        let offset = |i: usize| match i == reference {
            true => Estimate { value: model.offsets[reference], sigma: 0.0 },
            false => pooled(of_spectra(i)),
        };
        (0..model.channels()).map(offset).collect()
    }

    /// That of channel i by one acquisition.
    fn offset(&self, spectra: &Spectra, i: usize, reference: usize) -> Estimate<f64> {
        let signal = spectra.means[reference] - self.blind.model.offsets[reference];
        let value = spectra.means[i] - signal * self.steady_ratio(i, reference, 0.0).re;
        let lowest = |i: usize| spectra.lowest(i, self.point.delays[i]);
        let difference = |((w, own), (_, other)): ((f64, Complex<f64>), (f64, Complex<f64>))| {
            (own - other * self.steady_ratio(i, reference, w)).norm_sqr()
        };
        let power: f64 = lowest(i).zip(lowest(reference)).map(difference).sum();
        let density = power / (LOWEST_BINS - 1) as f64;
        Estimate { value, sigma: (density * spectra.mean_variance).sqrt() }
    }

    /// How channel i passes the alias of W next to 0 Hz, over how the reference does.
    fn steady_ratio(&self, i: usize, reference: usize, w: f64) -> Complex<f64> {
        let model = self.blind.model;
        let passed = |i: usize| model.response(i, model.alias(w, 0), self.point.ln_cutoffs[i]);
        let gains = self.point.gain(i, model) / self.point.gain(reference, model);
        passed(i) / passed(reference) * gains
    }

    /// Says that the signal hides the offsets, if they are known far worse than the noise would leave them.
    fn folded(&self, offsets: &[Estimate<f64>]) -> Option<CalibrationWarning> {
        let weights = self.blind.spectra.iter().map(|spectra| spectra.mean_variance.recip());
        let of_noise = (2.0 * self.noise / weights.sum::<f64>()).sqrt();
        let worst = offsets.iter().map(|offset| offset.sigma).fold(0.0, f64::max);
        let half_width = HALF_WIDTH * worst;
        (worst > HIDDEN_RATIO * of_noise)
            .then_some(CalibrationWarning::OffsetsHidden { half_width, noise: HALF_WIDTH * of_noise })
    }
}

#[cfg(test)]
mod tests;
