//! The methods that the demo compares, one of them the cubic spline through all slow samples in the order of
//! their instants.

use super::print::{Failure, failed, stopped};
use hybank::bank::Bank;
use hybank::design::{self, Problem};
use hybank::pipeline::{DroppedLatency, Settings, fused};
use hybank::simulate::{Captured, interleaved};
use hybank::spec::{DesignSpec, Method, Spec};
use hybank::units::{Decibels, FastPeriods};

/// Fast samples at the beginning that the error does not include, while the history of the filters fills.
pub(super) const SETTLING: usize = 2000;

/// The captures of the two parts of the signal. Everything here is linear, so each part has its own error.
pub(super) struct PartCaptures {
    /// Within the band of the spec.
    pub(super) in_band: Captured,
    /// Most of it within the band, and a little at all frequencies.
    pub(super) step: Captured,
}

impl PartCaptures {
    /// Both together.
    pub(super) fn sum(&self) -> Captured {
        let sum = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a + b).collect();
        let channels = self.in_band.channels.iter().zip(&self.step.channels);
        Captured {
            channels: channels.map(|(a, b)| sum(a, b)).collect(),
            target: sum(&self.in_band.target, &self.step.target),
        }
    }
}

/// A method of design, and whether it knows the band of the signal.
struct BankOf {
    name: &'static str,
    file: &'static str,
    method: Method,
    knows_the_band: bool,
}

/// The banks, the best one first.
const BANKS: [BankOf; 5] = [
    BankOf { name: "hybank, FIR 24 taps, with band", file: "fir", method: Method::Fir, knows_the_band: true },
    BankOf { name: "hybank, IIR, with band", file: "iir", method: Method::Iir, knows_the_band: true },
    BankOf {
        name: "hybank, FIR 24 taps, any input",
        file: "any",
        method: Method::Fir,
        knows_the_band: false,
    },
    BankOf {
        name: "separate delays, 24 taps",
        file: "separation",
        method: Method::Separation,
        knows_the_band: false,
    },
    BankOf { name: "sinc interpolation, 24 taps", file: "sinc", method: Method::Sinc, knows_the_band: false },
];

/// One method with its fused samples and their errors.
#[derive(Debug, serde::Serialize)]
pub(super) struct Contender {
    pub(super) name: &'static str,
    pub(super) file: String,
    pub(super) gamma: Option<f64>,
    /// For the chirp and the tones.
    pub(super) in_band: ContenderError,
    pub(super) step: ContenderError,
    /// Of the whole signal.
    #[serde(skip)]
    pub(super) samples: Vec<f64>,
}

/// The error against the exact fast samples.
#[derive(Debug, serde::Serialize)]
pub(super) struct ContenderError {
    pub(super) rmse: f64,
    pub(super) max_error: f64,
    /// 20 log10(rms of the target / rmse).
    pub(super) snr_db: Decibels,
}

/// The banks in the order of [`BANKS`], the spline, and plain interleaving last.
pub(super) fn contend(
    spec: &Spec,
    problem: &Problem,
    parts: &PartCaptures,
) -> Result<Vec<Contender>, Failure> {
    let mut contenders = Vec::new();
    for BankOf { name, file, method, knows_the_band } in BANKS {
        let bank = designed(spec, method, knows_the_band)?;
        // The target is as late as the bank.
        let causal = Settings { dropped: DroppedLatency::Added, ..Settings::default() };
        let contender = Contender::judge(name, file, parts, |channels| {
            fused(&bank, channels, causal.clone()).map_err(stopped)
        })?;
        contenders.push(Contender { gamma: bank.gamma.norm, ..contender });
    }
    let (delays, ratio, latency) = (problem.delays(), problem.ratio, problem.latency);
    let first = FastPeriods(-(latency as f64));
    let count = parts.step.target.len();
    contenders.push(Contender::judge("cubic spline through all samples", "spline", parts, |channels| {
        Ok(Samples::merged(&delays, ratio, channels).spline(first, count))
    })?);
    contenders.push(Contender::judge("plain interleaving", "interleaved", parts, |channels| {
        Ok(interleaved(&delays, ratio, latency, channels))
    })?);
    Ok(contenders)
}

fn designed(spec: &Spec, method: Method, knows_the_band: bool) -> Result<Bank, Failure> {
    let mut variant = spec.clone();
    variant.design = DesignSpec::new(method, spec.design.taps.filter(|_| method.has_taps()));
    variant.signal = variant.signal.filter(|_| knows_the_band);
    Ok(design::design(&variant, &design::DesignOptions::without_proof()).map_err(failed)?.bank)
}

impl Contender {
    fn judge(
        name: &'static str,
        file: &str,
        parts: &PartCaptures,
        fuse: impl Fn(&[Vec<f64>]) -> Result<Vec<f64>, Failure>,
    ) -> Result<Self, Failure> {
        let (in_band, step) = (fuse(&parts.in_band.channels)?, fuse(&parts.step.channels)?);
        Ok(Self {
            name,
            file: format!("fused-{file}.wav"),
            gamma: None,
            in_band: ContenderError::of(&in_band, &parts.in_band.target),
            step: ContenderError::of(&step, &parts.step.target),
            samples: in_band.iter().zip(&step).map(|(a, b)| a + b).collect(),
        })
    }
}

