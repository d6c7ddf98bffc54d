//! Captures in another order than that of the spec.

use super::error::CalibrateError;
use super::model::Model;
use super::parameters::Point;

/// The channel that each capture belongs to, from 0, if that is another order than the given one and the
/// evidence is clear. `distance(i, j, r)` says how far capture i is from channel j when the reference
/// capture is channel r; `spacing` is the least distance of two channels from each other.
///
/// The given order is contradicted when a capture is more than half a spacing from its channel, and another
/// order is clear when it brings all captures within a quarter.
pub(super) fn other_order(
    channels: usize,
    reference: usize,
    spacing: f64,
    distance: impl Fn(usize, usize, usize) -> f64,
) -> Option<Vec<usize>> {
    let worst = |order: &[usize]| {
        order.iter().enumerate().map(|(i, &j)| distance(i, j, order[reference])).fold(0.0, f64::max)
    };
    let given: Vec<usize> = (0..channels).collect();
    // Channels with one delay have no order, and NaN says nothing of it.
    let contradicts = spacing > 0.0 && worst(&given) > 0.5 * spacing;
    if !contradicts {
        return None;
    }
    let nearest = |i: usize, r: usize| {
        (0..channels).min_by(|&a, &b| distance(i, a, r).total_cmp(&distance(i, b, r))).unwrap_or(i)
    };
    let orders = (0..channels).map(|r| (0..channels).map(|i| nearest(i, r)).collect::<Vec<_>>());
    let clear = orders.filter(|order| is_permutation(order) && worst(order) <= 0.25 * spacing);
    clear.min_by(|a, b| worst(a).total_cmp(&worst(b)))
}

fn is_permutation(order: &[usize]) -> bool {
    let mut seen = vec![false; order.len()];
    order.iter().for_each(|&j| seen[j] = true);
    seen.into_iter().all(|seen| seen)
}

/// Refuses delays that are those of the spec in another order.
pub(super) fn check_delays(model: &Model, point: &Point, reference: usize) -> Result<(), CalibrateError> {
    let nominal: Vec<f64> = model.delays.iter().map(|delay| delay.0).collect();
    match order_of_delays(&nominal, &point.delays, reference) {
        Some(order) => Err(CalibrateError::WrongOrder { order: order.into_iter().map(|j| j + 1).collect() }),
        None => Ok(()),
    }
}

/// As [`other_order`], by delays.
pub(super) fn order_of_delays(nominal: &[f64], found: &[f64], reference: usize) -> Option<Vec<usize>> {
    let distance =
        |i: usize, j: usize, r: usize| (found[i] - found[reference] - (nominal[j] - nominal[r])).abs();
    let pairs = (0..nominal.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    let spacing = pairs.map(|(i, j)| (nominal[i] - nominal[j]).abs()).fold(f64::INFINITY, f64::min);
    other_order(nominal.len(), reference, spacing, distance)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn swapped_channels_are_recognised_and_skews_are_not() {
        let nominal = [0.0, 1.0, 2.0, 3.0];
        // Captures 1 and 2 are swapped; delays are relative to channel 1, which keeps 0.
        assert_eq!(order_of_delays(&nominal, &[0.0, -1.01, 1.0, 2.0], 0), Some(vec![1, 0, 2, 3]));
        assert_eq!(order_of_delays(&nominal, &[0.0, 2.02, 0.99, 3.0], 0), Some(vec![0, 2, 1, 3]));
        assert_eq!(order_of_delays(&nominal, &[0.0, 1.2, 2.3, 2.8], 0), None);
        // Neither order fits.
        assert_eq!(order_of_delays(&nominal, &[0.0, 1.6, 2.0, 3.0], 0), None);
    }

    #[test]
    fn channels_of_one_delay_have_no_order() {
        assert_eq!(order_of_delays(&[0.0, 0.0, 1.0], &[0.0, 1.0, 0.0], 0), None);
    }
}
