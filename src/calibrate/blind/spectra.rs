//! Spectral matrices of the captures, band by band, and how many aliases a band holds.

use crate::linalg::{CMat, Complex, fourier, hermitian_eigenvalues};
use std::f64::consts::{PI, TAU};

/// Share of the record at each end over which the window rises from 0 to 1. Its variance of 1.03 and its
/// side lobes, which fall by 18 dB per octave, are both small.
const TAPER_SHARE: f64 = 0.05;
/// The lowest bins hold the constant and what is left of it.
const FIRST_BIN: usize = 3;
/// Bins that tell the density at 0 Hz: a tenth of the shortest record, so that it is known to a fifth.
pub(super) const LOWEST_BINS: usize = 24;
/// Bins per band, if the record is long enough, and the most bands.
const BINS_PER_BAND: usize = 32;
const MOST_BANDS: usize = 128;
/// An eigenvalue counts as an alias if it exceeds the noise by this factor. Of bands of 16 bins and more the
/// largest eigenvalue of pure noise stays below four times the smallest quarter of all.
const ABOVE_NOISE: f64 = 10.0;

/// The transforms of the windowed captures.
///
/// The window belongs to the analog signal: channel i takes its values at the instants k M - D_i. The
/// product of signal and window is then sampled late by D_i like the signal itself, and the ends of the
/// record cause no error.
pub(in crate::calibrate) struct Spectra {
    /// X_i[b] at W = 2 pi b / K, per channel.
    bins: Vec<Vec<Complex<f64>>>,
    /// K.
    frames: usize,
    ratio: f64,
    /// K sum w^4 / (sum w^2)^2, by which neighbouring bins of windowed noise raise every variance.
    pub(super) variance_factor: f64,
    /// The window's mean of each channel.
    pub(super) means: Vec<f64>,
    /// sum w^2 / (sum w)^2.
    pub(super) mean_variance: f64,
}

/// The mean spectral matrix of neighbouring frequencies.
pub(in crate::calibrate) struct SpectralBand {
    /// W at the centre, rad per slow period.
    pub(in crate::calibrate) w: f64,
    /// Bins.
    pub(in crate::calibrate) count: usize,
    /// N x N, with the phases e^{-j W D_i / M} of the delays removed.
    pub(in crate::calibrate) matrix: CMat,
}

impl Spectra {
    /// Of captures of equal length, taken at k M - `delays`.
    pub(in crate::calibrate) fn new(captures: &[&[f64]], delays: &[f64], ratio: usize) -> Self {
        let frames = captures.first().map_or(0, |capture| capture.len());
        let m = ratio as f64;
        let latest = delays.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let earliest = delays.iter().copied().fold(f64::INFINITY, f64::min);
        let span = (frames as f64 - 1.0) * m + (latest - earliest);
        let power = |w: &[f64], n: i32| w.iter().map(|w| w.powi(n)).sum::<f64>();
        let (bins, means) = (Vec::new(), Vec::new());
        let mut all = Self { bins, frames, ratio: m, variance_factor: 1.0, means, mean_variance: 0.0 };
        for (capture, &delay) in captures.iter().zip(delays) {
            let window = |k: usize| taper((k as f64 * m + latest - delay) / span);
            let window: Vec<f64> = (0..frames).map(window).collect();
            let (sum, squares) = (power(&window, 1), power(&window, 2));
            all.variance_factor = frames as f64 * power(&window, 4) / (squares * squares);
            all.mean_variance = squares / (sum * sum);
            let mean = capture.iter().zip(&window).map(|(x, w)| x * w).sum::<f64>() / sum;
            let windowed: Vec<f64> = capture.iter().zip(&window).map(|(x, w)| (x - mean) * w).collect();
            let scale = squares.sqrt().recip();
            all.bins.push(fourier::real_spectrum(&windowed).into_iter().map(|x| x * scale).collect());
            all.means.push(mean);
        }
        all
    }

    /// The spectral matrices with the phases of `delays` removed.
    pub(in crate::calibrate) fn bands(&self, delays: &[f64]) -> Vec<SpectralBand> {
        let (all, count) = (self.bins_of_bands(), self.band_count());
        let edge = |b: usize| FIRST_BIN + all * b / count;
        (0..count).map(|b| self.band(edge(b), edge(b + 1), delays)).collect()
    }

