//! The search for the errors of a box for which a bank is worst, in double precision.
//!
//! At one frequency K = W - sum_i f_i h_i, and the rows h_i of a converter are those of a node that a
//! [`BoxPlant`] holds. Let (u, v) be the singular vectors of the largest gain of one combination. The rows
//! that maximise Re (u* K v) are found converter by converter, and their gain is no smaller: |K'| >= Re (u*
//! K' v) >= Re (u* K v) = |K|. From several combinations at many frequencies this ends at the local maxima.
//! Each of the largest is then followed between the nodes, and the norm of its plant is computed.
//!
//! So what is found is attained. That nothing larger was missed is not proven; `verify` has an upper bound.

use super::box_plant::{BoxPlant, BoxResponse, Combination};
use crate::design::DesignError;
use crate::design::error_grid::{self, Frequencies, GridFrequency, LocatedPeak};
use crate::design::filters::FilterResponse;
use crate::lti::peak::{Peak, local_maxima, refine};
use hybank_core::bank::SynthesisFilters;
use hybank_core::spec::ErrorPoint;
use hybank_linalg::{CMat, Complex};
use std::cell::OnceCell;

/// What the search of a box tolerates.
struct Settings {
    /// A step that raises the gain by less (relative) ends the ascent: what is left of it is rounding.
    least_step: f64,
    /// Relative change of a gain at which the refinement of a peak ends: a hundredth of the accuracy of a
    /// robust norm.
    flat_gain: f64,
    /// Share of the largest peak from which on others are followed between the nodes, too. Robust banks
    /// have many that are nearly equal, and a node is off its peak by some percent.
    near_worst: f64,
}

/// Of every search.
const SETTINGS: Settings = Settings { least_step: 1e-9, flat_gain: 1e-6, near_worst: 0.9 };

/// Steps of an ascent; two or three suffice.
const MAX_STEPS: usize = 16;
/// Combinations that are carried from one frequency to the next.
const CARRIED: usize = 3;
/// Peaks that are followed between the nodes.
const FOLLOWED: usize = 6;
/// Halvings of the distance of the nodes while a peak is followed, from a quarter of the half-width: a gain
/// is flat at its peak.
const HALVINGS: i32 = 6;

