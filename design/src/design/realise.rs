//! Turns the filters of a method into those of a bank: it distributes the filters of merged channels,
//! reduces the order or quantises the taps if the spec asks for it, and chooses the realisation that runs
//! fastest.

use super::designer::Study;
use super::limits::Stop;
use super::merging::{MergedChannels, Repeats};
use super::methods::Synthesis;
use super::plant::LiftedPlant;
use super::problem::Problem;
use super::quantise::{Allowance, QuantisationProblem, quantise, quantise_within};
use super::reduction::{Aim, ReductionProblem, reduce};
use super::{DesignError, filters};
use crate::lti::peak::Peak;
use crate::lti::{FirWithTail, LtiError, StateSpace};
use hybank_core::bank::{FixedPoint, SynthesisFilters};
use hybank_core::spec::{MAX_BITS, Method, Spec, WordLengths};

/// A change of coordinates may increase gamma by this fraction.
const REALISATION_ACCURACY: f64 = 1e-8;

/// A bank's filters as they are written to the file, with the results of order reduction and quantisation.
pub(super) struct Realised {
    pub(super) filters: SynthesisFilters,
    /// The norm of the error system of the final coefficients.
    pub(super) peak: Peak,
    /// The absolute error that `peak.gain` may have.
    pub(super) norm_error: f64,
    /// For integer taps.
    pub(super) fixed_point: Option<FixedPoint>,
    pub(super) study: Study,
}

impl Realised {
    /// Filters of which only the norm of the error system is known.
    pub(super) fn of(filters: SynthesisFilters, peak: Peak) -> Self {
        let study = match filters {
            SynthesisFilters::Fir(_) => Study::Fir { words: None, robust: None },
            SynthesisFilters::StateSpace(_) => Study::Recursive { reduction: None },
        };
        Self { filters, peak, norm_error: 0.0, fixed_point: None, study }
    }
}

/// Extends the filters of `synthesis`, designed for the `merged` channels, to all channels of `problem`.
/// When `stop` is due, the searches end with the best that they have.
///
/// # Errors
/// [`DesignError`] if the order reduction, the quantisation or the norm fails.
pub(super) fn realise(
    spec: &Spec,
    problem: &Problem,
    merged: &MergedChannels,
    merged_plant: &LiftedPlant,
    synthesis: &Synthesis,
    stop: &Stop,
) -> Result<Realised, DesignError> {
    let whole = if merged.are_unchanged() { merged_plant.clone() } else { LiftedPlant::new(problem) };
    let realisation = FilterRealisation { spec, problem, whole: &whole, merged, stop };
    let realised = match &synthesis.filters {
        SynthesisFilters::Fir(taps) => realisation.fir(taps, synthesis),
        recursion => realisation.state_space(&filters::lifted(recursion, spec.ratio), synthesis.peak.gain),
    }?;
    let lifted = filters::lifted(&realised.filters, spec.ratio);
    let norm_error = whole.norm_error(realised.peak.gain, &lifted)?;
    Ok(Realised { norm_error, ..realised })
}

struct FilterRealisation<'a> {
    spec: &'a Spec,
    /// All channels.
    problem: &'a Problem,
    /// The plant of all channels.
    whole: &'a LiftedPlant,
    merged: &'a MergedChannels,
    /// Ends the searches.
    stop: &'a Stop,
}

