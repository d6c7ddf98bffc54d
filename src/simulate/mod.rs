//! Virtual converters: what ideal samplers capture of an analog signal that has passed the analog front
//! ends.
//!
//! Channel i captures (phi_i * f)(k M - D_i), time in fast periods. The response to an analytic [`Source`]
//! is computed by closed forms, matrix exponentials and quadrature that is exact to rounding; the response
//! to a [`Periodic`] by Fourier synthesis. No time grid is involved, so the result at an instant
//! does not depend on the other instants. A [`Sampler`] adds errors of delay, gain, offset and
//! clock, jitter, noise and rounding.

mod capture;
mod complex;
mod converter;
mod errors;
mod normal;
mod parse;
mod recording;
mod response;
mod signal;
mod source;
mod walk;
mod workload;

pub use capture::{Analog, interleaved, target};
pub use complex::ComplexSource;
pub use converter::{Captured, Delivered, Quantiser, Sampler, capture};
pub use errors::{ErrorLists, ErrorsOfConverter, VirtualConverter};
pub use parse::ParseSourceError;
pub use recording::Periodic;
pub use response::{Instants, sample};
pub use signal::Signal;
pub use source::{NormalisedSource, Source, Tone};
pub use walk::sample_at;
pub use workload::{MOST_SAMPLES, WorkloadError, frames};
