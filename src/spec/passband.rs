//! Where a filter family passes: a cutoff, or the two edges of a band.

use serde::{Serialize, Serializer};

use super::FilterProblem;
use super::limits::MAX_ENTRY;
use crate::messages::Number;
use crate::units::Hertz;

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
    pub(super) fn check(self) -> Result<(), FilterProblem> {
        match self {
            Self::LowPass { cutoff } if is_too_large(cutoff) => {
                Err(FilterProblem::too_large("cutoff", cutoff.0, MAX_ENTRY))
            }
            Self::LowPass { cutoff } if cutoff.0 <= 0.0 => {
                Err(refused("cutoff", cutoff, "the cutoff must be a positive frequency in hertz".into()))
            }
            Self::LowPass { .. } => Ok(()),
            Self::BandPass { low, high } => check_band(low, high),
        }
    }
}

/// True for NaN too.
fn is_too_large(frequency: Hertz) -> bool {
    !(0.0..=MAX_ENTRY).contains(&frequency.0.abs())
}

fn check_band(low: Hertz, high: Hertz) -> Result<(), FilterProblem> {
    if let Some(edge) = [low, high].into_iter().find(|&edge| is_too_large(edge)) {
        return Err(FilterProblem::too_large("band", edge.0, MAX_ENTRY));
    }
    if low.0 <= 0.0 {
        let rule = format!(
            "a band-pass begins above 0 Hz; for the low-pass from 0 to {high} Hz write cutoff = {high}",
            high = Number(high.0)
        );
        return Err(refused("band", low, rule));
    }
    if low == high {
        let rule = "both edges of the band are at this frequency; give two, as in band = [60e6, 80e6]".into();
        return Err(refused("band", high, rule));
    }
    if high < low {
        let rule = format!(
            "the upper edge is below the lower one, {low} Hz; write band = [{high}, {low}]",
            low = Number(low.0),
            high = Number(high.0)
        );
        return Err(refused("band", high, rule));
    }
    Ok(())
}

fn refused(key: &'static str, value: Hertz, rule: String) -> FilterProblem {
    FilterProblem::of(key, format!("{key} = {value} Hz: {rule}", value = Number(value.0)))
}
