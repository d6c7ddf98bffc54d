//! Captures in another order than that of the spec.

/// How far channels are from each other and captures from channels, in any one unit.
pub(super) struct Distances<'a> {
    pub(super) channels: usize,
    /// Of two channels, nominally.
    pub(super) between: &'a dyn Fn(usize, usize) -> f64,
    /// Of capture i from channel j when the reference capture is channel r.
    pub(super) of_capture: &'a dyn Fn(usize, usize, usize) -> f64,
}

/// The channel that each capture belongs to, from 1, if that is another order than the given one and the
/// captures are clear about it: in the given order a capture is more than half a spacing of the channels
/// from its channel, and the other order brings all captures within a quarter.
pub(super) fn other_order(distances: &Distances<'_>, reference: usize) -> Option<Vec<usize>> {
    let n = distances.channels;
    let pairs = (0..n).flat_map(|i| (0..i).map(move |j| (i, j)));
    let spacing = pairs.map(|(i, j)| (distances.between)(i, j)).fold(f64::INFINITY, f64::min);
    let worst = |order: &[usize]| {
        let all = order.iter().enumerate().map(|(i, &j)| (distances.of_capture)(i, j, order[reference]));
        all.fold(0.0, f64::max)
    };
    let given: Vec<usize> = (0..n).collect();
    // Channels with one delay have no order, and NaN says nothing of it.
    let contradicts = spacing > 0.0 && worst(&given) > 0.5 * spacing;
    if !contradicts {
        return None;
    }
    let nearest = |i: usize, r: usize| {
        let of = |j: &usize| (distances.of_capture)(i, *j, r);
        (0..n).min_by(|a, b| of(a).total_cmp(&of(b))).unwrap_or(i)
    };
    let orders = (0..n).map(|r| (0..n).map(|i| nearest(i, r)).collect::<Vec<_>>());
    let is_permutation = |order: &[usize]| given.iter().all(|j| order.contains(j));
    let clear = orders.filter(|order| is_permutation(order) && worst(order) <= 0.25 * spacing);
    clear.min_by(|a, b| worst(a).total_cmp(&worst(b))).map(from_one)
}

/// As [`other_order`], by delays.
pub(super) fn order_of_delays(nominal: &[f64], found: &[f64], reference: usize) -> Option<Vec<usize>> {
    let distances = Distances {
        channels: nominal.len(),
        between: &|i, j| (nominal[i] - nominal[j]).abs(),
        of_capture: &|i, j, r| (found[i] - found[reference] - (nominal[j] - nominal[r])).abs(),
    };
    other_order(&distances, reference)
}

/// The numbers of channels in messages.
pub(super) fn from_one(order: Vec<usize>) -> Vec<usize> {
    order.into_iter().map(|j| j + 1).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn swapped_channels_are_recognised_and_skews_are_not() {
        let nominal = [0.0, 1.0, 2.0, 3.0];
        // Captures 1 and 2 are swapped; delays are relative to channel 1, which keeps 0.
        assert_eq!(order_of_delays(&nominal, &[0.0, -1.01, 1.0, 2.0], 0), Some(vec![2, 1, 3, 4]));
        assert_eq!(order_of_delays(&nominal, &[0.0, 2.02, 0.99, 3.0], 0), Some(vec![1, 3, 2, 4]));
        assert_eq!(order_of_delays(&nominal, &[0.0, 1.2, 2.3, 2.8], 0), None);
        // Neither order fits.
        assert_eq!(order_of_delays(&nominal, &[0.0, 1.6, 2.0, 3.0], 0), None);
    }

    #[test]
    fn channels_of_one_delay_have_no_order() {
        assert_eq!(order_of_delays(&[0.0, 0.0, 1.0], &[0.0, 1.0, 0.0], 0), None);
    }
}
