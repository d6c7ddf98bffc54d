//! Impulse responses and frequency responses of synthesis filters and front ends, for those who look at
//! them.

use super::problem::{Channel, Problem};
use super::{DesignError, LiftedPlant, filters};
use crate::lti::FirMatrix;
use hybank_core::bank::{Bank, SynthesisFilters};
use hybank_core::units::{GridTime, Hertz, RadiansPerFastPeriod, RadiansPerSlowPeriod};
use hybank_linalg::Complex;
use std::f64::consts::PI;

/// Energy of a recursive filter's response beyond which it counts as over, relative to all of it.
const TAIL_ENERGY: f64 = 1e-12;
/// Slow periods of a recursive filter's response that are computed at most.
const MOST_PERIODS: usize = 4096;

/// The impulse responses `f_i[n]` of the synthesis filters at the fast rate, all of one length. That of a
/// recursive filter ends where 1e-12 of its energy is left, or after 4,096 slow periods.
pub fn impulse_responses(bank: &Bank) -> Vec<Vec<f64>> {
    let fir = match &bank.filters {
        SynthesisFilters::Fir(taps) => return taps.clone(),
        SynthesisFilters::StateSpace(_) => lags_of_recursion(bank),
    };
    fir.impulse_responses(fir.lags().len() * bank.ratio)
}

/// F_0 = D, F_j = C A^(j-1) B.
fn lags_of_recursion(bank: &Bank) -> FirMatrix {
    let system = filters::lifted(&bank.filters, bank.ratio);
    let mut lags = vec![system.d().clone()];
    let mut state = system.b().clone();
    let mut energies = vec![system.d().norm_squared()];
    for _ in 1..MOST_PERIODS {
        let lag = system.c() * &state;
        energies.push(lag.norm_squared());
        lags.push(lag);
        state = system.a() * state;
    }
    let total: f64 = energies.iter().sum();
    let mut left = 0.0;
    let tail = energies.iter().rev().take_while(|&&energy| {
        left += energy;
        left <= TAIL_ENERGY * total
    });
    let kept = lags.len() - tail.count();
    lags.truncate(kept.max(1));
    FirMatrix::new(lags)
}

/// `F(e^{j w}) = sum_n f[n] e^{-j w n}` and its group delay, `-d arg F / d w`, in fast samples.
pub fn fir_response(taps: &[f64], w: RadiansPerFastPeriod) -> (Complex<f64>, f64) {
    let (mut response, mut moment) = (Complex::<f64>::ZERO, Complex::<f64>::ZERO);
    for (n, tap) in taps.iter().enumerate() {
        let value = Complex::from_polar(*tap, -w.0 * n as f64);
        (response, moment) = (response + value, moment + value * n as f64);
    }
    (response, (moment / response).re)
}

/// |Phi(2 pi f)| of the target and of each channel, gains included, at these frequencies.
///
/// # Errors
/// [`DesignError::NoSpec`] for a bank without front ends.
pub fn front_end_gains(bank: &Bank, frequencies: &[Hertz]) -> Result<Vec<Vec<f64>>, DesignError> {
    let problem = Problem::of_bank(bank)?;
    let first: Vec<usize> = problem.converters().into_iter().map(|channels| channels.start).collect();
    let gains = |frequency: &Hertz| {
        let w = frequency.angular().per_fast_period(bank.fast_period);
        let gain = |front_end: usize| problem.front_ends[front_end].response(w).norm();
        let converters = first.iter().map(|&i| &problem.channels[i]);
        let channels = converters.map(|channel| channel.gain.abs() * gain(channel.front_end));
        std::iter::once(gain(problem.target)).chain(channels).collect()
    };
    Ok(frequencies.iter().map(gains).collect())
}

