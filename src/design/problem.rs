//! The design problem in normalised time: a spec without its units.

use super::DesignError;
use super::covariances::Covariances;
use crate::analog::{StableFilter, StrictlyProper, signal};
use crate::linalg::Complex;
use crate::spec::{ChannelSpec, FilterSpec, Spec};
use crate::units::{FastPeriods, RadiansPerFastPeriod};
use crate::verify::uncertainty::ErrorPoint;

/// Maximum number of states of the delay chains of the lifted system. Its matrices are dense: at this size
/// one matrix takes 128 MiB. A norm needs several of them, and its time grows with the cube of the states.
pub const MAX_CHAIN_STATES: usize = 4096;

/// Slow periods of delay up to which latencies that predict are compared, too.
const KEPT_PERIODS: usize = 16;

/// Front ends, delays and rates in units of the fast period (h = 1).
#[derive(Debug, Clone)]
pub struct Problem {
    /// M, the ratio of output rate to input rate.
    pub ratio: usize,
    /// The latency m0 in fast samples.
    pub latency: usize,
    /// W, the filter of the signal: the front ends see white noise, or an input of bounded energy, through it.
    /// `None` stands for W = 1.
    pub signal: Option<StableFilter>,
    /// The distinct analog filters Phi. Channels whose filters are proportional share one filter and its state.
    pub front_ends: Vec<StrictlyProper>,
    /// Index of Phi_0 in `front_ends`.
    pub target: usize,
    /// The slow channels.
    pub channels: Vec<Channel>,
    /// Power s_i^2 of the noise that each channel adds to its samples, relative to an input of unit density.
    pub noise: Vec<f64>,
}

