//! The way from a spec to a finished bank.

use super::equivalence::BlockedPlant;
use super::problem::{Part, Problem};
use super::quantise::{QuantisationProblem, WordStudy, quantise};
use super::reduction::{Aim, OrderReduction, ReductionProblem, reduce};
use super::{DesignError, comparison, error_system, fir, fir_kyp, iir};
use crate::bank::{Bank, FixedPoint, Gamma, SynthesisFilters};
use crate::linalg::Mat;
use crate::lti::peak::Peak;
use crate::lti::{StateSpace, TappedRecursion};
use crate::spec::{Method, Solver, Spec};

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
    /// For integer taps what they cost.
    pub words: Option<WordStudy>,
    /// For FIR designs what their lower bound was read from; else empty.
    pub dual: Vec<fir::DualPoint>,
    /// What became of the order, where the spec asks for fewer states.
    pub reduction: Option<OrderReduction>,
}

/// Designs the bank that `spec` asks for.
///
/// # Errors
/// [`DesignError`]: front ends that are none, a comparison method that does not apply, numerics that gave no bank at
/// all. A bank that is returned carries the exact norm of its very coefficients.
pub fn design(spec: &Spec) -> Result<Design, DesignError> {
    let latency = latency(spec)?;
    let problem = Problem::new(spec, latency)?;
    let distinct = Distinct::of(&problem);
    let Found { solution, bounds, iterations, dual } = run_method(spec, &distinct.problem)?;
    let plant = BlockedPlant::new(&problem);
    let written = write_filters(spec, &plant, &distinct, solution)?;
    let Written { judged: Judged { filters, peak }, reduction, integers } =
        with_integers(spec, &plant, &problem.noise, written)?;
    let (fixed_point, words) = integers.unzip();
    let bank = Bank { fixed_point, ..bank_of(spec, latency, filters, bounds.below(peak.gain)) };
    Ok(Design {
        bank,
        latency_chosen: spec.latency.is_none(),
        peak_frequency: peak.frequency,
        iterations,
        words,
        dual,
        reduction,
    })
}

/// The bank with the whole of its spec.
fn bank_of(spec: &Spec, latency: usize, filters: SynthesisFilters, gamma: Gamma) -> Bank {
    Bank {
        fast_period: spec.fast_period.0,
        ratio: spec.ratio,
        latency,
        method: spec.design.method,
        delays: spec.channels.iter().map(|channel| channel.delay.0).collect(),
        filters,
        gamma,
        proof: None,
        fixed_point: None,
        spec: Some(completed(spec, latency)),
    }
}

/// The spec with what the designer chose filled in.
fn completed(spec: &Spec, latency: usize) -> Spec {
    let mut complete = spec.clone();
    complete.latency = Some(latency);
    if complete.design.method.has_taps() {
        complete.design.taps = Some(taps_of(spec));
    }
    complete
}

/// m0 of a spec in fast samples: what it says, or the designer's choice.
pub fn latency(spec: &Spec) -> Result<usize, DesignError> {
    spec.latency.map_or_else(|| choose_latency(spec), Ok)
}

/// The problem with each channel once, and how the channels as they are share these.
struct Distinct {
    problem: Problem,
    parts: Vec<Part>,
}

impl Distinct {
    fn of(problem: &Problem) -> Self {
        let (problem, parts) = problem.without_duplicates();
        Self { problem, parts }
    }

    /// No channel shares a filter with another.
    fn are_all(&self) -> bool {
        self.problem.channels.len() == self.parts.len()
    }
}

/// What a method comes up with.
enum Solution {
    /// FIR filters, one a channel, with their exact norm where the method has computed it.
    Taps(Vec<Vec<f64>>, Option<Peak>),
    /// One block for each slow tick, with the norm of its error system.
    System(StateSpace, f64),
}

/// What is known below gamma.
struct Bounds {
    lower: f64,
    noncausal: f64,
}

impl Bounds {
    /// With the norm of the bank, above which no bound stays whatever the rounding.
    fn below(&self, norm: f64) -> Gamma {
        Gamma::computed(norm, self.lower, self.noncausal)
    }
}

/// A solution on the distinct channels, with the record of the search.
struct Found {
    solution: Solution,
    bounds: Bounds,
    iterations: usize,
    dual: Vec<fir::DualPoint>,
}

/// A bank's filters with their exact norm.
struct Judged {
    filters: SynthesisFilters,
    peak: Peak,
}