    pub(super) fn band_count(&self) -> usize {
        (self.bins_of_bands() / BINS_PER_BAND).clamp(1, MOST_BANDS)
    }

    fn bins_of_bands(&self) -> usize {
        self.frames.div_ceil(2).saturating_sub(2 * FIRST_BIN)
    }

    /// The bins next to 0 Hz of a channel with the phase of its `delay` removed, each with its W.
    pub(super) fn lowest(&self, channel: usize, delay: f64) -> impl Iterator<Item = (f64, Complex<f64>)> {
        let step = TAU / self.frames as f64;
        let lowest = (FIRST_BIN..FIRST_BIN + LOWEST_BINS).map(move |b| (b as f64 * step, b));
        let unturned = move |w: f64| Complex::from_polar(1.0, w * delay / self.ratio);
        lowest.map(move |(w, b)| (w, self.bins[channel][b] * unturned(w)))
    }

    fn band(&self, first: usize, end: usize, delays: &[f64]) -> SpectralBand {
        let n = self.bins.len();
        let mut matrix = CMat::zeros(n, n);
        let mut column = vec![Complex::ZERO; n];
        let step = TAU / self.frames as f64;
        let turned = |w: f64| -> Vec<Complex<f64>> {
            delays.iter().map(|delay| Complex::from_polar(1.0, w * delay / self.ratio)).collect()
        };
        let (mut phasors, turns) = (turned(first as f64 * step), turned(step));
        for b in first..end {
            for (((slot, bins), phasor), turn) in
                column.iter_mut().zip(&self.bins).zip(&mut phasors).zip(&turns)
            {
                *slot = bins[b] * *phasor;
                *phasor *= turn;
            }
            for i in 0..n {
                for j in 0..n {
                    matrix[(i, j)] += column[i] * column[j].conj();
                }
            }
        }
        let count = end - first;
        let w = 0.5 * (first + end).saturating_sub(1) as f64 * step;
        SpectralBand { w, count, matrix: matrix / Complex::from(count.max(1) as f64) }
    }
}

impl SpectralBand {
    /// The power of all channels in all bins.
    pub(in crate::calibrate) fn power(&self) -> f64 {
        self.count as f64 * self.matrix.trace().re
    }

    /// The power that a source with this column leaves: that of R without its part along the column.
    pub(in crate::calibrate) fn unexplained(&self, column: &CMat) -> f64 {
        let along = (column.adjoint() * &self.matrix * column)[(0, 0)].re / column.norm_squared();
        self.power() - self.count as f64 * along
    }

    /// Eigenvalues, largest first; none if they cannot be computed.
    pub(super) fn eigenvalues(&self) -> Vec<f64> {
        let mut values = hermitian_eigenvalues(&self.matrix).unwrap_or_default();
        values.sort_by(|a, b| b.total_cmp(a));
        values
    }
}

/// The number of occupied aliases of each band: eigenvalues above the noise and above `least` times the
/// largest. A band in which all N eigenvalues count is of no use, and so is one in which none does: 0 for
/// both.
pub(super) fn occupied(bands: &[SpectralBand], least: f64) -> Vec<usize> {
    let values: Vec<Vec<f64>> = bands.iter().map(SpectralBand::eigenvalues).collect();
    let mut noise: Vec<f64> = values.iter().filter_map(|values| values.last().copied()).collect();
    noise.sort_by(f64::total_cmp);
    let floor = noise.get(noise.len() / 4).copied().unwrap_or(0.0).max(0.0);
    let count = |values: &Vec<f64>| {
        let limit = (ABOVE_NOISE * floor).max(least * values.first().copied().unwrap_or(0.0));
        let above = values.iter().filter(|&&value| value > limit).count();
        if above < values.len() { above } else { 0 }
    };
    values.iter().map(count).collect()
}

/// The window at the share `x` of its length: 1 in the middle, half a cosine at both ends.
fn taper(x: f64) -> f64 {
    let share = (x.min(1.0 - x) / TAPER_SHARE).clamp(0.0, 1.0);
    0.5 - 0.5 * (PI * share).cos()
}
