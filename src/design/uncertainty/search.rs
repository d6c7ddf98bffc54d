//! The search for the errors of a box for which a bank is worst, in double precision.
//!
//! At one frequency K = W - sum_i f_i h_i, and each row h_i is one of those that a [`BoxPlant`] holds. Let
//! (u, v) be the singular vectors of the largest gain of one combination. The rows that maximise Re (u* K v)
//! are found channel by channel, and their gain is no smaller: |K'| >= Re (u* K' v) >= Re (u* K v) = |K|.
//! From several combinations at many frequencies this ends at the local maxima. Each of the largest is
//! then followed between the nodes, and the norm of its plant is computed.
//!
//! So what is found is attained. That nothing larger was missed is not proven; `verify` has an upper bound.

use super::box_plant::{BoxPlant, BoxResponse, Combination};
use crate::bank::{Bank, SynthesisFilters, TapSlopes};
use crate::design::DesignError;
use crate::design::error_grid::{Frequencies, PRUNE_LEVEL};
use crate::design::exchange::{LocatedPeak, Location, Peaks};
use crate::design::filters::{FilterResponse, polyphase, response};
use crate::design::plant::LiftedPlant;
use crate::design::problem::Problem;
use crate::linalg::{self, CMat, Complex, Mat};
use crate::lti::peak::{Peak, local_maxima, refine};
use crate::units::{RadiansPerSlowPeriod, Seconds};
use crate::verify::uncertainty::{ErrorBox, ErrorPoint, Taps};
use std::cell::OnceCell;

/// Steps of a climb; two or three suffice.
const MAX_STEPS: usize = 16;
/// A step that raises the gain by less (relative) ends the climb.
const LEAST_STEP: f64 = 1e-9;
/// Combinations that are carried from one frequency to the next.
const CARRIED: usize = 3;
/// Relative change of a gain at which the refinement of a peak ends.
const FLAT_GAIN: f64 = 1e-8;
/// Peaks that are followed between the nodes.
const FOLLOWED: usize = 4;
/// Halvings of the distance of the nodes while a peak is followed, from a quarter of the half-width: a gain is flat at its
/// peak.
const HALVINGS: i32 = 6;

/// The norm of `bank` with the errors of `point`, and the frequency of its peak, with fixed or with
/// delay-scheduled taps.
///
/// # Errors
/// As [`super::super::analyze`].
pub fn norm_at(
    bank: &Bank,
    point: &ErrorPoint,
    taps: Taps,
) -> Result<(f64, RadiansPerSlowPeriod), DesignError> {
    let peak = LiftedPlant::new(&moved(bank, point)?)?.bank_norm(&taps.filters(bank, point))?;
    Ok((peak.gain, RadiansPerSlowPeriod(peak.frequency)))
}

/// The problem of `bank` with the errors of `point`.
pub(super) fn moved(bank: &Bank, point: &ErrorPoint) -> Result<Problem, DesignError> {
    Problem::with_errors(bank.spec.as_ref().ok_or(DesignError::NoSpec)?, bank.latency, point)
}

/// Points of the box that may be the worst ones, with their peak frequencies; the centre among them.
///
/// # Errors
/// As [`super::super::analyze`].
pub(super) fn candidates(
    bank: &Bank,
    errors: &ErrorBox,
    taps: Taps,
) -> Result<Vec<(ErrorPoint, RadiansPerSlowPeriod)>, DesignError> {
    let plant = BoxPlant::new(bank.spec.as_ref().ok_or(DesignError::NoSpec)?, bank.latency, errors)?;
    let filters = MovingFilters::of(bank, taps)?;
    let search = BoxSearch::new(plant, filters.nominal.lags(), filters.nominal.resonances())?;
    let mut points = search.worst_points(&filters)?;
    points.push(ErrorPoint::none(bank.channel_count()));
    let norm = |point: ErrorPoint| Ok((norm_at(bank, &point, taps)?.1, point));
    let found = points.into_iter().map(norm).collect::<Result<Vec<_>, DesignError>>()?;
    Ok(found.into_iter().map(|(frequency, point)| (point, frequency)).collect())
}

/// Filters that may follow the delays.
pub(in crate::design) struct MovingFilters {
    nominal: FilterResponse,
    /// For each channel whose delay the taps follow their change per second; none for fixed filters.
    slopes: Vec<(usize, Vec<Mat>)>,
}

/// Their responses at one frequency.
struct FiltersAt {
    nominal: CMat,
    slopes: Vec<(usize, CMat)>,
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

    fn of(bank: &Bank, taps: Taps) -> Result<Self, DesignError> {
        let fast_period = bank.spec.as_ref().map_or(bank.fast_period, |spec| spec.fast_period);
        match (taps, &bank.filters, &bank.tap_slopes) {
            (Taps::Following, SynthesisFilters::Fir(list), Some(slopes)) => {
                Ok(Self::scheduled(list, slopes, bank.ratio, fast_period))
            }
            _ => Ok(Self { nominal: FilterResponse::new(bank)?, slopes: Vec::new() }),
        }
    }

