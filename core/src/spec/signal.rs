//! The `[signal]` table: what the analog signal is.

use super::error::At;
use super::limits::{range, within};
use super::{FilterSpec, SpecError, SpecProblem};
use crate::messages::Number;
use crate::units::Hertz;
use serde::ser::{Serialize, SerializeMap, Serializer};

/// Rms of the signal that is assumed where the spec names none, of full scale: 12 dB below full scale, which
/// leaves room for peaks.
pub const USUAL_RMS: f64 = 0.25;

/// Variance of the rounding to 16 bits of a full scale from -1 to 1, step^2 / 12: the noise that is assumed
/// where the spec states none and there has to be some.
pub const ROUNDING_16_BITS: f64 = 1.0 / (12.0 * (1u64 << 30) as f64);

/// Least and largest floor in decibels below the band.
const FLOORS: std::ops::RangeInclusive<f64> = 3.0..=200.0;

/// The analog signal f = W w, with w of bounded energy or white: every front end sees Phi_i W in place of
/// Phi_i. gamma is then relative to w.
#[derive(Debug, Clone, PartialEq)]
pub struct SignalSpec {
    /// Where the signal lies.
    pub spectrum: SignalSpectrum,
    /// By how many decibels the spectrum falls outside the band; `None` lets the designer choose by the
    /// noise of the converters. Only for a band.
    pub floor_db: Option<f64>,
    /// Rms at the output of the target, of full scale.
    pub rms: f64,
}

/// The spectrum of a signal.
#[derive(Debug, Clone, PartialEq)]
pub enum SignalSpectrum {
    /// Flat in a band, and below a floor outside.
    Band(Band),
    /// |W|^2 of a stable filter, which may have a direct term.
    Filter(FilterSpec),
}

/// The frequencies from `low` to `high`; from 0 for a low-pass signal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Band {
    /// 0 for a low-pass signal.
    pub low: Hertz,
    /// Above `low`.
    pub high: Hertz,
}

impl Band {
    /// From 0 to `high`.
    pub const fn up_to(high: Hertz) -> Self {
        Self { low: Hertz(0.0), high }
    }

    /// Whether the band begins at 0.
    pub fn is_low_pass(self) -> bool {
        self.low.0 == 0.0
    }
}

impl SignalSpec {
    /// A signal in `band` with the usual rms; the floor follows from the noise of the converters.
    pub const fn in_band(band: Band) -> Self {
        Self { spectrum: SignalSpectrum::Band(band), floor_db: None, rms: USUAL_RMS }
    }

    /// The band, unless the spectrum is a filter.
    pub fn band(&self) -> Option<Band> {
        match self.spectrum {
            SignalSpectrum::Band(band) => Some(band),
            SignalSpectrum::Filter(_) => None,
        }
    }

    /// Checks the rules of the table.
    ///
    /// # Errors
    /// [`SpecError`] for the first thing that is wrong.
    pub fn check(&self) -> Result<(), SpecError> {
        check_rms(self.rms).at("rms")?;
        match &self.spectrum {
            SignalSpectrum::Band(band) => {
                check_band(*band).at("band")?;
                self.floor_db.map_or(Ok(()), check_floor).at("floor_db")
            }
            SignalSpectrum::Filter(filter) => {
                filter.check_proper().map_err(|error| error.inside("filter"))?;
                self.floor_db.map_or(Ok(()), |_| Err(needless_floor())).at("floor_db")
            }
        }
    }
}

impl Serialize for SignalSpec {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        match &self.spectrum {
            SignalSpectrum::Band(band) if band.is_low_pass() => map.serialize_entry("band", &band.high)?,
            SignalSpectrum::Band(band) => map.serialize_entry("band", &[band.low, band.high])?,
            SignalSpectrum::Filter(filter) => map.serialize_entry("filter", filter)?,
        }
        if let Some(floor) = self.floor_db {
            map.serialize_entry("floor_db", &floor)?;
        }
        map.serialize_entry("rms", &self.rms)?;
        map.end()
    }
}

/// 0 <= low < high.
fn check_band(band: Band) -> Result<(), SpecProblem> {
    let Band { low, high } = band;
    // Written so that NaN is refused too.
    if !(high.0.is_finite() && high.0 > 0.0) {
        return Err(range(high.0, "Hz", "the band of the signal must end at a positive, finite frequency"));
    }
    if !(low.0 >= 0.0 && low.0 < high.0) {
        let rule = format!(
            "the band of the signal must begin at 0 or above, and below its end at {} Hz",
            Number(high.0)
        );
        return Err(range(low.0, "Hz", rule));
    }
    Ok(())
}

/// The floor in decibels.
fn check_floor(floor: f64) -> Result<(), SpecProblem> {
    let (least, most) = (FLOORS.start(), FLOORS.end());
    let rule = format!("floor_db says how far the signal is down outside its band, {least} to {most} dB");
    within(floor, FLOORS, "dB", rule)
}

/// The rms, of full scale.
fn check_rms(rms: f64) -> Result<(), SpecProblem> {
    let rule = "the rms of the signal at the target must lie above 1e-12, and at 1 or below";
    within(rms, 1e-12..=1.0, "of full scale", rule)
}

/// A floor beside a filter.
fn needless_floor() -> SpecProblem {
    let remedy = "a filter is the whole spectrum with its floor; leave floor_db out, or give a band in place of the filter";
    SpecProblem::Conflict { first: "filter", second: "floor_db", remedy }
}
