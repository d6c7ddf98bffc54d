//! What to spend on: where to put cameras, how exact depth must be, and how many bits to give intensities
//! and depths (thesis 3.7).

mod bits;
mod depth;
mod placement;
#[path = "../../thesis_views/theory/random.rs"]
mod random;

pub use bits::{RoundingCosts, rounded_map, sensitivity};
pub use depth::price_of_depth_errors;
pub use placement::{Candidate, Costs, Placement, Wanted};