impl ContenderError {
    fn of(samples: &[f64], target: &[f64]) -> Self {
        let errors = samples.iter().zip(target).skip(SETTLING).map(|(sample, target)| sample - target);
        let error_power: f64 = errors.clone().map(|error| error * error).sum();
        let power: f64 = target.iter().skip(SETTLING).map(|x| x * x).sum();
        Self {
            rmse: (error_power / (target.len() - SETTLING) as f64).sqrt(),
            max_error: errors.map(f64::abs).fold(0.0, f64::max),
            snr_db: Decibels::of_power(power / error_power),
        }
    }
}

/// Samples at increasing instants.
struct Samples {
    instants: Vec<f64>,
    values: Vec<f64>,
}

impl Samples {
    /// Of channels with the delays D_i: sample k of channel i is taken at k M - D_i.
    fn merged(delays: &[FastPeriods], ratio: usize, channels: &[Vec<f64>]) -> Self {
        let of_channel = |(delay, samples): (&FastPeriods, &Vec<f64>)| {
            let instant = |k: usize| (k * ratio) as f64 - delay.0;
            samples.iter().enumerate().map(|(k, x)| (instant(k), *x)).collect::<Vec<_>>()
        };
        let mut all: Vec<(f64, f64)> = delays.iter().zip(channels).flat_map(of_channel).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        all.dedup_by_key(|sample| sample.0);
        let (instants, values) = all.into_iter().unzip();
        Self { instants, values }
    }

    /// The natural cubic spline at `count` instants, `first` and every fast period after it; before the
    /// first and after the last sample its outer pieces go on.
    fn spline(&self, first: FastPeriods, count: usize) -> Vec<f64> {
        let (t, y) = (&self.instants, &self.values);
        if t.len() < 2 {
            return vec![y.first().copied().unwrap_or(0.0); count];
        }
        let curvatures = self.curvatures();
        let mut piece = 0;
        let at = |n: usize| {
            let x = first.0 + n as f64;
            while piece + 2 < t.len() && t[piece + 1] <= x {
                piece += 1;
            }
            let (width, below, above) = (t[piece + 1] - t[piece], x - t[piece], t[piece + 1] - x);
            let (m, next) = (curvatures[piece], curvatures[piece + 1]);
            let cubic = |m: f64, d: f64| m * (d * d * d / width - width * d) / 6.0;
            (y[piece] * above + y[piece + 1] * below) / width + cubic(m, above) + cubic(next, below)
        };
        (0..count).map(at).collect()
    }

    /// Second derivatives at the samples: h_i m_i-1 + 2 (h_i + h_i+1) m_i + h_i+1 m_i+1 = 6 times the change
    /// of slope, with zeros at the ends. The system is diagonally dominant and needs no pivots.
    fn curvatures(&self) -> Vec<f64> {
        let (t, y) = (&self.instants, &self.values);
        let count = t.len();
        let width = |i: usize| t[i + 1] - t[i];
        let slope = |i: usize| (y[i + 1] - y[i]) / width(i);
        // After elimination m_i = value_i - factor_i m_i+1.
        let (mut factors, mut values) = (vec![0.0; count], vec![0.0; count]);
        for i in 1..count - 1 {
            let pivot = 2.0 * (width(i - 1) + width(i)) - width(i - 1) * factors[i - 1];
            factors[i] = width(i) / pivot;
            values[i] = (6.0 * (slope(i) - slope(i - 1)) - width(i - 1) * values[i - 1]) / pivot;
        }
        for i in (1..count - 1).rev() {
            values[i] -= factors[i] * values[i + 1];
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(f: impl Fn(f64) -> f64) -> Samples {
        let delays = [FastPeriods(1.2), FastPeriods(0.6)];
        let channel = |delay: &FastPeriods| (0..60).map(|k| f(f64::from(2 * k) - delay.0)).collect();
        let channels: Vec<Vec<f64>> = delays.iter().map(channel).collect();
        Samples::merged(&delays, 2, &channels)
    }

    /// The influence of the ends falls by 2 + sqrt 3 per sample or so.
    #[test]
    fn a_cubic_is_its_own_spline_away_from_the_ends() {
        let cubic = |t: f64| 1.0 + t * (0.5 - t * (0.01 - 1e-4 * t));
        let (first, values) = (FastPeriods(40.25), samples(cubic).spline(FastPeriods(40.25), 40));
        for (n, value) in values.iter().enumerate() {
            let want = cubic(first.0 + n as f64);
            assert!((value - want).abs() < 1e-9 * want.abs(), "{n}: {value} instead of {want}");
        }
    }

    #[test]
    fn a_spline_goes_through_its_samples() {
        let wild = |t: f64| (1.7 * t).sin() + (0.3 * t * t).cos();
        let own = samples(wild).spline(FastPeriods(0.8), 50);
        for k in 0..25 {
            let instant = 2.0 * f64::from(k) + 0.8;
            assert!((own[2 * k as usize] - wild(instant)).abs() < 1e-12, "{instant}");
        }
    }

    #[test]
    fn few_samples_are_a_line_or_a_constant() {
        let two = Samples { instants: vec![0.0, 2.0], values: vec![1.0, 2.0] };
        assert_eq!(two.spline(FastPeriods(0.0), 4), [1.0, 1.5, 2.0, 2.5]);
        let one = Samples { instants: vec![0.0], values: vec![3.0] };
        assert_eq!(one.spline(FastPeriods(0.0), 2), [3.0, 3.0]);
    }
}
