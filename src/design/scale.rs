//! A scale for gamma: what the simplest banks reach with the same front ends, delays and latency.

use super::DesignError;
use super::analysis::bank_problem;
use super::interleaving::nearest_samples;
use super::plant::LiftedPlant;
use super::problem::Problem;
use crate::bank::Bank;
use crate::linalg::Mat;
use crate::lti::StateSpace;
use crate::lti::gramian::h2_norm;

/// gamma of the simplest banks, h = 1, and the size of the reference.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct GammaScale {
    /// gamma of a bank whose output is zero: the largest gain from the analog input to the reference.
    pub zero_output: f64,
    /// gamma of plain interleaving: each output sample is the slow sample nearest to its instant.
    pub interleaving: f64,
    /// Root mean square of the reference for white noise f of unit density. With `rms_error` it gives the
    /// signal-to-noise ratio of a signal with the target's spectrum.
    pub rms_reference: f64,
}

impl GammaScale {
    /// Of the front ends, delays and latency of `bank`.
    ///
    /// # Errors
    /// [`DesignError::NoSpec`] for a bank without front ends, [`DesignError::TooLate`] for delays that need
    /// too many delay-chain states.
    pub fn new(bank: &Bank) -> Result<Self, DesignError> {
        let problem = bank_problem(bank)?;
        let plant = LiftedPlant::new(&problem)?;
        let zero = StateSpace::gain(Mat::zeros(problem.ratio, problem.channels.len()));
        let reference = plant.reference()?;
        Ok(Self {
            zero_output: plant.norm(&zero)?.gain,
            interleaving: plant.fir_norm(&interleaving(&problem))?.gain,
            rms_reference: h2_norm(&reference)? / (problem.ratio as f64).sqrt(),
        })
    }
}

/// The taps of plain interleaving: one tap of 1 for each of the M phases.
fn interleaving(problem: &Problem) -> Vec<Vec<f64>> {
    let nearest = nearest_samples(&problem.delays(), problem.ratio, problem.latency, 0);
    let lags = 1 + nearest.iter().map(|sample| sample.lag as usize).max().unwrap_or(0);
    let mut taps = vec![vec![0.0; lags * problem.ratio]; problem.channels.len()];
    for (phase, sample) in nearest.into_iter().enumerate() {
        taps[sample.channel][sample.lag as usize * problem.ratio + phase] = 1.0;
    }
    taps
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::design;
    use crate::spec::Spec;

    fn bank(channels: &str, latency: usize) -> Bank {
        let text = format!(
            "fast_period = 1.0\nratio = 2\nlatency = {latency}\nchannel = [{channels}]\n\
             target = {{ filter = {{ num = [0.25], den = [1.0, 1.0, 0.25] }} }}\n\
             design = {{ method = \"iir\" }}"
        );
        design(&Spec::from_toml(&text, "spec.toml").unwrap()).unwrap().bank
    }

    /// Converters that sample exactly in turn have the ideal samples: plain interleaving makes no error.
    #[test]
    fn interleaving_of_perfect_converters_is_exact() {
        for latency in [1, 2, 7] {
            let bank = bank("{ delay = 1.0 }, { delay = 0.0 }", latency);
            let scale = GammaScale::new(&bank).unwrap();
            assert!(scale.interleaving < 1e-12, "{latency}: {scale:?}");
        }
    }

    /// The gain to the lifted reference is largest at frequency 0, where all of its M samples agree: it is
    /// the norm of the samples of |Phi|^2 that alias there, sum_k |Phi(2 pi k)|^2.
    #[test]
    fn the_gamma_of_zero_output_is_that_of_the_aliases_of_the_reference() {
        let scale = GammaScale::new(&bank("{ delay = 1.2 }, { delay = 0.6 }", 4)).unwrap();
        let phi = |w: f64| 0.25 / (w * w + 0.25);
        let sum: f64 = (-2000..=2000).map(|k| phi(std::f64::consts::TAU * f64::from(k)).powi(2)).sum();
        assert!((scale.zero_output - sum.sqrt()).abs() < 1e-9, "{scale:?} {}", sum.sqrt());
        // int |Phi|^2 dw / 2 pi = wc / 4 for wc^2 / (s + wc)^2.
        assert!((scale.rms_reference - (0.5_f64 / 4.0).sqrt()).abs() < 1e-12, "{scale:?}");
        assert!(scale.interleaving < scale.zero_output && scale.interleaving > 0.04, "{scale:?}");
    }

    #[test]
    fn the_taps_pick_the_nearest_samples() {
        let bank = bank("{ delay = 1.4 }, { delay = 0.2 }", 3);
        let taps = interleaving(&bank_problem(&bank).unwrap());
        // Instants -3 and -2: the samples at -3.4 and -2.2.
        assert_eq!(taps, [vec![0.0, 0.0, 1.0, 0.0], vec![0.0, 0.0, 0.0, 1.0]]);
    }
}
