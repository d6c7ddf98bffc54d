//! Virtual converters: what ideal samplers behind the analog front ends would have captured.
//!
//! Analytic sources are answered by closed forms and matrix exponentials, recordings by exact Fourier
//! synthesis; nothing is ever stepped on a coarse time grid.

mod capture;
mod recording;
mod response;
mod source;

pub use capture::{Analog, Captured, capture, interleaved};
pub use recording::Recording;
pub use response::{Instants, panels, sample};
pub use source::{ParseSourceError, Source, Tone};
