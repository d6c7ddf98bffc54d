//! What captures say of the order and the delays of a spec.

use super::CalibrationSettings;
use super::blind::{Blind, unexplained_in_order};
use super::contradiction::Contradiction;
use super::estimates::ChannelEstimate;
use super::fit::FittedValues;
use super::model::ChannelModel;
use super::order::{from_one, order_of_delays};
use super::record::{Acquisition, Record};
use crate::sine_fit::Estimate;
use crate::spec::Spec;
use crate::units::FastPeriods;

/// Share of the unexplained power that other delays or another order may leave to count.
const CLEARLY_LESS: f64 = 0.1;
/// Another order is looked for where the given one leaves more than this share of the power unexplained;
/// delays within a tenth of a fast period leave less.
const ORDER_DOUBTFUL: f64 = 0.05;
/// The next best order leaves this many times as much.
const DISTINCT_ORDER: f64 = 3.0;
/// A delay contradicts when it is this many standard deviations beyond its interval. The interval and its
/// own error are then both exhausted.
const CLEAR_SIGMAS: f64 = 6.0;
/// Largest standard deviation, in fast periods, of a delay that would show that it is wrong.
const SHARP_SIGMA: f64 = 0.1;
/// The interval of a delay of which the spec says nothing, in fast periods.
const UNSTATED_HALF_WIDTH: f64 = 0.02;
/// Low and high frequencies that disagree by more than this (in units of their noise) do not see a delay.
const WORST_MISFIT: f64 = 3.0;

/// What captures say of delays.
#[derive(Default)]
pub(super) struct Delays {
    /// Another order, or delays outside of their intervals.
    pub(super) contradictions: Vec<Contradiction>,
    /// Whether a wrong delay would have shown.
    pub(super) are_told: bool,
}

impl Delays {
    fn in_order(order: Vec<usize>) -> Self {
        Self { contradictions: vec![Contradiction::WrongOrder { order }], are_told: true }
    }
}

/// By how much a delay deviates from that of the spec.
struct Deviation {
    channel: usize,
    found: Estimate<FastPeriods>,
    half_width: FastPeriods,
}

impl Deviation {
    fn is_wrong(&self) -> bool {
        self.found.value.0.abs() > self.half_width.0 + CLEAR_SIGMAS * self.found.sigma.0
    }

    /// Whether a wrong delay would show.
    fn is_sharp(&self) -> bool {
        self.found.sigma.0 <= SHARP_SIGMA
    }
}

/// What the bands that hold one alias each say of the delays. Something is reported only if the signal then
/// leaves at most a tenth of the power unexplained that it leaves with the spec, whatever Nyquist zone each
/// band may belong to.
pub(super) fn delays_told(spec: &Spec, model: &ChannelModel, records: &[Record]) -> Delays {
    let uncertainty = spec.uncertainty.clone().unwrap_or_default();
    let reference = uncertainty.reference_channel().unwrap_or(0);
    let all = [Acquisition { name: "the captures", records }];
    let Ok(blind) = Blind::new(model, &all, 1) else { return Delays::default() };
    if let Some(order) = other_order(&blind, records.len()) {
        return Delays::in_order(order);
    }
    let fit = FittedValues { offset: false, ..FittedValues::default() };
    let Ok(fitted) = blind.fit(CalibrationSettings { fit, reference }) else {
        return Delays { are_told: blind.determines_delays(SHARP_SIGMA), ..Delays::default() };
    };
    let (nominal, found) = blind.unexplained(&fitted.point);
    let fits = fitted.misfit.is_none_or(|misfit| misfit <= WORST_MISFIT);
    let is_clear = fits && found <= CLEARLY_LESS * nominal;
    if is_clear && let Some(order) = order_of_delays(&model.delays, &fitted.point.delays, reference) {
        return Delays::in_order(order);
    }
    let deviations = deviations(spec, model, &fitted.channels(model));
    let wrong = || deviations.iter().filter(|deviation| deviation.is_wrong());
    let contradiction = |&Deviation { channel, found: deviation, half_width }: &Deviation| {
        Contradiction::Delay { channel: channel + 1, reference: reference + 1, deviation, half_width }
    };
    let contradictions: Vec<_> = if is_clear { wrong().map(contradiction).collect() } else { Vec::new() };
    let are_told = deviations.iter().all(Deviation::is_sharp) && contradictions.len() == wrong().count();
    Delays { contradictions, are_told }
}

/// The deviations of all delays that were fitted.
fn deviations(spec: &Spec, model: &ChannelModel, estimates: &[ChannelEstimate]) -> Vec<Deviation> {
    let uncertainty = spec.uncertainty.clone().unwrap_or_default();
    let half_widths = uncertainty.delays(estimates.len());
    let deviation = |(channel, estimate): (usize, &ChannelEstimate)| {
        let delay = estimate.delay?;
        let half_width = match uncertainty.delay {
            Some(_) => half_widths[channel].in_fast_periods(spec.fast_period),
            None => FastPeriods(UNSTATED_HALF_WIDTH),
        };
        let value = FastPeriods(delay.value.0 - model.delays[channel]);
        Some(Deviation { channel, found: Estimate { value, sigma: delay.sigma }, half_width })
    };
    estimates.iter().enumerate().filter_map(deviation).collect()
}

/// An order of the channels, from 1, that explains bands of one alias, in whatever zone, at least ten times
/// as well as the given one and clearly better than any other, and than one inverted channel: two channels
/// swapped, all rotated, or reversed.
fn other_order(blind: &Blind<'_>, channels: usize) -> Option<Vec<usize>> {
    let given: Vec<usize> = (0..channels).collect();
    let others = other_orders(&given);
    let bands = blind.single_bands(others.len());
    let left = unexplained_in_order(&bands, &given, None);
    // NaN, without bands, says nothing.
    let is_doubtful = left > ORDER_DOUBTFUL;
    if !is_doubtful {
        return None;
    }
    let weigh = |order: Vec<usize>| (unexplained_in_order(&bands, &order, None), order);
    let mut weighed: Vec<_> = others.into_iter().map(weigh).collect();
    weighed.sort_by(|a, b| a.0.total_cmp(&b.0));
    let inverted = (0..channels).map(|i| unexplained_in_order(&bands, &given, Some(i)));
    let second =
        weighed.get(1).map(|(left, _)| *left).into_iter().chain(inverted).fold(f64::INFINITY, f64::min);
    let (best, order) = weighed.into_iter().next()?;
    (best <= CLEARLY_LESS * left && DISTINCT_ORDER * best <= second).then(|| from_one(order))
}

/// `given` with two channels swapped, all rotated, or reversed.
fn other_orders(given: &[usize]) -> Vec<Vec<usize>> {
    let channels = given.len();
    let mut orders: Vec<Vec<usize>> = Vec::new();
    for i in 0..channels {
        let rotated: Vec<usize> = (0..channels).map(|j| given[(i + j) % channels]).collect();
        orders.push(rotated.iter().rev().copied().collect());
        orders.push(rotated);
        orders.extend((0..i).map(|j| {
            let mut swapped = given.to_vec();
            swapped.swap(i, j);
            swapped
        }));
    }
    orders.sort();
    orders.dedup();
    orders.retain(|order| order != given);
    orders
}