/// Errors with their norm.
pub(in crate::design) struct WorstErrors {
    pub(in crate::design) point: ErrorPoint,
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
        Ok(Self { corners: plant.corners(), plant, frequencies, responses })
    }

    /// Makes the errors of `point` a combination; see [`BoxPlant::include`].
    pub(in crate::design) fn include(&mut self, point: &ErrorPoint) -> Combination {
        let combination = self.plant.include(point);
        self.responses.fill_with(OnceCell::new);
        combination
    }

    /// The errors of the largest norm of a bank found over the box; no errors are among those that are
    /// tried.
    ///
    /// # Errors
    /// As [`BoxSearch::peaks`], and [`DesignError::Lti`] for unstable filters.
    pub(in crate::design) fn worst(&self, filters: &SynthesisFilters) -> Result<WorstErrors, DesignError> {
        let at = |point: ErrorPoint| {
            let peak = self.plant.moved(&point).bank_norm(filters)?;
            Ok::<_, DesignError>(WorstErrors { point, peak })
        };
        let without_errors = at(ErrorPoint::none(self.plant.options.len()))?;
        let response = FilterResponse::new(filters, self.plant.plant.ratio())?;
        self.worst_points(&response)?.into_iter().try_fold(without_errors, |worst, point| {
            let other = at(point)?;
            Ok(if other.peak.gain > worst.peak.gain { other } else { worst })
        })
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
            for start in self.exchanged(&found[k], k, filters)? {
                let peak = self.refined(&start.combination, around, filters)?;
                let location = GridFrequency { frequency: peak.frequency, scenario: start.combination };
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
        let mut carried = vec![vec![0; self.plant.options.len()]];
        for &k in &self.frequencies.first {
            let at = filters.at(self.frequencies.all[k]);
            let mut starts = self.worst_corners(self.response(k), &at)?;
            starts.append(&mut carried);
            all[k] = self.ascended(starts, k, &at)?;
            carried = combinations(&all[k]);
        }
        for pair in self.frequencies.first.windows(2) {
            let (low, high) = (&all[pair[0]], &all[pair[1]]);
            if highest(low).max(highest(high)) >= level {
                let starts = [combinations(low), combinations(high)].concat();
                let between = pair[0] + 1..pair[1];
                for (k, found) in between.clone().zip(&mut all[between]) {
                    *found = self.ascended(starts.clone(), k, &filters.at(self.frequencies.all[k]))?;
                }
            }
        }
        Ok(all)
    }

    /// Some corners of the box: those of the largest gains among [`BoxPlant::corners`].
    fn worst_corners(&self, response: &BoxResponse, filters: &CMat) -> Result<Vec<Combination>, DesignError> {
        let found = |corner: &Combination| {
            Ok(Attained { gain: self.gain(response, filters, corner)?, combination: corner.clone() })
        };
        let mut corners = self.corners.iter().map(found).collect::<Result<Vec<_>, DesignError>>()?;
        corners.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        Ok(combinations(&corners))
    }

    /// Where the ascents from `starts` end, the worst first.
    fn ascended(
        &self,
        starts: Vec<Combination>,
        k: usize,
        filters: &CMat,
    ) -> Result<Vec<Attained>, DesignError> {
        let mut all: Vec<Attained> = Vec::new();
        for start in starts {
            let found = ascend(&self.plant, self.response(k), filters, start)?;
            if all.iter().all(|known| known.combination != found.combination) {
                all.push(found);
            }
        }
        all.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        all.truncate(CARRIED);
        Ok(all)
    }

    /// The same from `found`, where no other error of a single channel has a larger gain.
    fn exchanged(
        &self,
        found: &[Attained],
        k: usize,
        filters: &FilterResponse,
    ) -> Result<Vec<Attained>, DesignError> {
        let (response, at) = (self.response(k), filters.at(self.frequencies.all[k]));
        let mut starts = Vec::new();
        for Attained { mut gain, mut combination } in found.iter().cloned() {
            for i in 0..combination.len() {
                let mut best = combination[i];
                for choice in 0..self.plant.options[i].len() {
                    combination[i] = choice;
                    let other = self.gain(response, &at, &combination)?;
                    if other > gain * (1.0 + SETTINGS.least_step) {
                        (gain, best) = (other, choice);
                    }
                }
                combination[i] = best;
            }
            starts.push(combination);
        }
        self.ascended(starts, k, &at)
    }

    /// The gain of one combination.
    fn gain(
        &self,
        response: &BoxResponse,
        filters: &CMat,
        combination: &[usize],
    ) -> Result<f64, DesignError> {
        Ok(hybank_linalg::largest_singular_value(&self.plant.error(response, filters, combination))?)
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

    /// The points of the box where the gain is largest, the worst first, by the peaks between the nodes.
    ///
    /// # Errors
    /// As [`BoxSearch::peaks`].
    fn worst_points(&self, filters: &FilterResponse) -> Result<Vec<ErrorPoint>, DesignError> {
        let found = self.sweep(filters, 0.0)?;
        let most = found.iter().map(|found| highest(found)).fold(0.0, f64::max);
        let mut peaks = self.peaks_among(&found, filters, SETTINGS.near_worst * most)?;
        peaks.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let mut points: Vec<ErrorPoint> = Vec::new();
        for peak in peaks {
            let point = self.plant.point(&peak.location.scenario);
            if points.len() < FOLLOWED && !points.contains(&point) {
                points.push(self.followed(point, peak.location.frequency, filters)?);
            }
        }
        Ok(points)
    }

    /// The local maximum near `point`, between the nodes too.
    fn followed(
        &self,
        mut point: ErrorPoint,
        frequency: f64,
        filters: &FilterResponse,
    ) -> Result<ErrorPoint, DesignError> {
        let at = filters.at(frequency);
        for halving in 2..2 + HALVINGS {
            let near = self.plant.near(&point, 0.5f64.powi(halving));
            let found = ascend(&near, &near.response(frequency), &at, vec![0; point.delays.len()])?;
            point = near.point(&found.combination);
        }
        Ok(point)
    }
}

/// A combination of locally largest gain, from `combination` on.
fn ascend(
    plant: &BoxPlant,
    response: &BoxResponse,
    filters: &CMat,
    mut combination: Combination,
) -> Result<Attained, DesignError> {
    let mut gain = 0.0;
    for _ in 0..MAX_STEPS {
        let svd = hybank_linalg::svd(&plant.error(response, filters, &combination))?;
        if svd.s[0] <= gain * (1.0 + SETTINGS.least_step) {
            break;
        }
        gain = svd.s[0];
        let (left, right) = (svd.u.columns(0, 1).into_owned(), svd.v.columns(0, 1).into_owned());
        let direction = SingularPair { samples: &response.nodes * right, filters: left.ad_mul(filters) };
        if !direction.improve(plant, &mut combination) {
            break;
        }
    }
    Ok(Attained { gain, combination })
}

/// The largest gain of combinations of which the worst comes first.
fn highest(found: &[Attained]) -> f64 {
    found.first().map_or(0.0, |found| found.gain)
}

/// The first combinations.
fn combinations(found: &[Attained]) -> Vec<Combination> {
    found.iter().take(CARRIED).map(|found| found.combination.clone()).collect()
}

/// u* F and H v for the singular vectors (u, v) of an error.
struct SingularPair {
    /// Of all nodes.
    samples: CMat,
    /// u* F.
    filters: CMat,
}

impl SingularPair {
    /// Lowers Re (u* F H v), channel by channel. Returns whether anything changed.
    fn improve(&self, plant: &BoxPlant, combination: &mut Combination) -> bool {
        let mut changed = false;
        for i in 0..combination.len() {
            let own = combination[i];
            let mut best = (own, self.output(plant, combination));
            for choice in 0..plant.options[i].len() {
                combination[i] = choice;
                let output = self.output(plant, combination);
                if output < best.1 {
                    best = (choice, output);
                }
            }
            combination[i] = best.0;
            changed |= best.0 != own;
        }
        changed
    }

    /// Re (u* F H v).
    fn output(&self, plant: &BoxPlant, combination: &[usize]) -> f64 {
        let chosen = |i: usize| plant.options[i][combination[i]];
        let term = |i: usize| {
            let gain = Complex::from(1.0 + chosen(i).gain);
            let of = |(column, row): (usize, usize)| (self.filters[column] * self.samples[row] * gain).re;
            plant.columns(i).zip(plant.rows(chosen(i).node)).map(of).sum::<f64>()
        };
        (0..combination.len()).map(term).sum()
    }
}
