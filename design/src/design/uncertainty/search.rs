//! The search for the errors of a box for which a bank is worst, in double precision.
//!
//! At one frequency K = W - sum_i f_i h_i is affine in the rows h_i, which are nearly affine in the errors
//! of a converter. The largest gain of what is affine lies at a corner, so corners are tried, and no
//! errors: the errors of one converter after the other are exchanged for those of the largest gain until no
//! exchange raises it. From several combinations at many frequencies this ends at the local maxima, and the
//! norm of the largest ones is computed.
//!
//! So what is found is attained. That nothing larger was missed is not proven; `verify` has an upper bound.

use super::box_plant::{BoxPlant, BoxResponse, Combination};
use crate::design::DesignError;
use crate::design::error_grid::{self, Frequencies, GridFrequency, LocatedPeak};
use crate::design::filters::FilterResponse;
use crate::lti::peak::{Peak, local_maxima, refine};
use hybank_core::bank::SynthesisFilters;
use hybank_linalg::CMat;
use std::cell::OnceCell;

/// What the search of a box tolerates.
struct Settings {
    /// An exchange that raises the gain by less (relative) is none: what it gains is rounding.
    least_step: f64,
    /// Relative change of a gain at which the refinement of a peak ends: a hundredth of the accuracy of a
    /// robust norm.
    flat_gain: f64,
    /// Share of the largest peak from which on the norms of others are computed, too. Robust banks have many
    /// that are nearly equal.
    near_worst: f64,
}

/// Of every search.
const SETTINGS: Settings = Settings { least_step: 1e-9, flat_gain: 1e-6, near_worst: 0.98 };

/// Rounds over all converters; two or three suffice.
const MOST_ROUNDS: usize = 16;
/// Combinations that are carried from one frequency to the next.
const CARRIED: usize = 3;
/// Corners whose gain is computed at a frequency; an ascent begins at the largest one too.
const CORNERS: usize = 64;
/// Combinations whose norm is computed.
const NORMS: usize = 4;

/// Errors with their norm.
pub(in crate::design) struct WorstErrors {
    pub(in crate::design) combination: Combination,
    pub(in crate::design) peak: Peak,
}

/// A combination with its gain at some frequency.
#[derive(Debug, Clone)]
struct Attained {
    gain: f64,
    combination: Combination,
}

/// The search over one box.
pub(in crate::design) struct BoxSearch {
    pub(in crate::design) plant: BoxPlant,
    frequencies: Frequencies,
    responses: Vec<OnceCell<BoxResponse>>,
    corners: Vec<Combination>,
}

impl BoxSearch {
    /// For filters of `lags` slow lags, with the resonances of their own.
    ///
    /// # Errors
    /// [`DesignError::Lti`] if a front end is not stable.
    pub(in crate::design) fn new(
        plant: BoxPlant,
        lags: usize,
        resonances: &[f64],
    ) -> Result<Self, DesignError> {
        let frequencies = Frequencies::new(lags, &[&plant.plant.resonances()?, resonances].concat());
        let responses = frequencies.all.iter().map(|_| OnceCell::new()).collect();
        Ok(Self { corners: plant.corners(CORNERS), plant, frequencies, responses })
    }

    /// The errors of the largest norm of a bank found over the box; no errors are among those that are
    /// tried.
    ///
    /// # Errors
    /// As [`BoxSearch::peaks`], and [`DesignError::Lti`] for unstable filters.
    pub(in crate::design) fn worst(&self, filters: &SynthesisFilters) -> Result<WorstErrors, DesignError> {
        let at = |combination: Combination| {
            let peak = self.plant.moved(&combination).bank_norm(filters)?;
            Ok::<_, DesignError>(WorstErrors { combination, peak })
        };
        let without_errors = at(self.no_errors())?;
        let response = FilterResponse::new(filters, self.plant.plant.ratio())?;
        self.worst_combinations(&response)?.into_iter().try_fold(without_errors, |worst, combination| {
            let other = at(combination)?;
            Ok(if other.peak.gain > worst.peak.gain { other } else { worst })
        })
    }

    /// The combinations of the largest peaks, the worst first.
    fn worst_combinations(&self, filters: &FilterResponse) -> Result<Vec<Combination>, DesignError> {
        let found = self.sweep(filters, 0.0)?;
        let most = found.iter().map(|found| highest(found)).fold(0.0, f64::max);
        let mut peaks = self.peaks_among(&found, filters, SETTINGS.near_worst * most)?;
        peaks.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let mut worst: Vec<Combination> = Vec::new();
        for peak in peaks {
            if worst.len() < NORMS && !worst.contains(&peak.location.scenario) {
                worst.push(peak.location.scenario);
            }
        }
        Ok(worst)
    }

    fn no_errors(&self) -> Combination {
        vec![0; self.plant.options.len()]
    }

    /// The peaks over the frequencies above `level`, each with the combination of errors that attains it.
    ///
    /// # Errors
    /// [`DesignError::Linalg`] if a decomposition does not converge.
    pub(in crate::design) fn peaks(
        &self,
        filters: &FilterResponse,
        level: f64,
    ) -> Result<Vec<LocatedPeak<Combination>>, DesignError> {
        let found = self.sweep(filters, error_grid::SETTINGS.prune_level * level)?;
        self.peaks_among(&found, filters, level)
    }

