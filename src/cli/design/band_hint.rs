//! What a band in the spec would bring.

use crate::bank::Bank;
use crate::design::{self, Design, DesignError, ProofSearch};
use crate::figures::{snr, target_band};
use crate::overview::{band, decibels_of};
use crate::spec::{SignalSpec, Spec};
use crate::units::{Decibels, Hertz};

/// No second design is made after one that took longer, in seconds.
const MOST_SECONDS: f64 = 10.0;
/// Gains below this are not worth a line.
const WORTHWHILE: Decibels = Decibels(1.0);

/// The signal-to-noise ratio within the band of the target, of a bank that is designed without a signal and
/// of one that is designed for that band.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub(in crate::cli) struct BandHint {
    low_hertz: Hertz,
    high_hertz: Hertz,
    snr_db: Decibels,
    instead_of_db: Decibels,
}

impl BandHint {
    /// For a design without a signal that took so many seconds; `None` where a band gains nothing.
    ///
    /// # Errors
    /// [`DesignError`] of the figures; a second design that fails is no hint.
    pub(super) fn new(found: &Design, seconds: f64) -> Result<Option<Self>, DesignError> {
        let Some(spec) = found.bank.spec.as_ref().filter(|spec| spec.signal.is_none()) else {
            return Ok(None);
        };
        let Some(band) = target_band(spec)?.filter(|_| seconds < MOST_SECONDS) else { return Ok(None) };
        let signal = Some(SignalSpec::in_band(band));
        let wanted = Spec { signal, latency: Some(found.bank.latency), ..spec.clone() };
        let Ok(other) = design::design_with(&wanted, ProofSearch::Skip) else { return Ok(None) };
        let instead_of_db = snr(&Bank { spec: Some(wanted), ..found.bank.clone() })?.total_db;
        let snr_db = snr(&other.bank)?.total_db;
        Ok((snr_db - instead_of_db >= WORTHWHILE).then_some(Self {
            low_hertz: band.low,
            high_hertz: band.high,
            snr_db,
            instead_of_db,
        }))
    }

    /// One line.
    pub(super) fn text(&self, is_normalised: bool) -> String {
        format!(
            "signal     without [signal]; with the band {} the SNR in the band would be {} instead of {}\n",
            band(self.low_hertz, self.high_hertz, is_normalised),
            decibels_of(self.snr_db),
            decibels_of(self.instead_of_db),
        )
    }
}
