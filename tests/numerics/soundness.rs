//! What `verify` must not say: delays next to whole numbers against a closed form, and files whose gammas
//! are false.

use crate::support::random::Random;
use crate::support::specs::{alike, tf, thesis, with_taps};
use hybank::bank::{Bank, Gamma, SynthesisFilters};
use hybank::design::prove;
use hybank::spec::{DesignSpec, Method, Spec};
use hybank::units::Seconds;
use hybank::verify::verify;
use std::f64::consts::PI;

/// Front end w / (s + w) for target and channel, M = 1, one tap of 1, D = (latency + offset) h.
struct OnePole {
    pole: f64,
    latency: usize,
    delay: f64,
    fast_period: f64,
}

impl OnePole {
    fn bank(&self) -> Bank {
        let pole = self.pole / self.fast_period;
        let filter = tf(&[pole], &[1.0, pole]);
        let mut spec = alike(&filter, 1, self.latency, &[self.delay]);
        (spec.fast_period, spec.design) = (Seconds(self.fast_period), DesignSpec::new(Method::Fir, Some(1)));
        Bank {
            fast_period: Seconds(self.fast_period),
            latency: self.latency,
            delays: vec![Seconds(self.delay)],
            spec: Some(spec),
            ..Bank::bare(SynthesisFilters::Fir(vec![vec![1.0]]), 1)
        }
    }

    /// ||K|| of x(k) - x(k - d), d = |D / h - latency| < 1, by its closed form: with E = e^{-w},
    /// e = e^{-w d} - 1 and the energies g_v = w (1 - e^{-2 w d}) / 2, g_u = w (1 - e^{-2 w (1 - d)}) / 2 of
    /// the input's two parts of a period,
    /// |K|^2 = g_v |1 + e e^{-w (1 - d)} z^-1 / (1 - E z^-1)|^2 + g_u |e / (1 - E z^-1)|^2.
    fn norm(&self) -> f64 {
        let w = self.pole;
        let latency = self.latency as f64;
        // The double nearest to a whole number of fast periods means that number.
        let is_whole = self.delay == latency * self.fast_period;
        let apart = if is_whole { 0.0 } else { latency.mul_add(-self.fast_period, self.delay) };
        let d = (apart / self.fast_period).abs();
        let (g_v, g_u) = (-0.5 * w * (-2.0 * w * d).exp_m1(), -0.5 * w * (-2.0 * w * (1.0 - d)).exp_m1());
        let (decay, change, between) = ((-w).exp(), (-w * d).exp_m1(), (-w * (1.0 - d)).exp());
        let square = |angle: f64| {
            // 1 - E cos and E sin of z^-1 = e^{-i angle}.
            let (re, im) = (-(-w).exp_m1() + decay * 2.0 * (0.5 * angle).sin().powi(2), decay * angle.sin());
            let size = re * re + im * im;
            let (c, s) = (angle.cos(), -angle.sin());
            let (x, y) = (c * re + s * im, s * re - c * im);
            let factor = change * between / size;
            g_v * ((1.0 + factor * x).powi(2) + (factor * y).powi(2)) + g_u * change * change / size
        };
        (0..=2000).map(|k| square(PI * f64::from(k) / 2000.0)).fold(0.0, f64::max).sqrt()
    }
}

/// A delay that is a whole number up to 1e-13 relative is none: these were proven to be far better than they
/// are.
#[test]
fn delays_next_to_whole_numbers_are_not_rounded() {
    for (pole, delay, latency, norm) in [
        (1e6, 60000.000000005, 60000, 70.6),
        (1e6, 60000.00000001, 60000, 99.6),
        (1e6, 1.00000000000009, 1, 0.30),
        (1e6, 0.99999999999991, 1, 0.30),
    ] {
        let example = OnePole { pole, latency, delay, fast_period: 1.0 };
        assert!((example.norm() / norm - 1.0).abs() < 1e-2, "{delay}: {}", example.norm());
        let (_, proven) = prove(&example.bank()).unwrap();
        assert!(proven.attained <= example.norm() * (1.0 + 1e-9), "{delay}: {proven:?}");
        assert!(proven.upper >= example.norm() * (1.0 - 1e-9), "{delay}: {proven:?}");
        assert!(proven.upper <= example.norm() * (1.0 + 1e-6), "{delay}: {proven:?}");
    }
}

