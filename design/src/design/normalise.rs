//! From a spec to its problem in normalised time.

use super::DesignError;
use super::problem::{Channel, Problem};
use hybank_core::spec::{Band, ConverterErrors, ErrorPoint, FilterSpec, Spec};
use hybank_core::units::{GridTime, RadiansPerFastPeriod};
use hybank_verify::analog::{StableFilter, StrictlyProper, signal};
use std::f64::consts::TAU;

impl Problem {
    /// Normalises `spec` with the given latency (fast samples).
    pub fn new(spec: &Spec, latency: usize) -> Result<Self, DesignError> {
        let mut front_ends = Vec::new();
        let refused = |place: &dyn Fn() -> String| {
            let place = place();
            |source| DesignError::Analog { place, source }
        };
        let signal = signal(spec).map_err(refused(&|| "signal.filter".to_owned()))?;
        let realise = |filter: &FilterSpec, place: &dyn Fn() -> String| {
            StrictlyProper::driven_by(signal.as_ref(), filter, spec.fast_period).map_err(refused(place))
        };
        let (target, _) = intern(&mut front_ends, realise(&spec.target, &|| "target.filter".to_owned())?);
        let (layout, delays) = (spec.layout(), spec.delays());
        let mut converters = Vec::with_capacity(spec.channels.len());
        for (i, channel) in spec.channels.iter().enumerate() {
            let filter = realise(&channel.filter, &|| format!("filter of channel {}", i + 1))?;
            let (front_end, proportion) = intern(&mut front_ends, filter);
            converters.push((front_end, proportion * channel.gain));
        }
        let channel = |(converter, delay): (usize, GridTime)| {
            let (front_end, gain) = converters[converter];
            let converter_gain = spec.channels[converter].gain;
            Channel { front_end, gain, converter_gain, converter, delay }
        };
        let channels = layout.owners().into_iter().zip(layout.waited_delays(&delays)).map(channel).collect();
        let (fast_period, ratio, wait) = (spec.fast_period, spec.ratio, layout.wait(&delays));
        let mut problem = Self {
            fast_period,
            ratio,
            latency,
            signal,
            band: band(spec),
            front_ends,
            target,
            channels,
            wait,
            noise: Vec::new(),
        };
        problem.check_size()?;
        problem.noise = problem.noise_powers(spec)?;
        Ok(problem)
    }

    /// Power of the noise that each channel adds, with the noise, bits and jitter of the converters of
    /// `spec` and the front ends of this problem.
    pub(super) fn noise_powers(&self, spec: &Spec) -> Result<Vec<f64>, DesignError> {
        let scale = input_scale(spec, self.signal.as_ref(), &self.front_ends[self.target]);
        let jitter = self.jitter_powers(spec);
        let power = |(channel, jitter): (&Channel, f64)| {
            spec.channels[channel.converter].sample_noise().powi(2) * scale + jitter
        };
        Ok(self.channels.iter().zip(jitter).map(power).collect())
    }

    /// Power of the noise by which the jitter of each channel of `spec` shows, relative to an input of unit
    /// density: the mean square of what the front end's output changes meanwhile. It grows with the signal,
    /// so it needs no full scale.
    fn jitter_powers(&self, spec: &Spec) -> Vec<f64> {
        let power = |channel: &Channel| {
            let deviation = spec.channels[channel.converter].jitter.in_fast_periods(spec.fast_period);
            channel.gain * channel.gain * self.change(channel.front_end, deviation)
        };
        self.channels.iter().map(power).collect()
    }

    /// The jitter's part of the noise of each sample of a frame of `spec`, over the power of the target.
    ///
    /// # Errors
    /// As [`Problem::new`].
    pub(crate) fn jitter_shares(spec: &Spec, latency: usize) -> Result<Vec<f64>, DesignError> {
        let problem = Self::new(spec, latency)?;
        let power = problem.output_power(problem.target);
        Ok(problem.jitter_powers(spec).into_iter().map(|jitter| jitter / power).collect())
    }

    /// The same problem with errors of its converters; the delays may become negative.
    pub(crate) fn perturbed(&self, point: &ErrorPoint) -> Self {
        let mut moved = self.clone();
        let perturbed = |channel: &Channel| moved.perturb(*channel, point.of(channel.converter));
        let channels = self.channels.iter().map(perturbed).collect();
        Self { channels, ..moved }
    }