/// The gains `||H_i(e^{j w})||` of the norm-equivalent analysis filters (thesis 5.16) of the target and of
/// each channel at the fast rate, gains included, at these frequencies of at most 1/(2 h).
///
/// H_i is a row whose entries depend on the choice of a square root; its norm does not. It is the gain of
/// the front end with all its aliases: the square is the sum over k of `|Phi_i(j (w + 2 pi k))|^2`.
///
/// # Errors
/// As [`front_end_gains`].
pub fn analysis_gains(bank: &Bank, frequencies: &[Hertz]) -> Result<Vec<Vec<f64>>, DesignError> {
    let problem = Problem::of_bank(bank)?;
    // Delays change the phase only, and noise is none of the front ends'.
    let delay = GridTime::fast_sample(0.0, problem.fast_period);
    let undelayed = |channel: &Channel| Channel { delay, ..*channel };
    let first = problem.converters().into_iter().map(|channels| &problem.channels[channels.start]);
    let channels: Vec<Channel> = first.map(undelayed).collect();
    let noise = vec![0.0; channels.len()];
    let plant = LiftedPlant::new(&Problem { ratio: 1, latency: 0, channels, noise, ..problem });
    let gains = |frequency: &Hertz| {
        let point = plant.at(frequency.angular().per_fast_period(bank.fast_period).0);
        point.w.row_iter().chain(point.h.row_iter()).map(|row| row.norm()).collect()
    };
    Ok(frequencies.iter().map(gains).collect())
}

