//! A bank made ready to run: coefficients in the order of use, shared by any number of streams.

use crate::adapters::Corrections;
use crate::algorithms::choice::{ChosenAlgorithm, check_recursive};
use crate::algorithms::{AlgorithmFacts, Direct, OverlapSave, Recursive};
use crate::engine::{Engine, Fir, StatefulFilter};
use crate::state::Digest;
use crate::{Algorithm, BuildError, Isa, Nonlinearity, Precision, Sample, Shape, StateMatrices};
use std::sync::Arc;

/// How a bank is made ready to run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Number type of the FIR kernels. Recursions feed their rounding errors back and always run in f64.
    pub precision: Precision,
    /// How FIR filters are computed, [`Algorithm::Direct`] unless asked for otherwise, because the others
    /// round otherwise or add latency.
    pub algorithm: Algorithm,
    /// Instruction set, the widest one unless asked for otherwise.
    pub isa: Isa,
}

impl Default for Options {
    fn default() -> Self {
        Self { precision: Precision::default(), algorithm: Algorithm::default(), isa: Isa::detect() }
    }
}

/// How a bank runs, for reports.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct PlanSummary {
    /// `direct` or `overlap-save` (FIR), `parallel-form` (delay lines and second-order sections
    /// side by side) or `dense` (delay lines and any other states).
    pub algorithm: &'static str,
    /// Number type of the sums: `f32` or `f64`.
    pub numbers: &'static str,
    /// Instruction set of the kernels.
    pub isa: String,
    /// F, frames of a transform, if the algorithm has one.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub transform: Option<usize>,
    /// B, frames of a block, of which a transform makes the outputs.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub block: Option<usize>,
    /// Output samples by which the algorithm is later than the bank's own latency.
    pub extra_latency: usize,
    /// Multiply-adds for each output sample; additions of transforms count as such. `None`
    /// for recursions.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub multiply_adds: Option<f64>,
}

/// A bank made ready to run. It never changes; a clone shares the coefficients, and any number of
/// [streams](crate::Stream) on any threads may use it at the same time.
#[derive(Debug, Clone)]
pub struct Plan {
    /// With a state at its beginning.
    start: Arc<Engine>,
    facts: AlgorithmFacts,
    channels: usize,
    ratio: usize,
    latency: usize,
    /// Offsets and nonlinearities of the converters, if any is not zero.
    corrections: Option<Arc<Corrections>>,
    isa: Isa,
    /// Of all that the bits of outputs depend on.
    digest: Digest,
}

impl Plan {
    /// FIR filters: y[kM + p] = sum_i sum_j f_i[p + jM] x_i[k - j], where `taps[i][n]` = f_i\[n\] at the
    /// fast rate, i = 1..N, of any lengths, and M = `ratio`. `latency` = m0: the output samples by which the
    /// filters were designed to be late.
    ///
    /// # Errors
    /// [`BuildError`] if N or M is 0, a tap is not finite, or the filters are too long, for the chosen
    /// algorithm or at all.
    pub fn from_taps(
        taps: &[Vec<f64>],
        ratio: usize,
        latency: usize,
        options: Options,
    ) -> Result<Self, BuildError> {
        check_counts(taps.len(), ratio)?;
        let isa = options.isa;
        let choice = options.algorithm.choose(taps, ratio, options.precision)?;
        let start = match options.precision {
            Precision::Single => Engine::F32(choice.filter(taps, ratio, isa)?),
            Precision::Double => Engine::F64(choice.filter(taps, ratio, isa)?),
        };
        let mut plan = Self::new(start, Shape { channels: taps.len(), ratio }, latency, isa);
        plan.digest.add_lists(taps);
        Ok(plan)
    }

    /// Recursive filters of a shape; `latency` as in [`Plan::from_taps`].
    ///
    /// # Errors
    /// [`BuildError`] if N or M is 0, the matrices do not fit together, an entry is not finite, or an
    /// algorithm for FIR filters is asked for.
    pub fn from_state_space(
        filter: &StateMatrices,
        shape: Shape,
        latency: usize,
        options: Options,
    ) -> Result<Self, BuildError> {
        let Shape { channels, ratio } = shape;
        check_counts(channels, ratio)?;
        check_recursive(options.algorithm)?;
        let isa = options.isa;
        let start = Engine::Recursive(StatefulFilter::new(Recursive::new(filter, channels, ratio, isa)?));
        let mut plan = Self::new(start, shape, latency, isa);
        let StateMatrices { a, b, c, d } = filter;
        [a, b, c, d].into_iter().for_each(|rows| plan.digest.add_lists(rows));
        Ok(plan)
    }

