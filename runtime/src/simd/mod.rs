//! The kernels, and the only `unsafe` code of the crate.
//!
//! Each kernel is one generic body over a vector type, compiled once for each instruction
//! set inside a `#[target_feature]` function and chosen at run time. `unsafe` is needed for two
//! things only: to call such a function after the processor was asked, and to load and store
//! vectors at addresses whose bounds the safe wrapper has checked once for the whole call.
//!
//! Bits: an output is a sum of a fixed shape, lanes of fused multiply-adds and a tree over the lanes (see
//! `lanes`), the same for every instruction set. So it does not depend on vector width, block size, address or
//! thread count. Only on an x86 processor without FMA (before 2013) the portable body rounds the
//! product as well, because a fused multiply-add in software is forty times slower.
#![allow(unsafe_code)]

mod channels;
#[cfg(target_arch = "x86_64")]
mod convert;
mod finite;
mod fir;
mod isa;
mod lanes;
#[cfg(target_arch = "x86_64")]
mod lanes_avx2;
#[cfg(target_arch = "x86_64")]
mod lanes_avx512;
mod layout;
mod pairs;
mod peak;
mod phases;
mod polyphase;
mod recursion;
mod single;
#[cfg(target_arch = "x86_64")]
mod ticks_x86;
mod transform;
mod vector;

pub(crate) use finite::{all_finite_f32, all_finite_f64};
pub(crate) use fir::{Cut, FirKernel};
pub use isa::Isa;
pub(crate) use layout::{decode, encode, interleave};
pub(crate) use pairs::{Halves, Products, join_f32, join_f64, split_f32, split_f64};
pub use peak::multiply_add_chains;
pub(crate) use polyphase::{Polyphase, Stretch};
pub(crate) use recursion::{ColumnTile, Form, Recursion, RecursionKernel, SectionVector};
pub(crate) use transform::{
    Frames, SHORTEST_TRANSFORM, Segments, Spectra, Transform, TransformKernel, group_lanes, row_samples,
};
