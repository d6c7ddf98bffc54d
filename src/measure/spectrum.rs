//! Amplitude spectra and their windows, which are sums of cosines.

use crate::linalg::{Complex, fourier};
use crate::units::Hertz;
use std::f64::consts::{SQRT_2, TAU};

const J: Complex<f64> = Complex::new(0.0, 1.0);

/// A window w(n) = sum over k of (-1)^k a_k cos(2 pi k n / N), after Harris (1978) and Albrecht (2001).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Window {
    /// No window.
    None,
    /// Two terms.
    Hann,
    /// Four-term Blackman-Harris, side lobes at -92 dB.
    Bh4,
    /// Seven-term Blackman-Harris, side lobes at -180 dB.
    #[default]
    Bh7,
}

impl Window {
    /// a_0, a_1, ..
    pub fn coefficients(self) -> &'static [f64] {
        match self {
            Self::None => &[1.0],
            Self::Hann => &[0.5, 0.5],
            Self::Bh4 => &[0.358_75, 0.488_29, 0.141_28, 0.011_68],
            Self::Bh7 => &[
                0.271_051_400_693_42,
                0.433_297_939_234_48,
                0.218_122_999_543_11,
                0.065_925_446_388_03,
                0.010_811_742_098_37,
                0.000_776_584_825_22,
                0.000_013_887_217_35,
            ],
        }
    }

    /// The equivalent noise bandwidth in bins, N sum w^2 / (sum w)^2 = (a_0^2 + sum of a_k^2 / 2) / a_0^2.
    pub fn noise_bandwidth(self) -> f64 {
        let a = self.coefficients();
        1.0 + a[1..].iter().map(|a| 0.5 * a * a).sum::<f64>() / (a[0] * a[0])
    }

    /// `samples` times the window.
    fn apply(self, samples: &[f64]) -> Vec<f64> {
        let step = TAU / samples.len() as f64;
        let a = self.coefficients();
        // Clenshaw's recurrence with x = -cos: one cosine per sample, whatever the number of terms.
        let value = |n: usize| {
            let x = -(step * n as f64).cos();
            let (b1, b2) = a[1..].iter().rev().fold((0.0, 0.0), |(b1, b2), a| (a + 2.0 * x * b1 - b2, b1));
            a[0] + x * b1 - b2
        };
        samples.iter().enumerate().map(|(n, x)| x * value(n)).collect()
    }
}

/// The spectrum of a record: each bin is the amplitude of the sine that has the power of the bin, or in
/// complex records of the exponential. Bin k lies k fs / N above the first one, which is at 0; complex
/// records begin with the bin after -fs / 2.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordSpectrum {
    /// The window of the record.
    pub window: Window,
    /// fs / N.
    pub bin: Hertz,
    /// The number of bins below 0; 0 for real samples.
    pub negative: usize,
    /// 2 |X_k| / sum w for k = 0 ..= N/2; sqrt 2 in place of 2 for k = 0 and k = N/2, which have no mirror
    /// image. Of complex samples |Z_k| / sum w for -N/2 < k <= N/2.
    pub amplitudes: Vec<f64>,
}

impl RecordSpectrum {
    /// Of finite samples.
    pub fn new(samples: &[f64], rate: Hertz, window: Window) -> Self {
        let count = samples.len().max(1);
        let transform = fourier::real_spectrum(&window.apply(samples));
        let scale = 1.0 / (window.coefficients()[0] * count as f64);
        let is_single = |k: usize| k == 0 || 2 * k == count;
        let amplitude =
            |(k, x): (usize, &Complex<f64>)| x.norm() * scale * if is_single(k) { SQRT_2 } else { 2.0 };
        let amplitudes = transform.iter().enumerate().map(amplitude).collect();
        Self { window, bin: rate / count as f64, negative: 0, amplitudes }
    }

    /// Of finite complex samples, as many real as imaginary parts.
    ///
    /// The transforms X and Y of the parts give those of both signs: Z_k = X_k + j Y_k and
    /// Z_-k = conj(X_k - j Y_k).
    pub fn complex(real: &[f64], imaginary: &[f64], rate: Hertz, window: Window) -> Self {
        let count = real.len().max(1);
        let [x, y] = [real, imaginary].map(|part| fourier::real_spectrum(&window.apply(part)));
        let scale = 1.0 / (window.coefficients()[0] * count as f64);
        let negative = (count - 1) / 2;
        let below = (1..=negative).rev().map(|k| (x[k] - J * y[k]).norm() * scale);
        let above = x.iter().zip(&y).map(|(x, y)| (x + J * y).norm() * scale);
        Self { window, bin: rate / count as f64, negative, amplitudes: below.chain(above).collect() }
    }

    /// Frequency of bin k, from the first one on.
    pub fn frequency(&self, k: usize) -> Hertz {
        self.bin * (k as f64 - self.negative as f64)
    }

    /// At most `columns` points, the largest bin of each stretch of equally many: its frequency and
    /// amplitude. No line is lost, however narrow it is.
    pub fn columns(&self, columns: usize) -> Vec<(Hertz, f64)> {
        let width = self.amplitudes.len().div_ceil(columns.max(1)).max(1);
        let point = |(column, bins): (usize, &[f64])| {
            let larger = |best: (usize, f64), (i, a): (usize, &f64)| if *a > best.1 { (i, *a) } else { best };
            let (at, largest) = bins.iter().enumerate().fold((0, 0.0), larger);
            (self.frequency(column * width + at), largest)
        };
        self.amplitudes.chunks(width).enumerate().map(point).collect()
    }

    /// The mean square between two bins (`from` included, `to` not): a sine counts A^2 / 2, noise its
    /// variance.
    pub fn mean_square(&self, from: usize, to: usize) -> f64 {
        let bins = &self.amplitudes[from.min(self.amplitudes.len())..to.min(self.amplitudes.len())];
        bins.iter().map(|a| 0.5 * a * a).sum::<f64>() / self.window.noise_bandwidth()
    }

    /// The largest bin beyond the main lobe of the constant: its frequency and amplitude.
    pub fn largest(&self) -> (Hertz, f64) {
        let lobe = self.window.coefficients().len();
        let beyond = self.amplitudes.iter().enumerate().filter(|(k, _)| k.abs_diff(self.negative) >= lobe);
        let (at, largest) = beyond.fold((0, 0.0), |most, (k, &a)| if a > most.1 { (k, a) } else { most });
        (self.frequency(at), largest)
    }

    /// Mean noise density in squared units of the samples per hertz: the mean of A_k^2 / 2 over the bins,
    /// divided by the equivalent noise bandwidth of the window in hertz.
    pub fn density(&self) -> f64 {
        let count = self.amplitudes.len();
        if count < 3 {
            return f64::NAN;
        }
        // The first and the last bin of real samples are half as wide as the others and are left out.
        self.mean_square(1, count - 1) / (self.bin.0 * (count - 2) as f64)
    }
}