    /// The same plan for converters whose samples contain offsets and have a static nonlinearity: of a
    /// sample x of channel i `nonlinearity[i].at(x) + offsets[i]` is subtracted, in the number type of the
    /// kernels, before anything else happens to it. An empty list of nonlinearities stands for none.
    ///
    /// Samples before the first frame, samples that are not finite, and the frames of
    /// [`Stream::flush`](crate::Stream::flush) are 0 after the subtraction. If all offsets are 0, nothing is
    /// subtracted and nothing is slower.
    ///
    /// # Errors
    /// [`BuildError::OffsetCount`] unless there is one for each channel; [`BuildError::NotFinite`].
    pub fn with_corrections(
        self,
        offsets: &[f64],
        nonlinearity: &[Nonlinearity],
    ) -> Result<Self, BuildError> {
        let mut digest = self.digest;
        digest.add_list(offsets);
        if !nonlinearity.is_empty() {
            digest.add_lists(&nonlinearity.iter().map(|one| one.values().to_vec()).collect::<Vec<_>>());
        }
        let corrections = Corrections::new(offsets, nonlinearity, self.channels)?.map(Arc::new);
        Ok(Self { corrections, digest, ..self })
    }

    fn new(start: Engine, Shape { channels, ratio }: Shape, latency: usize, isa: Isa) -> Self {
        let facts = start.facts();
        let mut digest = Digest::new(facts.name, start.numbers());
        let (transform, _) = facts.transform.unwrap_or_default();
        [channels, ratio, latency, transform].into_iter().for_each(|size| digest.add(size as u64));
        Self {
            start: Arc::new(start),
            facts,
            channels,
            ratio,
            latency: latency.saturating_add(facts.delay * ratio),
            corrections: None,
            isa,
            digest,
        }
    }

    /// What is subtracted from samples; `None` for nothing.
    pub(crate) fn corrections(&self) -> Option<&Corrections> {
        self.corrections.as_deref()
    }

    /// What tells this plan from those whose outputs have other bits.
    pub(crate) fn digest(&self) -> [u64; 2] {
        self.digest.words()
    }

    /// With a state at its beginning.
    pub(crate) fn start(&self) -> Engine {
        Engine::clone(&self.start)
    }

    /// N, samples per frame of the input.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// M, output samples per frame.
    pub fn ratio(&self) -> usize {
        self.ratio
    }

    /// m0 and what the algorithm adds to it, in output samples: output sample n belongs to the time of fast
    /// sample n - latency.
    pub fn latency(&self) -> usize {
        self.latency
    }

    /// The part of the latency that is due to the algorithm, in output samples: y\[n\] of the equation comes
    /// as sample n + extra.
    pub fn extra_latency(&self) -> usize {
        self.facts.delay * self.ratio
    }

    /// K - 1, frames after which an input is forgotten. `None` for a recursion, which never forgets.
    pub fn history(&self) -> Option<usize> {
        self.facts.history
    }

    /// Frames by which a stream is processed: two streams of the same input, one begun a multiple of so many
    /// frames after the other and with its [history](Plan::history) before that, have the same bits. 1 for
    /// the direct algorithm, the 2 S B frames of a batch for overlap-save. For recursions 64: denormals are
    /// flushed so often, and the bits are the same only if the state is. How a stream is cut into calls
    /// never matters.
    pub fn alignment(&self) -> usize {
        self.facts.alignment
    }

    /// Frames of zeros that bring out the last samples, as many as the latency: ceil(latency / M).
    pub fn flush_frames(&self) -> usize {
        self.latency.div_ceil(self.ratio)
    }

    /// The name of the algorithm, see [`PlanSummary::algorithm`].
    pub fn algorithm(&self) -> &'static str {
        self.facts.name
    }

    /// How the bank runs.
    pub fn summary(&self) -> PlanSummary {
        let AlgorithmFacts { name, transform, multiply_adds, .. } = self.facts;
        PlanSummary {
            algorithm: name,
            numbers: self.start.numbers(),
            isa: self.isa.to_string(),
            transform: transform.map(|(len, _)| len),
            block: transform.map(|(_, block)| block),
            extra_latency: self.extra_latency(),
            multiply_adds,
        }
    }
}

impl ChosenAlgorithm {
    fn filter<T: Sample>(self, taps: &[Vec<f64>], ratio: usize, isa: Isa) -> Result<Fir<T>, BuildError> {
        Ok(match self {
            Self::Direct => Fir::Direct(StatefulFilter::new(Direct::new(taps, ratio, isa)?)),
            Self::OverlapSave(shape) => {
                Fir::OverlapSave(StatefulFilter::new(OverlapSave::new(taps, shape, isa)?))
            }
        })
    }
}

fn check_counts(channels: usize, ratio: usize) -> Result<(), BuildError> {
    match (channels, ratio) {
        (_, 0) => Err(BuildError::NoRatio),
        (0, _) => Err(BuildError::NoChannels),
        _ => Ok(()),
    }
}