    fn at(&self, omega: f64) -> FiltersAt {
        let slopes = self.slopes.iter().map(|(j, lags)| (*j, response(lags, omega)));
        FiltersAt { nominal: self.nominal.at(omega), slopes: slopes.collect() }
    }
}

impl FiltersAt {
    /// F where the delays are off by `delays`, in seconds.
    fn moved(&self, delays: impl Fn(usize) -> f64) -> CMat {
        let move_by = |f: CMat, (j, slope): &(usize, CMat)| f + slope * Complex::from(delays(*j));
        self.slopes.iter().fold(self.nominal.clone(), move_by)
    }
}

/// A combination with its gain at some frequency.
#[derive(Debug, Clone)]
struct Found {
    gain: f64,
    combination: Combination,
}

/// The search over one box.
pub(in crate::design) struct BoxSearch {
    plant: BoxPlant,
    frequencies: Frequencies,
    responses: Vec<OnceCell<BoxResponse>>,
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
        let frequencies = Frequencies::new(lags, &[plant.resonances()?, resonances].concat());
        let responses = frequencies.all.iter().map(|_| OnceCell::new()).collect();
        Ok(Self { plant, frequencies, responses })
    }

    /// The front ends.
    pub(in crate::design) fn plant(&self) -> &BoxPlant {
        &self.plant
    }

    /// Makes the errors of `point` a combination; see [`BoxPlant::include`].
    ///
    /// # Errors
    /// As [`BoxPlant::include`].
    pub(in crate::design) fn include(&mut self, point: &ErrorPoint) -> Result<Combination, DesignError> {
        let combination = self.plant.include(point)?;
        self.responses.fill_with(OnceCell::new);
        Ok(combination)
    }

    /// The peaks over the frequencies above `level`, each with the combination of errors that attains it.
    ///
    /// # Errors
    /// [`DesignError::Linalg`] if a decomposition does not converge.
    pub(in crate::design) fn peaks(
        &self,
        filters: &MovingFilters,
        level: f64,
    ) -> Result<Peaks<Combination>, DesignError> {
        let found = self.sweep(filters, PRUNE_LEVEL * level)?;
        let highest = |k: usize| found[k].first().map_or(0.0, |found| found.gain);
        let frequency = |k: usize| self.frequencies.all[k];
        let grid: Vec<Peak> =
            (0..found.len()).map(|k| Peak { gain: highest(k), frequency: frequency(k) }).collect();
        let mut peaks: Vec<LocatedPeak<Combination>> = Vec::new();
        for around in local_maxima(&grid).into_iter().filter(|[_, peak, _]| peak.gain > PRUNE_LEVEL * level) {
            let k = self.frequencies.all.partition_point(|omega| *omega < around[1].frequency);
            for start in self.from_all_sides(&found[k], k, filters)? {
                let peak = self.refined(&start.combination, around, filters)?;
                let location = Location { frequency: peak.frequency, scenario: start.combination };
                let peak = LocatedPeak { gain: peak.gain, location };
                if peak.gain > level && !peaks.contains(&peak) {
                    peaks.push(peak);
                }
            }
        }
        let estimate = peaks.iter().map(|peak| peak.gain).fold(0.0, f64::max);
        Ok(Peaks { estimate, peaks })
    }

    /// The combinations found at each frequency, the worst first. Where the gains are below `level` some
    /// frequencies are left out.
    fn sweep(&self, filters: &MovingFilters, level: f64) -> Result<Vec<Vec<Found>>, DesignError> {
        let mut all: Vec<Vec<Found>> = vec![Vec::new(); self.frequencies.all.len()];
        let nominal = vec![0; self.plant.options().len()];
        let mut carried = vec![nominal.clone()];
        for &k in &self.frequencies.first {
            all[k] = self.climbed(&carried, k, filters)?;
            carried = all[k].iter().take(CARRIED).map(|found| found.combination.clone()).collect();
            carried.push(nominal.clone());
        }
        for pair in self.frequencies.first.windows(2) {
            let [low, high] = [&all[pair[0]], &all[pair[1]]];
            if low.iter().chain(high).any(|found| found.gain >= level) {
                let starts = low.iter().chain(high).map(|found| found.combination.clone());
                let starts: Vec<Combination> = starts.collect();
                for k in pair[0] + 1..pair[1] {
                    all[k] = self.climbed(&starts, k, filters)?;
                }
            }
        }
        Ok(all)
    }

    /// Where the climbs from `starts` end, the worst first.
    fn climbed(
        &self,
        starts: &[Combination],
        k: usize,
        filters: &MovingFilters,
    ) -> Result<Vec<Found>, DesignError> {
        let at = filters.at(self.frequencies.all[k]);
        let mut all: Vec<Found> = Vec::new();
        for start in starts {
            let found = self.climb(self.response(k), &at, start.clone())?;
            if all.iter().all(|known| known.combination != found.combination) {
                all.push(found);
            }
        }
        all.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        Ok(all)
    }

    /// The same from `found`, and from each of its channels with each of its errors alone.
    fn from_all_sides(
        &self,
        found: &[Found],
        k: usize,
        filters: &MovingFilters,
    ) -> Result<Vec<Found>, DesignError> {
        let mut starts: Vec<Combination> = found.iter().map(|found| found.combination.clone()).collect();
        for (i, options) in self.plant.options().iter().enumerate() {
            for choice in 0..options.len() {
                let mut alone = vec![0; self.plant.options().len()];
                alone[i] = choice;
                starts.push(alone);
            }
        }
        let mut all = self.climbed(&starts, k, filters)?;
        all.truncate(CARRIED);
        Ok(all)
    }

    /// A combination of locally largest gain, from `combination` on.
    fn climb(
        &self,
        response: &BoxResponse,
        filters: &FiltersAt,
        mut combination: Combination,
    ) -> Result<Found, DesignError> {
        let mut gain = 0.0;
        for _ in 0..MAX_STEPS {
            let delay = |j: usize| self.plant.options()[j][combination[j]].delay.0;
            let measured = self.plant.measurements(response, &combination);
            let svd = linalg::svd(&(&response.references - filters.moved(delay) * measured))?;
            if svd.s[0] <= gain * (1.0 + LEAST_STEP) {
                break;
            }
            gain = svd.s[0];
            let (left, right) = (svd.u.columns(0, 1).into_owned(), svd.v.columns(0, 1).into_owned());
            let direction = Direction {
                samples: &response.nodes * right,
                nominal: left.ad_mul(&filters.nominal),
                slopes: filters.slopes.iter().map(|(j, slope)| (*j, left.ad_mul(slope))).collect(),
            };
            if !direction.improve(&self.plant, &mut combination) {
                break;
            }
        }
        Ok(Found { gain, combination })
    }

    /// The peak of one combination over the frequencies.
    fn refined(
        &self,
        combination: &[usize],
        around: [Peak; 3],
        filters: &MovingFilters,
    ) -> Result<Peak, DesignError> {
        let at = |frequency: f64| gain_of(&self.plant, combination, filters, frequency);
        let [low, middle, high] = around;
        let around = [at(low.frequency)?, at(middle.frequency)?, at(high.frequency)?];
        refine(at, around, FLAT_GAIN)
    }

    fn response(&self, k: usize) -> &BoxResponse {
        self.responses[k].get_or_init(|| self.plant.response(self.frequencies.all[k]))
    }

    /// The points of the box where the gain is largest, the worst first, by the peaks between the nodes.
    ///
    /// # Errors
    /// As [`BoxSearch::peaks`].
    pub(in crate::design) fn worst_points(
        &self,
        filters: &MovingFilters,
    ) -> Result<Vec<ErrorPoint>, DesignError> {
        let mut peaks = self.peaks(filters, 0.0)?.peaks;
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
        filters: &MovingFilters,
    ) -> Result<ErrorPoint, DesignError> {
        let at = filters.at(frequency);
        for halving in 2..2 + HALVINGS {
            let near = self.plant.near(&point, 0.5f64.powi(halving))?;
            let local = Self { plant: near, frequencies: Frequencies::new(1, &[]), responses: Vec::new() };
            let start = vec![0; point.delays.len()];
            let found = local.climb(&local.plant.response(frequency), &at, start)?;
            point = local.plant.point(&found.combination);
        }
        Ok(point)
    }
}

