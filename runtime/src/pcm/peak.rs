//! The largest magnitude of samples.

use crate::Sample;
use crate::sample::same;

/// Magnitude bits of floats: those of all but NaN are in the order of the magnitudes.
const MAGNITUDE_32: u32 = u32::MAX >> 1;
const MAGNITUDE_64: u64 = u64::MAX >> 1;

/// The largest magnitude of `samples`; 0 for none.
pub(crate) fn peak<T: Sample>(samples: &[T]) -> f64 {
    if let Some(samples) = same::<T, f32>(samples) {
        let bits = samples.iter().map(|x| x.to_bits() & MAGNITUDE_32).max();
        return f32::from_bits(bits.unwrap_or(0)).into();
    }
    let bits = same::<T, f64>(samples).unwrap_or_default().iter().map(|x| x.to_bits() & MAGNITUDE_64).max();
    f64::from_bits(bits.unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_peak_is_the_largest_magnitude() {
        assert_eq!(peak(&[0.0f32, 0.25, -0.75, 0.5]), 0.75);
        assert_eq!(peak(&[0.0f64, 1.25, -0.75]), 1.25);
        assert_eq!((peak::<f32>(&[]), peak::<f64>(&[])), (0.0, 0.0));
    }
}
