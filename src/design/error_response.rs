//! The error of a bank by frequency.

use super::DesignError;
use super::analysis::bank_problem;
use super::filters::FilterResponse;
use super::plant::LiftedPlant;
use crate::bank::Bank;
use crate::linalg;
use crate::units::{Hertz, RadiansPerSlowPeriod};
use std::f64::consts::PI;

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
    let problem = bank_problem(bank)?;
    problem.check_size()?;
    let plant = LiftedPlant::new(&problem)?;
    let filters = FilterResponse::new(bank)?;
    let step = PI / points.saturating_sub(1).max(1) as f64;
    let at = |k: usize| {
        let omega = step * k as f64;
        let (h, w) = plant.response(omega);
        let gain = linalg::largest_singular_value(&(w - filters.at(omega) * h))?;
        Ok((RadiansPerSlowPeriod(omega).in_hertz(bank.slow_period()), gain))
    };
    (0..points).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bank::SynthesisFilters;
    use crate::design::filters;
    use crate::linalg::Complex;

    /// The definition: the whole error system, evaluated by a solve at each frequency.
    #[test]
    fn the_gains_are_those_of_the_error_system_for_fir_and_recursive_banks() {
        for text in
            [include_str!("../../filters/thesis-fir.json"), include_str!("../../filters/thesis-iir.json")]
        {
            let bank = Bank::from_json(text, "bank.json").unwrap();
            let plant = LiftedPlant::new(&bank_problem(&bank).unwrap()).unwrap();
            let error = plant.error_system(&filters::lifted(&bank.filters, bank.ratio).unwrap()).unwrap();
            let points = error_response(&bank, 9).unwrap();
            assert_eq!(points.len(), 9);
            for (k, (hertz, gain)) in points.iter().enumerate() {
                let omega = PI * k as f64 / 8.0;
                let want =
                    linalg::singular_values(&error.response_at(Complex::from_polar(1.0, omega))).unwrap()[0];
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
        let bank = Bank::from_json(include_str!("../../filters/thesis-fir.json"), "bank.json").unwrap();
        assert_eq!(error_response(&bank, 1).unwrap()[0].0, Hertz(0.0));
        assert_eq!(error_response(&bank, 0).unwrap(), []);
    }
}
