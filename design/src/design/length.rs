//! The number of taps of a bank, from what the bank must reach.

use super::DesignError;
use super::deviations::Deviations;
use super::figure_band::FigureBand;
use super::fir_errors::{BankSize, FirErrors, candidates};
use super::methods::robust_fir::robust_box;
use super::methods::{self, MethodSettings};
use super::plant::LiftedPlant;
use super::preparation::{SizingControl, merged, settings, with_usual_noise};
use super::problem::{Problem, common_delay};
use super::tones::ToneResponse;
use hybank_core::bank::SynthesisFilters;
use hybank_core::spec::{MAX_OPTIMISED_TAPS, Method, Spec};
use std::fmt;

/// By how much the largest image lies below the noise in the band, where nothing is asked for.
const BELOW_NOISE_DB: f64 = 20.0;
/// More taps are chosen only if they lower the whole error by more than this share.
const WORTHWHILE_TAPS: f64 = 0.01;
/// The length suffices when its doubling lowers the mean square by no more than this share.
const SAME_SQUARE: f64 = 1e-3;
/// Frames of the first length that is tried, beyond the latency.
const FIRST_FRAMES: usize = 8;
/// Samples of the longest length that is tried for an output sample; a longer bank is a case for recursive
/// filters.
const MOST_SAMPLES: usize = 1024;
/// Lengths that are designed at most for a wanted figure, each a tenth longer than the one before.
const LENGTHENINGS: usize = 16;

/// A figure of a bank that a spec may ask for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum TargetFigure {
    /// Power of the target over that of error and noise.
    Snr,
    /// Distance of the largest image of a tone.
    Sfdr,
}

impl fmt::Display for TargetFigure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Snr => "SNR",
            Self::Sfdr => "SFDR",
        })
    }
}

/// What the fewest taps are chosen for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Goal {
    /// A figure of at least so many decibels.
    AtLeast(TargetFigure, f64),
    /// The largest image of a bank that is made for samples without noise lies [`BELOW_NOISE_DB`] below the
    /// noise in the band; or more taps bring nothing.
    BelowNoise,
}

impl Goal {
    /// What `spec` asks for.
    pub(super) fn of(spec: &Spec) -> Self {
        let snr = spec.design.target_snr_db.map(|wanted| Self::AtLeast(TargetFigure::Snr, wanted));
        let sfdr = || spec.design.target_sfdr_db.map(|wanted| Self::AtLeast(TargetFigure::Sfdr, wanted));
        snr.or_else(sfdr).unwrap_or(Self::BelowNoise)
    }
}

/// The lengths of FIR banks for a spec.
pub(super) struct Lengths<'a> {
    spec: &'a Spec,
    /// With the channels that are designed.
    problem: Problem,
    /// The noise of their samples, with the usual resolution where the spec states none.
    noise: Vec<f64>,
    deviations: Vec<Deviations>,
}

impl<'a> Lengths<'a> {
    /// For `spec` and its `problem`.
    ///
    /// # Errors
    /// [`DesignError::Lti`] if a decomposition does not converge.
    pub(super) fn new(spec: &'a Spec, problem: &Problem) -> Result<Self, DesignError> {
        let deviations = Deviations::uncertain(spec);
        let noisy = Problem { noise: problem.noise_powers(&with_usual_noise(spec))?, ..problem.clone() };
        let [own, noisy] = [problem, &noisy].map(|problem| merged(spec, problem, !deviations.is_empty()));
        Ok(Self { spec, problem: own?.problem, noise: noisy?.problem.noise, deviations })
    }

    /// The latency of the least error with so many taps.
    pub(super) fn best(&self, taps: usize) -> BankSize {
        self.errors(&self.problem, taps).best(taps)
    }

    /// The fewest taps that reach the goal: those of least mean square do, and those of the method.
    ///
    /// # Errors
    /// [`DesignError::FigureOutOfReach`], [`DesignError::FigureMissed`], [`DesignError::Stopped`].
    pub(super) fn fewest(&self, goal: Goal, comparison: SizingControl<'_>) -> Result<BankSize, DesignError> {
        let size = self.fewest_of_least_squares(goal)?;
        let is_minimax = self.spec.design.method == Method::Fir && robust_box(self.spec).is_none();
        match goal {
            Goal::AtLeast(figure, wanted) if is_minimax => self.lengthened(size, figure, wanted, comparison),
            _ => Ok(size),
        }
    }

    fn fewest_of_least_squares(&self, goal: Goal) -> Result<BankSize, DesignError> {
        // What noise adds to the images, no length takes away.
        let quiet = Problem { noise: vec![0.0; self.noise.len()], ..self.problem.clone() };
        let problem = if goal == Goal::BelowNoise { &quiet } else { &self.problem };
        let (errors, most) = self.long_enough(problem, goal)?;
        if self.reaches(&errors, most, goal)? {
            return Ok(self.best(fewest(most, |taps| self.reaches(&errors, taps, goal))?));
        }
        let size = errors.best(most);
        if let Goal::AtLeast(figure, wanted) = goal {
            let best = self.figure(&errors, &errors.taps(size), size.latency, figure)?;
            let latency =
                size.latency + if self.spec.latency.is_none() { common_delay(self.spec) } else { 0 };
            return Err(DesignError::FigureOutOfReach { figure, wanted, best, latency });
        }
        let errors = self.errors(&self.problem, most);
        let enough = least(&errors) * (1.0 + WORTHWHILE_TAPS).powi(2);
        Ok(errors.best(fewest(most, |taps| Ok(errors.square(errors.best(taps)) <= enough))?))
    }

