//! The sides of a box of errors, one for each uncertain number.

use crate::verify::uncertainty::{ErrorBox, ErrorPoint};

/// One uncertain number of a channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::design) enum Side {
    /// The delay.
    Delay(usize),
    /// The gain.
    Gain(usize),
    /// The cut-off.
    Cutoff(usize),
}

/// The sides of `errors` that have a length: delays, then gains, then cut-offs.
pub(in crate::design) fn sides(errors: &ErrorBox) -> Vec<Side> {
    let channels = 0..errors.delays.len();
    let delays = channels.clone().filter(|&i| errors.delays[i].0 > 0.0).map(Side::Delay);
    let gains = channels.clone().filter(|&i| errors.gains[i] > 0.0).map(Side::Gain);
    let cutoffs = channels.filter(|&i| errors.cutoffs[i] > 0.0).map(Side::Cutoff);
    delays.chain(gains).chain(cutoffs).collect()
}

/// The point of the box with these shares, from -1 to 1, of its half-widths.
pub(in crate::design) fn point_at(errors: &ErrorBox, sides: &[Side], shares: &[f64]) -> ErrorPoint {
    let mut point = ErrorPoint::none(errors.delays.len());
    for (side, &share) in sides.iter().zip(shares) {
        match *side {
            Side::Delay(i) => point.delays[i] = errors.delays[i] * share,
            Side::Gain(i) => point.gains[i] = errors.gains[i] * share,
            Side::Cutoff(i) => point.cutoffs[i] = errors.cutoffs[i] * share,
        }
    }
    point
}
