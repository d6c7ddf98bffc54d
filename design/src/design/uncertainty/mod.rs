//! What errors of delays, gains and cut-offs cost a finished bank: a proven bound of gamma over a box of
//! them, and the errors of the box for which a search finds the largest gamma.
//!
//! ```
//! use hybank_design::design::uncertainty::{BoxStudy, BoxWidths};
//! use hybank_core::{bank::Bank, quantity};
//! let bank = Bank::from_json(include_str!("../../../../filters/thesis-fir.json"), "thesis-fir.json")?;
//! // The second delay may be off by a hundredth of a fast period.
//! let widths = BoxWidths { delay_box: vec![quantity::time("0.01 samples")?], ..BoxWidths::default() };
//! let worst = BoxStudy::new(&bank, &widths.error_box(&bank)?.ok_or("no box")?)?;
//! assert!(worst.attained > 0.0401 && worst.attained < worst.upper && worst.upper < 0.043);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub(super) mod box_plant;
pub(super) mod search;
mod study;
mod widths;

pub use study::BoxStudy;
pub use widths::{BoxWidths, ReferenceChannel};

#[cfg(test)]
mod tests;
