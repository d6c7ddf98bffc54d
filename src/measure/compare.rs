//! A record against a reference: lag, gain, offset and error.

use super::alignment::Alignment;
use super::lag::likely_lags;
use super::{MeasureError, Spectrum, Window};
use crate::linalg::Mat;
use crate::sine_fit::Estimate;
use crate::units::{Decibels, Hertz, Seconds};

/// Samples with which a lag is tried.
const PROBED: usize = 1 << 15;
/// Mean squares of errors within this factor are the same.
const EQUAL_ERRORS: f64 = 1.05;
/// An error below this share of the signal is none.
const NO_ERROR: f64 = 1e-10;
/// Bands of the error spectrum.
const BANDS: usize = 16;

/// A record y against a reference r: `y[n] = gain r(n - lag) + offset + error`, with the least mean square
/// of the error. r is interpolated between its samples by a windowed sinc of 257 samples, which is exact for
/// a lag of whole samples and else good to -118 dB up to 0.485 fs; 128 samples at each end are not compared.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Comparison {
    /// Samples by which the record comes later.
    pub lag_samples: Estimate<f64>,
    /// The same in seconds.
    #[serde(rename = "lag_seconds")]
    pub lag: Seconds,
    /// Gain of the record over the reference; below 0 if it is inverted.
    pub gain: Estimate<f64>,
    /// Constant that is added to the record.
    pub offset: Estimate<f64>,
    /// Mean square of the scaled reference without its mean over that of the error.
    #[serde(rename = "snr_db")]
    pub snr: Decibels,
    /// Mean square of the reference over that of record minus reference, sample by sample, with no lag, gain
    /// or offset taken out.
    #[serde(rename = "snr_unaligned_db")]
    pub snr_unaligned: Decibels,
    /// Root mean square of the error.
    pub error_rms: f64,
    /// Largest error.
    pub largest_error: f64,
    /// Sample of the record at which it is.
    pub largest_error_at: usize,
    /// Samples that were compared.
    pub compared: usize,
    /// The error in equal bands from 0 to half the rate.
    pub error_bands: Vec<Band>,
    /// The spectrum of the error.
    #[serde(skip)]
    pub error_spectrum: Spectrum,
}

/// The error in a band.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Band {
    /// Beginning of the band.
    #[serde(rename = "from_hertz")]
    pub from: Hertz,
    /// End of the band.
    #[serde(rename = "to_hertz")]
    pub to: Hertz,
    /// Root mean square of the error in it.
    pub rms: f64,
}

/// Compares a record with a reference of the same rate.
///
/// # Errors
/// [`MeasureError`]: constant recordings, too little overlap, or a lag that does not settle.
pub fn compare(
    samples: &[f64],
    reference: &[f64],
    rate: Hertz,
    window: Window,
) -> Result<Comparison, MeasureError> {
    for (which, x) in [("record", samples), ("reference", reference)] {
        let mut finite = x.iter().filter(|x| x.is_finite());
        let first = finite.next();
        if finite.all(|x| Some(x) == first) {
            return Err(MeasureError::Constant { which });
        }
    }
    let whole = likeliest(samples, reference, &likely_lags(samples, reference))?;
    let mut alignment = Alignment::new(samples, reference, whole, usize::MAX);
    let settled = alignment.settle()?;
    Ok(compared(&alignment, rate, window, &settled.covariance))
}

/// Of likely lags the one with the smallest error; of several with the same error the one nearest to 0,
/// since the recordings of a tone agree at every period.
fn likeliest(samples: &[f64], reference: &[f64], lags: &[i64]) -> Result<i64, MeasureError> {
    let mut first_failure = None;
    let mut settled: Vec<(i64, f64)> = Vec::new();
    for &lag in lags {
        let mut alignment = Alignment::new(samples, reference, lag, PROBED);
        match alignment.settle() {
            Ok(found) => settled.push((alignment.whole, found.error / found.signal)),
            Err(failure) => first_failure = first_failure.or(Some(failure)),
        }
    }
    let least = settled.iter().fold(f64::INFINITY, |least, (_, error)| error.min(least));
    let equal = settled.iter().filter(|(_, error)| *error <= EQUAL_ERRORS * least + NO_ERROR);
    let nearest = equal.min_by_key(|(lag, _)| lag.abs()).map(|(lag, _)| *lag);
    nearest.ok_or(first_failure.unwrap_or(MeasureError::NoLag { lag: 0 }))
}

/// The figures at the lag that was found.
fn compared(alignment: &Alignment<'_>, rate: Hertz, window: Window, covariance: &Mat) -> Comparison {
    let points: Vec<(usize, f64, f64)> = alignment.points().map(|p| (p.n, p.value, p.error)).collect();
    let count = points.len() as f64;
    let mean = points.iter().map(|p| p.1).sum::<f64>() / count;
    let signal = points.iter().map(|p| (alignment.gain * (p.1 - mean)).powi(2)).sum::<f64>();
    let errors: Vec<f64> = points.iter().map(|p| p.2).collect();
    let squares = errors.iter().map(|e| e * e).sum::<f64>();
    let largest = points.iter().max_by(|a, b| a.2.abs().total_cmp(&b.2.abs()));
    let sigma = |i: usize| covariance[(i, i)].max(0.0).sqrt();
    let lag = alignment.whole as f64 + alignment.phase;
    let error_spectrum = Spectrum::new(&errors, rate, window);
    Comparison {
        lag_samples: Estimate { value: lag, sigma: sigma(2) },
        lag: Seconds(lag / rate.0),
        gain: Estimate { value: alignment.gain, sigma: sigma(0) },
        offset: Estimate { value: alignment.offset, sigma: sigma(1) },
        snr: Decibels::of_power(signal / squares),
        snr_unaligned: unaligned(alignment.samples, alignment.reference),
        error_rms: (squares / count).sqrt(),
        largest_error: largest.map_or(0.0, |p| p.2.abs()),
        largest_error_at: largest.map_or(0, |p| p.0),
        compared: points.len(),
        error_bands: bands(&error_spectrum, rate),
        error_spectrum,
    }
}

/// Energy of the reference over that of the difference.
fn unaligned(samples: &[f64], reference: &[f64]) -> Decibels {
    let pairs = samples.iter().zip(reference).filter(|(x, r)| x.is_finite() && r.is_finite());
    let (signal, error) = pairs.fold((0.0, 0.0), |(s, e), (x, r)| (s + r * r, e + (x - r) * (x - r)));
    Decibels::of_power(signal / error)
}

fn bands(spectrum: &Spectrum, rate: Hertz) -> Vec<Band> {
    let bins = spectrum.amplitudes.len();
    let edge = |band: usize| rate * (0.5 * band as f64 / BANDS as f64);
    let band = |i: usize| Band {
        from: edge(i),
        to: edge(i + 1),
        rms: spectrum.mean_square(i * bins / BANDS, (i + 1) * bins / BANDS).sqrt(),
    };
    (0..BANDS).map(band).collect()
}