/// A bank's filters as they go into the file, with what became of their order and of their taps.
struct Written {
    judged: Judged,
    reduction: Option<OrderReduction>,
    integers: Option<(FixedPoint, WordStudy)>,
}

impl From<Judged> for Written {
    fn from(judged: Judged) -> Self {
        Self { judged, reduction: None, integers: None }
    }
}

fn taps_of(spec: &Spec) -> usize {
    spec.design.taps.unwrap_or_else(|| comparison::default_taps(spec.ratio))
}

fn run_method(spec: &Spec, problem: &Problem) -> Result<Found, DesignError> {
    let plant = BlockedPlant::new(problem);
    let gamma_margin = spec.design.gamma_margin.unwrap_or(0.0);
    match spec.design.method {
        Method::Fir => {
            if spec.design.solver == Some(Solver::Kyp) {
                return fir_kyp::design_fir_kyp(&plant, taps_of(spec)).map(from_fir);
            }
            let second = fir::SecondObjective::new(&problem.noise, spec.design.gamma_margin);
            fir::design_fir(&plant, taps_of(spec), second).map(from_fir)
        }
        Method::Iir => iir::design_iir(&plant, gamma_margin).map(from_state_space),
        Method::H2 => iir::design_h2(&plant).map(from_state_space),
        Method::Sinc => fixed(&plant, comparison::sinc_taps(problem, taps_of(spec))?),
        Method::Separation => fixed(&plant, comparison::separation_taps(spec, problem, taps_of(spec))?),
    }
}

fn from_fir(design: fir::FirDesign) -> Found {
    Found {
        solution: Solution::Taps(design.taps, Some(design.peak)),
        bounds: Bounds { lower: design.lower, noncausal: design.noncausal },
        iterations: design.iterations,
        dual: design.dual,
    }
}

fn from_state_space(design: iir::StateSpaceDesign) -> Found {
    Found {
        solution: Solution::System(design.filters, design.upper),
        bounds: Bounds { lower: design.lower, noncausal: design.noncausal },
        iterations: design.trials,
        dual: Vec::new(),
    }
}

/// A comparison method optimises nothing: what bounds every bank is all that is known below.
fn fixed(plant: &BlockedPlant, taps: Vec<Vec<f64>>) -> Result<Found, DesignError> {
    let noncausal = iir::noncausal_bound(plant)?;
    let bounds = Bounds { lower: noncausal, noncausal };
    Ok(Found { solution: Solution::Taps(taps, None), bounds, iterations: 0, dual: Vec::new() })
}

/// The filters of all channels in the form in which they are written. The norm that counts is that of these coefficients,
/// on all channels.
fn write_filters(
    spec: &Spec,
    plant: &BlockedPlant,
    distinct: &Distinct,
    solution: Solution,
) -> Result<Written, DesignError> {
    match solution {
        Solution::Taps(taps, Some(peak)) if distinct.are_all() => {
            Ok(Judged { filters: SynthesisFilters::Fir(taps), peak }.into())
        }
        Solution::Taps(taps, _) => {
            judged(plant, SynthesisFilters::Fir(shared_taps(&taps, &distinct.parts))).map(Written::from)
        }
        Solution::System(system, norm) => recursive_form(spec, plant, distinct, &system, norm),
    }
}

/// The filters with integer taps where the spec asks for these.
fn with_integers(
    spec: &Spec,
    plant: &BlockedPlant,
    noise: &[f64],
    written: Written,
) -> Result<Written, DesignError> {
    let Judged { filters, peak } = &written.judged;
    let (SynthesisFilters::Fir(taps), Some(bits)) = (filters, &spec.design.bits) else {
        return Ok(written);
    };
    let problem =
        QuantisationProblem { plant, taps, noise, gamma_margin: spec.design.gamma_margin.unwrap_or(0.0) };
    let (integers, study) = quantise(problem, peak.gain, bits, spec.design.fraction_bits)?;
    let judged = judged(plant, SynthesisFilters::Fir(integers.taps()))?;
    Ok(Written { judged, integers: Some((integers, study)), ..written })
}

/// A change of coordinates may cost this fraction of gamma.
const FORM_ACCURACY: f64 = 1e-9;

