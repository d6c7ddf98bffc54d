//! A quantiser of full scale 1.

/// A quantiser of B bits: codes -2^(B-1) .. 2^(B-1) - 1 in steps of 2^(1-B), zero among them, rounded to the
/// nearest one, ties to even. What lies beyond saturates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Quantiser {
    bits: u32,
}

impl Quantiser {
    /// Fewest bits: sign and one more.
    pub const LEAST_BITS: u32 = 2;
    /// Most bits: every code is a 32-bit float.
    pub const MOST_BITS: u32 = 24;

    /// `None` unless `bits` are [`LEAST_BITS`](Self::LEAST_BITS) to [`MOST_BITS`](Self::MOST_BITS).
    pub fn new(bits: u32) -> Option<Self> {
        (Self::LEAST_BITS..=Self::MOST_BITS).contains(&bits).then_some(Self { bits })
    }

    /// The code's value, and whether it saturated.
    pub fn quantise(self, x: f64) -> (f64, bool) {
        let half = f64::from(1u32 << (self.bits - 1));
        let code = (x * half).round_ties_even();
        let clipped = code.clamp(-half, half - 1.0);
        (clipped / half, clipped != code)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn codes_saturate_at_both_ends_of_the_full_scale() {
        let three = Quantiser::new(3).unwrap();
        for (x, want) in [
            (0.0, (0.0, false)),
            (0.124, (0.0, false)),
            (0.126, (0.25, false)),
            (0.125, (0.0, false)),
            (0.375, (0.5, false)),
            (0.75, (0.75, false)),
            (0.88, (0.75, true)),
            (2.0, (0.75, true)),
            (-1.0, (-1.0, false)),
            (-1.2, (-1.0, true)),
        ] {
            assert_eq!(three.quantise(x), want, "{x}");
        }
        assert!(Quantiser::new(1).is_none() && Quantiser::new(25).is_none());
    }

    /// 6.02 B + 1.76 dB for a sine of full scale whose frequency is no rational multiple of the rate.
    #[test]
    fn the_error_of_a_full_scale_sine_is_that_of_the_formula() {
        for bits in [6, 8, 10, 12, 14, 16] {
            let quantiser = Quantiser::new(bits).unwrap();
            let (count, turn) = (200_000, (5f64.sqrt() - 1.0) / 2.0);
            // Full scale less half a step above, so that nothing saturates.
            let amplitude = 1.0 - 0.5f64.powi(bits as i32);
            let (mut signal, mut error) = (0.0, 0.0);
            for k in 0..count {
                let x = amplitude * (TAU * (turn * f64::from(k)).fract()).sin();
                let (y, clipped) = quantiser.quantise(x);
                assert!(!clipped || x > 1.0 - 0.5f64.powi(bits as i32 - 1));
                signal += x * x;
                error += (y - x).powi(2);
            }
            let snr = 10.0 * f64::log10(signal / error);
            let formula = 20.0 * f64::from(bits) * 2f64.log10() + 10.0 * 1.5f64.log10();
            // The formula takes the error as uniform; the amplitude is a part of a step short of 1.
            let tolerance = 0.05 + 0.5 * 0.5f64.powi(bits as i32 - 6);
            assert!((snr - formula).abs() < tolerance, "{bits} bits: {snr:.3} dB, formula {formula:.3} dB");
        }
    }
}
