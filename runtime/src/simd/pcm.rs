//! Samples of PCM formats to f32 and back a vector at a time, and frames from rows a lane group at a time.

use super::dispatch::{Kernel, compiled, compiled_narrow};
use super::fir::widths;
use super::isa::Isa;
use super::vector::Vector;
use crate::pcm::PcmFormat;

/// Lanes of a group.
const GROUP: usize = 8;

/// Decodes samples from the first on as far as there is a fast way; returns how many. The caller does the
/// rest.
pub(crate) fn decode(isa: Isa, format: PcmFormat, bytes: &[u8], out: &mut [f32]) -> usize {
    // SAFETY: the kernel checks the lengths itself.
    unsafe { compiled::<Decode>(isa)((format, bytes, out)) }
}

/// Encodes all samples; returns how many were clipped.
///
/// # Panics
/// If `out` is too short.
pub(crate) fn encode(isa: Isa, format: PcmFormat, samples: &[f32], out: &mut [u8]) -> u64 {
    assert!(samples.len() * format.bytes() <= out.len());
    // SAFETY: the kernel asks nothing of its job.
    unsafe { compiled::<Encode>(isa)((format, samples, out)) }
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
    assert!(m == 0 || (m - 1) * stride + frames.next_multiple_of(GROUP) <= rows.len());
    let rows = rows.as_ptr();
    // SAFETY: the bounds are asserted above.
    unsafe { compiled_narrow::<Interleave>(isa)(PcmRows { rows, stride, m, frames, out: out.as_mut_ptr() }) }
}

/// Decodes whole vectors with `$load`, of a format of so many bytes; the samples done.
macro_rules! vectors {
    ($out:ident, $bytes:ident, $size:literal, $at:ident => $load:expr) => {{
        let mut done = 0;
        for (out, bytes) in $out.chunks_exact_mut(V::LANES).zip($bytes.chunks_exact($size * V::LANES)) {
            let $at = bytes.as_ptr();
            // Both slices hold a vector.
            $load.store(out.as_mut_ptr());
            done += V::LANES;
        }
        done
    }};
}

/// Whole vectors; the samples done.
struct Decode;

impl Kernel for Decode {
    type Sample = f32;
    type Job<'a> = (PcmFormat, &'a [u8], &'a mut [f32]);
    type Output = usize;

    #[inline(always)]
    unsafe fn run<V: Vector<Sample = f32>>((format, bytes, out): Self::Job<'_>) -> usize {
        match format {
            PcmFormat::F32Le if cfg!(target_endian = "little") => {
                vectors!(out, bytes, 4, at => V::load(at.cast()))
            }
            PcmFormat::S16Le => vectors!(out, bytes, 2, at => V::load_i16(at)),
            PcmFormat::S32Le => vectors!(out, bytes, 4, at => V::load_i32(at)),
            _ => 0,
        }
    }
}

/// All samples; how many were clipped.
struct Encode;

impl Kernel for Encode {
    type Sample = f32;
    type Job<'a> = (PcmFormat, &'a [f32], &'a mut [u8]);
    type Output = u64;

    #[inline(always)]
    unsafe fn run<V: Vector<Sample = f32>>((format, samples, out): Self::Job<'_>) -> u64 {
        if format != PcmFormat::S16Le {
            return encode_each(format, samples, out);
        }
        let (vectors, rest) = samples.split_at(samples.len() / V::LANES * V::LANES);
        let (places, last) = out.split_at_mut(2 * vectors.len());
        let mut clipped = 0;
        for (samples, out) in vectors.chunks_exact(V::LANES).zip(places.chunks_exact_mut(2 * V::LANES)) {
            // Both slices hold a vector.
            clipped += u64::from(V::load(samples.as_ptr()).store_i16(out.as_mut_ptr()));
        }
        clipped + encode_each(format, rest, last)
    }
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

/// Rows, `stride` samples apart, and the frames that they become.
struct PcmRows {
    rows: *const f32,
    stride: usize,
    m: usize,
    frames: usize,
    out: *mut f32,
}

/// Blocks of a group of frames; the frames done. Rows are what sums of phases are with one lane a frame.
struct Interleave;

impl Kernel for Interleave {
    type Sample = f32;
    type Job<'a> = PcmRows;
    type Output = usize;

    #[inline(always)]
    unsafe fn run<V: Vector<Sample = f32>>(PcmRows { rows, stride, m, frames, out }: PcmRows) -> usize {
        // Of three samples per frame the place after them is written too.
        let whole = frames.saturating_sub(usize::from(m == 3)) / GROUP * GROUP;
        for first in (0..whole).step_by(GROUP) {
            for (sample, width) in widths(m) {
                let row = |p: usize| V::load(rows.add((sample + p.min(width - 1)) * stride + first));
                let block = [row(0), row(1), row(2), row(3)];
                let to = out.add(first * m + sample);
                match width {
                    1 => block[0].store(to),
                    2 => V::store_frames::<2, 1>(block, to, m),
                    3 => V::store_frames::<3, 1>(block, to, m),
                    _ => V::store_frames::<4, 1>(block, to, m),
                }
            }
        }
        whole
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(count: usize) -> Vec<f32> {
        (0..count).map(|i| i as f32).collect()
    }

    #[test]
    fn rows_become_frames() {
        // Miri takes a thousand times as long.
        for n in 1..if cfg!(miri) { 10 } else { 40 } {
            for frames in [0usize, 1, 7, 8, 9, 16, 24, 33] {
                let stride = frames.next_multiple_of(8) + 3;
                let rows = ramp(n * stride + 8);
                let mut out = vec![-1.0; n * frames];
                let done = interleave(Isa::detect(), &rows, stride, n, frames, &mut out);
                // At most the last block and a cut one are left to the caller.
                assert!(done <= frames && done + 16 > frames);
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
        // Miri takes a thousand times as long.
        let step = if cfg!(miri) { 3500 } else { 1 };
        let mut samples: Vec<f32> =
            (0..70_000).step_by(step).map(|i| (i as f32 - 35_000.0) / 32768.0 + 1e-6).collect();
        samples.extend([1e30, -1e30, 1.0, -1.0, 0.5 / 32768.0, 1.5 / 32768.0, 32767.5 / 32768.0]);
        samples.splice(0..0, [f32::NAN, f32::INFINITY, f32::NEG_INFINITY]);
        samples.extend([-32768.5, -32769.0, 32767.4, 32767.25, -32767.5, f32::NAN].map(|x| x / 32768.0));
        for format in PcmFormat::ALL {
            let mut fast = vec![0; samples.len() * format.bytes()];
            let mut slow = fast.clone();
            let clipped = encode(Isa::detect(), format, &samples, &mut fast);
            assert_eq!(clipped, encode_each(format, &samples, &mut slow), "{format}");
            for (fast, slow) in fast.chunks_exact(format.bytes()).zip(slow.chunks_exact(format.bytes())) {
                // Rust leaves the sign of a NaN open, and Miri draws it.
                let nan = format.decode(fast).is_nan() && format.decode(slow).is_nan();
                assert!(fast == slow || nan, "{format}: {fast:?} instead of {slow:?}");
            }
        }
    }
}
