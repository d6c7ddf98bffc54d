//! The ends of the range of a converter.

/// The lowest and the highest value of samples, at which they clip: those of their format. If no sample is
/// beyond full scale, and all are multiples of the distance q from the largest one to 1, a power of two,
/// they are the steps of a converter and the rails are -1 and 1 - q. `None` for floats some of which are
/// beyond.
///
/// ```
/// use hybank_core::io::rails_of;
/// let of = |samples: &[f64]| rails_of(samples.iter().copied(), None);
/// assert_eq!(of(&[-1.0, 0.3, 0.5]), Some((-1.0, 1.0)));
/// assert_eq!(of(&[-1.0, 0.25, 0.875]), Some((-1.0, 0.875)));
/// assert_eq!(of(&[-1.0, 1.5]), None);
/// ```
pub fn rails_of(
    samples: impl Iterator<Item = f64> + Clone,
    of_format: Option<(f64, f64)>,
) -> Option<(f64, f64)> {
    if samples.clone().any(|x| x.abs() > 1.0) {
        return of_format;
    }
    let top = samples.clone().fold(f64::NEG_INFINITY, f64::max);
    let step = 1.0 - top;
    let is_code = |x: f64| x.is_nan() || (x / step).fract() == 0.0;
    let is_quantised = step > 0.0 && step.log2().fract() == 0.0 && samples.clone().all(is_code);
    if is_quantised { Some((-1.0, top)) } else { of_format.or(Some((-1.0, 1.0))) }
}