impl FilterRealisation<'_> {
    /// What the method of the spec minimises.
    fn aim(&self) -> Aim {
        if self.spec.design.method == Method::H2 { Aim::MeanSquare } else { Aim::WorstCase }
    }

    /// The taps of all channels, quantised if the spec asks for integer taps.
    fn fir(&self, merged: &[Vec<f64>], synthesis: &Synthesis) -> Result<Realised, DesignError> {
        let design = &self.spec.design;
        let taps = self.merged.share_taps(merged);
        let peak = if self.merged.are_unchanged() { synthesis.peak } else { self.whole.fir_norm(&taps)? };
        let robust = synthesis.robust.clone();
        let problem = QuantisationProblem {
            plant: self.whole,
            taps: &taps,
            noise: &self.whole.problem().noise,
            gamma_margin: design.gamma_margin.unwrap_or(0.0),
            aim: self.aim(),
            stop: self.stop,
        };
        let gamma = peak.gain;
        let (integers, words) = match (&design.bits, design.loss_db) {
            (bits, Some(loss_db)) => {
                let most = bits.clone().unwrap_or(WordLengths::Same(MAX_BITS));
                quantise_within(problem, gamma, &Allowance { loss_db, most })?
            }
            (Some(bits), None) => quantise(problem, gamma, bits, design.fraction_bits)?,
            (None, None) => {
                let study = Study::Fir { words: None, robust };
                return Ok(Realised { study, ..Realised::of(SynthesisFilters::Fir(taps), peak) });
            }
        };
        let evaluated = evaluate(self.whole, SynthesisFilters::Fir(integers.taps()))?;
        let study = Study::Fir { words: Some(words), robust };
        Ok(Realised { fixed_point: Some(integers), study, ..evaluated })
    }

    /// A recursive bank of the order that the spec asks for; `norm` is the norm of the error of `system`
    /// with the merged channels.
    ///
    /// A smaller bank has a channel that is whole periods older as well: it costs no state, whereas the bank
    /// would need states to keep the newer channel's samples as long.
    fn state_space(&self, system: &StateSpace, norm: f64) -> Result<Realised, DesignError> {
        let full = self.fastest_realisation(&system.map_inputs(&self.merged.shares()), norm)?;
        let (Some(reduction), SynthesisFilters::StateSpace(block)) =
            (self.spec.design.reduction(), &full.filters)
        else {
            return Ok(full);
        };
        let distinct = self.problem.merge_channels(Repeats::AtOneInstant).of_unit_size()?;
        let problem = ReductionProblem {
            plant: &LiftedPlant::new(&distinct.problem),
            bank: &system.map_inputs(&self.merged.shares_of(&distinct)),
            order: block.a.len(),
            aim: self.aim(),
            gamma_margin: self.spec.design.gamma_margin.unwrap_or(0.0),
            stop: self.stop,
        };
        let (smaller, record) = reduce(&problem, reduction)?;
        let evaluated = match smaller {
            None => full,
            Some(smaller) => {
                let whole = smaller.map_inputs(&distinct.shares());
                self.fastest_realisation(&whole, record.reduced.figures.gamma)?
            }
        };
        Ok(Realised { study: Study::Recursive { reduction: Some(record) }, ..evaluated })
    }

    /// The filters in the cheapest realisation that keeps the norm `promised`: an FIR head followed by
    /// parallel sections, an FIR head followed by a balanced recursion, or the filters as they are.
    fn fastest_realisation(&self, system: &StateSpace, promised: f64) -> Result<Realised, DesignError> {
        match self.fast_realisation(&FirWithTail::new(system)?, promised)? {
            Some(found) => Ok(found),
            None => evaluate(self.whole, block_filters(system)),
        }
    }

    /// The first of the fast realisations that keeps the norm, if any does.
    fn fast_realisation(&self, split: &FirWithTail, promised: f64) -> Result<Option<Realised>, DesignError> {
        let candidates = [split.parallel_form(), Ok(Some(split.clone()))];
        for candidate in candidates.into_iter().filter_map(|form| form.ok().flatten()) {
            match evaluate(self.whole, block_filters(&candidate.realise())) {
                Ok(found) if found.peak.gain <= promised * (1.0 + REALISATION_ACCURACY) => {
                    return Ok(Some(found));
                }
                // Rounding may move a pole across the unit circle.
                Ok(_) | Err(DesignError::Lti(LtiError::Unstable { .. })) => {}
                Err(other) => return Err(other),
            }
        }
        Ok(None)
    }
}

fn block_filters(system: &StateSpace) -> SynthesisFilters {
    SynthesisFilters::StateSpace(filters::to_block(system))
}

fn evaluate(plant: &LiftedPlant, filters: SynthesisFilters) -> Result<Realised, DesignError> {
    let peak = plant.bank_norm(&filters)?;
    Ok(Realised::of(filters, peak))
}
