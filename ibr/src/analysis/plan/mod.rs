//! What to spend on: where to put cameras, and how many bits to give intensities and depths (thesis 3.7).

mod bits;
mod placement;

pub use bits::{BitSplit, Sensitivity, sensitivity};
pub use placement::{Candidate, Costs, Placement, Wanted};
