//! Discrete Fourier transforms of any length.

use crate::Complex;
use realfft::{RealFftPlanner, RealToComplex};
use rustfft::FftPlanner;
use std::cell::RefCell;
use std::sync::Arc;

/// X_k = sum_n x_n e^{-2 pi j k n / L} for k = 0 ..= L/2, of L real samples; one zero for none.
pub fn real_spectrum(samples: &[f64]) -> Vec<Complex<f64>> {
    let mut spectrum = vec![Complex::ZERO; samples.len() / 2 + 1];
    if !samples.is_empty() {
        let transform = real_transform(samples.len());
        // The lengths fit by construction, which is all that this call can object to.
        if transform.process(&mut samples.to_vec(), &mut spectrum).is_err() {
            spectrum.fill(Complex::ZERO);
        }
    }
    spectrum
}

/// The transform of L real samples. Each thread keeps its last one: channels are as long as each other.
fn real_transform(length: usize) -> Arc<dyn RealToComplex<f64>> {
    thread_local! {
        static LAST: RefCell<Option<Arc<dyn RealToComplex<f64>>>> = const { RefCell::new(None) };
    }
    LAST.with_borrow_mut(|last| {
        let kept = last.take().filter(|kept| kept.len() == length);
        let transform = kept.unwrap_or_else(|| RealFftPlanner::new().plan_fft_forward(length));
        Arc::clone(last.insert(transform))
    })
}

/// X_k = sum_n x_n e^{-2 pi j k n / L} for k = 0 .. L - 1, of L complex samples.
pub fn spectrum(mut samples: Vec<Complex<f64>>) -> Vec<Complex<f64>> {
    FftPlanner::new().plan_fft_forward(samples.len()).process(&mut samples);
    samples
}

/// x_n = sum over all k modulo L of X_k e^{2 pi j k n / L}, real, for n = 0 .. L, from X_k of k = 0 ..=
/// L/2: L times the inverse of [`real_spectrum`]. Zeros if the lengths do not fit.
pub fn real_sequence(spectrum: &[Complex<f64>], length: usize) -> Vec<f64> {
    let mut sequence = vec![0.0; length];
    let mut spectrum = spectrum.to_vec();
    // The constant and, of even lengths, the highest frequency are real.
    let last = if length.is_multiple_of(2) { spectrum.len().checked_sub(1) } else { None };
    for real in [Some(0), last].into_iter().flatten() {
        if let Some(value) = spectrum.get_mut(real) {
            value.im = 0.0;
        }
    }
    if length > 0 {
        let transform = RealFftPlanner::new().plan_fft_inverse(length);
        if transform.process(&mut spectrum, &mut sequence).is_err() {
            sequence.fill(0.0);
        }
    }
    sequence
}

/// sum over n of x_{n + lag} y_n at the index lag modulo the length, which is a power of two and holds every
/// lag of which there are products.
pub fn cross_correlation(x: &[f64], y: &[f64]) -> Vec<f64> {
    let size = (x.len() + y.len()).next_power_of_two();
    let [x, y] = [x, y].map(|samples| {
        let mut padded = samples.to_vec();
        padded.resize(size, 0.0);
        real_spectrum(&padded)
    });
    let product: Vec<Complex<f64>> = x.iter().zip(&y).map(|(x, y)| x * y.conj() / size as f64).collect();
    real_sequence(&product, size)
}

/// X_k R_k* over the square root of its modulus: the spectrum of a correlation of which neither the
/// strongest frequencies alone nor the noise between them decides.
pub fn half_whitened(x: &[Complex<f64>], r: &[Complex<f64>]) -> Vec<Complex<f64>> {
    let cross = |(x, r): (&Complex<f64>, &Complex<f64>)| {
        let product = x * r.conj();
        if product.norm() > 0.0 { product / product.norm().sqrt() } else { Complex::ZERO }
    };
    x.iter().zip(r).map(cross).collect()
}

/// z_n = L sum_k x_k y_{n - k}, indices modulo the length L of both.
///
/// # Panics
/// If the lengths differ.
pub fn circular_convolution(mut x: Vec<Complex<f64>>, mut y: Vec<Complex<f64>>) -> Vec<Complex<f64>> {
    assert_eq!(x.len(), y.len(), "a circular convolution needs two sequences of one length");
    let mut planner = FftPlanner::new();
    let forward = planner.plan_fft_forward(x.len());
    forward.process(&mut x);
    forward.process(&mut y);
    x.iter_mut().zip(&y).for_each(|(x, y)| *x *= y);
    planner.plan_fft_inverse(x.len()).process(&mut x);
    x
}
