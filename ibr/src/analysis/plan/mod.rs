//! What to spend on: where to put cameras, how exact depth must be, and how many bits to give intensities
//! and depths (thesis 3.7).

mod advice;
mod bits;
mod depth;
mod placement;
mod search;

pub use advice::{Advice, AnotherView};
pub use bits::{BitSplit, RoundingCosts, Sensitivity, rounded_map, sensitivity};
pub use depth::price_of_depth_errors;
pub use placement::{Candidate, Costs, Placement, Wanted};
pub use search::Search;
