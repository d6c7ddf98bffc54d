//! From captures, real or complex, to the phasors of their tones.
//!
//! The front ends are real, so the conjugate of an exponential at -f has passed them like one at +f.
//! Phasors are those at +f for both signs, and what follows from them does not know of complex samples.

use crate::calibrate::model::Model;
use crate::calibrate::record::Record;
use crate::linalg::Complex;
use crate::sine_fit::{Channel, Component, Direction, SineFit, ToneFit};
use crate::units::Hertz;
use std::f64::consts::TAU;

/// Records of real or of complex samples.
pub(super) struct Captures<'a> {
    pub(super) records: &'a [Record],
    pub(super) is_complex: bool,
}

/// What one tone says of the channels.
pub(super) struct Measured {
    /// Rad per fast period.
    pub(super) w: f64,
    /// Cycles per slow sample.
    pub(super) cycles: f64,
    pub(super) frequency: Hertz,
    /// a_it / a_rt over the nominal ratio.
    pub(super) ratios: Vec<Complex<f64>>,
    /// Standard deviations of ln |ratio| (real part) and of its phase (imaginary part).
    pub(super) sigmas: Vec<Complex<f64>>,
}

impl<'a> Captures<'a> {
    pub(super) fn new(records: &'a [Record]) -> Self {
        Self { records, is_complex: records.iter().all(|record| record.imaginary.is_some()) }
    }

    /// The parts of all records, one after the other.
    pub(super) fn channels(&self) -> Vec<Channel<'a>> {
        self.records.iter().flat_map(Record::channels).collect()
    }

    /// Frames of the shortest record.
    pub(super) fn frames(&self) -> usize {
        self.records.iter().map(|record| record.samples.len()).min().unwrap_or(0)
    }

    /// The channels of a fit that are the parts of record `i`.
    pub(super) fn parts(&self, i: usize) -> std::ops::Range<usize> {
        let count = if self.is_complex { 2 } else { 1 };
        count * i..count * (i + 1)
    }

    fn component(&self, i: usize, direction: Direction) -> Component {
        let first = self.parts(i).start;
        match self.is_complex {
            true => Component::Complex([first, first + 1], direction),
            false => Component::Real(first),
        }
    }

    /// Tone `t` of `sines` in record `i`: of complex records the exponential in `direction`.
    pub(super) fn tone(&self, sines: &SineFit, i: usize, t: usize, direction: Direction) -> ToneFit {
        sines.phasor(self.component(i, direction), t)
    }

    /// The ratios of tone `t` to the reference, and their errors.
    pub(super) fn measured(&self, model: &Model, sines: &SineFit, t: usize, reference: usize) -> Measured {
        let frequency = sines.frequencies[t].value;
        let w = TAU * frequency.per_fast_period(model.fast_period).0.abs();
        let phasor = |i: usize| {
            let tone = self.tone(sines, i, t, Direction::Forward);
            let phasor = Complex::from_polar(tone.amplitude.value, tone.phase.value.0);
            if self.is_complex && frequency.0 < 0.0 { phasor.conj() } else { phasor }
        };
        let expected = |i: usize| model.nominal(i, w) / model.nominal(reference, w);
        let ratio = |i: usize| phasor(i) / phasor(reference) / expected(i);
        let sigmas = |i: usize| {
            let [own, other] = [i, reference].map(|i| self.component(i, Direction::Forward));
            let ratio = sines.ratio(own, other, t);
            let phase = match self.is_complex {
                true => ratio.phase.sigma.0,
                // A phase becomes a delay by the fitted frequency, whose error counts.
                false => TAU * frequency.0 * sines.lag_between(i, reference, t).sigma.0,
            };
            Complex::new(ratio.gain.sigma / ratio.gain.value, phase)
        };
        let all = 0..model.channels();
        let (ratios, sigmas) = (all.clone().map(ratio).collect(), all.map(sigmas).collect());
        Measured { w, cycles: frequency / sines.rate, frequency, ratios, sigmas }
    }

    /// The exponential that is the tone: the larger one over all records, forward for real samples.
    pub(super) fn direction(&self, sines: &SineFit, t: usize) -> Direction {
        let power = |direction| -> f64 {
            let amplitude = |i| self.tone(sines, i, t, direction).amplitude.value;
            (0..self.records.len()).map(|i| amplitude(i).powi(2)).sum()
        };
        match self.is_complex && power(Direction::Backward) > power(Direction::Forward) {
            true => Direction::Backward,
            false => Direction::Forward,
        }
    }
}
