//! Discrete Fourier transforms of any length.

use crate::Complex;
use realfft::RealFftPlanner;
use rustfft::FftPlanner;

/// X_k = sum_n x_n e^{-2 pi j k n / L} for k = 0 ..= L/2, of L real samples; one zero for none.
pub fn real_spectrum(samples: &[f64]) -> Vec<Complex<f64>> {
    let mut spectrum = vec![Complex::ZERO; samples.len() / 2 + 1];
    if !samples.is_empty() {
        let transform = RealFftPlanner::new().plan_fft_forward(samples.len());
        // The lengths fit by construction, which is all that this call can object to.
        if transform.process(&mut samples.to_vec(), &mut spectrum).is_err() {
            spectrum.fill(Complex::ZERO);
        }
    }
    spectrum
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn sequence(length: usize, seed: f64) -> Vec<Complex<f64>> {
        (0..length).map(|n| Complex::new((seed + n as f64).sin(), (2.0 * seed - n as f64).cos())).collect()
    }

    #[test]
    fn spectra_are_the_sums_of_the_definition() {
        for length in [1, 2, 7, 30] {
            let samples: Vec<f64> = sequence(length, 0.4).iter().map(|x| x.re).collect();
            for (k, bin) in real_spectrum(&samples).iter().enumerate() {
                let turn =
                    |n: usize| Complex::from_polar(1.0, -TAU * ((k * n) % length) as f64 / length as f64);
                let sum: Complex<f64> = samples.iter().enumerate().map(|(n, x)| turn(n) * *x).sum();
                assert!((bin - sum).norm() < 1e-12, "{length}: {bin} {sum}");
            }
        }
        assert_eq!(real_spectrum(&[]), [Complex::ZERO]);
    }

    #[test]
    fn convolutions_are_the_sums_of_the_definition() {
        for length in [1, 2, 7, 32] {
            let (x, y) = (sequence(length, 0.3), sequence(length, 1.7));
            let z = circular_convolution(x.clone(), y.clone());
            for (n, z) in z.iter().enumerate() {
                let sum: Complex<f64> = (0..length).map(|k| x[k] * y[(n + length - k) % length]).sum();
                assert!((z / length as f64 - sum).norm() < 1e-12, "{length}: {z} {sum}");
            }
        }
    }
}
