//! Cutoffs so far below the fast rate that gamma vanishes in the rounding errors of doubles.

use crate::support::specs::{alike, butterworth};
use hybank::design::{LiftedPlant, Problem};
use std::f64::consts::TAU;

/// gamma below which a computed norm has few digits.
const TINY: f64 = 1e-9;

/// The noncausal bound of two channels after Butterworth filters, M = 2, for a cutoff in multiples of the
/// fast rate.
fn noncausal(order: usize, cutoff: f64) -> f64 {
    let spec = alike(&butterworth(order, TAU * cutoff), 2, 10, &[1.2, 0.6]);
    LiftedPlant::new(&Problem::new(&spec, 10).unwrap()).noncausal_bound().unwrap().gain
}

/// The cutoffs of the design guide.
#[test]
fn gamma_is_tiny_below_the_cutoffs_of_the_design_guide() {
    for (order, stated) in [(2, 1.2e-5), (4, 2.5e-3), (6, 0.015), (8, 0.035)] {
        let (mut low, mut high) = (1e-7f64, 0.4f64);
        for _ in 0..50 {
            let middle = (low * high).sqrt();
            if noncausal(order, middle) < TINY { low = middle } else { high = middle }
        }
        assert!((low / stated - 1.0).abs() < 0.05, "order {order}: {low} of the fast rate, not {stated}");
    }
}
