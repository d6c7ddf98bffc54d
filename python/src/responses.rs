//! The responses and the matrices of a bank.

use crate::arrays::matrix;
use crate::background;
use crate::errors::refused;
use hybank::bank::{Bank, StateMatrices, SynthesisFilters};
use hybank::design;
use hybank::design::responses::{fir_response, impulse_responses};
use hybank::units::Hertz;
use numpy::{Complex64, PyArray1, PyArray2};
use pyo3::prelude::*;
use std::sync::Arc;

/// Most states of a realisation as dense matrices: 128 MiB.
const MOST_DENSE_STATES: usize = 4096;

/// Most frequencies of a response, which take a minute.
const MOST_FREQUENCIES: usize = 10_000_000;

/// A one-dimensional array of doubles.
pub(crate) type Doubles<'py> = Bound<'py, PyArray1<f64>>;

/// A two-dimensional array.
pub(crate) type DoubleRows<'py, T = f64> = Bound<'py, PyArray2<T>>;

/// `a`, `b`, `c` and `d`.
pub(crate) type Matrices<'py> = (DoubleRows<'py>, DoubleRows<'py>, DoubleRows<'py>, DoubleRows<'py>);

/// The error at `n` frequencies: these in hertz, and its gains.
pub(crate) fn error_response<'py>(
    py: Python<'py>,
    bank: &Arc<Bank>,
    n: i64,
) -> PyResult<(Doubles<'py>, Doubles<'py>)> {
    let (count, bank) = (frequency_count(n)?, Arc::clone(bank));
    let points = background::run(py, None, move |_| design::error_response(&bank, count))?;
    let points = points.map_err(refused)?;
    let (hertz, gain): (Vec<f64>, Vec<f64>) = points.into_iter().map(|(hertz, gain)| (hertz.0, gain)).unzip();
    Ok((PyArray1::from_vec(py, hertz), PyArray1::from_vec(py, gain)))
}

/// The filters' responses at `n` frequencies, a row for each filter.
pub(crate) fn frequency_response<'py>(
    py: Python<'py>,
    bank: &Arc<Bank>,
    n: i64,
) -> PyResult<(Doubles<'py>, DoubleRows<'py, Complex64>)> {
    let (frequencies, bank) = (frequencies(bank, n)?, Arc::clone(bank));
    let of = frequencies.clone();
    let rows = background::run(py, None, move |_| {
        let angular = |f: &Hertz| f.angular().per_fast_period(bank.fast_period);
        let row = |taps: &Vec<f64>| of.iter().map(|f| fir_response(taps, angular(f)).0).collect();
        impulse_responses(&bank).iter().map(row).collect::<Vec<Vec<Complex64>>>()
    })?;
    let rows = PyArray2::from_vec2(py, &rows)?;
    Ok((PyArray1::from_iter(py, frequencies.iter().map(|f| f.0)), rows))
}

/// The gains of the target and of each channel at `n` frequencies, a row for each.
pub(crate) fn front_end_gains<'py>(
    py: Python<'py>,
    bank: &Bank,
    n: i64,
) -> PyResult<(Doubles<'py>, DoubleRows<'py>)> {
    let frequencies = frequencies(bank, n)?;
    let gains = design::responses::front_end_gains(bank, &frequencies).map_err(refused)?;
    let count = 1 + bank.channel_count();
    let rows: Vec<Vec<f64>> = (0..count).map(|i| gains.iter().map(|gains| gains[i]).collect()).collect();
    Ok((PyArray1::from_iter(py, frequencies.iter().map(|f| f.0)), PyArray2::from_vec2(py, &rows)?))
}

/// The bank as a state space, if it is not too large for dense matrices.
pub(crate) fn state_space<'py>(py: Python<'py>, bank: &Bank) -> PyResult<Matrices<'py>> {
    let lags = |f: &Vec<f64>| f.len().div_ceil(bank.ratio).saturating_sub(1);
    let states = match &bank.filters {
        SynthesisFilters::Fir(taps) => taps.iter().map(lags).max().unwrap_or(0).saturating_mul(taps.len()),
        _ => 0,
    };
    if states > MOST_DENSE_STATES {
        return Err(refused(format!(
            "ss would have {states} states, and dense matrices of at most {MOST_DENSE_STATES} are made; use taps"
        )));
    }
    let filters = design::filters::lifted(&bank.filters, bank.ratio);
    let StateMatrices { a, b, c, d } = design::filters::to_block(&filters);
    let (states, channels) = (a.len(), bank.frame_samples());
    Ok((matrix(py, a, states)?, matrix(py, b, channels)?, matrix(py, c, states)?, matrix(py, d, channels)?))
}

/// Equidistant frequencies from 0 to half the fast rate.
fn frequencies(bank: &Bank, n: i64) -> PyResult<Vec<Hertz>> {
    let count = frequency_count(n)?;
    let step = 0.5 / bank.fast_period.0 / count.saturating_sub(1).max(1) as f64;
    Ok((0..count).map(|k| Hertz(step * k as f64)).collect())
}

fn frequency_count(n: i64) -> PyResult<usize> {
    let count = usize::try_from(n).ok().filter(|&count| count <= MOST_FREQUENCIES);
    count.ok_or_else(|| refused(format!("n: {n} frequencies; give 0 to {MOST_FREQUENCIES}")))
}
