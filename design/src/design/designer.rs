//! The steps from a spec to a finished bank.

use super::band_error::BandError;
use super::deviations::Deviations;
use super::limits::{Stage, Stop, TIME_LIMIT, remedy};
use super::methods::robust_fir::RobustStudy;
use super::methods::{self, MethodSettings, Synthesis};
use super::plant::LiftedPlant;
use super::preparation::{SizingControl, merged, settings};
use super::problem::Problem;
use super::quantise::WordStudy;
use super::realise::{Realised, realise};
use super::reduction::OrderReduction;
use super::sizing::Sizing;
use super::{DesignError, filters, prove};
use hybank_core::bank::{Bank, Gamma, SynthesisFilters};
use hybank_core::spec::{At, DesignSpec, Method, SignalSpec, Spec, SpecProblem};
use hybank_core::units::RadiansPerSlowPeriod;
use hybank_verify::analog::SignalFilter;
use hybank_verify::verify::Verified;
use std::time::{Duration, Instant};

/// A bank with the record of its design.
#[derive(Debug, Clone)]
pub struct Design {
    /// The finished bank. It carries its proof if one was found.
    pub bank: Bank,
    /// Latency and taps, and which of them the designer chose.
    pub sizing: Sizing,
    /// Frequency of the worst case.
    pub peak_frequency: RadiansPerSlowPeriod,
    /// How the bank compares with others that the spec might have had.
    pub study: Study,
    /// The bounds that the bank's proof proves, or the reason why the bank carries no proof.
    pub proof: Result<Verified, DesignError>,
    /// Why the proof does not cover the box of the spec's `[uncertainty]`, if it does not.
    pub box_unproven: Option<DesignError>,
    /// Time that the search for the proof took.
    pub proof_time: Duration,
}

/// How a bank compares with others, by the kind of its filters.
#[derive(Debug, Clone)]
pub enum Study {
    /// Taps.
    Fir {
        /// With the real taps, if the spec asks for integer ones.
        words: Option<WordStudy>,
        /// With the bank that takes the errors for zero, if the spec has an `[uncertainty]`.
        robust: Option<RobustStudy>,
    },
    /// A recursion.
    Recursive {
        /// With those of more and of fewer states, if the spec asks for fewer.
        reduction: Option<OrderReduction>,
    },
}

/// Whether [`design`] searches for a proof of the gammas. The search may take longer than the design.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ProofSearch {
    /// Search. The bank carries the proof if one is found.
    Run,
    /// Do not search. The bank carries no proof; [`Design::proof`] is [`DesignError::ProofSkipped`].
    Skip,
}

/// How a design runs.
#[derive(Clone)]
pub struct DesignOptions<'a> {
    /// Whether a proof is searched.
    pub proof: ProofSearch,
    /// The time after which the design ends with what it has.
    pub time_limit: Option<Duration>,
    /// Called with the step that begins.
    pub observer: &'a dyn Fn(Stage),
    /// Ends the design.
    pub stop: Stop,
}

impl Default for DesignOptions<'_> {
    /// With the search for a proof, limited to [`TIME_LIMIT`] and unobserved.
    fn default() -> Self {
        let (proof, time_limit, stop) = (ProofSearch::Run, Some(TIME_LIMIT), Stop::default());
        Self { proof, time_limit, observer: &|_| (), stop }
    }
}

impl DesignOptions<'_> {
    /// The default without the search for a proof.
    pub fn without_proof() -> Self {
        Self { proof: ProofSearch::Skip, ..Self::default() }
    }
}

