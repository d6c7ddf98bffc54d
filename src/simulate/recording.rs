//! A recording as a periodic, band-limited analog signal.

use super::response::Instants;
use crate::analog::StrictlyProper;
use crate::linalg::{Complex, fourier};
use crate::units::{FastPeriods, RadiansPerFastPeriod};
use std::f64::consts::{PI, TAU};

/// A Taylor series ends where its terms are below this, relative to the first one.
const NEGLIGIBLE_TERM: f64 = 1e-17;
/// Terms of a Taylor series, at most; shifts up to [`Periodic::most_shift`] take half of them.
const MOST_TERMS: u32 = 128;
/// Largest pi |shift| / T: e to this power is what rounding errors grow by.
const MOST_EXPONENT: f64 = 12.0;

/// L samples with a spacing of T fast periods, continued with period L T and interpolated by the
/// trigonometric polynomial of least degree: f(t) = Re sum_k c_k e^{2 pi j k t / (L T)}, k = 0 .. L/2.
#[derive(Debug, Clone)]
pub struct Periodic {
    /// X_k / L for k = 0 .. L/2, the last halved when L is even.
    spectrum: Vec<Complex<f64>>,
    /// T.
    spacing: FastPeriods,
    length: usize,
}

impl Periodic {
    /// `samples` taken at the instants 0, T, 2 T, .. with T = `spacing` > 0. An empty recording is the zero
    /// signal.
    pub fn new(samples: &[f64], spacing: FastPeriods) -> Self {
        let length = samples.len();
        let mut spectrum = fourier::real_spectrum(samples);
        spectrum.iter_mut().for_each(|bin| *bin /= length.max(1) as f64);
        if length.is_multiple_of(2)
            && let Some(nyquist) = spectrum.last_mut()
        {
            *nyquist *= 0.5;
        }
        Self { spectrum, spacing, length }
    }

    /// L T, the duration.
    pub fn duration(&self) -> FastPeriods {
        FastPeriods(self.length as f64 * self.spacing.0)
    }

    /// (phi * f)(t) at the given instants.
    ///
    /// The sum over the L/2 harmonics at equally spaced instants is a chirp-z transform (Bluestein, 1970):
    /// exact to rounding for any ratio of the two rates, in O(n log n).
    pub fn sample(&self, filter: &StrictlyProper, instants: Instants) -> Vec<f64> {
        self.sample_through(|w| filter.response(w), instants)
    }

    /// The same of a front end with this `response`.
    pub(crate) fn sample_through(
        &self,
        response: impl Fn(RadiansPerFastPeriod) -> Complex<f64>,
        instants: Instants,
    ) -> Vec<f64> {
        if instants.count == 0 || self.length == 0 {
            return vec![0.0; instants.count];
        }
        chirp_z(&self.filtered(response, instants.first), instants.step / self.duration(), instants.count)
    }

    /// (phi * f)(t) at the given instants, each later by its shift: the Taylor series around the instants,
    /// each of whose terms is a sum as in [`Periodic::sample`].
    ///
    /// Its error relative to the largest value is some 1e-16 e^z with z = pi |shift| / T; keep the shifts
    /// below [`Periodic::most_shift`].
    pub fn sample_near(
        &self,
        filter: &StrictlyProper,
        instants: Instants,
        shifts: &[FastPeriods],
    ) -> Vec<f64> {
        let mut output = self.sample(filter, instants);
        if output.is_empty() || self.length == 0 {
            return output;
        }
        let largest = shifts.iter().fold(0.0f64, |most, shift| most.max(shift.0.abs()));
        let (turn, step) = (PI / self.spacing.0, instants.step / self.duration());
        let mut derivative = self.filtered(|w| filter.response(w), instants.first);
        let mut powers = vec![1.0; output.len()];
        let mut bound = 1.0;
        for order in (1..=MOST_TERMS).map(f64::from) {
            bound *= largest * turn / order;
            // In units of the highest frequency, so that no power overflows.
            for (k, bin) in derivative.iter_mut().enumerate() {
                *bin *= Complex::new(0.0, self.omega(k) / turn);
            }
            let term = chirp_z(&derivative, step, output.len());
            for (((y, power), shift), term) in output.iter_mut().zip(&mut powers).zip(shifts).zip(term) {
                *power *= shift.0 * turn / order;
                *y += *power * term;
            }
            if bound < NEGLIGIBLE_TERM && order > largest * turn {
                break;
            }
        }
        output
    }

    /// The largest shift of [`Periodic::sample_near`] that keeps its digits.
    pub fn most_shift(&self) -> FastPeriods {
        self.spacing * (MOST_EXPONENT / PI)
    }

    /// Angular frequency of harmonic k, rad per fast period.
    fn omega(&self, k: usize) -> f64 {
        k as f64 * (TAU / self.duration().0)
    }

    /// Coefficients of the filtered harmonics, with their phases at `first`.
    fn filtered(
        &self,
        response: impl Fn(RadiansPerFastPeriod) -> Complex<f64>,
        first: FastPeriods,
    ) -> Vec<Complex<f64>> {
        let first = first / self.duration();
        let coefficient = |(k, bin): (usize, &Complex<f64>)| {
            let weight = if k == 0 { 1.0 } else { 2.0 };
            bin * response(RadiansPerFastPeriod(self.omega(k))) * Complex::from_polar(weight, phase(k, first))
        };
        self.spectrum.iter().enumerate().map(coefficient).collect()
    }
}

