//! Safe calls of the conversions: the fast form where there is one, and how far it got.

use super::Isa;
#[cfg(target_arch = "x86_64")]
use super::convert::{self, F32, Rows, S16, S32};
use crate::PcmFormat;

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::*;

    #[target_feature(enable = "avx2,fma")]
    pub(super) unsafe fn decode(format: PcmFormat, bytes: &[u8], out: &mut [f32]) -> usize {
        // SAFETY: the caller's.
        unsafe {
            match format {
                PcmFormat::F32Le => convert::decode::<F32>(bytes, out),
                PcmFormat::S16Le => convert::decode::<S16>(bytes, out),
                PcmFormat::S32Le => convert::decode::<S32>(bytes, out),
                _ => 0,
            }
        }
    }

    #[target_feature(enable = "avx2,fma")]
    pub(super) unsafe fn interleave(rows: Rows, m: usize, frames: usize, out: &mut [f32]) -> usize {
        // SAFETY: the caller's.
        unsafe { convert::interleave(rows, m, frames, out) }
    }

    #[target_feature(enable = "avx2,fma")]
    pub(super) unsafe fn encode(format: PcmFormat, samples: &[f32], out: &mut [u8]) -> u64 {
        let (done, clipped) = match format {
            // SAFETY: the caller's.
            PcmFormat::S16Le => unsafe { convert::encode_s16(samples, out) },
            _ => (0, 0),
        };
        clipped + super::encode_each(format, &samples[done..], &mut out[done * format.bytes()..])
    }
}

/// Decodes samples from the first on as far as there is a fast way; returns how many. The caller does the
/// rest.
pub(crate) fn decode(isa: Isa, format: PcmFormat, bytes: &[u8], out: &mut [f32]) -> usize {
    #[cfg(target_arch = "x86_64")]
    if isa != Isa::portable() {
        // SAFETY: an `Isa` is made only where the processor has it, and each but the portable one includes AVX2.
        return unsafe { avx2::decode(format, bytes, out) };
    }
    let _ = (isa, format, bytes, out);
    0
}

/// Sample p of frame k of `out` = `rows[p * stride + k]`, for frames of `m` samples; returns the
/// frames done, from the first on. The caller does the rest.
///
/// # Panics
/// If `out` or `rows` is too short; each row needs `frames` rounded up to 8.
pub(crate) fn interleave(
    isa: Isa,
    rows: &[f32],
    stride: usize,
    m: usize,
    frames: usize,
    out: &mut [f32],
) -> usize {
    assert!(m * frames <= out.len());
    assert!(m == 0 || (m - 1) * stride + frames.next_multiple_of(8) <= rows.len());
    #[cfg(target_arch = "x86_64")]
    if m > 0 && isa != Isa::portable() {
        let rows = Rows { first: rows.as_ptr(), stride };
        // SAFETY: as in `decode`; the bounds are asserted above.
        return unsafe { avx2::interleave(rows, m, frames, out) };
    }
    let _ = isa;
    0
}

/// Encodes all samples; returns how many were clipped.
///
/// # Panics
/// If `out` is too short.
pub(crate) fn encode(isa: Isa, format: PcmFormat, samples: &[f32], out: &mut [u8]) -> u64 {
    assert!(samples.len() * format.bytes() <= out.len());
    #[cfg(target_arch = "x86_64")]
    if isa != Isa::portable() {
        // SAFETY: as in `decode`.
        return unsafe { avx2::encode(format, samples, out) };
    }
    let _ = isa;
    encode_each(format, samples, out)
}

#[inline(always)]
fn encode_each(format: PcmFormat, samples: &[f32], out: &mut [u8]) -> u64 {
    let mut clipped = 0;
    crate::pcm::for_pcm_format!(format, FORMAT => {
        for (slot, &value) in out.chunks_exact_mut(FORMAT.bytes()).zip(samples) {
            clipped += u64::from(FORMAT.encode(f64::from(value), slot));
        }
    });
    clipped
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(count: usize) -> Vec<f32> {
        (0..count).map(|i| i as f32).collect()
    }

    #[test]
    fn rows_become_frames() {
        for n in 1..40 {
            for frames in [0usize, 1, 7, 8, 9, 16, 24, 33] {
                let stride = frames.next_multiple_of(8) + 3;
                let rows = ramp(n * stride + 8);
                let mut out = vec![-1.0; n * frames];
                let done = interleave(Isa::detect(), &rows, stride, n, frames, &mut out);
                // At most the last block and a cut one are left to the caller.
                assert!(done <= frames && (Isa::detect() == Isa::portable() || done + 16 > frames));
                for k in 0..done {
                    for i in 0..n {
                        assert_eq!(out[k * n + i], rows[i * stride + k], "n {n} frames {frames}");
                    }
                }
            }
        }
    }

    #[test]
    fn decoding_is_the_same_as_one_by_one() {
        for format in PcmFormat::ALL {
            let bytes: Vec<u8> = (0..8 * 131u32).map(|i| (i * i % 251) as u8).collect();
            for count in [0, 1, 7, 8, 9, 131] {
                let mut out = vec![-1.0; count];
                let done = decode(Isa::detect(), format, &bytes, &mut out);
                for (slot, sample) in out[..done].iter().zip(bytes.chunks_exact(format.bytes())) {
                    let want = format.decode(sample) as f32;
                    assert!(slot.to_bits() == want.to_bits() || slot.is_nan() && want.is_nan(), "{format}");
                }
            }
        }
    }

    #[test]
    fn encoding_is_the_same_as_one_by_one() {
        let mut samples: Vec<f32> = (0..70_000).map(|i| (i as f32 - 35_000.0) / 32768.0 + 1e-6).collect();
        samples.extend([1e30, -1e30, 1.0, -1.0, 0.5 / 32768.0, 1.5 / 32768.0, 32767.5 / 32768.0]);
        samples.splice(0..0, [f32::NAN, f32::INFINITY, f32::NEG_INFINITY]);
        samples.extend([-32768.5, -32769.0, 32767.4, 32767.25, -32767.5, f32::NAN].map(|x| x / 32768.0));
        for format in PcmFormat::ALL {
            let mut fast = vec![0; samples.len() * format.bytes()];
            let mut slow = fast.clone();
            let clipped = encode(Isa::detect(), format, &samples, &mut fast);
            assert_eq!(clipped, encode_each(format, &samples, &mut slow), "{format}");
            assert_eq!(fast, slow, "{format}");
        }
    }
}
