//! What a bank makes of a tone: its images and its error of gain and phase.

use super::DesignError;
use super::deviations::Deviations;
use super::filters::FilterResponse;
use super::problem::Problem;
use hybank_core::bank::SynthesisFilters;
use hybank_core::spec::HALF_WIDTH;
use hybank_core::units::{CyclesPerFastPeriod, RadiansPerFastPeriod};
use hybank_linalg::{CMat, Complex, fourier};
use std::f64::consts::TAU;
use std::ops::Range;

/// How the worst tone is searched.
struct Settings {
    /// Grid points for each peak that filters of a given length may have in a band: a refinement begins
    /// beside its top.
    per_peak: f64,
    /// Multiply-adds that the grid may take: about a second.
    most_work: f64,
    /// A tone between two points of the grid is worse than theirs from this factor on: below, rounding
    /// would choose.
    worse_factor: f64,
    /// The target counts as zero below this share of its largest gain in the band: 120 dB.
    vanishing: f64,
}

/// Of every search.
const SETTINGS: Settings =
    Settings { per_peak: 8.0, most_work: 1e9, worse_factor: 1.0 + 1e-9, vanishing: 1e-6 };

/// Fewest and most points of the grid.
const POINTS: std::ops::RangeInclusive<f64> = 400.0..=20_000.0;
/// Local peaks of the grid that are refined, the largest ones.
const REFINED: usize = 8;
/// Steps of the golden section: the interval shrinks by 1e-8.
const STEPS: usize = 40;

/// The output of a bank for the tone e^{j w t}. With the responses F_i of the filters at the fast rate
///
/// ```text
/// Y_k = (1 / M) sum_i F_i(e^{j (w + 2 pi k / M)}) g_i Phi_i(j w) e^{-j w D_i}
/// ```
///
/// is the amplitude at w + 2 pi k / M: the tone for k = 0, an image for k = 1 .. M - 1. Where delays or
/// gains are uncertain, the figures are root mean squares over their errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToneOutput {
    /// w / (2 pi).
    pub frequency: CyclesPerFastPeriod,
    /// |Phi_0(j w)|, the gain of the target.
    pub target: f64,
    /// The largest |Y_k| / |Y_0|, k = 1 .. M - 1; 0 for M = 1.
    pub image: f64,
    /// The largest that it may be while every uncertain delay and gain stays within its half-width, to first
    /// order in these.
    pub image_at_worst: f64,
    /// |Y_0 / (Phi_0 e^{-j w m0}) - 1|: the relative error of gain and phase together.
    pub gain_error: f64,
}

/// F at each angle of the slow rate, of a bank or of another way from slow samples to fast ones.
pub(crate) struct PeriodicFilters<'a> {
    /// F, M x N.
    pub(crate) at: Box<dyn Fn(f64) -> CMat + 'a>,
    /// Slow periods that the filters see.
    pub(crate) lags: usize,
    /// Angles from 0 to pi at which F may have narrow peaks.
    pub(crate) resonances: Vec<f64>,
}

/// A bank, or another way, that answers tones.
pub(crate) struct ToneResponse<'a> {
    problem: Problem,
    filters: PeriodicFilters<'a>,
    /// Of the converters.
    spread: Vec<Deviations>,
}

impl<'a> ToneResponse<'a> {
    /// Of `filters` after the front ends of `problem`, without the spectrum of a signal, for converters that
    /// are off by so much.
    pub(crate) fn new(filters: PeriodicFilters<'a>, problem: Problem, spread: Vec<Deviations>) -> Self {
        Self { problem, filters, spread }
    }

    /// The same of the filters of a bank.
    ///
    /// # Errors
    /// [`DesignError::Lti`] for unstable filters.
    pub(crate) fn of_bank(
        filters: &SynthesisFilters,
        problem: Problem,
        spread: Vec<Deviations>,
    ) -> Result<Self, DesignError> {
        let filters = FilterResponse::new(filters, problem.ratio)?;
        let (lags, resonances) = (filters.lags(), filters.resonances());
        let filters = PeriodicFilters { at: Box::new(move |theta| filters.at(theta)), lags, resonances };
        Ok(Self::new(filters, problem, spread))
    }

