//! A record against a reference: lag, gain, offset and error.

use super::alignment::{Alignment, likely_lags};
use super::{MeasureError, RecordSpectrum, UnsettledEnds, Window};
use crate::linalg::Mat;
use crate::sine_fit::Estimate;
use crate::units::{Decibels, Hertz, Seconds};

/// Samples with which a lag is tried.
const PROBED: usize = 1 << 15;
/// Mean squares of errors within this factor are the same, if they are those of the same samples.
const EQUAL_ERRORS: f64 = 1.05;
/// Fewest samples by which two lags are compared.
const LEAST_SHARED: usize = 256;
/// An error below this share of the signal is none.
const NO_ERROR: f64 = 1e-10;
/// Bands of the error spectrum.
const BANDS: usize = 16;

/// A record y against a reference r: `y[n] = gain r(n - lag) + offset + error`, with the least mean square
/// of the error. r is interpolated between its samples by a windowed sinc of 257 samples, which is exact
/// for a lag of whole samples and else good to -118 dB up to 0.485 fs; 128 samples at each end are not
/// compared, nor are [`UnsettledEnds`]. Of several lags that explain the record, as with the periods of a
/// tone, it is the shortest.
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
    /// Samples at both ends whose error is far above that of the rest, such as those of a filter without
    /// input before the first sample: they are left out of all figures.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unsettled_ends: Option<UnsettledEnds>,
    /// The error in equal bands from 0 to half the rate.
    pub error_bands: Vec<ErrorBand>,
    /// The spectrum of the error.
    #[serde(skip)]
    pub error_spectrum: RecordSpectrum,
}

/// The error in a band.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct ErrorBand {
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
    let mut settled = alignment.settle()?;
    let ends = unsettled_ends(&alignment);
    if let Some(ends) = ends {
        let known = alignment.known();
        alignment.restrict(known.start + ends.samples..known.end.saturating_sub(ends.samples));
        settled = alignment.settle()?;
    }
    let comparison = compared(&alignment, rate, window, &settled.covariance);
    Ok(Comparison { unsettled_ends: ends, ..comparison })
}

/// Both ends, if the error is far larger there.
fn unsettled_ends(alignment: &Alignment<'_>) -> Option<UnsettledEnds> {
    let errors: Vec<f64> = alignment.points().map(|point| point.error).collect();
    UnsettledEnds::of(&errors)
}

/// Of likely lags, the shortest first, the one with the smallest error; a longer one must explain the
/// samples better that both explain, since the recordings of a tone agree at every period.
fn likeliest(samples: &[f64], reference: &[f64], lags: &[i64]) -> Result<i64, MeasureError> {
    let mut first_failure = None;
    let mut best: Option<Alignment<'_>> = None;
    for &lag in lags {
        let mut alignment = Alignment::new(samples, reference, lag, PROBED);
        match alignment.settle() {
            Ok(_) if best.as_ref().is_none_or(|best| is_better(&alignment, best)) => best = Some(alignment),
            Ok(_) => {}
            Err(failure) => first_failure = first_failure.or(Some(failure)),
        }
    }
    best.map(|best| best.whole).ok_or(first_failure.unwrap_or(MeasureError::NoLag { lag: 0 }))
}

/// Whether `longer` explains the record better than `shorter` where both are known. Where they share too few
/// samples each is judged by its own.
fn is_better(longer: &Alignment<'_>, shorter: &Alignment<'_>) -> bool {
    let (a, b) = (longer.probed(), shorter.probed());
    let shared = a.start.max(b.start)..a.end.min(b.end);
    let is_shared = shared.len() >= LEAST_SHARED;
    let [own, other] = [longer, shorter].map(|alignment| {
        let mut same = Alignment::new(alignment.samples, alignment.reference, alignment.whole, PROBED);
        same.restrict(if is_shared { shared.clone() } else { alignment.probed() });
        same.settle().map_or(f64::INFINITY, |found| found.error)
    });
    EQUAL_ERRORS * own + NO_ERROR < other
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
    let error_spectrum = RecordSpectrum::new(&errors, rate, window);
    Comparison {
        lag_samples: Estimate { value: lag, sigma: sigma(2) },
        lag: Seconds(lag / rate.0),
        gain: Estimate { value: alignment.gain, sigma: sigma(0) },
        offset: Estimate { value: alignment.offset, sigma: sigma(1) },
        snr: Decibels::of_power(signal / squares),
        snr_unaligned: unaligned(alignment),
        error_rms: (squares / count).sqrt(),
        largest_error: largest.map_or(0.0, |p| p.2.abs()),
        largest_error_at: largest.map_or(0, |p| p.0),
        compared: points.len(),
        unsettled_ends: None,
        error_bands: bands(&error_spectrum, rate),
        error_spectrum,
    }
}

/// Energy of the reference over that of the difference, among the samples that are compared.
fn unaligned(alignment: &Alignment<'_>) -> Decibels {
    let pairs =
        alignment.points().filter_map(|p| Some((alignment.samples[p.n], *alignment.reference.get(p.n)?)));
    let pairs = pairs.filter(|(_, r)| r.is_finite());
    let (signal, error) = pairs.fold((0.0, 0.0), |(s, e), (x, r)| (s + r * r, e + (x - r) * (x - r)));
    Decibels::of_power(signal / error)
}

fn bands(spectrum: &RecordSpectrum, rate: Hertz) -> Vec<ErrorBand> {
    let bins = spectrum.amplitudes.len();
    let edge = |band: usize| rate * (0.5 * band as f64 / BANDS as f64);
    let band = |i: usize| ErrorBand {
        from: edge(i),
        to: edge(i + 1),
        rms: spectrum.mean_square(i * bins / BANDS, (i + 1) * bins / BANDS).sqrt(),
    };
    (0..BANDS).map(band).collect()
}
