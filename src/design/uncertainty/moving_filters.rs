//! Filters that may follow the delays, and their responses.

use crate::bank::{Bank, SynthesisFilters, TapSlopes};
use crate::design::DesignError;
use crate::design::filters::{FilterResponse, polyphase, response};
use crate::linalg::{CMat, Complex, Mat};
use crate::units::Seconds;
use crate::verify::uncertainty::Taps;

/// Filters that may follow the delays.
pub(in crate::design) struct MovingFilters {
    pub(super) nominal: FilterResponse,
    /// For each channel whose delay the taps follow their change per second; none for fixed filters.
    slopes: Vec<(usize, Vec<Mat>)>,
}

/// Their responses at one frequency.
pub(super) struct FiltersAt {
    pub(super) nominal: CMat,
    pub(super) slopes: Vec<(usize, CMat)>,
}

impl MovingFilters {
    /// Fixed filters with the taps `lags`.
    pub(in crate::design) fn fixed(lags: Vec<Mat>) -> Self {
        Self { nominal: FilterResponse::Polynomial(lags), slopes: Vec::new() }
    }

    /// Taps with slopes per fast period.
    pub(in crate::design) fn scheduled(
        taps: &[Vec<f64>],
        slopes: &TapSlopes,
        ratio: usize,
        fast_period: Seconds,
    ) -> Self {
        let by_delay = slopes.by_delay.iter().enumerate().filter(|(_, slope)| !slope.is_empty());
        let per_second = by_delay.map(|(j, slope)| {
            (j, polyphase(slope, ratio).into_iter().map(|lag| lag / fast_period.0).collect())
        });
        Self { nominal: FilterResponse::Polynomial(polyphase(taps, ratio)), slopes: per_second.collect() }
    }

    pub(super) fn of(bank: &Bank, taps: Taps) -> Result<Self, DesignError> {
        let fast_period = bank.spec.as_ref().map_or(bank.fast_period, |spec| spec.fast_period);
        match (taps, &bank.filters, &bank.tap_slopes) {
            (Taps::Scheduled, SynthesisFilters::Fir(list), Some(slopes)) => {
                Ok(Self::scheduled(list, slopes, bank.ratio, fast_period))
            }
            _ => Ok(Self { nominal: FilterResponse::new(bank)?, slopes: Vec::new() }),
        }
    }

    pub(super) fn at(&self, omega: f64) -> FiltersAt {
        let slopes = self.slopes.iter().map(|(j, lags)| (*j, response(lags, omega)));
        FiltersAt { nominal: self.nominal.at(omega), slopes: slopes.collect() }
    }
}

impl FiltersAt {
    /// F where the delays are off by `delays`, in seconds.
    pub(super) fn moved(&self, delays: impl Fn(usize) -> f64) -> CMat {
        let move_by = |f: CMat, (j, slope): &(usize, CMat)| f + slope * Complex::from(delays(*j));
        self.slopes.iter().fold(self.nominal.clone(), move_by)
    }
}
