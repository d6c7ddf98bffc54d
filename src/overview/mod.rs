//! What reports show of a bank: its figures with their meaning, pictures, and what is doubtful about it.
//! The commands `design`, `plot` and `report` and the page of `playground/` show it.

mod facts;
mod measured;
#[cfg(feature = "page")]
pub mod page;
mod pictures;
mod spur_chart;
mod terms;
mod text;
mod understood;

pub use facts::{ChannelFact, Facts, uselessness, warnings};
pub use measured::{BeforeAfter, Figure, Unmeasured, causes, column};
pub use pictures::{Picture, pictures};
pub use spur_chart::{Drawn, before_after, spectra, spur_chart};
pub use terms::{Fact, band, figure_facts, rounded as decibels_of};
pub use text::{change, decibels, frequency, six_digits};
pub use understood::understood;
