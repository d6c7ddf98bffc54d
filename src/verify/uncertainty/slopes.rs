//! Proven bounds of how fast the error can change with the delays.

use super::super::VerifyError;
use super::super::ball;
use super::super::spectrum;
use super::ErrorBox;
use super::aliases::{Aliases, FrontEnd, Weight};
use super::angle::{Frequency, cosine_below, outward};
use super::channel::{Memories, column_norm, signal_transfer, transfer};
use super::grid::{Grid, Halvings};
use super::memory::Lags;
use crate::bank::Bank;
use crate::units::Seconds;
use std::f64::consts::PI;

/// Cells per degree of the polynomials: the bounds are 0.3 % too large at most.
const CELLS_PER_DEGREE: f64 = 10.0;
/// Relative size of the tails.
const TAIL_SIZE: f64 = 1e-6;
/// Relative size of what is not known of recursive filters.
const FILTER_TAIL: f64 = 1e-12;
const MAX_DEGREE: usize = 4096;

/// How fast the error of a bank can change with the delays. The bounds hold for all delays.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Slopes {
    /// L_i per fast period: `|gamma(delta) - gamma(delta')| <= sum_i L_i |delta_i - delta'_i|`. `L_i = max
    /// over omega of |F_i| g_i`, `g_i^2 = (1/M) sum_k nu_k^2 |Phi_i(j nu_k)|^2`. Infinite for front ends of
    /// relative degree 1.
    pub lipschitz: Vec<f64>,
    /// max over omega of |F_i|, summed over the samples of a converter.
    pub columns: Vec<f64>,
    /// max over omega of g_i.
    pub steepness: Vec<f64>,
}

impl Slopes {
    /// A bound of `||K_jittered - K||` for sampling instants that are off by at most `jitter[i]`,
    /// differently at each sample: `sqrt(2) sum_i jitter_i ||F_i|| max g_i`.
    ///
    /// A sample is off by the integral of v' over at most jitter_i, so by Cauchy-Schwarz its square is at
    /// most jitter_i times the integral of v'^2 over both sides; and for every shift the samples of v' have
    /// at most g_i^2 times the energy of the input.
    pub fn jitter(&self, jitter: &[Seconds], fast_period: Seconds) -> f64 {
        let terms = jitter.iter().zip(&self.columns).zip(&self.steepness);
        let term = |((time, column), steep): ((&Seconds, &f64), &f64)| {
            let time = time.in_fast_periods(fast_period).0;
            if time == 0.0 { 0.0 } else { time * column * steep }
        };
        outward(std::f64::consts::SQRT_2 * (1.0 + 1e-15) * terms.map(term).sum::<f64>())
    }
}

/// The slopes of `bank`, for all gains and cut-offs in the box `errors`.
///
/// # Errors
/// As [`super::worst_case`].
pub fn slopes(bank: &Bank, errors: &ErrorBox) -> Result<Slopes, VerifyError> {
    errors.check(bank.channel_count())?;
    let certain = ErrorBox { delays: vec![Seconds(0.0); bank.channel_count()], ..errors.clone() };
    let grid = Grid::new(bank, &certain, &Halvings::none(bank.channel_count()))?;
    let memories = Memories::new(&grid, errors)?;
    let lags = Lags::new(&bank.filters, bank.ratio, FILTER_TAIL).ok_or(VerifyError::LongMemory)?;
    let mut found = Slopes { lipschitz: Vec::new(), columns: Vec::new(), steepness: Vec::new() };
    for (i, samples) in bank.layout().ranges().into_iter().enumerate() {
        let of = |sample| of_channel(bank, &memories, &lags, sample, errors.cutoffs[i]);
        let all = samples.map(of).collect::<Result<Vec<_>, _>>()?;
        // The samples of a converter move together, and have one front end.
        let sum = |part: usize| match all.as_slice() {
            [one] => one[part],
            all => outward(all.iter().map(|bounds| bounds[part]).sum()),
        };
        let gain = 1.0 + errors.gains[i];
        found.lipschitz.push(outward(gain * sum(0)));
        found.columns.push(sum(1));
        found.steepness.push(outward(gain * all.iter().map(|bounds| bounds[2]).fold(0.0, ball::nan_max)));
    }
    Ok(found)
}

/// L_i, max |F_i| and max g_i of channel `i`.
fn of_channel(
    bank: &Bank,
    memories: &Memories<'_>,
    lags: &Lags,
    i: usize,
    cutoff: f64,
) -> Result<[f64; 3], VerifyError> {
    let (transfer, signal) = (transfer(memories.grid(), i), signal_transfer(memories.grid()));
    let front_end = FrontEnd { transfer: &transfer, signal: signal.as_ref(), cutoff };
    let count = front_end.aliases(bank.ratio).ok_or(VerifyError::LongMemory)?;
    let memory = memories.of_slope(memories.grid().channels[i].rows[0][0]);
    let range = [1.0 - cutoff, 1.0 + cutoff];
    // The slope of a kernel that is x times faster is x^2 phi'(x t).
    let factor = (range[1] / range[0]).powf(1.5) * (1.0 + 1e-12);
    let whole = memory.whole();
    let periods = memory.periods(TAIL_SIZE * whole, MAX_DEGREE);
    let tail = outward(factor * memory.tail(periods));
    let (filter, last) = (lags.beyond(i, 0), lags.count() - 1);
    let filter_tail = lags.beyond(i, lags.count());
    let cut = [outward(filter * tail + filter_tail * factor * whole), filter_tail, tail];
    let degrees = [periods + last, last, periods];
    let values = |near: &Frequency| {
        let filters = spectrum::filter_response(&bank.filters, bank.ratio, near.z).into();
        let column = column_norm(&filters, i);
        let steep = Aliases::new(&front_end, near.angle, bank.ratio, count)?.norm(Weight::Slope);
        Some([column * steep, column, steep])
    };
    largest(degrees, cut, values).ok_or(VerifyError::LongMemory)
}

/// Bounds the maxima over all frequencies of three norms, whose polynomials have these degrees and tails.
fn largest(
    degrees: [usize; 3],
    tails: [f64; 3],
    values: impl Fn(&Frequency) -> Option<[f64; 3]>,
) -> Option<[f64; 3]> {
    let cells = ((CELLS_PER_DEGREE * degrees[0] as f64) as usize).max(16);
    let mut most = [0.0; 3];
    for k in 0..cells {
        let found = values(&Frequency::near(PI * (k as f64 + 0.5) / cells as f64))?;
        most.iter_mut().zip(found).for_each(|(most, value)| *most = ball::nan_max(*most, value));
    }
    let y = 0.5 * PI / cells as f64 + 1e-13;
    let bound = |j: usize| (most[j] + tails[j]) / cosine_below(0.5 * degrees[j] as f64 * y) + tails[j];
    Some([0, 1, 2].map(|j| outward(bound(j))))
}
