//! What a spec leaves open: the latency, and the number of taps.
//!
//! What counts is the whole error: the mean square of the error for the signal plus the noise of the
//! converters at the output. The latency is the shortest one whose whole error is within 0.1 dB of the
//! least over all latencies, with the length of the spec. Where the spec states no noise, the samples are
//! rounded to 16 bits: beyond that no latency pays. The error is the least that banks of that length can
//! reach, which a smoother finds without a design. `sinc` and `separation` minimise nothing: the output
//! instant lies in the middle of the samples that their taps see.

use super::DesignError;
use super::filters;
use super::least_errors::{LeastErrors, candidates, check_reach, is_almost, manageable, shortest};
use super::limits::Stop;
use super::merging::Repeats;
use super::methods::robust_fir::robust_box;
use super::methods::{self, Deviations, Settings};
use super::plant::LiftedPlant;
use super::problem::{Problem, common_delay};
use super::realise::realise;
use crate::analog::SignalFilter;
use crate::bank::SynthesisFilters;
use crate::lti::gramian::h2_norm;
use crate::spec::{MAX_ERROR_STATES, MAX_OPTIMISED_TAPS, Method, Spec};
use crate::units::Seconds;

/// Bits of a converter of which nothing is said.
const USUAL_BITS: u32 = 16;
/// More taps are chosen only if they lower the whole error by more than this share.
const WORTHWHILE_TAPS: f64 = 0.01;
/// The length suffices when its doubling lowers the mean square by no more than this share.
const SAME_SQUARE: f64 = 1e-3;
/// Frames of the first length that is tried, beyond the latency.
const FIRST_FRAMES: usize = 8;
/// Frames of the longest one; a longer bank is a case for recursive filters.
const MOST_FRAMES: usize = 2048;
/// Lengths that are designed at most for a wanted SNR, each a tenth longer than the one before.
const LENGTHENINGS: usize = 16;

/// Slow periods of latency without a better bank of the wanted order that end the search for one: the error
/// of reduced banks is not monotonic in the latency.
const FRUITLESS_PERIODS: usize = 4;

/// What follows the designs that a choice compares, and ends them.
#[derive(Clone, Copy)]
pub(super) struct Comparison<'a> {
    /// Called with the number of designs that were compared.
    pub(super) observer: &'a dyn Fn(usize),
    /// When to end.
    pub(super) stop: &'a Stop,
}

impl Comparison<'_> {
    /// So many designs were compared, and another one begins.
    fn after(self, designs: usize) -> Result<(), DesignError> {
        (self.observer)(designs);
        self.go_on()
    }

    /// A design that was ended early says nothing about its length or latency.
    fn go_on(self) -> Result<(), DesignError> {
        if self.stop.is_due() { Err(DesignError::Stopped) } else { Ok(()) }
    }
}

/// Latency and number of taps of a bank: those of its spec, and what was chosen where the spec leaves them
/// open.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sizing {
    /// m0, in fast samples.
    pub latency: usize,
    /// Taps per channel at the fast rate; 0 for recursive filters.
    pub taps: usize,
    /// The latency was left to the designer.
    pub latency_chosen: bool,
    /// The number of taps was left to the designer.
    pub taps_chosen: bool,
}

/// Latency and taps while they are chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Choice {
    taps: usize,
    latency: usize,
}

impl Sizing {
    /// The sizes of the bank that `spec` asks for.
    ///
    /// # Errors
    /// As [`design`](super::design).
    pub fn of(spec: &Spec) -> Result<Self, DesignError> {
        let comparison = Comparison { observer: &|_| (), stop: &Stop::default() };
        Self::new(spec, &Problem::before_sizing(spec)?, comparison)
    }

    /// The sizes for `spec` and its `problem`. `comparison` follows and ends the designs that are compared.
    ///
    /// # Errors
    /// [`DesignError::OutOfReach`] for a latency that the taps do not reach; [`DesignError::SnrOutOfReach`]
    /// or [`DesignError::SnrMissed`] if no number of taps has the SNR that the spec asks for;
    /// [`DesignError::Stopped`].
    pub(super) fn new(
        spec: &Spec,
        problem: &Problem,
        comparison: Comparison<'_>,
    ) -> Result<Self, DesignError> {
        let taps = spec.design.taps.or(usual_taps(spec));
        let Choice { taps, latency } = match (taps, spec.latency) {
            (Some(taps), Some(latency)) => {
                check_reach(problem.clone(), taps)?;
                Choice { taps, latency }
            }
            (None, Some(latency)) if !spec.is_fir() => Choice { taps: 0, latency },
            _ => choose(spec, taps, problem, comparison)?,
        };
        let taps_chosen = spec.is_fir() && spec.design.taps.is_none();
        let sizing = Self { latency, taps, latency_chosen: spec.latency.is_none(), taps_chosen };
        // The delays may ask for more than the longest latency.
        sizing.applied_to(spec).check()?;
        Ok(sizing)
    }