    /// The errors of lengths up to one that reaches the goal, or whose doubling brings nothing.
    fn long_enough(&self, problem: &Problem, goal: Goal) -> Result<(FirErrors, usize), DesignError> {
        let (most, mut taps) = (self.most(), self.first());
        let mut errors = self.errors(problem, taps);
        while taps < most && !self.reaches(&errors, taps, goal)? {
            taps = (2 * taps).min(most);
            let before = least(&errors);
            errors = self.errors(problem, taps);
            if before - least(&errors) <= SAME_SQUARE * before {
                break;
            }
        }
        Ok((errors, taps))
    }

    /// As long as it takes until the bank of least gamma has the figure: it does not aim at that.
    fn lengthened(
        &self,
        BankSize { mut taps, mut latency }: BankSize,
        figure: TargetFigure,
        wanted: f64,
        comparison: SizingControl<'_>,
    ) -> Result<BankSize, DesignError> {
        let most = MAX_OPTIMISED_TAPS / self.spec.layout().count();
        let mut best = f64::NEG_INFINITY;
        for designs in 0..LENGTHENINGS {
            if designs > 0 {
                taps = (taps + (taps / 10).max(1)).min(most);
                latency = self.best(taps).latency;
            }
            comparison.after(designs)?;
            let settings = MethodSettings { stop: comparison.stop.clone(), ..settings(self.spec, taps)? };
            let plant = LiftedPlant::new(&Problem { latency, ..self.problem.clone() });
            let synthesis = methods::synthesise(Method::Fir, &plant, &settings)?;
            comparison.go_on()?;
            if let SynthesisFilters::Fir(filters) = &synthesis.filters {
                let errors = FirErrors::new(&self.problem, &self.deviations, taps, latency..=latency);
                best = f64::max(best, self.figure(&errors, filters, latency, figure)?);
            }
            if best >= wanted {
                return Ok(BankSize { taps, latency });
            }
            if taps == most {
                break;
            }
        }
        Err(DesignError::FigureMissed { figure, wanted, best, taps })
    }

    fn errors(&self, problem: &Problem, taps: usize) -> FirErrors {
        let latencies = match self.spec.latency {
            Some(_) => problem.latency..=problem.latency,
            None => candidates(problem, taps),
        };
        FirErrors::new(problem, &self.deviations, taps, latencies)
    }

    /// Whether the bank of least mean square with so many taps reaches the goal.
    fn reaches(&self, errors: &FirErrors, taps: usize, goal: Goal) -> Result<bool, DesignError> {
        let size = errors.best(taps);
        let filters = errors.taps(size);
        let (figure, wanted) = match goal {
            Goal::AtLeast(figure, wanted) => (figure, wanted),
            Goal::BelowNoise => {
                let noise = decibels(errors.zero_output() / errors.noise_of(&filters, &self.noise));
                (TargetFigure::Sfdr, noise + BELOW_NOISE_DB)
            }
        };
        Ok(self.figure(errors, &filters, size.latency, figure)? >= wanted)
    }

    /// A figure of any filters, in decibels.
    fn figure(
        &self,
        errors: &FirErrors,
        filters: &[Vec<f64>],
        latency: usize,
        figure: TargetFigure,
    ) -> Result<f64, DesignError> {
        if figure == TargetFigure::Snr {
            return Ok(decibels(errors.zero_output() / errors.square_of(filters, latency)));
        }
        let plain = Problem { latency, signal: None, ..self.problem.clone() };
        let band = FigureBand::new(self.spec, &plain).cycles(self.spec);
        let spread = match self.deviations.as_slice() {
            [] => vec![Deviations::default(); self.spec.channels.len()],
            own => own.to_vec(),
        };
        let tones = ToneResponse::of_bank(&SynthesisFilters::Fir(filters.to_vec()), plain, spread)?;
        Ok(tones.worst(band).image.map_or(f64::NEG_INFINITY, |tone| -2.0 * decibels(tone.image)))
    }

    /// The length of the first bank that is tried.
    fn first(&self) -> usize {
        let ratio = self.problem.ratio;
        let delay = self.problem.longest_delay().0.ceil() as usize;
        let oldest = self.spec.latency.map_or(0, |_| self.problem.latency + delay);
        ((oldest / ratio + FIRST_FRAMES) * ratio).min(self.most())
    }

    /// The length of the last one.
    fn most(&self) -> usize {
        let (channels, ratio) = (self.spec.layout().count(), self.problem.ratio);
        let seen = (MOST_SAMPLES / channels).max(1) * ratio;
        if self.spec.design.method == Method::Fir { seen.min(MAX_OPTIMISED_TAPS / channels) } else { seen }
    }
}

/// The fewest taps that suffice, where `most` do.
fn fewest(most: usize, suffice: impl Fn(usize) -> Result<bool, DesignError>) -> Result<usize, DesignError> {
    let (mut too_few, mut taps) = (0, most);
    while taps - too_few > 1 {
        let middle = too_few + (taps - too_few) / 2;
        if suffice(middle)? { taps = middle } else { too_few = middle }
    }
    Ok(taps)
}

/// The least mean square of all lengths and latencies.
fn least(errors: &FirErrors) -> f64 {
    errors.square(errors.best(errors.longest))
}

fn decibels(power_ratio: f64) -> f64 {
    10.0 * power_ratio.log10()
}
