//! The kernels, and the only `unsafe` code of the crate.
//!
//! Each kernel is one generic body over a [`vector::Vector`], compiled once for each instruction
//! set inside a `#[target_feature]` function and chosen at run time. `unsafe` is needed for two
//! things only: to call such a function after the processor was asked, and to load and store
//! vectors at addresses whose bounds the safe wrapper has checked once for the whole call.
//!
//! Bits: an output is one chain of fused multiply-adds over channels and taps in a fixed order, in
//! one lane. So it does not depend on vector width, block size, address or thread count. Only on an
//! x86 processor without FMA (before 2013) the portable body rounds the product as well, because
//! a fused multiply-add in software is forty times slower.
#![allow(unsafe_code)]

#[cfg(target_arch = "x86_64")]
mod convert;
mod isa;
mod layout;
mod peak;
mod polyphase;
mod recursion;
mod vector;

pub use isa::Isa;
pub(crate) use layout::{Progress, deinterleave, deinterleave_f32, encode, interleave};
pub use peak::multiply_add_chains;
pub(crate) use polyphase::{FirKernel, PhaseGroup, Steps};
pub(crate) use recursion::{ColumnTile, Form, Recursion, RecursionKernel, Registers, SectionVector};

/// Frames that a kernel may read and write past the last one asked for: its widest vector.
pub(crate) const OVERRUN: usize = 16;
