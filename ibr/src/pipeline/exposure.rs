//! The exposures of views: factors for their colours, and what of these drifts from view to view.

/// A number for each of red, green and blue; the same ones for grey.
pub type Exposure = [f64; 3];

/// Logarithms of brightness and colours that differ by less drift, as those of one camera do. On "Cones" red
/// and green of im6 are 3 % brighter than those of im2, and those of the photographs between lie between.
const DRIFT: f64 = 0.04;

/// The logarithms of those parts of the factors that drift: of the brightness, where it differs little in
/// all views, and of each colour beside the brightness likewise; 0 for other parts.
pub(super) fn drifts(gains: &[Exposure]) -> Vec<Exposure> {
    let is_small = |part: &dyn Fn(&Exposure) -> f64| gains.iter().all(|gain| part(gain).abs() < DRIFT);
    let common = if is_small(&ln_brightness) { 1.0 } else { 0.0 };
    let beside = |gain: &Exposure, c: usize| gain[c].ln() - ln_brightness(gain);
    let own: Exposure = std::array::from_fn(|c| if is_small(&|gain| beside(gain, c)) { 1.0 } else { 0.0 });
    let drift =
        |gain: &Exposure| std::array::from_fn(|c| common * ln_brightness(gain) + own[c] * beside(gain, c));
    gains.iter().map(drift).collect()
}

/// Factors that give photographs one exposure, each with its own drift.
pub(crate) fn without_drift(gains: &[Exposure]) -> Vec<Exposure> {
    let factors = |(gain, drift): (&Exposure, Exposure)| std::array::from_fn(|c| gain[c] * (-drift[c]).exp());
    gains.iter().zip(drifts(gains)).map(factors).collect()
}

/// Logarithm of the common factor of the colours.
fn ln_brightness(gain: &Exposure) -> f64 {
    gain.map(f64::ln).iter().sum::<f64>() / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The brightness of the second view differs by more than drift; red beside it by less.
    #[test]
    fn large_differences_are_taken_out_and_drift_stays() {
        let gains = [[1.0; 3], [1.2 * 1.02, 1.2, 1.2 / 1.02]];
        let found = without_drift(&gains);
        assert_eq!(found[0], [1.0; 3]);
        assert!(found[1].iter().all(|factor| (factor - 1.2).abs() < 1e-12), "{found:?}");
        let small = [[1.0; 3], [1.03; 3]];
        assert!(without_drift(&small)[1].iter().all(|factor| (factor - 1.0).abs() < 1e-12));
        assert!(without_drift(&[]).is_empty());
    }
}
