//! The tones of all channels, real or complex.
//!
//! The front ends are real, so the conjugate of an exponential at -f has passed them like one at +f.
//! Amplitudes are those at +f for both signs, and what follows from them does not know of complex samples.

use super::super::record::Record;
use crate::linalg::Complex;
use crate::sine_fit::{Channel, Component, Direction, Estimate, SineFit, ToneFit};
use std::f64::consts::TAU;

/// Records of real or of complex samples.
pub(super) struct Captures<'a> {
    records: &'a [Record],
    pub(super) is_complex: bool,
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

    /// Number of records.
    pub(super) fn records(&self) -> usize {
        self.records.len()
    }

    pub(super) fn record(&self, i: usize) -> &'a Record {
        &self.records[i]
    }

    /// The channels of a fit that are the parts of record `i`.
    pub(super) fn parts(&self, i: usize) -> std::ops::Range<usize> {
        let count = if self.is_complex { 2 } else { 1 };
        count * i..count * (i + 1)
    }

    /// Tone `t` of `sines` in record `i`: of complex records the exponential in `direction`.
    pub(super) fn tone(&self, sines: &SineFit, i: usize, t: usize, direction: Direction) -> ToneFit {
        sines.phasor(self.wave(i, direction), t)
    }

    /// The amplitude of tone `t` in record `i` as one of positive frequency.
    pub(super) fn amplitude(&self, sines: &SineFit, i: usize, t: usize) -> Complex<f64> {
        let tone = self.tone(sines, i, t, Direction::Forward);
        let amplitude = Complex::from_polar(tone.amplitude.value, tone.phase.value.0);
        if self.is_complex && sines.frequencies[t].value.0 < 0.0 { amplitude.conj() } else { amplitude }
    }

    /// Standard deviations of ln abs and of the phase of the ratio of the amplitudes in two records.
    pub(super) fn sigmas(&self, sines: &SineFit, i: usize, reference: usize, t: usize) -> (f64, f64) {
        let ratio =
            sines.ratio(self.wave(i, Direction::Forward), self.wave(reference, Direction::Forward), t);
        let phase = match self.is_complex {
            true => ratio.phase.sigma.0,
            // A phase becomes a delay by the fitted frequency, whose error counts.
            false => TAU * sines.frequencies[t].value.0 * sines.lag_between(i, reference, t).sigma.0,
        };
        (ratio.gain.sigma / ratio.gain.value, phase)
    }

    /// Where record `i` has its phasors.
    fn wave(&self, i: usize, direction: Direction) -> Component {
        let parts = self.parts(i);
        if self.is_complex {
            Component::Complex([parts.start, parts.start + 1], direction)
        } else {
            Component::Real(i)
        }
    }

    /// The exponential that is the tone: the larger one over all records, forward for real samples.
    pub(super) fn direction(&self, sines: &SineFit, t: usize) -> Direction {
        let power = |direction| -> f64 {
            let size = |i| self.tone(sines, i, t, direction).amplitude.value.powi(2);
            (0..self.records.len()).map(size).sum()
        };
        match self.is_complex && power(Direction::Backward) > power(Direction::Forward) {
            true => Direction::Backward,
            false => Direction::Forward,
        }
    }

    /// The constants of the parts of record `i`.
    pub(super) fn constants<'b>(
        &self,
        sines: &'b SineFit,
        i: usize,
    ) -> impl Iterator<Item = Estimate<f64>> + use<'b> {
        sines.channels[self.parts(i)].iter().map(|part| part.constant)
    }
}
