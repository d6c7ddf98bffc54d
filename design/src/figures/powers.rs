//! Mean squares of the errors of reconstructions: from the signal, from the noise of the converters, and
//! from delays, gains and offsets that are not known exactly.

use super::reconstruction::Reconstruction;
use crate::design::{AliasColumns, Deviations, Integrand, QuadratureNode, SampledSignal};
use hybank_linalg::{CMat, Complex};
use std::ops::Range;

/// Multiply-adds that an integral may take, about: a second or two.
const MOST_WORK: f64 = 1e9;
/// Angles of a rule for each slow period that its integrand reaches over.
const ANGLES_PER_PERIOD: f64 = 4.0;
/// Slow periods over which usual ways and front ends reach beside delays and filters.
const MEMORY: usize = 16;

/// What a mean square error is computed for.
pub(super) struct Conditions {
    /// The signal.
    pub(super) signal: SampledSignal,
    /// s_i^2 of each channel by its sources, in the scale of the signal.
    pub(super) noise: Vec<NoisePowers>,
    /// How far each converter is from the spec; offsets are in the scale of the signal.
    pub(super) spread: Vec<Deviations>,
}

/// Powers of noise by its sources.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct NoisePowers {
    /// The rounding to bits.
    pub(super) bits: f64,
    /// The converter's noise.
    pub(super) noise: f64,
    /// Jitter.
    pub(super) jitter: f64,
}

impl NoisePowers {
    pub(super) fn total(&self) -> f64 {
        self.bits + self.noise + self.jitter
    }
}

/// Mean squares per fast sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Powers {
    /// Of the error from the signal.
    pub(super) signal: f64,
    /// The same, as a mean over the uncertain delays.
    pub(super) late: f64,
    /// What the uncertain gains add to it.
    pub(super) gains: f64,
    /// Of the uncertain offsets at the output.
    pub(super) offsets: f64,
    /// Of the noise at the output.
    pub(super) noise: NoisePowers,
}

/// The mean square of the target.
pub(super) fn target_power(signal: &SampledSignal) -> f64 {
    let at = |QuadratureNode { theta, share }| share * signal.at(theta).reference.norm_squared();
    nodes(signal, &[]).into_iter().map(at).sum::<f64>() / signal.problem().ratio as f64
}

impl Conditions {
    /// The mean squares of the errors of all `ways`, at the same angles.
    pub(super) fn powers(&self, ways: &[Reconstruction]) -> Vec<Powers> {
        let mut means = vec![[0.0; 6]; ways.len()];
        for QuadratureNode { theta, share } in nodes(&self.signal, ways) {
            let columns = self.signal.at(theta);
            let late = self.late(&columns);
            for (mean, way) in means.iter_mut().zip(ways) {
                let here = self.at(way, theta, &columns, late.as_ref());
                mean.iter_mut().zip(here).for_each(|(sum, square)| *sum += share * square);
            }
        }
        let per_sample = 1.0 / self.signal.problem().ratio as f64;
        let powers = |(way, p): (&Reconstruction, [f64; 6])| Powers {
            signal: p[0] * per_sample,
            late: p[1] * per_sample,
            gains: p[2] * per_sample,
            offsets: self.offsets(way) * per_sample,
            noise: NoisePowers {
                bits: p[3] * per_sample,
                noise: p[4] * per_sample,
                jitter: p[5] * per_sample,
            },
        };
        ways.iter().zip(means).map(powers).collect()
    }

    /// F of a way at an angle with these columns.
    pub(super) fn filters(&self, way: &Reconstruction, theta: f64, columns: &AliasColumns) -> CMat {
        let noise: Vec<f64> = self.noise.iter().map(NoisePowers::total).collect();
        way.at(theta, columns, &noise)
    }