/// Designs the bank that `spec` asks for, with the proof of its gammas. `options` say how.
///
/// A design that reaches its time limit or is ended by [`DesignOptions::stop`] gives the best bank so far,
/// whose gamma may lie above the least; [`Design::proof`] is then [`DesignError::Stopped`]. It ends between
/// two steps of its searches or two sample points of an interior-point method; a single equation or norm is
/// computed to its end.
///
/// # Errors
/// [`DesignError`] if the spec breaks a rule of [`Spec::check`], a filter of the spec is not a valid front
/// end, a comparison method does not apply, no bank was found for numerical reasons, or the design was ended
/// before there was one: [`DesignError::StoppedWithoutBank`]. A bank without a proof is not an error: see
/// [`Design::proof`].
pub fn design(spec: &Spec, options: &DesignOptions<'_>) -> Result<Design, DesignError> {
    spec.check()?;
    let stop = options.stop.within(options.time_limit);
    let judged = for_signal(spec, options, &stop).map_err(|error| match error {
        DesignError::Stopped => DesignError::StoppedWithoutBank { remedy: remedy(spec) },
        other => other,
    })?;
    if stop.is_due() {
        return Ok(Design { proof: Err(DesignError::Stopped), ..judged });
    }
    if options.proof == ProofSearch::Run {
        (options.observer)(Stage::Proof);
    }
    Ok(judged.proved(options.proof, &stop))
}

/// The bank for the usual W of its signal; or that for a sharp one, where the band limits the first bank and
/// the second has a better SNR.
fn for_signal(spec: &Spec, options: &DesignOptions<'_>, stop: &Stop) -> Result<Design, DesignError> {
    let usual = designed(&filled_in(spec), options, stop)?;
    // What is uncertain limits a bank before its band does.
    let is_driven =
        matches!(spec.design.method, Method::Fir | Method::Iir) && Deviations::uncertain(spec).is_empty();
    let Some(floor) = SignalFilter::sharp_floor(spec).filter(|_| is_driven) else { return Ok(usual) };
    let Some(error) = BandError::of(&usual.bank)?.filter(BandError::is_of_signal) else { return Ok(usual) };
    // A design that fails or does not end in time is no better.
    let Ok(sharp) = designed(&with_floor(spec, floor), options, stop) else { return Ok(usual) };
    let is_better = BandError::of(&sharp.bank)?.is_some_and(|other| other.is_better_than(&error));
    Ok(if is_better { sharp } else { usual })
}

/// The spec with the floor of its signal, if that follows from the noise of the converters.
fn filled_in(spec: &Spec) -> Spec {
    let floor = SignalFilter::of(spec).and_then(|filter| filter.floor_db);
    floor.map_or_else(|| spec.clone(), |floor| with_floor(spec, floor))
}

/// The spec with a floor of its signal, unless it states one.
fn with_floor(spec: &Spec, floor: f64) -> Spec {
    let signal = spec.signal.clone().map(|signal| {
        let floor_db = signal.floor_db.or(Some(floor));
        SignalSpec { floor_db, ..signal }
    });
    Spec { signal, ..spec.clone() }
}

/// The bank of a spec without its proof.
fn designed(spec: &Spec, options: &DesignOptions<'_>, stop: &Stop) -> Result<Design, DesignError> {
    let problem = Problem::before_sizing(spec)?;
    let observer = |designs| (options.observer)(Stage::Latency { designs });
    let sizing = Sizing::new(spec, &problem, SizingControl { observer: &observer, stop })?;
    let problem = Problem { latency: sizing.latency, ..problem };
    (options.observer)(Stage::Filters);
    let settings = MethodSettings { stop: stop.clone(), ..settings(spec, sizing.taps)? };
    let apart = settings.robust.is_some() || !settings.deviations.is_empty();
    let merged = merged(spec, &problem, apart)?;
    let plant = LiftedPlant::new(&merged.problem);
    let synthesis = methods::synthesise(spec.design.method, &plant, &settings)?;
    (options.observer)(Stage::Realisation);
    let realised = realise(spec, &problem, &merged, &plant, &synthesis, stop)?;
    Ok(judge(spec, sizing, realised, &synthesis).without_unresolved_bounds(&problem))
}