    /// The spec with these sizes and nothing left open.
    pub(super) fn applied_to(&self, spec: &Spec) -> Spec {
        let mut sized = Spec { latency: Some(self.latency), ..spec.clone() };
        if self.taps_chosen {
            (sized.design.taps, sized.design.target_snr_db) = (Some(self.taps), None);
        }
        sized
    }
}

/// The number of taps of the comparison methods: 23 for M = 2, as in the thesis.
fn usual_taps(spec: &Spec) -> Option<usize> {
    let compares = matches!(spec.design.method, Method::Sinc | Method::Separation);
    compares.then(|| 12 * spec.ratio - 1)
}

/// Taps and latency where at least one of them is open.
fn choose(
    spec: &Spec,
    taps: Option<usize>,
    problem: &Problem,
    comparison: Comparison<'_>,
) -> Result<Choice, DesignError> {
    comparison.after(0)?;
    // Delays that all channels have only add to the latency.
    let common = if spec.latency.is_some() { 0 } else { common_delay(spec) };
    let wanted = spec.design.target_snr_db;
    // A wanted SNR is that of the noise which the spec states; without one the usual rounding limits it.
    let noisy = if wanted.is_some() { with_uncertain_instants(spec) } else { with_usual_noise(spec) };
    let noise = problem.noise_powers(&noisy)?;
    let whole = Problem { noise, ..problem.clone() }.earlier(common);
    let merged = whole.merge_channels(Repeats::of(spec)).of_unit_size()?.problem;
    let problem = if wanted.is_some() { merged.clone() } else { manageable(merged.clone()) };
    let mut chosen = match (spec.design.method, taps) {
        (Method::Sinc | Method::Separation, taps) => middle(&problem, taps.unwrap_or_default()),
        (_, Some(taps)) => {
            let errors = LeastErrors::new(&problem, taps, candidates(&problem, taps))?;
            Choice { taps, latency: errors.shortest() }
        }
        (_, None) if spec.is_fir() => fewest_taps(spec, &problem)?,
        (_, None) => {
            let errors = LeastErrors::causal(&problem)?;
            let latency = match spec.design.order {
                Some(_) => latency_of_order(spec, &whole, &errors, comparison)?,
                None => errors.shortest(),
            };
            Choice { taps: 0, latency }
        }
    };
    let is_minimax = spec.design.method == Method::Fir && robust_box(spec).is_none();
    if let Some(wanted) = wanted.filter(|_| is_minimax) {
        chosen = lengthened(spec, &merged, chosen, wanted, comparison)?;
    }
    Ok(Choice { latency: common + chosen.latency, ..chosen })
}

/// The latency at which the output instant lies in the middle of the samples that the taps see.
fn middle(problem: &Problem, taps: usize) -> Choice {
    let delays: f64 = problem.delays().iter().map(|delay| delay.0).sum();
    let mean = delays / problem.channels.len() as f64;
    Choice { taps, latency: ((0.5 * (taps - 1) as f64 + mean).round() as usize).max(problem.wait) }
}

/// The shortest latency at which a bank with as few states as `spec` asks for is almost the best. The states
/// that a long latency takes are missing elsewhere, so there is a best latency, which only designs show.
/// `errors` are those of banks with any number of states: a latency at which these are worse than a bank
/// that was found needs no design.
///
/// # Errors
/// [`DesignError`] of a design, where none succeeds.
fn latency_of_order(
    spec: &Spec,
    problem: &Problem,
    errors: &LeastErrors,
    comparison: Comparison<'_>,
) -> Result<usize, DesignError> {
    let first = errors.shortest();
    let mut tried = Tried { errors: vec![f64::INFINITY; errors.longest() + 1], best: first, refused: None };
    for latency in first..=errors.longest() {
        let in_vain = latency > tried.best + FRUITLESS_PERIODS * problem.ratio;
        if in_vain || is_almost(tried.least(), errors.lasting) {
            break;
        }
        comparison.after(tried.count())?;
        tried.note(latency, error_of_order(spec, &Problem { latency, ..problem.clone() }, comparison.stop));
        comparison.go_on()?;
    }
    for latency in (problem.wait..first).rev() {
        if is_almost(errors.rms(latency), tried.least()) {
            comparison.after(tried.count())?;
            let problem = Problem { latency, ..problem.clone() };
            tried.note(latency, error_of_order(spec, &problem, comparison.stop));
            comparison.go_on()?;
        }
    }
    tried.shortest()
}