/// The gain of a combination at a frequency.
fn gain_of(
    plant: &BoxPlant,
    combination: &[usize],
    filters: &MovingFilters,
    frequency: f64,
) -> Result<Peak, DesignError> {
    let response = plant.response(frequency);
    let delay = |j: usize| plant.options()[j][combination[j]].delay.0;
    let moved = filters.at(frequency).moved(delay);
    let error = &response.references - moved * plant.measurements(&response, combination);
    Ok(Peak { gain: linalg::largest_singular_value(&error)?, frequency })
}

/// u* F and H v for the singular vectors (u, v) of an error.
struct Direction {
    /// Of all nodes.
    samples: CMat,
    /// u* F without errors of the delays.
    nominal: CMat,
    /// Its change per second of each delay that the taps follow.
    slopes: Vec<(usize, CMat)>,
}

impl Direction {
    /// Lowers Re (u* F H v), channel by channel. Returns whether anything changed.
    fn improve(&self, plant: &BoxPlant, combination: &mut Combination) -> bool {
        let mut changed = false;
        for i in 0..combination.len() {
            let own = combination[i];
            let mut best = (own, self.output(plant, combination));
            for choice in 0..plant.options()[i].len() {
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
        let chosen = |i: usize| plant.options()[i][combination[i]];
        let term = |i: usize| {
            let slopes = self.slopes.iter().map(|(j, slope)| slope[i] * Complex::from(chosen(*j).delay.0));
            let filter = slopes.fold(self.nominal[i], |sum, slope| sum + slope);
            (filter * self.samples[chosen(i).node] * Complex::from(1.0 + chosen(i).gain)).re
        };
        (0..combination.len()).map(term).sum()
    }
}
