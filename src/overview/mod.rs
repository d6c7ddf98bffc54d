//! What reports show of a bank: its figures with their meaning, pictures, and what is doubtful about it.
//! The commands `design`, `plot` and `report` show it.
//!
//! ```
//! use hybank::bank::Bank;
//! use hybank::overview::{Facts, pictures};
//! let bank = Bank::from_json(include_str!("../../filters/thesis-fir.json"), "thesis-fir.json")?;
//! let facts = Facts::new(&bank, bank.spec.as_ref().ok_or("no spec")?)?;
//! let gamma = facts.error.iter().find(|fact| fact.name == "gamma").ok_or("no gamma")?;
//! assert_eq!(gamma.value, "0.039932");
//! assert_eq!(facts.channels[0].delay, "1.2 samples");
//! let tones = &pictures(&bank)?[0];
//! assert!(tones.name == "tones" && tones.chart.to_svg()?.starts_with("<svg"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod facts;
mod measured;
pub mod page;
mod pictures;
mod spur_chart;
mod terms;
mod text;
mod understood;

pub use facts::{ChannelFact, Facts, uselessness, warnings};
pub use measured::{BeforeAfter, Figure, Unmeasured, causes, column};
pub use pictures::{Picture, pictures};
pub use spur_chart::{DrawnRecording, before_after, spectra, spur_chart};
pub use terms::{Fact, band, figure_facts, key_figures, rounded as decibels_of};
pub use text::{decibels, frequency, six_digits};
pub use understood::understood;
