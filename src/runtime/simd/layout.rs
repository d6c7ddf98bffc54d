//! Safe calls of the conversions: the fast form where there is one, and how far it got.

use super::Isa;
#[cfg(target_arch = "x86_64")]
use super::convert::{self, F32, Rows, S16, S32};
use crate::io::PcmFormat;

/// Frames done by a fast conversion, from the first on; the caller does the rest.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Progress {
    pub(crate) frames: usize,
    /// There may be a value among them that is not finite.
    pub(crate) suspect: bool,
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::*;

    #[target_feature(enable = "avx2,fma")]
    pub(super) unsafe fn deinterleave(
        format: PcmFormat,
        bytes: &[u8],
        n: usize,
        frames: usize,
        rows: Rows,
    ) -> Option<(usize, bool)> {
        // SAFETY: the caller's.
        unsafe {
            match format {
                PcmFormat::F32Le => Some(convert::deinterleave::<F32>(bytes, n, frames, rows)),
                PcmFormat::S16Le => Some(convert::deinterleave::<S16>(bytes, n, frames, rows)),
                PcmFormat::S32Le => Some(convert::deinterleave::<S32>(bytes, n, frames, rows)),
                _ => None,
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

/// `rows[i * stride + k]` = sample i of frame k, for packed frames of `n` samples.
///
/// # Panics
/// If `bytes` or `rows` is too short; each row needs room for `frames` rounded up to 8.
pub(crate) fn deinterleave(
    isa: Isa,
    format: PcmFormat,
    bytes: &[u8],
    n: usize,
    frames: usize,
    rows: &mut [f32],
    stride: usize,
) -> Progress {
    assert!(n * frames * format.bytes() <= bytes.len());
    assert!(n == 0 || (n - 1) * stride + frames.next_multiple_of(8) <= rows.len());
    #[cfg(target_arch = "x86_64")]
    if n > 0 && isa != Isa::Portable && cfg!(target_endian = "little") {
        let rows = Rows { first: rows.as_mut_ptr(), stride };
        // SAFETY: an `Isa` other than portable is only ever used where it is available, and each
        // includes AVX2; the bounds are asserted above.
        if let Some((frames, suspect)) = unsafe { avx2::deinterleave(format, bytes, n, frames, rows) } {
            return Progress { frames, suspect: suspect && format.is_float() };
        }
    }
    let _ = isa;
    Progress::default()
}

/// As [`deinterleave`], for samples that are numbers already.
///
/// # Panics
/// As [`deinterleave`].
pub(crate) fn deinterleave_f32(
    isa: Isa,
    samples: &[f32],
    n: usize,
    frames: usize,
    rows: &mut [f32],
    stride: usize,
) -> Progress {
    // SAFETY: any f32 is four bytes, and bytes need no alignment.
    let bytes = unsafe { std::slice::from_raw_parts(samples.as_ptr().cast::<u8>(), size_of_val(samples)) };
    deinterleave(isa, PcmFormat::F32Le, bytes, n, frames, rows, stride)
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
    if m > 0 && isa != Isa::Portable {
        // The rows are only read.
        let rows = Rows { first: rows.as_ptr().cast_mut(), stride };
        // SAFETY: as in `deinterleave`.
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
    if isa != Isa::Portable {
        // SAFETY: as in `deinterleave`.
        return unsafe { avx2::encode(format, samples, out) };
    }
    let _ = isa;
    encode_each(format, samples, out)
}

#[inline(always)]
fn encode_each(format: PcmFormat, samples: &[f32], out: &mut [u8]) -> u64 {
    let mut clipped = 0;
    crate::io::for_pcm_format!(format, FORMAT => {
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
    fn frames_become_rows_and_frames_again() {
        for n in 1..40 {
            for frames in [0, 1, 7, 8, 9, 16, 24, 33] {
                let input = ramp(n * frames);
                let stride = frames.next_multiple_of(8) + 3;
                let mut rows = vec![-1.0; n * stride + 8];
                let done = deinterleave_f32(Isa::detect(), &input, n, frames, &mut rows, stride).frames;
                // At most the last block and a cut one are left to the caller.
                assert!(done <= frames && (Isa::detect() == Isa::Portable || done + 16 > frames));
                for i in 0..n {
                    for k in 0..frames {
                        if k < done {
                            assert_eq!(rows[i * stride + k], input[k * n + i], "n {n} frames {frames}");
                        }
                        rows[i * stride + k] = input[k * n + i];
                    }
                }
                let mut out = vec![-1.0; n * frames];
                let done = interleave(Isa::detect(), &rows, stride, n, frames, &mut out);
                assert_eq!(out[..n * done], input[..n * done], "n {n} frames {frames}");
            }
        }
    }

    #[test]
    fn what_is_not_finite_is_noticed_wherever_it_is() {
        if Isa::detect() == Isa::Portable {
            return;
        }
        for n in [1, 2, 3, 4, 7, 8, 11] {
            for place in 0..8 * n {
                for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                    let mut input = ramp(n * 16);
                    let mut rows = vec![0.0; n * 16];
                    let clean = deinterleave_f32(Isa::detect(), &input, n, 16, &mut rows, 16);
                    assert!(!clean.suspect && clean.frames >= 8);
                    input[place] = bad;
                    assert!(deinterleave_f32(Isa::detect(), &input, n, 16, &mut rows, 16).suspect);
                }
            }
        }
    }

    #[test]
    fn encoding_is_the_same_as_one_by_one() {
        let mut samples: Vec<f32> = (0..70_000).map(|i| (i as f32 - 35_000.0) / 32768.0 + 1e-6).collect();
        samples.extend([1e30, -1e30, 1.0, -1.0, 0.5 / 32768.0, 1.5 / 32768.0, 32767.5 / 32768.0]);
        for format in PcmFormat::ALL {
            let mut fast = vec![0; samples.len() * format.bytes()];
            let mut slow = fast.clone();
            let clipped = encode(Isa::detect(), format, &samples, &mut fast);
            assert_eq!(clipped, encode_each(format, &samples, &mut slow), "{format}");
            assert_eq!(fast, slow, "{format}");
        }
    }
}
