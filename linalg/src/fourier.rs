//! Discrete Fourier transforms of any length.

use crate::Complex;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use rustfft::{Fft, FftPlanner};
use std::cell::RefCell;
use std::sync::Arc;

/// X_k = sum_n x_n e^{-2 pi j k n / L} for k = 0 ..= L/2, of L real samples; one zero for none.
pub fn real_spectrum(samples: &[f64]) -> Vec<Complex<f64>> {
    let mut spectrum = vec![Complex::ZERO; samples.len() / 2 + 1];
    if !samples.is_empty() {
        // The lengths fit by construction, which is all that this call can object to.
        if real_forward(samples.len()).process(&mut samples.to_vec(), &mut spectrum).is_err() {
            spectrum.fill(Complex::ZERO);
        }
    }
    spectrum
}

/// X_k = sum_n x_n e^{-2 pi j k n / L} for k = 0 .. L - 1, of L complex samples.
pub fn spectrum(mut samples: Vec<Complex<f64>>) -> Vec<Complex<f64>> {
    forward(samples.len()).process(&mut samples);
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
    if length > 0 && real_inverse(length).process(&mut spectrum, &mut sequence).is_err() {
        sequence.fill(0.0);
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
        // Not by `hypot`, which takes longer than the transforms.
        let modulus = product.norm_sqr().sqrt();
        if modulus > 0.0 { product / modulus.sqrt() } else { Complex::ZERO }
    };
    x.iter().zip(r).map(cross).collect()
}

/// z_n = L sum_k x_k y_{n - k}, indices modulo the length L of both.
///
/// # Panics
/// If the lengths differ.
pub fn circular_convolution(mut x: Vec<Complex<f64>>, mut y: Vec<Complex<f64>>) -> Vec<Complex<f64>> {
    assert_eq!(x.len(), y.len(), "a circular convolution needs two sequences of one length");
    let forward = forward(x.len());
    forward.process(&mut x);
    forward.process(&mut y);
    x.iter_mut().zip(&y).for_each(|(x, y)| *x *= y);
    inverse(x.len()).process(&mut x);
    x
}

/// Lengths of which a thread keeps the plans, of each kind: those of a recording, of its pieces and of what
/// they are compared with.
const KEPT_PLANS: usize = 4;

/// The plans of the last lengths: the sines and cosines of a plan take longer than a transform.
struct Plans<P: ?Sized>(Vec<(usize, Arc<P>)>);

impl<P: ?Sized> Plans<P> {
    const fn none() -> RefCell<Self> {
        RefCell::new(Self(Vec::new()))
    }

    /// The plan of a length, made unless it is kept.
    fn of(&mut self, length: usize, plan: impl FnOnce() -> Arc<P>) -> Arc<P> {
        let known = self.0.iter().position(|(kept, _)| *kept == length);
        let found = known.map_or_else(plan, |k| self.0.remove(k).1);
        self.0.truncate(KEPT_PLANS - 1);
        self.0.insert(0, (length, Arc::clone(&found)));
        found
    }
}

thread_local! {
    static FORWARD: RefCell<Plans<dyn Fft<f64>>> = const { Plans::none() };
    static INVERSE: RefCell<Plans<dyn Fft<f64>>> = const { Plans::none() };
    static REAL_FORWARD: RefCell<Plans<dyn RealToComplex<f64>>> = const { Plans::none() };
    static REAL_INVERSE: RefCell<Plans<dyn ComplexToReal<f64>>> = const { Plans::none() };
}

fn forward(length: usize) -> Arc<dyn Fft<f64>> {
    FORWARD.with_borrow_mut(|plans| plans.of(length, || FftPlanner::new().plan_fft_forward(length)))
}

fn inverse(length: usize) -> Arc<dyn Fft<f64>> {
    INVERSE.with_borrow_mut(|plans| plans.of(length, || FftPlanner::new().plan_fft_inverse(length)))
}

fn real_forward(length: usize) -> Arc<dyn RealToComplex<f64>> {
    REAL_FORWARD.with_borrow_mut(|plans| plans.of(length, || RealFftPlanner::new().plan_fft_forward(length)))
}

fn real_inverse(length: usize) -> Arc<dyn ComplexToReal<f64>> {
    REAL_INVERSE.with_borrow_mut(|plans| plans.of(length, || RealFftPlanner::new().plan_fft_inverse(length)))
}
