#![doc = include_str!("../README.md")]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]

pub mod bank;
pub mod files;
pub mod io;
pub mod messages;
pub mod npy;
pub mod pipeline;
pub mod quantity;
pub mod spec;
pub mod units;

/// The crate `hybank-runtime`: it compiles a bank into a plan, filters streams with it, and converts PCM
/// samples.
pub use hybank_runtime as runtime;

#[cfg(test)]
use trials::random;