    /// The refined local maxima of what a sweep found.
    fn peaks_among(
        &self,
        found: &[Vec<Attained>],
        filters: &FilterResponse,
        level: f64,
    ) -> Result<Vec<LocatedPeak<Combination>>, DesignError> {
        let grid: Vec<Peak> = found
            .iter()
            .zip(&self.frequencies.all)
            .map(|(found, &frequency)| Peak { gain: highest(found), frequency })
            .collect();
        let mut peaks: Vec<LocatedPeak<Combination>> = Vec::new();
        for around in local_maxima(&grid)
            .into_iter()
            .filter(|[_, peak, _]| peak.gain > error_grid::SETTINGS.prune_level * level)
        {
            let k = self.frequencies.all.partition_point(|omega| *omega < around[1].frequency);
            for start in &found[k] {
                let peak = self.refined(&start.combination, around, filters)?;
                let scenario = start.combination.clone();
                let location = GridFrequency { frequency: peak.frequency, scenario };
                if peak.gain > level {
                    peaks.push(LocatedPeak { gain: peak.gain, location });
                }
            }
        }
        Ok(peaks)
    }

    /// The combinations found at each frequency, the worst first. Where the gains are below `level` some
    /// frequencies are left out.
    fn sweep(&self, filters: &FilterResponse, level: f64) -> Result<Vec<Vec<Attained>>, DesignError> {
        let mut all: Vec<Vec<Attained>> = vec![Vec::new(); self.frequencies.all.len()];
        let mut carried = vec![self.no_errors()];
        for &k in &self.frequencies.first {
            carried.push(self.worst_corner(k, filters)?);
            all[k] = self.ascended(carried, k, filters)?;
            carried = combinations(&all[k]);
        }
        for pair in self.frequencies.first.windows(2) {
            let (low, high) = (&all[pair[0]], &all[pair[1]]);
            if highest(low).max(highest(high)) >= level {
                let starts = [combinations(low), combinations(high)].concat();
                let between = pair[0] + 1..pair[1];
                for (k, found) in between.clone().zip(&mut all[between]) {
                    *found = self.ascended(starts.clone(), k, filters)?;
                }
            }
        }
        Ok(all)
    }

    /// The corner of the largest gain.
    fn worst_corner(&self, k: usize, filters: &FilterResponse) -> Result<Combination, DesignError> {
        let (response, at) = (self.response(k), filters.at(self.frequencies.all[k]));
        let mut worst = (0.0, self.no_errors());
        for corner in &self.corners {
            let gain = self.gain(response, &at, corner)?;
            if gain > worst.0 {
                worst = (gain, corner.clone());
            }
        }
        Ok(worst.1)
    }

    /// Where the ascents from `starts` end, the worst first.
    fn ascended(
        &self,
        starts: Vec<Combination>,
        k: usize,
        filters: &FilterResponse,
    ) -> Result<Vec<Attained>, DesignError> {
        let (response, at) = (self.response(k), filters.at(self.frequencies.all[k]));
        let mut all: Vec<Attained> = Vec::new();
        for start in starts {
            let found = self.ascend(response, &at, start)?;
            if all.iter().all(|known| known.combination != found.combination) {
                all.push(found);
            }
        }
        all.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        all.truncate(CARRIED);
        Ok(all)
    }

    /// A combination from which no other error of a single converter has a larger gain.
    fn ascend(
        &self,
        response: &BoxResponse,
        filters: &CMat,
        mut combination: Combination,
    ) -> Result<Attained, DesignError> {
        let mut gain = self.gain(response, filters, &combination)?;
        for _ in 0..MOST_ROUNDS {
            let before = gain;
            for i in 0..combination.len() {
                let mut best = combination[i];
                for choice in 0..self.plant.options[i].len() {
                    combination[i] = choice;
                    let other = self.gain(response, filters, &combination)?;
                    if other > gain * (1.0 + SETTINGS.least_step) {
                        (gain, best) = (other, choice);
                    }
                }
                combination[i] = best;
            }
            if gain == before {
                break;
            }
        }
        Ok(Attained { gain, combination })
    }

    /// The gain of one combination.
    fn gain(
        &self,
        response: &BoxResponse,
        filters: &CMat,
        combination: &[usize],
    ) -> Result<f64, DesignError> {
        let error = &response.references - filters * self.plant.measurements(response, combination);
        Ok(hybank_linalg::largest_singular_value(&error)?)
    }

    /// The peak of one combination over the frequencies.
    fn refined(
        &self,
        combination: &[usize],
        around: [Peak; 3],
        filters: &FilterResponse,
    ) -> Result<Peak, DesignError> {
        let at = |frequency: f64| {
            let response = self.plant.response(frequency);
            let gain = self.gain(&response, &filters.at(frequency), combination)?;
            Ok::<_, DesignError>(Peak { gain, frequency })
        };
        let [low, middle, high] = around;
        let around = [at(low.frequency)?, at(middle.frequency)?, at(high.frequency)?];
        refine(at, around, SETTINGS.flat_gain)
    }

    fn response(&self, k: usize) -> &BoxResponse {
        self.responses[k].get_or_init(|| self.plant.response(self.frequencies.all[k]))
    }
}

/// The largest gain of combinations of which the worst comes first.
fn highest(found: &[Attained]) -> f64 {
    found.first().map_or(0.0, |found| found.gain)
}

fn combinations(found: &[Attained]) -> Vec<Combination> {
    found.iter().map(|found| found.combination.clone()).collect()
}