/// Latencies at which banks were designed.
struct Tried {
    /// Whole errors of the banks, infinite without one.
    errors: Vec<f64>,
    /// The latency of the least one.
    best: usize,
    /// Why a latency has no bank.
    refused: Option<DesignError>,
}

impl Tried {
    fn least(&self) -> f64 {
        self.errors[self.best]
    }

    fn count(&self) -> usize {
        self.errors.iter().filter(|error| error.is_finite()).count()
    }

    fn note(&mut self, latency: usize, error: Result<f64, DesignError>) {
        match error {
            Ok(error) => self.errors[latency] = error,
            Err(refused) => self.refused = Some(refused),
        }
        if self.errors[latency] < self.least() {
            self.best = latency;
        }
    }

    /// The shortest latency that is almost the best.
    fn shortest(self) -> Result<usize, DesignError> {
        match self.refused {
            Some(refused) if self.errors[self.best].is_infinite() => Err(refused),
            _ => Ok(shortest(&self.errors)),
        }
    }
}

/// The whole error of the bank of least mean square with as few states as `spec` asks for.
fn error_of_order(spec: &Spec, problem: &Problem, stop: &Stop) -> Result<f64, DesignError> {
    let mut spec = spec.clone();
    spec.design.method = Method::H2;
    let merged = problem.merge_channels(Repeats::of(&spec)).of_unit_size()?;
    let plant = LiftedPlant::new(&merged.problem);
    let settings = Settings { stop: stop.clone(), ..settings(&spec, 0)? };
    let synthesis = methods::synthesise(Method::H2, &plant, &settings)?;
    let realised = realise(&spec, problem, &merged, &plant, &synthesis, stop)?;
    whole_error(&LiftedPlant::new(problem), &realised.filters)
}

/// The fewest taps per channel whose least error reaches the SNR that `spec` asks for, or which is within
/// [`WORTHWHILE_TAPS`] of the least of all lengths; at the latency of the spec, or over all of them and then
/// the shortest at which that many taps are almost the best.
fn fewest_taps(spec: &Spec, problem: &Problem) -> Result<Choice, DesignError> {
    let (ratio, given) = (spec.ratio, spec.latency);
    let errors = |taps: usize| {
        let latencies = given.map_or_else(|| candidates(problem, taps), |latency| latency..=latency);
        LeastErrors::new(problem, taps, latencies)
    };
    let most = match spec.design.method {
        Method::Fir => MAX_OPTIMISED_TAPS / (spec.layout().count() * ratio),
        _ => MOST_FRAMES,
    };
    let most = most.min(MAX_ERROR_STATES / 2 / spec.layout().count()).clamp(1, MOST_FRAMES) * ratio;
    let oldest = given.map_or(0, |latency| latency + problem.longest_delay().0.ceil() as usize);
    let mut taps = ((oldest / ratio + FIRST_FRAMES) * ratio).min(most);
    let mut best = errors(taps)?;
    while taps < most {
        taps = (2 * taps).min(most);
        let more = errors(taps)?;
        let done = best.least().powi(2) - more.least().powi(2) <= SAME_SQUARE * best.least().powi(2);
        best = more;
        if done {
            break;
        }
    }
    let wanted = spec.design.target_snr_db;
    let enough = wanted
        .map_or(best.least() * (1.0 + WORTHWHILE_TAPS), |snr| best.zero_output * 10f64.powf(-snr / 20.0));
    if best.least() > enough {
        return Err(DesignError::SnrOutOfReach {
            wanted: wanted.unwrap_or_default(),
            best: 20.0 * (best.zero_output / best.least()).log10(),
            latency: best.shortest() + if given.is_none() { common_delay(spec) } else { 0 },
        });
    }
    let mut too_few = 0;
    while taps - too_few > 1 {
        let middle = too_few + (taps - too_few) / 2;
        if errors(middle)?.least() <= enough { taps = middle } else { too_few = middle }
    }
    Ok(Choice { taps, latency: errors(taps)?.shortest() })
}

