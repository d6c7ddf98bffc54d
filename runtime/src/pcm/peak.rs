//! The largest magnitude of encoded samples.

use super::PcmFormat;

/// Magnitude bits of floats: those of all but NaN are in the order of the magnitudes.
const MAGNITUDE_32: u32 = u32::MAX >> 1;
const MAGNITUDE_64: u64 = u64::MAX >> 1;

impl PcmFormat {
    /// The largest magnitude in `samples`, of full scale; 0 for none. The usual formats take one pass of
    /// whole vectors.
    pub fn peak(self, samples: &[u8]) -> f64 {
        match self {
            Self::F32Le => {
                let (values, _) = samples.as_chunks();
                f32::from_bits(
                    values.iter().map(|x| u32::from_le_bytes(*x) & MAGNITUDE_32).max().unwrap_or(0),
                )
                .into()
            }
            Self::F64Le => {
                let (values, _) = samples.as_chunks();
                f64::from_bits(
                    values.iter().map(|x| u64::from_le_bytes(*x) & MAGNITUDE_64).max().unwrap_or(0),
                )
            }
            Self::S16Le => {
                let (values, _) = samples.as_chunks();
                let most = values.iter().map(|x| i16::from_le_bytes(*x).unsigned_abs()).max().unwrap_or(0);
                f64::from(most) / f64::from(1u16 << 15)
            }
            _ => {
                let values = samples.chunks_exact(self.bytes());
                values.map(|sample| self.decode(sample).abs()).fold(0.0, f64::max)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_peak_of_every_format_is_that_of_its_samples() {
        let values = [0.0, 0.25, -0.75, 0.5, -0.125];
        for format in [
            PcmFormat::F32Le,
            PcmFormat::F64Le,
            PcmFormat::S16Le,
            PcmFormat::S24Le,
            PcmFormat::S32Le,
            PcmFormat::U8,
            PcmFormat::F32Be,
        ] {
            let mut bytes = vec![0; values.len() * format.bytes()];
            for (slot, value) in bytes.chunks_exact_mut(format.bytes()).zip(values) {
                format.encode(value, slot);
            }
            assert_eq!(format.peak(&bytes), 0.75, "{format:?}");
            assert_eq!(format.peak(&[]), 0.0);
        }
        assert_eq!(PcmFormat::S16Le.peak(&i16::MIN.to_le_bytes()), 1.0);
    }
}