/// The largest singular value of the error system K = W - F H at `points` equidistant frequencies from 0 to
/// 1/(2 M h), with these frequencies.
///
/// Gamma is the maximum over all frequencies. A frequency stands for all that alias to it in the slow
/// samples. The values are in normalised time (h = 1). One point is the frequency 0.
///
/// # Errors
/// [`DesignError::NoSpec`] for a bank without front ends, [`DesignError::TooLate`] for delays that need too
/// many delay-chain states.
pub fn error_response(bank: &Bank, points: usize) -> Result<Vec<(Hertz, f64)>, DesignError> {
    let problem = Problem::of_bank(bank)?;
    problem.check_size()?;
    let plant = LiftedPlant::new(&problem);
    let filters = filters::FilterResponse::new(&bank.filters, bank.ratio)?;
    let step = PI / points.saturating_sub(1).max(1) as f64;
    let at = |k: usize| {
        let omega = step * k as f64;
        let gain = hybank_linalg::largest_singular_value(&plant.at(omega).error(&filters.at(omega)))?;
        Ok((RadiansPerSlowPeriod(omega).in_hertz(bank.slow_period()), gain))
    };
    (0..points).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::designed;
    use hybank_core::bank::StateMatrices;
    use std::f64::consts::TAU;

    /// The sum over 20,000 aliases on either side; the rest is below (0.5 / (2 pi 20,000))^3.
    #[test]
    fn analysis_filters_are_the_front_ends_with_their_aliases() {
        let text = "fast_period = 0.5\nratio = 2\nlatency = 4\n\
             channel = [{ delay = 0.6, gain = -2.0 }, { delay = 0.1 }]\n\
             target = { filter = { num = [1.0], den = [1.0, 2.0, 1.0] } }\ndesign = { method = \"sinc\", taps = 4 }";
        let spec = hybank_core::spec::Spec::from_toml(text, "spec.toml").unwrap();
        let bank = designed(&spec).bank;
        let frequencies = [0.0, 0.25, 0.5, 0.75, 1.0].map(Hertz);
        for (hertz, gains) in frequencies.iter().zip(analysis_gains(&bank, &frequencies).unwrap()) {
            // h = 0.5: 1 / (s + 1)^2 is 0.25 / (s + 0.5)^2 in fast periods.
            let square = |w: f64| (0.25 / (w * w + 0.25)).powi(2);
            let w = TAU * hertz.0 * 0.5;
            let sum: f64 = (-20_000..=20_000).map(|k| square(w + TAU * f64::from(k))).sum();
            for (gain, factor) in gains.iter().zip([1.0, 2.0, 1.0]) {
                assert!((gain / (factor * sum.sqrt()) - 1.0).abs() < 1e-9, "{hertz:?} {gains:?} {sum}");
            }
        }
    }

    #[test]
    fn a_recursion_has_the_impulse_response_of_its_closed_form() {
        // y[k] = sum_j 0.5^j x[k - j] at phase 0, the input itself at phase 1.
        let block = StateMatrices {
            a: vec![vec![0.5]],
            b: vec![vec![0.5]],
            c: vec![vec![1.0], vec![0.0]],
            d: vec![vec![1.0], vec![1.0]],
        };
        let bank = Bank::bare(SynthesisFilters::StateSpace(block), 2);
        let responses = impulse_responses(&bank);
        let want = |n: usize| {
            if n == 1 {
                1.0
            } else if n % 2 == 1 {
                0.0
            } else {
                0.5_f64.powi(n as i32 / 2)
            }
        };
        assert!(responses[0].iter().enumerate().all(|(n, x)| (x - want(n)).abs() < 1e-15), "{responses:?}");
        // 0.25^20 is just below 1e-12.
        assert!((38..=42).contains(&responses[0].len()), "{}", responses[0].len());
    }

    #[test]
    fn a_delay_has_its_delay_at_every_frequency() {
        for w in [0.0, 0.3, 3.0] {
            let (response, delay) = fir_response(&[0.0, 0.0, -2.0], RadiansPerFastPeriod(w));
            assert!((response.norm() - 2.0).abs() < 1e-12 && (delay - 2.0).abs() < 1e-12, "{w}");
        }
        // A symmetric filter has half its length.
        let (_, delay) = fir_response(&[1.0, 2.0, 2.0, 1.0], RadiansPerFastPeriod(0.4));
        assert!((delay - 1.5).abs() < 1e-12);
    }

    #[test]
    fn front_ends_have_their_cutoffs() {
        let bank =
            Bank::from_json(include_str!("../../../filters/interleaved-4x250M.json"), "bank.json").unwrap();
        // A quarter of the fast rate is the target's cutoff; above half of it the filter goes on.
        let gains = front_end_gains(&bank, &[Hertz(0.0), Hertz(250e6), Hertz(2.5e9)]).unwrap();
        assert!(gains[0].iter().all(|gain| (gain - 1.0).abs() < 1e-9) && gains[1].len() == 5);
        assert!((gains[1][0] - 0.5_f64.sqrt()).abs() < 1e-9, "{gains:?}");
        assert!((gains[2][0] - (1.0 + 1e8_f64).powf(-0.5)).abs() < 1e-12, "{gains:?}");
    }

    /// The definition: the whole error system, evaluated by a solve at each frequency.
    #[test]
    fn the_gains_are_those_of_the_error_system_for_fir_and_recursive_banks() {
        for text in [
            include_str!("../../../filters/thesis-fir.json"),
            include_str!("../../../filters/thesis-iir.json"),
        ] {
            let bank = Bank::from_json(text, "bank.json").unwrap();
            let plant = LiftedPlant::new(&Problem::of_bank(&bank).unwrap());
            let error = plant.error_system(&filters::lifted(&bank.filters, bank.ratio));
            let points = error_response(&bank, 9).unwrap();
            assert_eq!(points.len(), 9);
            for (k, (hertz, gain)) in points.iter().enumerate() {
                let omega = PI * k as f64 / 8.0;
                let want =
                    hybank_linalg::singular_values(&error.response_at(Complex::from_polar(1.0, omega)))
                        .unwrap()[0];
                assert!((gain - want).abs() < 1e-9 * (1.0 + want), "{k}: {gain} {want}");
                let nyquist = 0.5 / bank.slow_period().0;
                assert!((hertz.0 - nyquist * k as f64 / 8.0).abs() < 1e-12 * nyquist, "{k}: {hertz:?}");
                assert!(*gain <= bank.gamma.upper.unwrap());
            }
        }
    }

    #[test]
    fn a_bank_without_front_ends_is_refused_and_one_point_is_direct_current() {
        let bare = Bank::bare(SynthesisFilters::Fir(vec![vec![1.0]]), 1);
        assert_eq!(error_response(&bare, 2), Err(DesignError::NoSpec));
        let bank = Bank::from_json(include_str!("../../../filters/thesis-fir.json"), "bank.json").unwrap();
        assert_eq!(error_response(&bank, 1).unwrap()[0].0, Hertz(0.0));
        assert_eq!(error_response(&bank, 0).unwrap(), []);
    }
}
