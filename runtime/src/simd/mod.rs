//! The kernels, and the only `unsafe` code of the crate.
//!
//! ```text
//! isa        the instruction sets of this processor, as values that only detection makes
//! dispatch   from an Isa to a function compiled for it
//! vector     the vector trait, all that kernels know of an instruction set
//! portable  avx2  avx512  neon      the trait for each set
//! fir  recursion  spectra  pcm  finite  peak      the kernels
//! flush      the mode in which denormals count as 0
//! lanes      lane groups as the numbers of rustfft
//! ```
//!
//! Each kernel is one body that is generic over the vector type, compiled once for each instruction set.
//! `unsafe` is needed for four things only: to call such a function after the processor was asked, to load
//! and store vectors at addresses whose bounds the safe wrapper has checked once for the whole call, for
//! one hint to the compiler in assembly, and to set the mode of denormals.
//!
//! What an unsafe function asks for is said at the function, its trait or the head of its file, and not
//! again in its body. There are two preconditions. *The set is there*: a function that is generic over a
//! vector runs only inside [`dispatch`], in a function compiled for the vector's set, which only an [`Isa`]
//! selects. *The memory is there*: the safe call of each kernel (`Polyphase::run`, `RecursionKernel::run`)
//! asserts the lengths of its slices once, from the numbers by which the kernel addresses them. Unsafe
//! blocks in safe functions say which of the two holds there, and why.
//!
//! Bits: an output is a sum of a fixed shape, lanes of fused multiply-adds and a tree over the lanes (see
//! `vector`), the same for every instruction set. So it does not depend on vector width, block size, address
//! or thread count. Only on an x86 processor without FMA (before 2013) the portable body rounds the product
//! as well, because a fused multiply-add in software is forty times slower.
#![allow(unsafe_code)]
#![allow(unsafe_op_in_unsafe_fn, reason = "each unsafe function says what it asks for")]
#![deny(clippy::undocumented_unsafe_blocks)]

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx2_frames;
#[cfg(target_arch = "x86_64")]
#[cfg(target_arch = "x86_64")]
mod avx512;
mod dispatch;
mod finite;
mod fir;
mod flush;
mod isa;
mod lanes;
#[cfg(target_arch = "aarch64")]
mod neon;
mod pcm;
mod peak;
mod portable;
mod recursion;
mod spectra;
mod vector;
#[cfg(test)]
pub(crate) mod work;

pub(crate) use dispatch::SimdElement;
pub(crate) use finite::{Replaced, not_finite, replace_not_finite};
pub(crate) use fir::{FirKernel, Polyphase, Segment, Tiling};
pub(crate) use flush::flushing;
pub use isa::Isa;
pub(crate) use lanes::{Lanes, Row};
pub(crate) use pcm::{decode, encode};
pub use peak::multiply_add_chains;
pub(crate) use recursion::{ColumnTile, Recursion, RecursionForm, RecursionKernel, SectionVector};
pub(crate) use spectra::{Product, multiply};
pub(crate) use vector::group_lanes;
