//! The `[signal]` table: what the analog signal is.

use super::filter_reader::proper_filter;
use super::limits::{range, within};
use super::reader::{Either, Fields, Value};
use super::{Fault, FilterSpec, SpecProblem};
use crate::messages::Number;
use crate::units::Hertz;
use serde::ser::{Serialize, SerializeMap, Serializer};

/// Rms of the signal that is assumed where the spec names none, of full scale: 12 dB below full scale, which
/// leaves room for peaks.
pub const USUAL_RMS: f64 = 0.25;

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
#[non_exhaustive]
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

    /// Whether the band holds `frequency`.
    pub fn contains(self, frequency: Hertz) -> bool {
        (self.low.0..=self.high.0).contains(&frequency.0)
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
    /// The first [`SpecProblem`] found.
    pub fn check(&self) -> Result<(), SpecProblem> {
        check_rms(self.rms)?;
        match &self.spectrum {
            SignalSpectrum::Band(band) => {
                check_band(*band)?;
                self.floor_db.map_or(Ok(()), check_floor)
            }
            SignalSpectrum::Filter(filter) => {
                filter.check_proper()?;
                self.floor_db.map_or(Ok(()), |_| Err(needless_floor()))
            }
        }
    }
}

/// The keys of the table.
pub(super) const KEYS: [&str; 4] = ["band", "filter", "floor_db", "rms"];

/// Reads the table.
pub(super) fn read(item: &Value<'_>) -> Result<SignalSpec, Fault> {
    let fields = item.fields(&KEYS)?;
    let spectrum = spectrum(&fields)?;
    let floor_db = fields.read("floor_db", |v| match &spectrum {
        SignalSpectrum::Filter(_) => Err(v.fault(needless_floor())),
        SignalSpectrum::Band(_) => v.number_in(check_floor),
    })?;
    Ok(SignalSpec {
        spectrum,
        floor_db,
        rms: fields.read("rms", |v| v.number_in(check_rms))?.unwrap_or(USUAL_RMS),
    })
}

fn spectrum(fields: &Fields<'_>) -> Result<SignalSpectrum, Fault> {
    match fields.either("band", "filter", "each is the spectrum of the signal, keep one of them")? {
        Either::First(band) => {
            let read = band_of(&band)?;
            check_band(read).map_err(|problem| band.fault(problem))?;
            Ok(SignalSpectrum::Band(read))
        }
        Either::Second(filter) => proper_filter(&filter).map(SignalSpectrum::Filter),
        Either::Neither => {
            let remedy = "say which frequencies the signal occupies, as in band = \"8 kHz\" or band = [\"60 MHz\", \"80 MHz\"]";
            Err(fields.whole().fault(SpecProblem::MissingKey { key: "band", remedy }))
        }
    }
}

/// One frequency, the end of a band that begins at 0, or two.
fn band_of(value: &Value<'_>) -> Result<Band, Fault> {
    if !value.is_list() {
        return Ok(Band::up_to(value.frequency()?));
    }
    let [low, high] = value.frequencies("a frequency, or a list of two")?;
    // A band from -0.0 begins at 0.0.
    Ok(Band { low: Hertz(low.0 + 0.0), high })
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