/// 2 pi k turn modulo 2 pi; k is multiplied by the fraction of the turn alone, or digits would be lost.
fn phase(k: usize, turn: f64) -> f64 {
    TAU * (k as f64 * turn.fract()).fract()
}

/// y[n] = Re sum_k c_k e^{2 pi j k n turn}, n = 0 .. count.
///
/// k n = (k^2 + n^2 - (n - k)^2) / 2 makes the sum a convolution with a chirp.
fn chirp_z(c: &[Complex<f64>], turn: f64, count: usize) -> Vec<f64> {
    let size = (c.len() + count - 1).next_power_of_two();
    let mut signal = vec![Complex::ZERO; size];
    for (k, (slot, value)) in signal.iter_mut().zip(c).enumerate() {
        *slot = value * half_square(k, turn);
    }
    let mut kernel = vec![Complex::ZERO; size];
    for n in 0..count.max(c.len()) {
        let value = half_square(n, turn).conj();
        if n < count {
            kernel[n] = value;
        }
        if n > 0 && n < c.len() {
            kernel[size - n] = value;
        }
    }
    let sum = fourier::circular_convolution(signal, kernel);
    (0..count).map(|n| (sum[n] * half_square(n, turn)).re / size as f64).collect()
}

/// e^{j pi n^2 turn}. Both products are exact: a fused multiply-add recovers the rounding error of each.
/// Plain products would lose the digits of the phase in recordings of millions of samples.
fn half_square(n: usize, turn: f64) -> Complex<f64> {
    let n = n as f64;
    let once = n * turn;
    let once_error = n.mul_add(turn, -once);
    let reduced = once.rem_euclid(2.0);
    let twice = n * reduced;
    let twice_error = n.mul_add(reduced, -twice);
    Complex::from_polar(1.0, PI * (twice.rem_euclid(2.0) + twice_error + n * once_error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::FilterSpec;
    use crate::units::Seconds;

    fn filter() -> StrictlyProper {
        let written = FilterSpec::TransferFunction { num: vec![0.25], den: vec![1.0, 1.0, 0.25] };
        StrictlyProper::new(&written, Seconds(1.0)).unwrap()
    }

    fn instants(first: f64, step: f64, count: usize) -> Instants {
        Instants { first: FastPeriods(first), step: FastPeriods(step), count }
    }

    fn response(w: f64) -> Complex<f64> {
        filter().response(RadiansPerFastPeriod(w))
    }

    /// The definition: one sum over the harmonics for each instant.
    fn definition(samples: &[f64], spacing: f64, t: f64) -> f64 {
        let l = samples.len();
        let coefficient = |k: usize| -> Complex<f64> {
            samples
                .iter()
                .enumerate()
                .map(|(n, x)| Complex::from_polar(*x, -TAU * (k * n % l) as f64 / l as f64))
                .sum()
        };
        (0..=l / 2)
            .map(|k| {
                let w = TAU * k as f64 / (l as f64 * spacing);
                let weight = if k == 0 || 2 * k == l { 1.0 } else { 2.0 };
                (coefficient(k) * response(w) * Complex::from_polar(weight / l as f64, w * t)).re
            })
            .sum()
    }

    #[test]
    fn agrees_with_the_definition_for_any_rates() {
        for (length, spacing, first, step) in
            [(16, 1.0, -1.2, 2.0), (15, 1.0, 0.0, 3.0), (21, 0.91, -0.6, 2.0), (1, 1.0, 0.5, 2.0)]
        {
            let samples: Vec<f64> = (0..length).map(|n| ((n * n) as f64).sin()).collect();
            let ours =
                Periodic::new(&samples, FastPeriods(spacing)).sample(&filter(), instants(first, step, 9));
            for (n, value) in ours.iter().enumerate() {
                let reference = definition(&samples, spacing, first + n as f64 * step);
                assert!((value - reference).abs() < 1e-12, "{length} {n}: {value} {reference}");
            }
        }
    }

    #[test]
    fn a_long_recording_keeps_its_digits() {
        let length = 300_007;
        let w = TAU * 1234.0 / length as f64;
        let samples: Vec<f64> = (0..length).map(|n| (w * n as f64).cos()).collect();
        let ours =
            Periodic::new(&samples, FastPeriods(1.0)).sample(&filter(), instants(-0.6, 2.0, length / 2));
        let gain = response(w);
        for (n, value) in ours.iter().enumerate().step_by(977) {
            let exact = (gain * Complex::from_polar(1.0, w * (2.0 * n as f64 - 0.6))).re;
            assert!((value - exact).abs() < 1e-9, "{n}: {value} {exact}");
        }
    }

    #[test]
    fn an_empty_recording_is_the_zero_signal() {
        let empty = Periodic::new(&[], FastPeriods(1.0));
        assert_eq!(empty.sample(&filter(), instants(0.0, 1.0, 3)), vec![0.0; 3]);
    }
}