/// Judges FIR filters that were designed elsewhere, `taps[i][n]` = `f_i[n]`, with the front ends, the delays
/// and the latency of `spec`. What the spec says of the design does not matter.
///
/// # Errors
/// [`DesignError::Spec`] for a spec without latency or with other numbers of channels and taps, else as
/// [`design`].
pub fn judge_taps(spec: &Spec, taps: Vec<Vec<f64>>, search: ProofSearch) -> Result<Design, DesignError> {
    let length = taps.first().map_or(0, Vec::len);
    let complete = Spec { design: DesignSpec::new(Method::Fir, Some(length)), ..spec.clone() };
    complete.check()?;
    let remedy = "filters that are not designed here have one; give it";
    let missing = SpecProblem::MissingKey { key: "latency", remedy };
    let latency = spec.latency.ok_or(missing).at("")?;
    let problem = Problem::new(&complete, latency)?;
    let channels = problem.channels.len();
    if taps.len() != channels || taps.iter().any(|list| list.len() != length) {
        return Err(DesignError::TapCount { lists: taps.len(), channels });
    }
    let plant = LiftedPlant::new(&problem);
    let synthesis = Synthesis::of_taps(&plant, taps.clone())?;
    let filters = SynthesisFilters::Fir(taps);
    let norm_error = plant.norm_error(synthesis.peak.gain, &filters::lifted(&filters, problem.ratio))?;
    let realised = Realised { norm_error, ..Realised::of(filters, synthesis.peak) };
    let sizing = Sizing { latency, taps: length, latency_chosen: false, taps_chosen: false };
    let judged = judge(&complete, sizing, realised, &synthesis).without_unresolved_bounds(&problem);
    Ok(judged.proved(search, &Stop::default()))
}

/// The bank with the norm of its final coefficients. No lower bound exceeds that norm.
fn judge(spec: &Spec, sizing: Sizing, realised: Realised, synthesis: &Synthesis) -> Design {
    let Realised { filters, peak, norm_error, fixed_point, study } = realised;
    let bank = Bank {
        fast_period: spec.fast_period,
        ratio: spec.ratio,
        latency: sizing.latency,
        method: spec.design.method,
        samples: spec.layout().samples().to_vec(),
        delays: spec.channels.iter().map(|channel| channel.delay).collect(),
        gains: spec.channels.iter().map(|channel| channel.gain).collect(),
        offsets: spec.channels.iter().map(|channel| channel.offset).collect(),
        nonlinearity: spec.channels.iter().map(|channel| channel.nonlinearity.clone()).collect(),
        filters,
        gamma: Gamma::computed(peak.gain, norm_error, synthesis.lower, synthesis.noncausal),
        proof: None,
        fixed_point,
        spec: Some(spec.clone()),
    };
    Design {
        sizing,
        peak_frequency: RadiansPerSlowPeriod(peak.frequency),
        study,
        proof: Err(DesignError::ProofSkipped),
        box_unproven: None,
        proof_time: Duration::ZERO,
        bank,
    }
}

impl Design {
    /// Leaves out the bounds that rest on differences which doubles do not resolve.
    fn without_unresolved_bounds(mut self, problem: &Problem) -> Self {
        if !problem.resolves_delays() {
            self.bank.gamma = Gamma { lower: None, noncausal: None, ..self.bank.gamma };
        }
        self
    }

    /// Searches for the proof, if `search` asks for one.
    fn proved(mut self, search: ProofSearch, stop: &Stop) -> Self {
        if search == ProofSearch::Run {
            self.prove(stop, &|_| ());
        }
        self
    }

    /// Searches for the proof of gamma, and then for that of the worst case over the box of the spec's
    /// `[uncertainty]` where the bank was designed for it. Each joins the bank if it is found. After each
    /// search `observer` is called with what is proven so far.
    pub fn prove(&mut self, stop: &Stop, observer: &dyn Fn(&Self)) {
        let begin = Instant::now();
        self.proof = prove::attach_proof(&mut self.bank, stop);
        // `verify` proves the worst case only with the rest.
        let has_box = self.proof.is_ok() && matches!(self.study, Study::Fir { robust: Some(_), .. });
        self.box_unproven = has_box.then_some(DesignError::ProofSkipped);
        self.proof_time = begin.elapsed();
        observer(self);
        if has_box {
            self.box_unproven = prove::attach_box_proof(&mut self.bank, stop).err();
            self.proof_time = begin.elapsed();
            observer(self);
        }
    }
}

#[cfg(test)]
mod tests;
