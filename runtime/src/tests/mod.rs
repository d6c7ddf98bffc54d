//! Streams of every algorithm against the definition of the sum, and what is promised of their calls.

mod calls;
mod cuts;
mod flush;
mod not_finite;
mod offsets;
mod pcm;
mod resets;
mod response;
mod small_calls;
pub(crate) mod support;
#[cfg(feature = "rayon")]
mod threads;
mod worst_case;
