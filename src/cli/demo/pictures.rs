//! The two pictures of the demo.

use super::contenders::Contender;
use super::{SETTLING, STEP_AT};
use crate::plot::{Chart, Marks, PlotError, Series};
use crate::simulate::Captured;
use crate::spec::Spec;
use crate::units::{Decibels, Seconds};

/// Interval over which the error is averaged.
const ERROR_INTERVAL: Seconds = Seconds(0.02);
/// Fast samples before and after the step that are drawn.
const BEFORE_STEP: usize = 12;
const AFTER_STEP: usize = 36;

/// What the pictures show.
pub(super) struct Pictures<'a> {
    pub(super) spec: &'a Spec,
    pub(super) captured: &'a Captured,
    /// What an ideal fast converter gives for the step alone.
    pub(super) step: &'a [f64],
    pub(super) contenders: &'a [Contender],
}

impl Pictures<'_> {
    /// Names of files and their SVG text.
    pub(super) fn all(&self) -> Result<[(&'static str, String); 2], PlotError> {
        let (step, marks) = self.around_the_step();
        Ok([("step.svg", step.to_svg_with(&marks)?), ("error.svg", self.errors().to_svg()?)])
    }

    /// The samples around the step: those of the first and the last contender as marks on the exact curve,
    /// and the step without the other signals.
    fn around_the_step(&self) -> (Chart, Vec<Marks>) {
        let latency = self.spec.latency.unwrap_or(0);
        let centre = STEP_AT.in_fast_periods(self.spec.fast_period).0 as usize + latency;
        let time = |n: usize| (self.spec.fast_period * (n as f64 - latency as f64)).0 - STEP_AT.0;
        let window = centre - BEFORE_STEP..centre + AFTER_STEP;
        let curve = |label: &str, samples: &[f64]| Series {
            label: label.into(),
            points: window.clone().map(|n| (time(n) * 1e3, samples[n])).collect(),
        };
        let marks = |contender: &Contender| Marks {
            label: contender.name.into(),
            points: window.clone().map(|n| (time(n) * 1e3, contender.samples[n], String::new())).collect(),
        };
        let chart = Chart {
            title: "Around the step: chirp, tones and step through the converters".into(),
            x_label: "time after the step, ms".into(),
            y_label: "amplitude, 1 = full scale".into(),
            series: vec![
                curve("ideal fast converter", &self.captured.target),
                curve("its response to the step alone", self.step),
            ],
        };
        let shown = self.contenders.first().into_iter().chain(self.contenders.last());
        (chart, shown.map(marks).collect())
    }

    /// RMS error in decibels over intervals of 20 ms. The chirp sweeps with time, so time stands for
    /// frequency.
    fn errors(&self) -> Chart {
        let period = self.spec.fast_period;
        let interval = ERROR_INTERVAL.in_fast_periods(period).0 as usize;
        let target = &self.captured.target;
        let level = |samples: &[f64], start: usize| {
            let power: f64 = (start..start + interval).map(|n| (samples[n] - target[n]).powi(2)).sum::<f64>()
                / interval as f64;
            Decibels::of_power(power.max(1e-30)).0
        };
        let curve = |contender: &Contender| Series {
            label: contender.name.into(),
            points: (SETTLING..target.len() - interval)
                .step_by(interval)
                .map(|start| ((period * start as f64).0, level(&contender.samples, start)))
                .collect(),
        };
        Chart {
            title: "Error while the chirp rises from 50 Hz to 13 kHz, step at 1 s".into(),
            x_label: "time, s".into(),
            y_label: "RMS error in 20 ms, dB of full scale".into(),
            series: self.contenders.iter().map(curve).collect(),
        }
    }
}
