//! From captures, real or complex, to the phasors of their tones.
//!
//! The front ends are real, so the conjugate of an exponential at -f has passed them like one at +f.
//! Phasors are those at +f for both signs, and what follows from them does not know of complex samples.

use crate::calibrate::model::ChannelModel;
use crate::calibrate::record::Record;
use crate::linalg::Complex;
use crate::sine_fit::{Channel, Component, Sense, SineFit, ToneFit};
use crate::spec::FrameLayout;
use crate::units::Hertz;
use std::f64::consts::TAU;
use std::ops::Range;

/// Records of real or of complex samples, one for each sample of a frame.
pub(super) struct ToneRecords<'a> {
    pub(super) records: &'a [Record],
    /// The records of each converter.
    converters: Vec<Range<usize>>,
    pub(super) is_complex: bool,
}

/// What one tone says of the channels.
pub(super) struct TonePhasors {
    /// Rad per fast period.
    pub(super) w: f64,
    /// Cycles per slow sample.
    pub(super) cycles: f64,
    pub(super) frequency: Hertz,
    /// a_it / a_rt over the nominal ratio.
    pub(super) ratios: Vec<Complex<f64>>,
    /// Standard deviations of ln |ratio| (real part) and of its phase (imaginary part).
    pub(super) sigmas: Vec<Complex<f64>>,
    /// The variance of ln of the reference's phasor, which is in all of them.
    pub(super) reference_variance: f64,
}

impl<'a> ToneRecords<'a> {
    pub(super) fn new(records: &'a [Record], layout: &FrameLayout) -> Self {
        let is_complex = records.iter().all(|record| record.imaginary.is_some());
        Self { records, converters: layout.ranges(), is_complex }
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
    pub(super) fn parts(&self, i: usize) -> Range<usize> {
        let count = if self.is_complex { 2 } else { 1 };
        count * i..count * (i + 1)
    }

    /// The parts of the records of a converter.
    pub(super) fn parts_of(&self, converter: usize) -> Range<usize> {
        let records = &self.converters[converter];
        self.parts(records.start).start..self.parts(records.end - 1).end
    }

    /// Number of converters.
    pub(super) fn converters(&self) -> usize {
        self.converters.len()
    }

    /// The records of a converter.
    pub(super) fn records_of(&self, converter: usize) -> Range<usize> {
        self.converters[converter].clone()
    }

    fn component(&self, i: usize, direction: Sense) -> Component {
        let first = self.parts(i).start;
        match self.is_complex {
            true => Component::Complex([first, first + 1], direction),
            false => Component::Real(first),
        }
    }

    /// Tone `t` of `sines` in record `i`: of complex records the exponential in `direction`.
    pub(super) fn tone(&self, sines: &SineFit, i: usize, t: usize, direction: Sense) -> ToneFit {
        sines.phasor(self.component(i, direction), t)
    }

    /// The ratios of tone `t` to the reference converter, and their errors. Of a converter with several
    /// samples per frame the phasors are turned to the first one and averaged.
    pub(super) fn measured(
        &self,
        model: &ChannelModel,
        sines: &SineFit,
        t: usize,
        reference: usize,
    ) -> TonePhasors {
        let frequency = sines.frequencies[t].value;
        let w = TAU * frequency.per_fast_period(model.fast_period).0.abs();
        let of_record = |i: usize| {
            let tone = self.tone(sines, i, t, Sense::Forward);
            let phasor = Complex::from_polar(tone.amplitude.value, tone.phase.value.0);
            if self.is_complex && frequency.0 < 0.0 { phasor.conj() } else { phasor }
        };
        let phasor = |converter: usize| {
            let records = self.records_of(converter);
            let (count, step) = (records.len() as f64, model.ratio as f64 / records.len() as f64);
            let turned =
                |(j, i): (usize, usize)| of_record(i) * Complex::from_polar(1.0, -w * step * j as f64);
            records.enumerate().map(turned).sum::<Complex<f64>>() / count
        };
        let expected = |i: usize| model.nominal(i, w) / model.nominal(reference, w);
        let ratio = |i: usize| phasor(i) / phasor(reference) / expected(i);
        // Of the mean of the converter's records.
        let variance = |converter: usize| {
            let records = self.records_of(converter);
            let amplitude = self.tone(sines, records.start, t, Sense::Forward).amplitude;
            (amplitude.sigma / amplitude.value).powi(2) / records.len() as f64
        };
        let sigmas = |converter: usize| {
            let [i, r] = [converter, reference].map(|converter| self.records_of(converter).start);
            let [own, other] = [i, r].map(|i| self.component(i, Sense::Forward));
            let ratio = sines.ratio(own, other, t);
            let phase = match self.is_complex {
                true => ratio.phase.sigma.0,
                // A phase becomes a delay by the fitted frequency, whose error counts.
                false => TAU * frequency.0 * sines.lag_between(i, r, t).sigma.0,
            };
            let single = Complex::new(ratio.gain.sigma / ratio.gain.value, phase);
            // The noise of several records averages, the error of the frequency does not.
            let averaged =
                |converter: usize| variance(converter) * (self.records_of(converter).len() - 1) as f64;
            let less = averaged(converter) + averaged(reference);
            if less == 0.0 {
                return single;
            }
            let reduced = |sigma: f64| (sigma * sigma - less).max(0.0).sqrt();
            Complex::new(reduced(single.re), reduced(single.im))
        };
        let all = 0..model.channels();
        let (ratios, sigmas) = (all.clone().map(ratio).collect(), all.map(sigmas).collect());
        let reference_variance = variance(reference);
        TonePhasors { w, cycles: frequency / sines.rate, frequency, ratios, sigmas, reference_variance }
    }

    /// The exponential that is the tone: the larger one over all records, forward for real samples.
    pub(super) fn direction(&self, sines: &SineFit, t: usize) -> Sense {
        let power = |direction| -> f64 {
            let amplitude = |i| self.tone(sines, i, t, direction).amplitude.value;
            (0..self.records.len()).map(|i| amplitude(i).powi(2)).sum()
        };
        match self.is_complex && power(Sense::Backward) > power(Sense::Forward) {
            true => Sense::Backward,
            false => Sense::Forward,
        }
    }
}
