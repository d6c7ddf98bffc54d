//! Where a filter family passes: a cutoff, or the two edges of a band.

use serde::{Serialize, Serializer};

use super::SpecError;
use super::error::{At, refused};
use super::limits::{MAX_ENTRY, within};
use crate::messages::Number;
use crate::units::Hertz;

/// The least positive number.
const ABOVE_ZERO: f64 = f64::from_bits(1);

/// The edges of a family member, with scipy.signal's meaning for the family. Written as the key `cutoff` or
/// as the key `band`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub enum Passband {
    /// From 0 to the cutoff: one pole per order.
    #[serde(rename = "cutoff", serialize_with = "as_number")]
    LowPass {
        /// The cutoff.
        cutoff: Hertz,
    },
    /// From edge to edge: two poles per order. An edge means for the band-pass what the cutoff means for the
    /// low-pass.
    #[serde(rename = "band", serialize_with = "as_pair")]
    BandPass {
        /// f_1, above 0.
        low: Hertz,
        /// f_2, above f_1.
        high: Hertz,
    },
}

fn as_number<S: Serializer>(cutoff: &Hertz, serializer: S) -> Result<S::Ok, S::Error> {
    cutoff.serialize(serializer)
}

fn as_pair<S: Serializer>(low: &Hertz, high: &Hertz, serializer: S) -> Result<S::Ok, S::Error> {
    [low, high].serialize(serializer)
}

impl Passband {
    /// Poles of the filter for each pole of its low-pass prototype.
    pub const fn poles_per_order(self) -> usize {
        match self {
            Self::LowPass { .. } => 1,
            Self::BandPass { .. } => 2,
        }
    }

    /// Zeros and poles of the filter, for those of its low-pass prototype. In a band-pass each pole of the
    /// prototype without a zero gets a zero at s = 0, so the excess of poles stays.
    pub(super) const fn degrees(self, zeros: usize, poles: usize) -> (usize, usize) {
        match self {
            Self::LowPass { .. } => (zeros, poles),
            Self::BandPass { .. } => (zeros + poles, 2 * poles),
        }
    }

    /// All edges times `factor`.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        match self {
            Self::LowPass { cutoff } => Self::LowPass { cutoff: cutoff * factor },
            Self::BandPass { low, high } => Self::BandPass { low: low * factor, high: high * factor },
        }
    }

    /// Checks the order of the edges.
    pub(super) fn check(self) -> Result<(), SpecError> {
        match self {
            Self::LowPass { cutoff } => {
                let rule = "the cutoff must be a positive frequency in hertz";
                within(cutoff.0, ABOVE_ZERO..=MAX_ENTRY, "Hz", rule).at("cutoff")
            }
            Self::BandPass { low, high } => check_band(low, high),
        }
    }
}

fn check_band(low: Hertz, high: Hertz) -> Result<(), SpecError> {
    let rule = format!(
        "a band-pass begins above 0 Hz; for the low-pass from 0 to {high} Hz write cutoff = {high}",
        high = Number(high.0)
    );
    within(low.0, ABOVE_ZERO..=MAX_ENTRY, "Hz", rule).at("band")?;
    within(high.0, ABOVE_ZERO..=MAX_ENTRY, "Hz", "a band ends at a finite frequency").at("band")?;
    if low == high {
        return Err(refused("band", "both edges are at one frequency; give two, as in band = [60e6, 80e6]"));
    }
    if high < low {
        let rule = format!(
            "the upper edge is below the lower one; write band = [{high}, {low}]",
            low = Number(low.0),
            high = Number(high.0)
        );
        return Err(refused("band", rule));
    }
    Ok(())
}
