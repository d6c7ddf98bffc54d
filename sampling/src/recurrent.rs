//! Recurrent nonuniform sampling: M interleaved sample sets of period M, each with its own offset.
//!
//! J. L. Yen, "On nonuniform sampling of bandwidth-limited signals", 1956; A. Papoulis,
//! "Generalized sampling expansion", 1977. Time is counted in fast periods (Nyquist at pi), so
//! that set i samples f at t_i + k M. With M distinct offsets
//!
//! ```text
//! f(t) = sum_i sum_k f(t_i + k M) psi_i(t - t_i - k M)
//! psi_i(u) = sinc(u / M) prod_{q /= i} sin(pi (u + t_i - t_q) / M) / sin(pi (t_i - t_q) / M)
//! ```

use super::SamplingError;
use std::f64::consts::PI;

/// Offsets closer than this (in fast periods, modulo the period) count as coinciding: the factor
/// 1 / sin(pi d / M) would then amplify the rounding of the samples beyond the samples themselves.
const CLOSEST_OFFSETS: f64 = 1e-9;

/// M sample sets of period M with distinct offsets, and their interpolation functions.
#[derive(Debug, Clone, PartialEq)]
pub struct Recurrent {
    offsets: Vec<f64>,
}

impl Recurrent {
    /// Sample sets at `offsets[i] + k M`, all in fast periods; M is the number of offsets.
    ///
    /// # Errors
    /// [`SamplingError::NotFinite`] for an offset that is not finite, and
    /// [`SamplingError::Coinciding`] when two offsets agree modulo the period (to 1e-9).
    pub fn new(offsets: &[f64]) -> Result<Self, SamplingError> {
        if let Some(index) = offsets.iter().position(|t| !t.is_finite()) {
            return Err(SamplingError::NotFinite { name: "offset", index, value: offsets[index] });
        }
        let sets = Self { offsets: offsets.to_vec() };
        match sets.closest_pair() {
            Some((first, second, distance)) if distance < CLOSEST_OFFSETS => {
                Err(SamplingError::Coinciding { first, second, distance })
            }
            _ => Ok(sets),
        }
    }

    /// The period M in fast periods, which is also the number of sets.
    fn period(&self) -> usize {
        self.offsets.len()
    }

    /// The two sets that lie closest modulo the period, and their distance in fast periods.
    fn closest_pair(&self) -> Option<(usize, usize, f64)> {
        let period = self.period() as f64;
        let pairs = (0..self.period()).flat_map(|i| (0..i).map(move |q| (q, i)));
        pairs
            .map(|(q, i)| {
                let d = self.offsets[i] - self.offsets[q];
                (q, i, (d - period * (d / period).round()).abs())
            })
            .min_by(|a, b| a.2.total_cmp(&b.2))
    }

    /// The interpolation function psi_i(u) of set `set`, `u` in fast periods from the sample.
    ///
    /// psi_i(0) = 1, and psi_i vanishes at every other instant of every set.
    ///
    /// # Panics
    /// Unless `set < period`.
    fn psi(&self, set: usize, u: f64) -> f64 {
        let period = self.period() as f64;
        let here = self.offsets[set];
        let others = self.offsets.iter().enumerate().filter(|&(q, _)| q != set);
        others.fold(sinc(u / period), |product, (_, &there)| {
            let gap = (here - there) / period;
            product * sin_pi(u / period + gap) / sin_pi(gap)
        })
    }

    /// FIR taps at the fast rate for set `set`: `taps[n] = psi_i(n - latency - t_i)`, n = 0..length.
    ///
    /// With x_i\[k\] = f(k M + t_i) the synthesis y\[k M + p\] = sum_i sum_j taps_i\[p + j M\] x_i\[k - j\]
    /// gives f(n - latency) up to the error of truncation to `length` taps.
    ///
    /// # Panics
    /// Unless `set < period`.
    pub fn taps(&self, set: usize, latency: f64, length: usize) -> Vec<f64> {
        (0..length).map(|n| self.psi(set, n as f64 - latency - self.offsets[set])).collect()
    }
}

/// sin(pi x). The argument is reduced before the multiplication, so integers give exactly 0.
fn sin_pi(x: f64) -> f64 {
    let turns = x.round();
    let sine = (PI * (x - turns)).sin();
    if turns.rem_euclid(2.0) == 0.0 { sine } else { -sine }
}

