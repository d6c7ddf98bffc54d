//! The exposures of views: factors for their colours, and what of these drifts from view to view.

/// A number for each of red, green and blue; the same ones for grey.
pub type Exposure = [f64; 3];

/// From this difference of logarithms on nothing drifts.
///
/// Whether the exposure between two views lies between theirs, two photographs do not show. On "Cones" red
/// and green of im6 are 3 % brighter than those of im2, and those between lie between: without drift the
/// view has 28.76 dB, with this one 29.24. On "poster1", with a factor of 0.965 on one photograph and the
/// exposure of the other one, it costs 0.6 dB.
const DRIFT: f64 = 0.035;

/// The share of a part of the factors that drifts: 1 - (d / [`DRIFT`])^4, with d the largest of the
/// logarithms. So nearly all of a small difference drifts, and no difference changes the view by a jump.
fn share(gains: &[Exposure], part: impl Fn(&Exposure) -> f64) -> f64 {
    let largest = gains.iter().map(|gain| part(gain).abs()).fold(0.0, f64::max);
    (1.0 - (largest / DRIFT).powi(4)).max(0.0)
}

/// The logarithms of the factors as far as they drift: of the brightness, and of each colour beside it.
pub(super) fn drifts(gains: &[Exposure]) -> Vec<Exposure> {
    let beside = |gain: &Exposure, c: usize| gain[c].ln() - ln_brightness(gain);
    let common = share(gains, ln_brightness);
    let own: Exposure = std::array::from_fn(|c| share(gains, |gain| beside(gain, c)));
    let drift =
        |gain: &Exposure| std::array::from_fn(|c| common * ln_brightness(gain) + own[c] * beside(gain, c));
    gains.iter().map(drift).collect()
}

/// Factors that give photographs one exposure, each with its own drift.
pub(crate) fn without_drift(gains: &[Exposure]) -> Vec<Exposure> {
    let factors = |(gain, drift): (&Exposure, Exposure)| std::array::from_fn(|c| gain[c] * (-drift[c]).exp());
    gains.iter().zip(drifts(gains)).map(factors).collect()
}

fn ln_brightness(gain: &Exposure) -> f64 {
    gain.map(f64::ln).iter().sum::<f64>() / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The brightness of the second view differs by more than drift, and red beside it by little.
    #[test]
    fn large_differences_are_taken_out_and_small_ones_stay() {
        let gains = [[1.0; 3], [1.2 * 1.005, 1.2, 1.2 / 1.005]];
        let found = without_drift(&gains);
        assert_eq!(found[0], [1.0; 3]);
        assert!(found[1].iter().all(|factor| (factor - 1.2).abs() < 1e-5), "{found:?}");
        assert!(without_drift(&[]).is_empty());
    }

    /// From no difference to a large one the factor follows without a jump, up to that of the difference.
    #[test]
    fn drift_ends_without_a_jump() {
        let factor = |step: i32| without_drift(&[[1.0; 3], [(f64::from(step) * 1e-4).exp(); 3]])[1][0];
        let steps: Vec<f64> = (-500..500).map(|step| factor(step + 1) / factor(step)).collect();
        assert!(steps.iter().all(|ratio| (1.0 - 1e-12..1.0 + 6e-4).contains(ratio)), "{steps:?}");
        assert!((factor(100) - 1.0).abs() < 1e-4 && (factor(400).ln() - 0.04).abs() < 1e-12);
    }
}
