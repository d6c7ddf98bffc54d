//! The bank: synthesis filters with the data needed to run and verify them, and its file format.
//!
//! [`Bank::from_json`] reads the file format `hybank-bank`, version 1, and [`Bank::to_json`] writes it.
//! Every number reads back to the same bits. Unknown keys are refused by name, except `meta`, which is not
//! read: other programs may store anything there.
//!
//! A file may carry a [`Proof`] of its gamma and a digest of its content. Reading ignores the digest, so
//! that an edited bank can be run; [`check_digest`] compares the digest with the content.

mod check;
mod digest;
mod file;
mod layout;
mod proof;
mod taps;

pub use check::MAX_BANK_LATENCY;
pub use digest::check_digest;
pub use proof::{BoxProof, Certificate, GainWitness, NormBound, Proof};
pub use taps::FixedPoint;

pub use crate::runtime::StateMatrices;
pub use crate::spec::{FrameLayout, FrameSample};

use crate::runtime::{BuildError, Nonlinearity, Options, Plan, Shape};
use crate::spec::{ErrorPoint, Method, Spec};
use crate::units::{FastPeriods, GridTime, Seconds};

/// `format` of a bank file.
pub const FORMAT: &str = "hybank-bank";

/// `version` of the bank files written and read.
pub const VERSION: usize = 1;

/// N synthesis filters with the data to run them. `design` writes a bank, and the other commands read it.
#[derive(Debug, Clone, PartialEq)]
pub struct Bank {
    /// The spec it was designed for, with all defaults filled in. What it leaves to the designer is open
    /// here: what was chosen is [`latency`](Self::latency), [`filters`](Self::filters) and
    /// [`fixed_point`](Self::fixed_point). `None` for a bank made elsewhere.
    pub spec: Option<Spec>,
    /// The fast period h.
    pub fast_period: Seconds,
    /// M, the number of fast samples per frame.
    pub ratio: usize,
    /// The latency m0 in fast samples, with the [wait](Bank::wait) for the rest of a frame.
    pub latency: usize,
    /// The design method.
    pub method: Method,
    /// L_i, the samples of each converter per frame: one, unless the converters have unequal rates.
    pub samples: Vec<usize>,
    /// The delay D_i of each converter.
    pub delays: Vec<Seconds>,
    /// The gain g_i of each converter relative to nominal. The filters are designed for it.
    pub gains: Vec<f64>,
    /// The offset o_i of each converter, relative to full scale. It is subtracted from the samples before
    /// the filters.
    pub offsets: Vec<f64>,
    /// The static nonlinearity of each converter, which is subtracted from its samples before the filters.
    pub nonlinearity: Vec<Nonlinearity>,
    /// The synthesis filters, one for each sample of a frame.
    pub filters: SynthesisFilters,
    /// The integers of the taps, if the taps are fixed-point numbers.
    pub fixed_point: Option<FixedPoint>,
    /// The worst-case error gamma and its bounds.
    pub gamma: Gamma,
    /// The proof of `gamma.upper`, if the file carries one.
    pub proof: Option<Proof>,
}

/// The synthesis filters: FIR taps or a state-space block.
#[derive(Debug, Clone, PartialEq)]
pub enum SynthesisFilters {
    /// `taps[i][n]` = `f_i[n]` at the fast rate, i in the order of [`FrameLayout::iter`].
    Fir(Vec<Vec<f64>>),
    /// One block per slow period.
    StateSpace(StateMatrices),
}

/// gamma = ||K|| in normalised time (h = 1), and its bounds; `None` if unknown.
///
/// `lower <= upper` and `noncausal <= upper` hold wherever both are known.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gamma {
    /// Norm computed from the coefficients of this bank. Its relative error is at most
    /// [`NORM_ACCURACY`](Self::NORM_ACCURACY), or more where the error is a small difference of the target
    /// and what the filters make of the samples: `upper` states it.
    pub norm: Option<f64>,
    /// An upper bound of the true norm of these coefficients: proven if the bank carries a proof, else the
    /// computed norm plus its stated error.
    pub upper: Option<f64>,
    /// Computed lower bound for all banks of this method and size; it is not proven.
    pub lower: Option<f64>,
    /// Computed lower bound for all banks, of any latency; it is not proven.
    pub noncausal: Option<f64>,
    /// No errors within the spec's `[uncertainty]` make the norm larger. Proven by `verify`; without such a
    /// table `None`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub worst_case: Option<f64>,
}

impl Gamma {
    /// Relative error of a computed norm that is no small difference.
    pub const NORM_ACCURACY: f64 = 1e-9;

    /// The bounds of a bank with the computed `norm`, whose absolute error is at most `error`. No lower
    /// bound exceeds the upper bound.
    pub fn computed(norm: f64, error: f64, lower: f64, noncausal: f64) -> Self {
        Self {
            norm: Some(norm),
            upper: Some(norm + error),
            lower: Some(lower.min(norm)),
            noncausal: Some(noncausal.min(norm)),
            worst_case: None,
        }
    }

    /// The same with lower bounds that do not exceed the norm.
    #[must_use]
    pub fn with_bounds_below_the_norm(self) -> Self {
        let below = |bound: Option<f64>| bound.map(|x| self.norm.map_or(x, |norm| x.min(norm)));
        Self { lower: below(self.lower), noncausal: below(self.noncausal), ..self }
    }
}

