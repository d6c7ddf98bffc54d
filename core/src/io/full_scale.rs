//! The full scale of inputs whose format does not say it: tables, and floating-point numbers of arrays, raw
//! streams and SigMF recordings.

use super::{InputFault, PcmFormat, StreamHeader};
use crate::quantity::FullScale;

/// Brings the samples of an input to full scale 1, or looks whether they may have another one.
#[derive(Debug)]
pub(super) struct Scaling {
    format: PcmFormat,
    given: Option<FullScale>,
    seen: Seen,
}

/// The samples so far.
#[derive(Debug)]
struct Seen {
    least: f64,
    most: f64,
    are_whole: bool,
}

impl Scaling {
    /// Of an input with this header. `None` if its format has a full scale.
    pub(super) fn new(header: &StreamHeader, given: Option<FullScale>) -> Option<Self> {
        let seen = Seen { least: f64::INFINITY, most: f64::NEG_INFINITY, are_whole: true };
        (!header.is_scaled).then_some(Self { format: header.layout.format, given, seen })
    }

    /// Takes whole frames.
    pub(super) fn take(&mut self, frames: &mut [u8]) {
        let Self { format, given, seen } = self;
        let numbers = frames.chunks_exact_mut(format.bytes());
        match given {
            None => numbers.for_each(|bytes| seen.take(format.decode(bytes))),
            Some(given) => {
                let (middle, amplitude) = (given.middle(), given.amplitude());
                numbers.for_each(|bytes| {
                    format.encode((format.decode(bytes) - middle) / amplitude, bytes);
                });
            }
        }
    }

    /// That full scale is likely not 1; complete at the end.
    pub(super) fn fault(&self) -> Option<InputFault> {
        let Seen { least, most, are_whole } = self.seen;
        let peak = most.max(-least);
        let likely = if are_whole { FullScale::of_codes(least, most) } else { None };
        (peak > 1.0).then_some(InputFault::BeyondFullScale { peak, likely })
    }
}

impl Seen {
    fn take(&mut self, x: f64) {
        if x.is_finite() {
            self.least = self.least.min(x);
            self.most = self.most.max(x);
            self.are_whole &= x.fract() == 0.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::SampleLayout;

    fn scaled(
        format: PcmFormat,
        given: Option<FullScale>,
        samples: &[f64],
    ) -> (Vec<f64>, Option<InputFault>) {
        let header = StreamHeader::real(SampleLayout::packed(format), 1);
        let mut scaling = Scaling::new(&header, given).unwrap();
        let mut bytes = vec![0; samples.len() * format.bytes()];
        for (x, slot) in samples.iter().zip(bytes.chunks_exact_mut(format.bytes())) {
            format.encode(*x, slot);
        }
        scaling.take(&mut bytes);
        (bytes.chunks_exact(format.bytes()).map(|x| format.decode(x)).collect(), scaling.fault())
    }

    #[test]
    fn samples_come_to_full_scale() {
        for format in [PcmFormat::F32Le, PcmFormat::F32Be, PcmFormat::F64Le, PcmFormat::F64Be] {
            let (samples, fault) = scaled(format, Some(FullScale::Unsigned(8)), &[0.0, 64.0, 255.0]);
            assert_eq!((samples, fault), (vec![-1.0, -0.5, 127.0 / 128.0], None));
            let (samples, _) = scaled(format, Some(FullScale::Number(0.5)), &[f64::NAN, 1.0]);
            assert!(samples[0].is_nan() && samples[1] == 2.0);
        }
    }

    #[test]
    fn samples_beyond_one_have_a_likely_full_scale() {
        let fault = |samples: &[f64]| {
            let (same, fault) = scaled(PcmFormat::F64Le, None, samples);
            assert_eq!(same.len(), samples.len());
            fault
        };
        assert_eq!(fault(&[1.0, -1.0, 0.25]), None);
        assert_eq!(fault(&[]), None);
        let beyond = |peak, likely| Some(InputFault::BeyondFullScale { peak, likely });
        assert_eq!(fault(&[f64::NAN, -100.0, 127.0]), beyond(127.0, Some(FullScale::Signed(8))));
        assert_eq!(fault(&[0.0, 4000.0]), beyond(4000.0, Some(FullScale::Unsigned(12))));
        assert_eq!(fault(&[0.5, -1.5]), beyond(1.5, None));
    }

    #[test]
    fn integers_have_their_own_full_scale() {
        let header = StreamHeader::real(SampleLayout::packed(PcmFormat::S16Le), 1);
        assert!(Scaling::new(&header, None).is_none());
    }
}