    /// The output at w / (2 pi) = `frequency`.
    pub(crate) fn at(&self, frequency: f64) -> ToneOutput {
        let Problem { ratio, latency, front_ends, target, channels, .. } = &self.problem;
        let w = TAU * frequency;
        let passed: Vec<Complex<f64>> =
            front_ends.iter().map(|filter| filter.response(RadiansPerFastPeriod(w))).collect();
        let samples: Vec<Complex<f64>> = channels
            .iter()
            .map(|channel| {
                let delay = channel.delay.in_fast_periods().0;
                passed[channel.front_end] * Complex::from_polar(channel.gain, -w * delay)
            })
            .collect();
        let filters = (self.filters.at)(w * *ratio as f64);
        let mean = |i: usize| samples[i] * self.spread[channels[i].converter].mean_phase(w);
        let outputs = answer(&filters, 0..samples.len(), w, mean);
        // The powers of what the outputs have beside their means.
        let mut beside = vec![0.0; *ratio];
        let mut uncertain = Vec::new();
        for (spread, one) in self.spread.iter().zip(self.problem.converters()) {
            let power = spread.power(w);
            if power > 0.0 {
                let own = answer(&filters, one, w, |i| samples[i]);
                beside.iter_mut().zip(&own).for_each(|(sum, y)| *sum += power * y.norm_sqr());
                uncertain.push((spread, own));
            }
        }
        let exact = answer(&filters, 0..samples.len(), w, |i| samples[i]);
        let at_worst = (1..*ratio).map(|k| largest_within(exact[k], k, &uncertain, w)).fold(0.0, f64::max);
        let image_at_worst = at_worst / exact[0].norm();
        let images = outputs.iter().zip(&beside).skip(1).map(|(y, beside)| y.norm().hypot(beside.sqrt()));
        let image = images.fold(0.0, f64::max) / outputs[0].norm();
        let wanted = passed[*target] * Complex::from_polar(1.0, -w * *latency as f64);
        let gain_error = (outputs[0] / *ratio as f64 / wanted - 1.0).norm();
        let gain_error = gain_error.hypot(beside[0].sqrt() / (*ratio as f64 * wanted.norm()));
        ToneOutput {
            frequency: CyclesPerFastPeriod(frequency),
            target: wanted.norm(),
            image,
            image_at_worst,
            gain_error,
        }
    }

    /// Tones at `count` equidistant frequencies of a band, ends included.
    pub(crate) fn curve(&self, [low, high]: [CyclesPerFastPeriod; 2], count: usize) -> Vec<ToneOutput> {
        let step = (high.0 - low.0) / count.saturating_sub(1).max(1) as f64;
        (0..count).map(|k| self.at(low.0 + step * k as f64)).collect()
    }

    /// The tones of the largest image and of the largest error of gain in a band, searched between the
    /// points of a grid too. Frequencies at which the target is zero are left out.
    pub(crate) fn worst(&self, band: [CyclesPerFastPeriod; 2]) -> Worst {
        let grid = self.grid(band);
        let largest = grid.iter().map(|tone| tone.target).fold(0.0, f64::max);
        let counts = |tone: &ToneOutput| tone.target > SETTINGS.vanishing * largest;
        let value =
            |of: fn(&ToneOutput) -> f64| move |tone: &ToneOutput| if counts(tone) { of(tone) } else { 0.0 };
        Worst {
            image: self.peak(&grid, &value(|tone| tone.image)),
            image_at_worst: match self.spread.iter().all(|spread| spread.power(1.0) == 0.0) {
                true => None,
                false => self.peak(&grid, &value(|tone| tone.image_at_worst)),
            },
            gain_error: self.peak(&grid, &value(|tone| tone.gain_error)),
            vanishes: !grid.iter().all(counts),
        }
    }

    /// Points dense enough for every peak of the filters, and those at the resonances of a recursion.
    fn grid(&self, [low, high]: [CyclesPerFastPeriod; 2]) -> Vec<ToneOutput> {
        let period = self.problem.ratio as f64;
        let work = self.filters.lags * self.problem.ratio * self.problem.channels.len();
        let peaks = (high.0 - low.0) * self.filters.lags as f64 * period;
        let wanted = (SETTINGS.per_peak * peaks).clamp(*POINTS.start(), *POINTS.end());
        let step = (high.0 - low.0) / wanted.min(SETTINGS.most_work / work as f64).max(100.0).floor();
        let even = (0..=((high.0 - low.0) / step).round() as usize).map(|k| low.0 + step * k as f64);
        let turns = (low.0 * period).floor() as i64..=(high.0 * period).ceil() as i64;
        let resonances = &self.filters.resonances;
        let folded = turns.flat_map(|turn| {
            resonances.iter().flat_map(move |b| [b / TAU, -b / TAU].map(|x| (turn as f64 + x) / period))
        });
        let inside = folded.filter(|f| (low.0..=high.0).contains(f));
        let mut all: Vec<f64> = even.map(|f| f.min(high.0)).chain(inside).collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        all.into_iter().map(|f| self.at(f)).collect()
    }