/// The sinc kernel sin(pi x) / (pi x), 1 at x = 0.
fn sinc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { sin_pi(x) / (PI * x) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn sine_and_sinc_at_integers_are_exact() {
        for n in -1000..1000 {
            assert_eq!(sin_pi(n as f64), 0.0);
            assert_eq!(sinc(n as f64), f64::from(n == 0));
        }
        assert_eq!(sin_pi(0.5), 1.0);
        assert_eq!(sin_pi(1.5), -1.0);
        assert!((sinc(0.5) - 2.0 / PI).abs() < 1e-16);
    }

    /// f(t) from finitely many samples, `samples[i][k] = f(t_i + (first + k) M)`; all others count as 0.
    fn interpolated(sets: &Recurrent, t: f64, samples: &[Vec<f64>], first: i64) -> f64 {
        let period = sets.period() as f64;
        let of_set = |(set, values): (usize, &Vec<f64>)| {
            let start = t - sets.offsets[set] - first as f64 * period;
            values.iter().enumerate().map(|(k, v)| v * sets.psi(set, start - k as f64 * period)).sum::<f64>()
        };
        samples.iter().enumerate().map(of_set).sum()
    }

    /// sum over |k| <= terms of one tone through all sets, tapered (Fejer) so that the slowly and
    /// conditionally converging series can be compared with the tone itself.
    fn tone_through(sets: &Recurrent, omega: f64, phase: f64, t: f64, terms: i64) -> f64 {
        let m = sets.period() as f64;
        let f = |t: f64| (omega * t + phase).cos();
        (-terms..=terms)
            .map(|k| {
                let taper = 1.0 - (k.abs() as f64) / (terms + 1) as f64;
                let terms = sets.offsets.iter().enumerate();
                taper
                    * terms
                        .map(|(i, ti)| f(ti + k as f64 * m) * sets.psi(i, t - ti - k as f64 * m))
                        .sum::<f64>()
            })
            .sum()
    }

    #[test]
    fn uniform_offsets_give_the_sinc() {
        for m in 1..=6 {
            let offsets: Vec<f64> = (0..m).map(|i| i as f64).collect();
            let sets = Recurrent::new(&offsets).unwrap();
            for i in 0..m {
                for step in -97..97 {
                    let u = step as f64 * 0.137;
                    assert!((sets.psi(i, u) - sinc(u)).abs() < 1e-13, "M={m} i={i} u={u}");
                }
            }
        }
    }

    #[test]
    fn every_function_is_one_at_its_sample_and_zero_at_all_others() {
        let sets = Recurrent::new(&[-1.2, -0.6, 0.31, 1.9]).unwrap();
        for i in 0..4 {
            for q in 0..4 {
                for k in -5..=5 {
                    let u = sets.offsets[q] + 4.0 * k as f64 - sets.offsets[i];
                    let expected = f64::from(q == i && k == 0);
                    assert!((sets.psi(i, u) - expected).abs() < 1e-14, "i={i} q={q} k={k}");
                }
            }
        }
    }

    #[test]
    fn tones_below_nyquist_are_reproduced() {
        for offsets in [vec![0.0, 0.6], vec![0.0, 0.9, 2.2], vec![-2.4, 0.2, 1.0, 2.7]] {
            let sets = Recurrent::new(&offsets).unwrap();
            for omega in [0.0, 0.4, 1.3, 2.6] {
                for t in [0.37, -1.9, 2.05] {
                    let got = tone_through(&sets, omega, 0.8, t, 4000);
                    let want = (omega * t + 0.8).cos();
                    assert!((got - want).abs() < 2e-3, "{offsets:?} omega={omega} t={t}: {got} {want}");
                }
            }
        }
    }

    #[test]
    fn coinciding_sets_tend_to_sampling_value_and_slope() {
        // f(t) = sum_k [f(2k) + (t - 2k) f'(2k)] sinc^2((t - 2k)/2), the limit of M = 2.
        let f = |t: f64| (sinc(0.37 * (t - 0.3))).powi(2);
        let slope = |t: f64| (f(t + 1e-6) - f(t - 1e-6)) / 2e-6;
        let sets = Recurrent::new(&[0.0, 1e-5]).unwrap();
        let grid = |offset: f64| (-400..=400).map(|k| f(2.0 * k as f64 + offset)).collect::<Vec<_>>();
        let samples = [grid(0.0), grid(1e-5)];
        for t in [0.4, 1.1, -2.7] {
            let hermite: f64 = (-400..=400)
                .map(|k| t - 2.0 * k as f64)
                .map(|u| (f(t - u) + u * slope(t - u)) * sinc(u / 2.0).powi(2))
                .sum();
            let close = interpolated(&sets, t, &samples, -400);
            assert!((close - hermite).abs() < 1e-4 && (close - f(t)).abs() < 1e-4, "{close} {hermite}");
        }
        assert!(matches!(
            Recurrent::new(&[0.25, 2.25]),
            Err(SamplingError::Coinciding { first: 0, second: 1, distance }) if distance < 1e-12
        ));
    }

    #[test]
    fn taps_reproduce_a_pulse_after_the_latency() {
        let sets = Recurrent::new(&[-1.2, -0.6]).unwrap();
        let (latency, length) = (400.0, 801);
        let f = |t: f64| sinc(0.35 * (t - 201.3)).powi(2);
        let channel = |i: usize| (0..400).map(|k| f(2.0 * k as f64 + sets.offsets[i])).collect::<Vec<_>>();
        let x = [channel(0), channel(1)];
        let taps = [sets.taps(0, latency, length), sets.taps(1, latency, length)];
        for n in [590, 601, 602, 640] {
            let (k, p) = (n / 2, n % 2);
            let y: f64 = (0..2)
                .map(|i| {
                    (0..=k)
                        .filter(|j| p + 2 * j < length && k - j < x[i].len())
                        .map(|j| taps[i][p + 2 * j] * x[i][k - j])
                        .sum::<f64>()
                })
                .sum();
            assert!((y - f(n as f64 - latency)).abs() < 1e-4, "n={n}: {y}");
        }
    }

    #[test]
    fn bad_offsets_are_named() {
        assert!(matches!(
            Recurrent::new(&[0.0, f64::NAN]),
            Err(SamplingError::NotFinite { name: "offset", index: 1, .. })
        ));
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn any_spread_offsets_reproduce_a_band_limited_pulse(
            m in 1_usize..6, jitter in prop::collection::vec(-0.3..0.3_f64, 6), t in -3.0..3.0_f64
        ) {
            let offsets: Vec<f64> = (0..m).map(|i| i as f64 + jitter[i]).collect();
            let sets = Recurrent::new(&offsets).unwrap();
            let f = |t: f64| sinc(0.45 * (t - 0.2)).powi(2);
            let grid: Vec<Vec<f64>> = offsets
                .iter()
                .map(|ti| (-500..=500).map(|k| f(ti + (k * m as i64) as f64)).collect())
                .collect();
            let got = interpolated(&sets, t, &grid, -500);
            // The energies of the functions, for the errors of the samples that are left out.
            let energy: f64 = (0..m)
                .map(|i| (-4000..4000).map(|n| sets.psi(i, f64::from(n) * 0.5 + 0.1).powi(2) * 0.5).sum::<f64>())
                .sum();
            prop_assert!((got - f(t)).abs() < 1e-5 * (1.0 + energy / m as f64), "{} {}", got, f(t));
        }

        #[test]
        fn functions_do_not_depend_on_a_common_shift(shift in -50.0..50.0_f64, u in -9.0..9.0_f64) {
            let near = Recurrent::new(&[0.0, 0.7, 2.2]).unwrap();
            let far = Recurrent::new(&[shift, 0.7 + shift, 2.2 + shift]).unwrap();
            prop_assert!((near.psi(1, u) - far.psi(1, u)).abs() < 1e-11);
        }

        #[test]
        fn tone_phase_does_not_matter(phase in -PI..PI) {
            let sets = Recurrent::new(&[0.0, 0.6]).unwrap();
            let got = tone_through(&sets, 1.7, phase, 0.21, 2000);
            prop_assert!((got - (1.7 * 0.21 + phase).cos()).abs() < 4e-3);
        }
    }
}
