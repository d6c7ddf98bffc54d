//! Figure 5.15: gamma of the FIR bank if the true delays are not those of the design.

use crate::filters::chart;
use crate::{Figure, Outcome};
use hybank::bank::Bank;
use hybank::design::norm_at;
use hybank::spec::ErrorPoint;
use hybank::units::FastPeriods;

/// Largest error of a delay, in fast samples.
const LARGEST: f64 = 0.1;
/// Points of a curve on either side of zero.
const HALF: i32 = 10;

pub(super) fn figure(bank: &Bank) -> Outcome<Figure> {
    let gamma = |first: f64, second: f64| -> Outcome<f64> {
        let delays = vec![FastPeriods(first), FastPeriods(second)];
        Ok(norm_at(bank, &ErrorPoint::of_delays(delays))?)
    };
    let mut curves = Vec::new();
    let mut worst: f64 = 0.0;
    for second in [-LARGEST, -0.5 * LARGEST, 0.0, 0.5 * LARGEST, LARGEST] {
        let mut points = Vec::new();
        for step in -HALF..=HALF {
            let first = LARGEST * f64::from(step) / f64::from(HALF);
            let gamma = gamma(first, second)?;
            worst = worst.max(gamma);
            points.push((first, gamma));
        }
        curves.push((format!("delay 2 off by {second}"), points));
    }
    let (title, x) = ("gamma with delays that are off", "error of delay 1, fast samples");
    Ok(Figure {
        number: "5.15",
        title: "Norm of the error system against errors of both delays",
        charts: vec![chart(title, x, "gamma", curves)],
        thesis: "The norm grows little for small errors; our sources give no number.",
        found: format!(
            "At most {:.2} % within {LARGEST} samples, against {:.2} % without errors.",
            100.0 * worst,
            100.0 * gamma(0.0, 0.0)?
        ),
    })
}