/// At least `chosen`, and as long as it takes until the bank of least gamma has the `wanted` SNR: it does
/// not aim at that.
///
/// # Errors
/// [`DesignError::SnrMissed`] if no length of [`LENGTHENINGS`] has it.
fn lengthened(
    spec: &Spec,
    problem: &Problem,
    chosen: Choice,
    wanted: f64,
    comparison: Comparison<'_>,
) -> Result<Choice, DesignError> {
    let Choice { mut taps, mut latency } = chosen;
    let most = MAX_OPTIMISED_TAPS / spec.layout().count();
    let mut best = f64::NEG_INFINITY;
    for designs in 0..LENGTHENINGS {
        if designs > 0 {
            taps = (taps + (taps / 10).max(1)).min(most);
        }
        if designs > 0 && spec.latency.is_none() {
            latency = LeastErrors::new(problem, taps, candidates(problem, taps))?.shortest();
        }
        comparison.after(designs)?;
        let settings = Settings { stop: comparison.stop.clone(), ..settings(spec, taps)? };
        let plant = LiftedPlant::new(&Problem { latency, ..problem.clone() });
        let error = whole_error(&plant, &methods::synthesise(Method::Fir, &plant, &settings)?.filters)?;
        comparison.go_on()?;
        let target = h2_norm(&plant.reference())? / (plant.ratio() as f64).sqrt();
        best = f64::max(best, 20.0 * (target / error).log10());
        if error <= target * 10f64.powf(-wanted / 20.0) {
            return Ok(Choice { taps, latency });
        }
        if taps == most {
            break;
        }
    }
    Err(DesignError::SnrMissed { wanted, best, taps })
}

/// The settings of the method, with so many taps.
///
/// # Errors
/// [`DesignError`] if the spec has no [`Problem`] at the slow rate.
pub(super) fn settings(spec: &Spec, taps: usize) -> Result<Settings, DesignError> {
    let at_slow_rate = || {
        let signal = SignalFilter::written_out(spec);
        let slow = Spec { fast_period: spec.fast_period * spec.ratio as f64, signal, ..spec.per_sample() };
        // The method replaces the latency. With this one no delay chain is long.
        let problem = Problem::new(&slow, common_delay(&slow))?;
        Ok::<_, DesignError>(problem.merge_channels(Repeats::AtOneInstant).of_unit_size()?.problem)
    };
    let separate = spec.design.method == Method::Separation;
    Ok(Settings {
        taps,
        robust: robust_box(spec),
        deviations: Deviations::averaged_over(spec),
        gamma_margin: spec.design.gamma_margin,
        at_slow_rate: separate.then(at_slow_rate).transpose()?,
        ..Settings::default()
    })
}

/// The spec with the usual resolution, if no channel has any noise; and where the method averages over
/// delays that are uncertain, with these as jitter: about as bad, but other at each sample, which a
/// smoother can weigh.
fn with_usual_noise(spec: &Spec) -> Spec {
    let mut noisy = spec.clone();
    if spec.channels.iter().all(|channel| channel.sample_noise() == 0.0 && channel.jitter.0 == 0.0) {
        noisy.channels.iter_mut().for_each(|channel| channel.bits = Some(USUAL_BITS));
    }
    with_uncertain_instants(&noisy)
}

/// The spec with uncertain delays as jitter, for a method that averages over them.
fn with_uncertain_instants(spec: &Spec) -> Spec {
    let mut noisy = spec.clone();
    for (channel, deviations) in
        noisy.channels.iter_mut().zip(Deviations::averaged_over(spec).unwrap_or_default())
    {
        let delay = spec.fast_period * deviations.delay.0;
        channel.jitter = Seconds(channel.jitter.0.hypot(delay.0));
    }
    noisy
}

/// The root of the mean square of error and noise together, per fast sample.
fn whole_error(plant: &LiftedPlant, filters: &SynthesisFilters) -> Result<f64, DesignError> {
    let error = plant.with_noise().error_system(&filters::lifted(filters, plant.ratio()));
    Ok(h2_norm(&error)? / (plant.ratio() as f64).sqrt())
}

#[cfg(test)]
mod tests;