/// The filters in the cheapest form that keeps the norm `promised`: parallel sections at the end of a delay line, a
/// triangle there, or else as they are.
fn written_form(plant: &BlockedPlant, system: &StateSpace, promised: f64) -> Result<Judged, DesignError> {
    match fast_form(plant, &TappedRecursion::new(system)?, promised)? {
        Some(found) => Ok(found),
        None => judged(plant, block_filters(system)),
    }
}

/// The first of the fast forms that keeps the norm, if any does.
fn fast_form(
    plant: &BlockedPlant,
    tapped: &TappedRecursion,
    promised: f64,
) -> Result<Option<Judged>, DesignError> {
    let forms = [tapped.modal(), tapped.triangular().map(Some)];
    for form in forms.into_iter().filter_map(|form| form.ok().flatten()) {
        let found = judged(plant, block_filters(&form.realise()?))?;
        if found.peak.gain <= promised * (1.0 + FORM_ACCURACY) {
            return Ok(Some(found));
        }
    }
    Ok(None)
}

/// A recursive bank as it is written, of the order that the spec asks for.
fn recursive_form(
    spec: &Spec,
    plant: &BlockedPlant,
    distinct: &Distinct,
    system: &StateSpace,
    norm: f64,
) -> Result<Written, DesignError> {
    let full = written_form(plant, &shared_inputs(system, &distinct.parts)?, norm)?;
    let (Some(wanted), SynthesisFilters::StateSpace(block)) = (spec.design.reduction, &full.filters) else {
        return Ok(full.into());
    };
    let problem = ReductionProblem {
        plant: &BlockedPlant::new(&distinct.problem),
        bank: system,
        order: block.a.len(),
        width: distinct.parts.len(),
        aim: if spec.design.method == Method::H2 { Aim::MeanSquare } else { Aim::WorstCase },
        gamma_margin: spec.design.gamma_margin.unwrap_or(0.0),
    };
    let (smaller, record) = reduce(&problem, wanted)?;
    let judged = match smaller {
        None => full,
        Some(smaller) => reduced_form(plant, &distinct.parts, smaller, record.reduced.figures.gamma)?,
    };
    Ok(Written { judged, reduction: Some(record), integers: None })
}

/// A reduced bank for all channels, in a fast form if one keeps the norm `promised`.
fn reduced_form(
    plant: &BlockedPlant,
    parts: &[Part],
    reduced: TappedRecursion,
    promised: f64,
) -> Result<Judged, DesignError> {
    let whole = reduced.with_inputs(|m| shared(m, parts))?;
    match fast_form(plant, &whole, promised)? {
        Some(found) => Ok(found),
        None => judged(plant, block_filters(&whole.realise()?)),
    }
}

fn block_filters(system: &StateSpace) -> SynthesisFilters {
    SynthesisFilters::StateSpace(error_system::to_block(system))
}

fn judged(plant: &BlockedPlant, filters: SynthesisFilters) -> Result<Judged, DesignError> {
    let peak = error_system::bank_gamma(plant, &filters)?;
    Ok(Judged { filters, peak })
}

/// Channels that cannot be told apart share their common filter: the same error, the least noise.
fn shared_taps(taps: &[Vec<f64>], parts: &[Part]) -> Vec<Vec<f64>> {
    let share = |part: &Part| taps[part.representative].iter().map(|tap| tap * part.share).collect();
    parts.iter().map(share).collect()
}

/// As [`shared_taps`], for the inputs of a system.
fn shared_inputs(system: &StateSpace, parts: &[Part]) -> Result<StateSpace, DesignError> {
    let (b, d) = (shared(system.b(), parts), shared(system.d(), parts));
    Ok(StateSpace::new(system.a().clone(), b, system.c().clone(), d)?)
}

/// The columns of a matrix of input weights, shared.
fn shared(m: &Mat, parts: &[Part]) -> Mat {
    Mat::from_fn(m.nrows(), parts.len(), |i, j| m[(i, parts[j].representative)] * parts[j].share)
}

/// Latencies tried beyond the longest delay, in slow ticks.
const LATENCY_LADDER: [usize; 6] = [1, 2, 3, 4, 6, 8];
/// A longer latency must lower gamma by this fraction to be worth it.
const WORTHWHILE: f64 = 1e-3;

/// The shortest latency of the ladder whose IIR optimum is within [`WORTHWHILE`] of the best; for FIR banks
/// no later than the middle of their taps, so that the filters can look both ways.
fn choose_latency(spec: &Spec) -> Result<usize, DesignError> {
    let base = Problem::new(spec, 0)?.longest_delay().0.ceil() as usize;
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
