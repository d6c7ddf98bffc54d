//! Samples of PCM formats to numbers and back, a loop of its own for each format and instruction set.

use super::dispatch::{Kernel, compiled};
use super::isa::Isa;
use super::vector::Vector;
use crate::Sample;
use crate::pcm::{PcmFormat, for_pcm_format};
use std::marker::PhantomData;

/// Decodes samples that lie close together, as many as both slices hold.
pub(crate) fn decode<T: Sample>(isa: Isa, format: PcmFormat, bytes: &[u8], out: &mut [T]) {
    // SAFETY: the kernel asks nothing of its job.
    unsafe { compiled::<Decode<T>>(isa)((format, bytes, out)) }
}

/// Encodes samples that are to lie close together, as many as both slices hold; returns how many were
/// clipped. For formats of few digits they are rounded to f32 first.
pub(crate) fn encode<T: Sample>(isa: Isa, format: PcmFormat, samples: &[T], out: &mut [u8]) -> u64 {
    // SAFETY: the kernel asks nothing of its job.
    unsafe { compiled::<Encode<T>>(isa)((format, samples, out)) }
}

struct Decode<T>(PhantomData<T>);

impl<T: Sample> Kernel for Decode<T> {
    type Sample = T;
    type Job<'a> = (PcmFormat, &'a [u8], &'a mut [T]);
    type Output = ();

    #[inline(always)]
    unsafe fn run<V: Vector<Sample = T>>((format, bytes, out): Self::Job<'_>) {
        if format == PcmFormat::S16Le {
            for (slot, sample) in out.iter_mut().zip(bytes.as_chunks::<2>().0) {
                *slot = T::from(f32::from(i16::from_le_bytes(*sample)) / 32768.0);
            }
            return;
        }
        for_pcm_format!(format, FORMAT => {
            for (slot, sample) in out.iter_mut().zip(bytes.chunks_exact(FORMAT.bytes())) {
                *slot = T::from_f64(FORMAT.decode(sample));
            }
        });
    }
}

/// A sum with it is rounded to an integer, whose digits are the last ones of the sum.
const INTEGER: f32 = 1.5 * (1 << 23) as f32;

/// Samples whose count has as many bits as they have.
const PART: usize = 4096;

struct Encode<T>(PhantomData<T>);

impl<T: Sample> Kernel for Encode<T> {
    type Sample = T;
    type Job<'a> = (PcmFormat, &'a [T], &'a mut [u8]);
    type Output = u64;

    #[inline(always)]
    unsafe fn run<V: Vector<Sample = T>>((format, samples, out): Self::Job<'_>) -> u64 {
        let mut clipped = 0;
        if format == PcmFormat::S16Le {
            for (slots, samples) in out.as_chunks_mut::<2>().0.chunks_mut(PART).zip(samples.chunks(PART)) {
                let mut count = 0u32;
                for (slot, sample) in slots.iter_mut().zip(samples) {
                    let scaled = sample.to_f64() as f32 * 32768.0;
                    let held = if scaled.is_nan() { 0.0 } else { scaled };
                    count += u32::from(!(-32768.5..32767.5).contains(&held));
                    let held = held.clamp(-32768.0, 32767.0);
                    *slot = ((held + INTEGER).to_bits() as i16).to_le_bytes();
                }
                clipped += u64::from(count);
            }
            return clipped;
        }
        for_pcm_format!(format, FORMAT => {
            for (slot, sample) in out.chunks_exact_mut(FORMAT.bytes()).zip(samples) {
                let value = if FORMAT.bytes() < 4 { f64::from(sample.to_f64() as f32) } else { sample.to_f64() };
                clipped += u64::from(FORMAT.encode(value, slot));
            }
        });
        clipped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decoding_is_the_same_as_one_by_one() {
        for format in PcmFormat::ALL {
            let bytes: Vec<u8> = (0..8 * 131u32).map(|i| (i * i % 251) as u8).collect();
            for count in [0, 1, 7, 8, 9, 131] {
                let mut out = vec![-1.0f32; count];
                decode(Isa::detect(), format, &bytes, &mut out);
                for (slot, sample) in out.iter().zip(bytes.chunks_exact(format.bytes())) {
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
            let slots = slow.chunks_exact_mut(format.bytes()).zip(&samples);
            let each = slots.map(|(slot, &x)| u64::from(format.encode(x.into(), slot)));
            assert_eq!(clipped, each.sum::<u64>(), "{format}");
            for (fast, slow) in fast.chunks_exact(format.bytes()).zip(slow.chunks_exact(format.bytes())) {
                // Rust leaves the sign of a NaN open, and Miri draws it.
                let nan = format.decode(fast).is_nan() && format.decode(slow).is_nan();
                assert!(fast == slow || nan, "{format}: {fast:?} instead of {slow:?}");
            }
        }
    }
}
