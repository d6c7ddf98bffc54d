//! Designs the synthesis filters of hybrid filter banks, and says how good they are.
//!
//! [`design`] makes a bank of a spec; [`figures`] are its SNR, its images and its error of gain, and what
//! the usual ways would give. [`lti`] has state-space systems, their norms and Riccati equations, [`lmi`]
//! the interior-point methods of sampled frequencies; neither knows what a filter bank is.

#![forbid(unsafe_code)]

pub mod design;
pub mod figures;
pub mod lmi;
pub mod lti;

#[cfg(test)]
mod tests;
