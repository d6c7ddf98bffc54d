//! Amplitude spectra.

use super::Window;
use crate::linalg::fourier;
use crate::units::Hertz;
use std::f64::consts::SQRT_2;

/// The spectrum of a record: bin k is the amplitude of the sine that has the power of the bin, at the
/// frequency k fs / N.
#[derive(Debug, Clone, PartialEq)]
pub struct Spectrum {
    /// The window of the record.
    pub window: Window,
    /// fs / N.
    pub bin: Hertz,
    /// 2 |X_k| / sum w for k = 0 ..= N/2; sqrt 2 in place of 2 for k = 0 and k = N/2, which have no mirror
    /// image.
    pub amplitudes: Vec<f64>,
}

impl Spectrum {
    /// Of finite samples.
    pub fn new(samples: &[f64], rate: Hertz, window: Window) -> Self {
        let count = samples.len().max(1);
        let transform = fourier::real_spectrum(&window.apply(samples));
        let scale = 1.0 / (window.coefficients()[0] * count as f64);
        let is_single = |k: usize| k == 0 || 2 * k == count;
        let amplitude = |(k, x): (usize, &crate::linalg::Complex<f64>)| {
            x.norm() * scale * if is_single(k) { SQRT_2 } else { 2.0 }
        };
        let amplitudes = transform.iter().enumerate().map(amplitude).collect();
        Self { window, bin: rate / count as f64, amplitudes }
    }

    /// Frequency of bin k.
    pub fn frequency(&self, k: usize) -> Hertz {
        self.bin * k as f64
    }

    /// At most `columns` points, the largest bin of each stretch of equally many: its frequency and amplitude. No
    /// line is lost, however narrow it is.
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

    /// The largest amplitude of bins beyond the main lobe of the constant.
    pub fn largest(&self) -> f64 {
        let skipped = self.window.coefficients().len();
        self.amplitudes.iter().skip(skipped).fold(0.0, |most, a| most.max(*a))
    }

    /// Mean noise density in squared units of the samples per hertz: the mean of A_k^2 / 2 over the bins,
    /// divided by the equivalent noise bandwidth of the window in hertz.
    pub fn density(&self) -> f64 {
        let count = self.amplitudes.len();
        if count < 3 {
            return f64::NAN;
        }
        // The first and the last bin are half as wide as the others and are left out.
        self.mean_square(1, count - 1) / (self.bin.0 * (count - 2) as f64)
    }
}
