//! What stands between recordings and a running bank: missing samples, latency, the end of the input.

mod gaps;
mod touch;

pub use gaps::{Gap, GapFiller, GapPolicy};