    /// The largest value near the largest local peaks of the grid; `None` where a value is not a number or
    /// infinite: then the bank gives no tone at all.
    fn peak(&self, grid: &[ToneOutput], value: &dyn Fn(&ToneOutput) -> f64) -> Option<ToneOutput> {
        if !grid.iter().all(|tone| value(tone).is_finite()) {
            return None;
        }
        let at = |i: usize| value(&grid[i]);
        let is_peak =
            |i: &usize| (*i == 0 || at(*i) >= at(i - 1)) && (i + 1 == grid.len() || at(*i) >= at(i + 1));
        let mut peaks: Vec<usize> = (0..grid.len()).filter(is_peak).collect();
        peaks.sort_by(|&i, &j| at(j).total_cmp(&at(i)));
        let refined = peaks.into_iter().take(REFINED).map(|i| {
            let ends = [&grid[i.saturating_sub(1)], &grid[(i + 1).min(grid.len() - 1)]];
            self.refined(ends.map(|tone| tone.frequency.0), grid[i], value)
        });
        refined.max_by(|a, b| value(a).total_cmp(&value(b)))
    }

    /// Golden section between two frequencies, or `best` where nothing is larger.
    fn refined(
        &self,
        [mut low, mut high]: [f64; 2],
        mut best: ToneOutput,
        value: &dyn Fn(&ToneOutput) -> f64,
    ) -> ToneOutput {
        let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
        for _ in 0..STEPS {
            let (a, b) = (high - ratio * (high - low), low + ratio * (high - low));
            let [left, right] = [a, b].map(|f| self.at(f));
            for tone in [left, right] {
                if value(&tone) > SETTINGS.worse_factor * value(&best) {
                    best = tone;
                }
            }
            if value(&left) > value(&right) { high = b } else { low = a }
        }
        best
    }
}

/// Directions in the plane in which the largest image is sought: its size is right to 0.1 %.
const DIRECTIONS: usize = 64;

/// The largest |M Y_k| within the half-widths of the uncertain converters, whose own parts of it are given.
/// A late sample is turned by -j w, one of a larger gain is longer; the part of each error in a direction is
/// largest at one end of its interval.
fn largest_within(
    exact: Complex<f64>,
    k: usize,
    uncertain: &[(&Deviations, Vec<Complex<f64>>)],
    w: f64,
) -> f64 {
    let along = |direction: usize| {
        let back = Complex::from_polar(1.0, -TAU * direction as f64 / DIRECTIONS as f64);
        let part = |(spread, own): &(&Deviations, Vec<Complex<f64>>)| {
            let own = own[k] * back;
            HALF_WIDTH * (spread.delay.0 * w * own.im.abs() + spread.gain * own.re.abs())
        };
        (exact * back).re + uncertain.iter().map(part).sum::<f64>()
    };
    (0..DIRECTIONS).map(along).fold(exact.norm(), f64::max)
}

/// M Y_k of some channels, k = 0 .. M - 1, at the frequency w.
fn answer(
    filters: &CMat,
    channels: Range<usize>,
    w: f64,
    sample: impl Fn(usize) -> Complex<f64>,
) -> Vec<Complex<f64>> {
    let phases = filters.row_iter().enumerate().map(|(p, row)| {
        let sum: Complex<f64> = channels.clone().map(|i| row[i] * sample(i)).sum();
        sum * Complex::from_polar(1.0, -w * p as f64)
    });
    fourier::spectrum(phases.collect())
}

/// The worst tones of a band.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Worst {
    /// Largest image; `None` where the bank passes some tone not at all.
    pub(crate) image: Option<ToneOutput>,
    /// Largest image at worst; `None` where all channels are exact too.
    pub(crate) image_at_worst: Option<ToneOutput>,
    /// Largest error of gain.
    pub(crate) gain_error: Option<ToneOutput>,
    /// Whether the target is zero somewhere in the band.
    pub(crate) vanishes: bool,
}