    /// `channel` with these errors; a front end that is not there is added.
    pub(super) fn perturb(&mut self, channel: Channel, errors: ConverterErrors) -> Channel {
        let (front_end, proportion) = self.with_cutoff(channel.front_end, 1.0 + errors.cutoff);
        Channel {
            front_end,
            gain: channel.gain * proportion * (1.0 + errors.gain),
            converter_gain: channel.converter_gain * (1.0 + errors.gain),
            delay: channel.delay.moved_by(errors.delay),
            converter: channel.converter,
        }
    }

    /// The front end to which `front_end` with its cut-off times `factor` is proportional, and the factor.
    fn with_cutoff(&mut self, front_end: usize, factor: f64) -> (usize, f64) {
        if factor == 1.0 {
            return (front_end, 1.0);
        }
        let scaled = self.front_ends[front_end].with_cutoff_scaled(factor);
        intern(&mut self.front_ends, scaled)
    }
}

fn band(spec: &Spec) -> Option<[RadiansPerFastPeriod; 2]> {
    let Band { low, high } = spec.signal.as_ref()?.band()?;
    Some([low, high].map(|end| RadiansPerFastPeriod(TAU * end.per_fast_period(spec.fast_period).0)))
}

/// The power of an input of unit density at the target, over that of the signal in full scale: with it the
/// noise of the converters and the signal have one scale.
pub(super) fn input_scale(spec: &Spec, signal: Option<&StableFilter>, target: &StrictlyProper) -> f64 {
    let Some((signal, table)) = signal.zip(spec.signal.as_ref()) else { return 1.0 };
    signal.power_through(target) / (table.rms * table.rms)
}

/// The index of the filter to which `filter` is proportional, and the factor. A filter that is not
/// proportional to any becomes the last one.
fn intern(front_ends: &mut Vec<StrictlyProper>, filter: StrictlyProper) -> (usize, f64) {
    let known = front_ends.iter().enumerate().find_map(|(i, seen)| Some((i, filter.ratio_to(seen)?)));
    known.unwrap_or_else(|| {
        front_ends.push(filter);
        (front_ends.len() - 1, 1.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problem(signal: &str, channel: &str) -> Problem {
        let text = format!(
            "fast_period = 1e-3\nratio = 2\n{signal}\ntarget = {{ filter = {{ family = \"butterworth\", order = 3, cutoff = 200 }} }}\n\
             channel = [{{ delay = 0, {channel} }}, {{ delay = 1e-3 }}]\n"
        );
        Problem::new(&Spec::from_toml(&text, "spec.toml").unwrap(), 0).unwrap()
    }

    /// The powers of noise and rounding are in units of full scale, that of jitter in units of the signal.
    #[test]
    fn the_causes_of_noise_add() {
        for signal in ["", "signal = { band = 150, rms = 0.1 }"] {
            let power = |channel: &str| problem(signal, channel).noise[0];
            let [noise, bits, jitter] = ["noise = 1e-3", "bits = 10", "jitter = \"10 us\""].map(power);
            let all = power("noise = 1e-3, bits = 10, jitter = \"10 us\"");
            assert!((all / (noise + bits + jitter) - 1.0).abs() < 1e-14);
            // The step of ten bits is 2^-9.
            assert!((bits / noise - 2f64.powi(-18) / 12.0 / 1e-6).abs() < 1e-12 * bits / noise);
            let plain = problem(signal, "noise = 0");
            let power = plain.output_power(plain.target);
            let full_scale = if signal.is_empty() { 1.0 } else { power / 0.01 };
            assert!((noise / (1e-6 * full_scale) - 1.0).abs() < 1e-9, "{noise} {full_scale}");
            // 0.01 fast periods: (2 pi f 1e-5)^2 for some f of the band.
            let share = (jitter / power).sqrt() / (std::f64::consts::TAU * 1e-5);
            assert!((50.0..200.0).contains(&share), "{share} Hz");
            assert_eq!((plain.noise[0], problem(signal, "bits = 10").noise[1]), (0.0, 0.0));
            // The sample of twice the gain changes twice as much.
            let twice = problem(signal, "gain = -2, jitter = \"10 us\"").noise[0];
            assert!((twice / jitter - 4.0).abs() < 1e-12);
        }
    }
}