impl Bank {
    /// A bank of filters that were designed elsewhere: h = 1, no latency, no delays, gains of one, no
    /// offsets, unknown front ends and gammas.
    pub fn bare(filters: SynthesisFilters, ratio: usize) -> Self {
        let (method, channels) = match &filters {
            SynthesisFilters::Fir(taps) => (Method::Fir, taps.len()),
            SynthesisFilters::StateSpace(block) => (Method::Iir, block.d.first().map_or(0, Vec::len)),
        };
        Self {
            spec: None,
            fast_period: Seconds(1.0),
            ratio,
            latency: 0,
            method,
            samples: vec![1; channels],
            delays: vec![Seconds(0.0); channels],
            gains: vec![1.0; channels],
            offsets: vec![0.0; channels],
            nonlinearity: vec![Nonlinearity::default(); channels],
            filters,
            fixed_point: None,
            gamma: Gamma::default(),
            proof: None,
        }
    }

    /// The spec with the sizes of this bank where it leaves them to the designer: the latency, the number of
    /// taps and their bits.
    pub fn sized_spec(&self) -> Option<Spec> {
        let mut spec = self.spec.clone()?;
        spec.latency = Some(self.latency);
        if let SynthesisFilters::Fir(taps) = &self.filters {
            spec.design = spec.design.with_taps(taps.first().map(Vec::len));
        }
        if let Some(words) = self.fixed_point.as_ref().filter(|_| spec.design.loss_db.is_some()) {
            (spec.design.bits, spec.design.loss_db) = (Some(words.bits.clone()), None);
        }
        Some(spec)
    }

    /// The same filters after converters with these errors; their gammas are unknown.
    #[must_use]
    pub fn with_errors(&self, point: &ErrorPoint) -> Self {
        let delay = |(delay, error): (&Seconds, &FastPeriods)| *delay + error.in_seconds(self.fast_period);
        let gain = |(gain, error): (&f64, &f64)| gain * (1.0 + error);
        Self {
            spec: self.spec.as_ref().map(|spec| spec.with_errors(point)),
            delays: self.delays.iter().zip(&point.delays).map(delay).collect(),
            gains: self.gains.iter().zip(&point.gains).map(gain).collect(),
            gamma: Gamma::default(),
            proof: None,
            ..self.clone()
        }
    }

    /// The number of converters.
    pub fn channel_count(&self) -> usize {
        self.delays.len()
    }

    /// The frames of the converters' samples.
    pub fn layout(&self) -> FrameLayout {
        FrameLayout::new(self.ratio, self.samples.clone())
    }

    /// N, the number of samples of a frame, each with a filter of its own.
    pub fn frame_samples(&self) -> usize {
        self.samples.iter().sum()
    }

    /// S, the part of the latency for which a frame waits for its last sample; 0 for converters of one rate
    /// without negative delays.
    pub fn wait(&self) -> usize {
        self.layout().wait(&self.grid_delays())
    }

    /// The fast samples by which the output lies behind the time axis of the converters.
    pub fn output_delay(&self) -> usize {
        self.latency.saturating_sub(self.wait())
    }

    /// The delay of each sample of a frame as the designer counts it, [`FrameLayout::waited_delays`].
    pub fn sample_delays(&self) -> Vec<FastPeriods> {
        self.layout().waited_delays(&self.grid_delays()).into_iter().map(GridTime::in_fast_periods).collect()
    }

    fn grid_delays(&self) -> Vec<GridTime> {
        self.delays.iter().map(|&delay| GridTime::new(delay, self.fast_period)).collect()
    }

    /// The slow period M h, in which a frame is taken.
    pub fn slow_period(&self) -> Seconds {
        self.fast_period * self.ratio as f64
    }

    /// True in normalised time: times are in fast periods, and the rates of recordings are free.
    pub fn is_normalised(&self) -> bool {
        self.fast_period == Seconds(1.0)
    }

    /// D_i / h of every channel.
    pub fn delays_in_fast_periods(&self) -> Vec<FastPeriods> {
        self.grid_delays().into_iter().map(GridTime::in_fast_periods).collect()
    }

    /// Compiles the bank into a plan, which any number of streams of the runtime may share. Its streams
    /// subtract the nonlinearities and offsets of the converters.
    ///
    /// # Errors
    /// [`BuildError`] if the bank's parts do not fit together, hold values that are not finite, or cannot
    /// run with `options`.
    pub fn plan(&self, options: Options) -> Result<Plan, BuildError> {
        let channels = self.frame_samples();
        let plan = match &self.filters {
            SynthesisFilters::Fir(taps) if taps.len() != channels => {
                Err(BuildError::FilterCount { delays: channels, filters: taps.len() })
            }
            SynthesisFilters::Fir(taps) => Plan::from_taps(taps, self.ratio, self.output_delay(), options),
            SynthesisFilters::StateSpace(filter) => Plan::from_state_space(
                filter,
                Shape { channels, ratio: self.ratio },
                self.output_delay(),
                options,
            ),
        };
        let layout = self.layout();
        plan?.with_corrections(&layout.each(&self.offsets), &self.corrected_curves())
    }

    /// The nonlinearity of each sample of a frame; nothing if no converter has one.
    fn corrected_curves(&self) -> Vec<Nonlinearity> {
        match self.is_straight() {
            true => Vec::new(),
            false => self.layout().each(&self.nonlinearity),
        }
    }

    /// A sample of a converter without its nonlinearity and its offset, as plans correct it.
    pub fn corrected(&self, converter: usize, x: f64) -> f64 {
        x - self.nonlinearity[converter].at(x) - self.offsets[converter]
    }

    /// Whether no converter has a nonlinearity that is corrected.
    pub fn is_straight(&self) -> bool {
        self.nonlinearity.iter().all(Nonlinearity::is_straight)
    }
}

#[cfg(test)]
mod tests;