/// The same for random poles, latencies, fast periods and distances from a whole number.
#[test]
fn no_interval_excludes_the_true_norm_for_any_delay() {
    let mut random = Random(2026);
    let mut uniform = |from: f64, to: f64| from + (to - from) * random.part();
    let (mut proven, mut refused) = (0, 0);
    for _ in 0..400 {
        let fast_period = [1.0, 1.0 / 48_000.0, 1.0 / 44_100.0, 4e-9][uniform(0.0, 4.0) as usize];
        let latency = 10f64.powf(uniform(0.0, 5.0)) as usize;
        let distance = 10f64.powf(uniform(-17.0, -0.5)) * if uniform(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
        let example = OnePole {
            pole: 10f64.powf(uniform(-3.0, 7.0)),
            latency,
            delay: (latency as f64 + distance) * fast_period,
            fast_period,
        };
        let what = || {
            let OnePole { pole, delay, .. } = &example;
            format!("pole {pole:e}, latency {latency}, delay {delay:e}, h {fast_period:e}")
        };
        let (norm, scale) = (example.norm(), example.pole.sqrt());
        match prove(&example.bank()) {
            Ok((_, found)) => {
                proven += 1;
                // The oracle computes in doubles; below 1e-9 of the scale it is rounding itself.
                let slack = 1e-7 * norm + 1e-9 * scale;
                assert!(found.attained <= norm + slack, "{}: {norm:e} {found:?}", what());
                assert!(found.upper >= norm - slack, "{}: {norm:e} {found:?}", what());
            }
            Err(_) => refused += 1,
        }
    }
    println!("{proven} proven, {refused} without a certificate");
    assert!(proven > 3 * refused, "{proven} {refused}");
}

fn proven(spec: &Spec) -> Bank {
    let found = crate::support::proven(spec);
    found.proof.unwrap();
    found.bank
}

/// Thesis example, 12 taps and latency 1 (FIR and recursive), and latency 10.
fn examples() -> [Bank; 3] {
    let hurried = thesis(1, &[1.2, 0.6]);
    [proven(&with_taps(hurried.clone(), 12)), proven(&hurried), proven(&thesis(10, &[1.2, 0.6]))]
}

/// What a forger may do to a file, the digest computed again.
fn forged(bank: &Bank, trick: usize) -> (&'static str, Bank) {
    let mut forged = bank.clone();
    let proof = forged.proof.as_mut().unwrap();
    let certificate = &mut proof.upper;
    let gamma = &mut forged.gamma;
    let scaled = |x: &mut Option<f64>, by: f64| *x = x.map(|x| x * by);
    let name = match trick {
        0 => {
            *gamma = Gamma { upper: Some(0.0), norm: Some(0.0), ..Gamma::default() };
            certificate.peak.reference.iter_mut().for_each(|pair| *pair = [0.0; 2]);
            "gammas of zero with a witness of weight zero"
        }
        1 => {
            certificate.gamma *= 50.0;
            scaled(&mut gamma.upper, 50.0);
            certificate.factor.iter_mut().flatten().for_each(|x| *x *= 50.0);
            "upper end and certificate times 50"
        }
        2 => {
            certificate.gamma *= 50.0;
            scaled(&mut gamma.upper, 50.0);
            scaled(&mut gamma.norm, 50.0);
            "all upper numbers times 50"
        }
        3 => {
            gamma.upper = gamma.norm.map(|norm| norm * (1.0 - 1e-12));
            (gamma.lower, gamma.noncausal) = (None, None);
            "upper below the norm"
        }
        4 => {
            scaled(&mut gamma.norm, 0.9);
            "norm times 0.9"
        }
        5 => {
            scaled(&mut gamma.norm, 1.1);
            "norm times 1.1"
        }
        _ => {
            forged.proof = None;
            "no proof at all"
        }
    };
    (name, forged)
}

/// Each is refused by the file's reader or by the proof.
#[test]
fn files_whose_gammas_are_false_are_refused() {
    for bank in examples() {
        verify(&bank).unwrap();
        for trick in 0..7 {
            let (name, forged) = forged(&bank, trick);
            let read = forged.to_json().and_then(|text| Bank::from_json(&text, "forged.json"));
            let judged = read
                .map_err(|error| error.to_string())
                .and_then(|bank| verify(&bank).map_err(|error| error.to_string()));
            assert!(judged.is_err(), "{name}: {judged:?} {:?}", forged.gamma);
            // Without the reader's checks, too.
            assert!(verify(&forged).is_err(), "{name}");
        }
    }
}