/// One slow channel of a [`Problem`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Channel {
    /// Index of a filter in [`Problem::front_ends`] to which Phi_i is proportional.
    pub front_end: usize,
    /// The samples over that filter's output: Phi_i over that filter, times `converter_gain`.
    pub gain: f64,
    /// g_i, the converter's own gain.
    pub converter_gain: f64,
    /// D_i.
    pub delay: FastPeriods,
}

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
        let mut channels = Vec::with_capacity(spec.channels.len());
        for (i, (channel, delay)) in spec.channels.iter().zip(spec.delays_in_fast_periods()).enumerate() {
            let filter = realise(&channel.filter, &|| format!("filter of channel {}", i + 1))?;
            let (front_end, proportion) = intern(&mut front_ends, filter);
            let converter_gain = channel.gain;
            channels.push(Channel { front_end, gain: proportion * converter_gain, converter_gain, delay });
        }
        let scale = input_scale(spec, signal.as_ref(), &front_ends[target]);
        let noise = spec.channels.iter().map(|channel| channel.sample_noise().powi(2) * scale).collect();
        let mut problem = Self { ratio: spec.ratio, latency, signal, front_ends, target, channels, noise };
        problem.check_size()?;
        let jitter = problem.jitter_powers(spec)?;
        problem.noise.iter_mut().zip(jitter).for_each(|(power, jitter)| *power += jitter);
        Ok(problem)
    }

    /// Power of the noise by which the jitter of each channel of `spec` shows, relative to an input of unit
    /// density: the mean square of what the front end's output changes meanwhile. It grows with the signal, so
    /// it needs no full scale.
    fn jitter_powers(&self, spec: &Spec) -> Result<Vec<f64>, DesignError> {
        if spec.channels.iter().all(|channel| channel.jitter.0 == 0.0) {
            return Ok(vec![0.0; self.channels.len()]);
        }
        let covariances = Covariances::new(self)?;
        let power = |(channel, written): (&Channel, &ChannelSpec)| {
            let deviation = written.jitter.in_fast_periods(spec.fast_period);
            channel.gain * channel.gain * covariances.change(channel.front_end, deviation)
        };
        Ok(self.channels.iter().zip(&spec.channels).map(power).collect())
    }

    /// The jitter's part of the noise of each channel of `spec`, over the power of the target.
    ///
    /// # Errors
    /// As [`Problem::new`].
    pub(crate) fn jitter_shares(spec: &Spec, latency: usize) -> Result<Vec<f64>, DesignError> {
        let problem = Self::new(spec, latency)?;
        let power = Covariances::new(&problem)?.power(problem.target);
        Ok(problem.jitter_powers(spec)?.into_iter().map(|jitter| jitter / power).collect())
    }

    /// The same problem `fast_periods` earlier: a common shift of all delays and of the latency changes
    /// neither the error nor the filters.
    pub(super) fn earlier(mut self, fast_periods: usize) -> Self {
        for channel in &mut self.channels {
            channel.delay.0 -= fast_periods as f64;
        }
        self.latency -= fast_periods;
        self
    }

    /// States of the front ends and of the signal's filter.
    pub fn analog_states(&self) -> usize {
        let own = self.signal.as_ref().map_or(0, StableFilter::order);
        own + self.front_ends.iter().map(|front_end| front_end.order()).sum::<usize>()
    }

    /// The response Phi W of the front end of this index, behind the signal's filter.
    pub fn response(&self, front_end: usize, w: RadiansPerFastPeriod) -> Complex<f64> {
        let response = self.front_ends[front_end].response(w);
        self.signal.as_ref().map_or(response, |signal| response * signal.response(w))
    }

    /// The delays of the channels.
    pub fn delays(&self) -> Vec<FastPeriods> {
        self.channels.iter().map(|channel| channel.delay).collect()
    }

    /// Checks that the delay chains are not too long.
    ///
    /// # Errors
    /// [`DesignError::TooLate`] if latency and delays lie so far apart that the chains between them have
    /// more than [`MAX_CHAIN_STATES`] states.
    pub fn check_size(&self) -> Result<(), DesignError> {
        let references = (0..self.ratio).map(|p| p as f64 - self.latency as f64);
        let times: Vec<f64> =
            self.channels.iter().map(|channel| -channel.delay.0).chain(references).collect();
        let latest = times.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let periods = |time: f64| ((latest - time) / self.ratio as f64).floor();
        let states: f64 = times.into_iter().map(periods).sum();
        if states <= MAX_CHAIN_STATES as f64 {
            return Ok(());
        }
        let (latency, longest_delay) = (self.latency, self.longest_delay());
        Err(DesignError::TooLate { latency, longest_delay, states, limit: MAX_CHAIN_STATES })
    }

    /// The same problem with `errors[i]` added to the delays.
    pub fn with_delay_errors(&self, errors: &[FastPeriods]) -> Self {
        let mut moved = self.clone();
        for (channel, &error) in moved.channels.iter_mut().zip(errors) {
            channel.delay += error;
        }
        moved
    }

    /// The problem of `spec` with errors of its channels; the delays may become negative.
    ///
    /// # Errors
    /// As [`Problem::new`].
    pub fn with_errors(spec: &Spec, latency: usize, point: &ErrorPoint) -> Result<Self, DesignError> {
        let mut moved = spec.clone();
        for (channel, cutoff) in moved.channels.iter_mut().zip(&point.cutoffs) {
            if *cutoff != 0.0 {
                channel.filter = channel.filter.with_cutoff_scaled(1.0 + cutoff);
            }
        }
        let mut problem = Self::new(&moved, latency)?;
        for ((channel, delay), gain) in problem.channels.iter_mut().zip(&point.delays).zip(&point.gains) {
            channel.delay += delay.in_fast_periods(spec.fast_period);
            channel.gain *= 1.0 + gain;
            channel.converter_gain *= 1.0 + gain;
        }
        problem.check_size()?;
        Ok(problem)
    }

    /// The largest delay.
    pub fn longest_delay(&self) -> FastPeriods {
        FastPeriods(self.channels.iter().map(|channel| channel.delay.0).fold(0.0, f64::max))
    }
}

/// The power of an input of unit density at the target, over that of the signal in full scale: with it the
/// noise of the converters and the signal have one scale.
fn input_scale(spec: &Spec, signal: Option<&StableFilter>, target: &StrictlyProper) -> f64 {
    let Some((signal, table)) = signal.zip(spec.signal.as_ref()) else { return 1.0 };
    signal.power_through(target) / (table.rms * table.rms)
}

/// The delay in whole slow periods that all channels have, in fast periods, beyond [`KEPT_PERIODS`] of them.
/// A bank of less latency would predict the target from samples that much older.
pub(super) fn common_delay(spec: &Spec) -> usize {
    let least = spec.delays_in_fast_periods().iter().map(|delay| delay.0).fold(f64::INFINITY, f64::min);
    let periods = (least / spec.ratio as f64).floor().max(0.0) as usize;
    periods.saturating_sub(KEPT_PERIODS) * spec.ratio
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
