use hybank_linalg::Complex;
use hybank_linalg::fourier::{circular_convolution, real_spectrum};
use std::f64::consts::TAU;

fn sequence(length: usize, seed: f64) -> Vec<Complex<f64>> {
    (0..length).map(|n| Complex::new((seed + n as f64).sin(), (2.0 * seed - n as f64).cos())).collect()
}

#[test]
fn spectra_are_the_sums_of_the_definition() {
    // More lengths than plans are kept, and some of them again.
    for length in [1, 2, 7, 30, 31, 32, 2, 32] {
        let samples: Vec<f64> = sequence(length, 0.4).iter().map(|x| x.re).collect();
        for (k, bin) in real_spectrum(&samples).iter().enumerate() {
            let turn = |n: usize| Complex::from_polar(1.0, -TAU * ((k * n) % length) as f64 / length as f64);
            let sum: Complex<f64> = samples.iter().enumerate().map(|(n, x)| turn(n) * *x).sum();
            assert!((bin - sum).norm() < 1e-12, "{length}: {bin} {sum}");
        }
    }
    assert_eq!(real_spectrum(&[]), [Complex::ZERO]);
}

#[test]
fn convolutions_are_the_sums_of_the_definition() {
    for length in [1, 2, 7, 32, 33, 34, 2, 34] {
        let (x, y) = (sequence(length, 0.3), sequence(length, 1.7));
        let z = circular_convolution(x.clone(), y.clone());
        for (n, z) in z.iter().enumerate() {
            let sum: Complex<f64> = (0..length).map(|k| x[k] * y[(n + length - k) % length]).sum();
            assert!((z / length as f64 - sum).norm() < 1e-12, "{length}: {z} {sum}");
        }
    }
}