    /// The power of uncertain offsets over the M phases: what the filters make of constants.
    fn offsets(&self, way: &Reconstruction) -> f64 {
        if self.spread.iter().all(|spread| spread.offset == 0.0) {
            return 0.0;
        }
        let filters = self.filters(way, 0.0, &self.signal.at(0.0));
        let constant = CMat::from_element(filters.ncols(), 1, Complex::ONE);
        self.of_converters(|spread, samples| spread.offset.powi(2) * power(&filters, &constant, samples))
    }

    /// The sum over the converters, whose errors are independent.
    fn of_converters(&self, of: impl Fn(&Deviations, Range<usize>) -> f64) -> f64 {
        let converters = self.signal.problem().converters().into_iter();
        self.spread.iter().zip(converters).map(|(spread, samples)| of(spread, samples)).sum()
    }

    /// The mean squares of [`Powers`] at an angle without the offsets, summed over the M phases.
    fn at(
        &self,
        way: &Reconstruction,
        theta: f64,
        columns: &AliasColumns,
        late: Option<&AliasColumns>,
    ) -> [f64; 6] {
        let filters = self.filters(way, theta, columns);
        let signal = error(columns, &filters);
        let late = late.filter(|_| way.is_relative()).map_or(signal, |late| error(late, &filters));
        let gains = self.of_converters(|spread, samples| match spread.gain {
            gain if gain > 0.0 && way.is_relative() => {
                gain * gain * power(&filters, &columns.measurement, samples)
            }
            _ => 0.0,
        });
        let noise = |power: fn(&NoisePowers) -> f64| {
            let of = filters.column_iter().zip(&self.noise);
            of.map(|(column, noise)| column.norm_squared() * power(noise)).sum()
        };
        [signal, late, gains, noise(|of| of.bits), noise(|of| of.noise), noise(|of| of.jitter)]
    }

    /// The columns with delays that are off; `None` where all are exact.
    fn late(&self, columns: &AliasColumns) -> Option<AliasColumns> {
        let delays: Vec<Deviations> = self
            .spread
            .iter()
            .map(|spread| Deviations { delay: spread.delay, ..Deviations::default() })
            .collect();
        let are_exact = delays.iter().all(|spread| spread.delay.0 == 0.0);
        (!are_exact).then(|| columns.clone().with_errors(self.signal.problem(), &delays))
    }
}

/// The power at the output of what the samples of a converter have in common.
fn power(filters: &CMat, of: &CMat, samples: Range<usize>) -> f64 {
    let (first, count) = (samples.start, samples.len());
    match count {
        1 => filters.column(first).norm_squared() * of.row(first).norm_squared(),
        _ => (filters.columns(first, count) * of.rows(first, count)).norm_squared(),
    }
}

/// The squared Frobenius norm of W - F H, from amplitudes: nothing of size 1 is subtracted from a square.
fn error(columns: &AliasColumns, filters: &CMat) -> f64 {
    let mut error = columns.reference.clone();
    error.gemm(-Complex::ONE, filters, &columns.measurement, Complex::ONE);
    error.norm_squared()
}

/// The angles of the integrals of all `ways`.
fn nodes(signal: &SampledSignal, ways: &[Reconstruction]) -> Vec<QuadratureNode> {
    let problem = signal.problem();
    let size = problem.ratio * (1 + problem.channels.len());
    let work: usize = signal.columns() * size
        + ways.iter().map(|way| size * (way.lags() + signal.columns())).sum::<usize>();
    let reach = (problem.latency as f64 + problem.longest_delay().0) / problem.ratio as f64;
    let memory = ways.iter().map(|way| way.lags() + way.poles().len()).max().unwrap_or(0) + MEMORY;
    let most = MOST_WORK / (ANGLES_PER_PERIOD * work as f64);
    // In the plane of theta.
    let own = ways.iter().flat_map(Reconstruction::poles).map(|pole| pole.ln());
    let poles: Vec<Complex<f64>> = signal.poles().into_iter().chain(own).collect();
    let periods = (reach + memory as f64).min(most).max(MEMORY as f64);
    Integrand { breaks: signal.breaks(), periods, poles: &poles }.nodes()
}
