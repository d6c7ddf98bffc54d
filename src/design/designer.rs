//! The way from a spec to a finished bank.

use super::equivalence::BlockedPlant;
use super::problem::{Part, Problem};
use super::{DesignError, comparison, error_system, fir, iir};
use crate::bank::{Bank, BlockFilter, Gamma, SynthesisFilters};
use crate::lti::peak::Peak;
use crate::spec::{Method, Spec};

/// A bank with the record of its design.
#[derive(Debug, Clone)]
pub struct Design {
    /// The bank, whole.
    pub bank: Bank,
    /// The latency was left to the designer.
    pub latency_chosen: bool,
    /// Where the worst case sits, radians a slow tick.
    pub peak_frequency: f64,
    /// Riccati equations or interior-point iterations.
    pub iterations: usize,
    /// For FIR designs what their lower bound was read from; else empty.
    pub dual: Vec<fir::DualPoint>,
}

/// Designs the bank that `spec` asks for.
///
/// # Errors
/// [`DesignError`]: front ends that are none, a comparison method that does not apply, numerics that gave no bank at
/// all. A bank that is returned carries the exact norm of its very coefficients.
pub fn design(spec: &Spec) -> Result<Design, DesignError> {
    let latency = latency(spec)?;
    let problem = Problem::new(spec, latency)?;
    let (distinct, parts) = problem.without_duplicates();
    let found = run_method(spec, &distinct)?;
    let filters = share_among_duplicates(found.filters, &parts);
    // The norm that counts is that of the coefficients as they are written, on all channels.
    let peak = match found.peak {
        Some(peak) if distinct.channels.len() == problem.channels.len() => peak,
        _ => error_system::bank_gamma(&BlockedPlant::new(&problem), &filters)?,
    };
    let gamma = Gamma {
        upper: Some(peak.gain),
        lower: Some(found.lower.min(peak.gain)),
        noncausal: Some(found.noncausal.min(peak.gain)),
    };
    let mut complete = spec.clone();
    complete.latency = Some(latency);
    if complete.design.method.has_taps() {
        complete.design.taps = Some(taps_of(spec));
    }
    let bank = Bank {
        fast_period: spec.fast_period,
        ratio: spec.ratio,
        latency,
        method: spec.design.method,
        delays: spec.channels.iter().map(|channel| channel.delay).collect(),
        filters,
        gamma,
        proof: None,
        spec: Some(complete),
    };
    Ok(Design {
        bank,
        latency_chosen: spec.latency.is_none(),
        peak_frequency: peak.frequency,
        iterations: found.iterations,
        dual: found.dual,
    })
}

/// m0 of a spec in fast samples: what it says, or the designer's choice.
pub fn latency(spec: &Spec) -> Result<usize, DesignError> {
    spec.latency.map_or_else(|| choose_latency(spec), Ok)
}

struct Found {
    filters: SynthesisFilters,
    /// Exact, of these very filters, where the method has computed it.
    peak: Option<Peak>,
    lower: f64,
    noncausal: f64,
    iterations: usize,
    dual: Vec<fir::DualPoint>,
}

fn taps_of(spec: &Spec) -> usize {
    spec.design.taps.unwrap_or_else(|| comparison::default_taps(spec.ratio))
}

fn run_method(spec: &Spec, problem: &Problem) -> Result<Found, DesignError> {
    let plant = BlockedPlant::new(problem);
    let slack = spec.design.slack.unwrap_or(0.0);
    match spec.design.method {
        Method::Fir => {
            let second = fir::SecondObjective::new(&problem.noise, spec.design.slack);
            fir::design_fir(&plant, taps_of(spec), second).map(from_fir)
        }
        Method::Iir => iir::design_iir(&plant, slack).map(from_state_space),
        Method::H2 => iir::design_h2(&plant).map(from_state_space),
        Method::Sinc => fixed(&plant, comparison::sinc_taps(problem, taps_of(spec))?),
        Method::Separation => fixed(&plant, comparison::separation_taps(spec, problem, taps_of(spec))?),
    }
}

fn from_fir(design: fir::FirDesign) -> Found {
    Found {
        filters: SynthesisFilters::Fir(design.taps),
        peak: Some(design.peak),
        lower: design.lower,
        noncausal: design.noncausal,
        iterations: design.iterations,
        dual: design.dual,
    }
}

fn from_state_space(design: iir::StateSpaceDesign) -> Found {
    Found {
        filters: SynthesisFilters::StateSpace(error_system::to_block(&design.filters)),
        peak: None,
        lower: design.lower,
        noncausal: design.noncausal,
        iterations: design.trials,
        dual: Vec::new(),
    }
}

/// A comparison method optimises nothing: what bounds every bank is all that is known below.
fn fixed(plant: &BlockedPlant, taps: Vec<Vec<f64>>) -> Result<Found, DesignError> {
    let noncausal = iir::noncausal_bound(plant)?;
    Ok(Found {
        filters: SynthesisFilters::Fir(taps),
        peak: None,
        lower: noncausal,
        noncausal,
        iterations: 0,
        dual: Vec::new(),
    })
}

/// Channels that cannot be told apart share their common filter: the same error, the least noise.
fn share_among_duplicates(filters: SynthesisFilters, parts: &[Part]) -> SynthesisFilters {
    let share = |row: &[f64]| -> Vec<f64> {
        parts.iter().map(|part| row[part.representative] * part.share).collect()
    };
    match filters {
        SynthesisFilters::Fir(taps) => SynthesisFilters::Fir(
            parts
                .iter()
                .map(|part| taps[part.representative].iter().map(|tap| tap * part.share).collect())
                .collect(),
        ),
        SynthesisFilters::StateSpace(block) => SynthesisFilters::StateSpace(BlockFilter {
            b: block.b.iter().map(|row| share(row)).collect(),
            d: block.d.iter().map(|row| share(row)).collect(),
            ..block
        }),
    }
}

/// Latencies tried beyond the longest delay, in slow ticks.
const LATENCY_LADDER: [usize; 6] = [1, 2, 3, 4, 6, 8];
/// A longer latency must lower gamma by this fraction to be worth it.
const WORTHWHILE: f64 = 1e-3;

/// The shortest latency of the ladder whose IIR optimum is within [`WORTHWHILE`] of the best; for FIR banks
/// no later than the middle of their taps, so that the filters can look both ways.
fn choose_latency(spec: &Spec) -> Result<usize, DesignError> {
    let base = Problem::new(spec, 0)?.longest_delay().ceil() as usize;
    let mut ladder = Vec::new();
    for ticks in LATENCY_LADDER {
        let latency = base + ticks * spec.ratio;
        let (distinct, _) = Problem::new(spec, latency)?.without_duplicates();
        let optimum = iir::design_iir(&BlockedPlant::new(&distinct), 0.0)?;
        let settled = optimum.upper <= optimum.noncausal * (1.0 + WORTHWHILE);
        ladder.push((latency, optimum.upper));
        if settled {
            break;
        }
    }
    let best = ladder.iter().map(|&(_, gamma)| gamma).fold(f64::INFINITY, f64::min);
    let enough = |&&(_, gamma): &&(usize, f64)| gamma <= best * (1.0 + WORTHWHILE);
    let chosen = ladder.iter().find(enough).map_or(base, |&(latency, _)| latency);
    Ok(if spec.design.method.has_taps() { chosen.max(centre(spec, base)) } else { chosen })
}

/// The latency at which FIR filters of the spec's length are centred on the sample they make.
fn centre(spec: &Spec, longest_delay: usize) -> usize {
    (taps_of(spec) / 2).max(longest_delay.min(taps_of(spec)))
}
