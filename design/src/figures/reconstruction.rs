//! Ways from slow samples to fast ones as the matrix F(theta) of their polyphase components: the filters of
//! a bank, and the usual ways.

use super::correction::Correction;
use super::spline::Spline;
use crate::design::filters::FilterResponse;
use crate::design::{AliasColumns, NearestSample, Problem, nearest_samples};
use hybank_linalg::{CMat, Complex};
use std::ops::Range;

/// A way from the N slow samples of a period to its M fast samples, linear and periodic.
pub(super) enum Reconstruction {
    /// The filters of a bank.
    Bank(FilterResponse),
    /// Each output sample is the slow sample nearest to its instant.
    Interleaving(Vec<NearestSample>),
    /// The same after each channel's own correction.
    Corrected(Correction),
    /// Taps of least mean-square error.
    LeastSquares(FilterResponse),
    /// The cubic spline through all slow samples.
    Spline(Spline),
    /// The Wiener filter of one converter: the least mean-square error with samples of all time.
    OneChannel {
        /// The converter, from 0.
        converter: usize,
        /// Its samples in a frame.
        samples: Range<usize>,
    },
}

impl Reconstruction {
    /// Plain interleaving with samples of all time; `None` unless each output sample has one slow sample of
    /// its own (N = M).
    pub(super) fn interleaving(problem: &Problem) -> Option<Self> {
        let Problem { ratio, latency, channels, .. } = problem;
        let nearest = || nearest_samples(&problem.delays(), *ratio, *latency, i64::MIN);
        (channels.len() == *ratio).then(|| Self::Interleaving(nearest()))
    }

    /// F at the angle theta, M x N, for a signal with `columns` there and the noise powers `noise`.
    pub(super) fn at(&self, theta: f64, columns: &AliasColumns, noise: &[f64]) -> CMat {
        match self {
            Self::Bank(filters) | Self::LeastSquares(filters) => filters.at(theta),
            Self::Corrected(correction) => correction.at(theta),
            Self::Interleaving(nearest) => interleaved(nearest, noise.len(), theta),
            Self::Spline(spline) => spline.at(theta),
            Self::OneChannel { samples, .. } => wiener(columns, noise, samples.clone()),
        }
    }

    /// The filters, where these are all there is.
    fn filters(&self) -> Option<&FilterResponse> {
        match self {
            Self::Bank(filters) | Self::LeastSquares(filters) => Some(filters),
            _ => None,
        }
    }

    /// Slow periods that FIR filters see; 1 of others.
    pub(super) fn lags(&self) -> usize {
        self.filters().map_or(1, FilterResponse::lags)
    }

    /// The poles of recursive filters.
    pub(super) fn poles(&self) -> &[Complex<f64>] {
        self.filters().map_or(&[], FilterResponse::poles)
    }

    /// Angles at which F may have narrow peaks.
    pub(super) fn resonances(&self) -> Vec<f64> {
        self.filters().map_or_else(Vec::new, FilterResponse::resonances)
    }

    /// Whether an error of a delay or a gain counts: they are relative to other channels.
    pub(super) fn is_relative(&self) -> bool {
        !matches!(self, Self::OneChannel { .. })
    }
}

fn interleaved(nearest: &[NearestSample], channels: usize, theta: f64) -> CMat {
    let mut filters = CMat::zeros(nearest.len(), channels);
    for (p, sample) in nearest.iter().enumerate() {
        filters[(p, sample.channel)] = Complex::from_polar(1.0, -theta * sample.lag as f64);
    }
    filters
}

/// W H* (H H* + S)^-1 in the columns of the samples of a converter, with their rows H and noise S.
fn wiener(columns: &AliasColumns, noise: &[f64], samples: Range<usize>) -> CMat {
    let rows = columns.measurement.rows(samples.start, samples.len());
    let mut filters = CMat::zeros(columns.reference.nrows(), noise.len());
    if samples.len() == 1 {
        let power = rows.norm_squared() + noise[samples.start];
        if power > 0.0 {
            let column = &columns.reference * rows.adjoint() / Complex::new(power, 0.0);
            filters.set_column(samples.start, &column.column(0));
        }
        return filters;
    }
    let mut powers = rows * rows.adjoint();
    samples.clone().enumerate().for_each(|(j, i)| powers[(j, j)] += Complex::from(noise[i]));
    let weights = hybank_linalg::solve(&powers, &(rows * columns.reference.adjoint())).adjoint();
    if weights.iter().all(|weight| weight.re.is_finite() && weight.im.is_finite()) {
        filters.columns_mut(samples.start, samples.len()).copy_from(&weights);
    }
    filters
}
