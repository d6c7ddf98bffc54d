//! Time and memory of a design, estimated before it starts.
//!
//! Every step of a design is dense linear algebra on matrices whose sizes follow from the spec. The
//! estimates count their operations and multiply them by rates that were measured on one core of a current
//! server processor (docs/figures.md). They are right within a factor of about two where a design takes
//! more than a few seconds.

pub(super) mod amount;
mod cost;
mod fir;
mod progress;
mod recursive;
mod sizes;

pub use amount::Effort;
pub use progress::{Observer, Stage, unobserved};

use super::DesignError;
use super::merging::Repeats;
use super::methods::Deviations;
use super::methods::scenarios::RobustProblem;
use super::problem::{Problem, common_delay};
use crate::memory::available_memory;
use crate::spec::{Method, Solver, Spec};
use sizes::Sizes;

/// A design that takes longer is refused, in seconds.
pub const MOST_SECONDS: f64 = 600.0;
/// Memory of the program itself and of everything that does not grow with the sizes, in bytes.
const BASE_BYTES: f64 = 10e6;

/// Designs of a comparison method that the choice of a latency compares at most.
const MOST_COMPARISONS: f64 = 40.0;
/// Surveys that the choice of a number of taps takes: lengths are doubled, then halved.
const LENGTHS: f64 = 12.0;

/// Frames that a bank sees whose number of taps is still open, before it is chosen.
const USUAL_LAGS: usize = 24;

/// Whether a design is refused when its estimate exceeds ten minutes or the free memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Limits {
    /// It is refused.
    #[default]
    Enforced,
    /// It runs all the same.
    Off,
}

/// The effort of the design of a spec, whose latency and taps may still be to be chosen; with the
/// search for a proof if `proving`, and with the scale of gamma that is reported.
///
/// # Errors
/// [`DesignError`] if the spec has no [`Problem`].
pub fn estimate(spec: &Spec, proving: bool) -> Result<Effort, DesignError> {
    let usual = if spec.is_fir() { USUAL_LAGS * spec.ratio } else { 0 };
    let taps = spec.design.taps.unwrap_or(usual);
    let common = if spec.latency.is_none() { common_delay(spec) } else { 0 };
    let problem = Problem::new(spec, spec.latency.unwrap_or(common))?.earlier(common);
    let problem = problem.merge_channels(Repeats::of(spec)).problem;
    let guess = || problem.longest_delay().0.ceil() as usize + taps / 4;
    let latency = if spec.latency.is_none() { guess() } else { problem.latency };
    let sizes = Sizes::new(&Problem { latency, ..problem }, taps);
    let design = synthesis(spec, &sizes);
    let finished = design.then(finishing(spec, &sizes)).then(fir::scale(&sizes)).then(if proving {
        proven(spec, &sizes)
    } else {
        Effort::default()
    });
    let chosen =
        if spec.latency.is_none() { latency_choice(spec, &sizes, design) } else { Effort::default() };
    let open = spec.is_fir() && spec.design.taps.is_none();
    let length = if open { fir::reachable(&sizes).times(LENGTHS) } else { Effort::default() };
    let total = finished.then(chosen).then(length);
    Ok(Effort { bytes: total.bytes + BASE_BYTES, ..total })
}

/// The method itself.
fn synthesis(spec: &Spec, sizes: &Sizes) -> Effort {
    match spec.design.method {
        Method::Fir if spec.design.solver == Some(Solver::Kyp) => fir::by_lmi(sizes),
        Method::Fir => fir::design(sizes).then(robust(spec, sizes)),
        Method::Iir => recursive::design(sizes),
        Method::H2 if spec.is_fir() && Deviations::of(spec).is_some() => fir::averaged(sizes),
        Method::H2 if spec.is_fir() => fir::mean_square(sizes),
        Method::H2 => recursive::mean_square(sizes),
        Method::Sinc => fir::judged(sizes),
        Method::Separation => fir::separation(sizes),
    }
}

/// The part of a design that is for uncertain channels.
fn robust(spec: &Spec, sizes: &Sizes) -> Effort {
    match RobustProblem::of(spec) {
        None => Effort::default(),
        Some(_) if spec.design.tracking.is_some() => fir::affine(sizes),
        Some(problem) => fir::robust(sizes, problem.scenario_count()),
    }
}

/// The search for a proof.
fn proven(spec: &Spec, sizes: &Sizes) -> Effort {
    if spec.is_fir() { fir::proven(sizes) } else { recursive::proven(sizes) }
}

/// The choice of the latency, for a method of which one design takes `design`.
fn latency_choice(spec: &Spec, sizes: &Sizes, design: Effort) -> Effort {
    match (spec.design.method, spec.design.taps) {
        (Method::Sinc | Method::Separation, _) => {
            design.times((sizes.taps + sizes.longest_delay).min(MOST_COMPARISONS))
        }
        (_, Some(_)) => fir::reachable(sizes),
        (_, None) => recursive::causal_errors(sizes),
    }
}

/// Integer taps or order reduction.
fn finishing(spec: &Spec, sizes: &Sizes) -> Effort {
    let integers = if spec.design.bits.is_some() { fir::integers(sizes) } else { Effort::default() };
    let reduction =
        if spec.design.reduction.is_some() { recursive::reduction(sizes) } else { Effort::default() };
    integers.then(reduction)
}

/// Refuses what cannot end in ten minutes or needs more memory than is free.
///
/// # Errors
/// [`DesignError::TooLong`] or [`DesignError::TooLarge`], with the figures and the way out.
pub(super) fn check(spec: &Spec, proving: bool, limits: Limits) -> Result<Effort, DesignError> {
    let effort = estimate(spec, proving)?;
    let memory = available_memory();
    let remedy = remedy(spec);
    match limits {
        Limits::Off => Ok(effort),
        Limits::Enforced if memory.is_some_and(|memory| effort.bytes > memory) => {
            Err(DesignError::TooLarge { effort, memory: memory.unwrap_or_default(), remedy })
        }
        Limits::Enforced if effort.seconds > MOST_SECONDS => Err(DesignError::TooLong { effort, remedy }),
        Limits::Enforced => Ok(effort),
    }
}

/// The way out.
fn remedy(spec: &Spec) -> &'static str {
    match spec.design.method {
        Method::Fir if spec.design.bits.is_some() => {
            "use fewer taps, leave out bits, take a smaller ratio or fewer channels"
        }
        Method::Fir if spec.design.tracking.is_some() => {
            "use fewer taps or channels, a smaller ratio, or leave out tracking"
        }
        Method::Fir if spec.uncertainty.is_some() => {
            "use fewer taps, a smaller ratio or fewer channels, or leave out [uncertainty]"
        }
        Method::Fir => "use fewer taps, a smaller ratio or fewer channels",
        Method::Iir | Method::H2 if spec.design.reduction.is_some() => {
            "use a shorter latency, leave out the order reduction, or use the method fir"
        }
        Method::Iir | Method::H2 => {
            "use a shorter latency, a smaller ratio, fewer channels, or the method fir"
        }
        Method::Sinc | Method::Separation => {
            "use fewer taps, a smaller ratio or fewer channels, or set the latency"
        }
    }
}

#[cfg(test)]
mod tests;
