//! Converters whose delays a tone beside the signal tells while their samples arrive: a pilot.

use super::PredictedQuality;
use super::error::MergeError;
use super::phasor::Phasor;
use super::tracked::{DelayTrack, TrackedFusion};
use crate::bank::Bank;
use crate::calibrate::{by_scatter, usual_reference};
use crate::design::Problem;
use crate::design::problem::Channel;
use crate::linalg::Complex;
use crate::sampling::LearnedCourse;
use crate::sampling::nonuniform::Measured;
use crate::sine_fit::Estimate;
use crate::units::{FastPeriods, Hertz, Seconds};
use std::collections::VecDeque;
use std::f64::consts::TAU;

/// Frames of a block, of which the tone tells the delays in the middle.
const FRAMES: usize = 2048;
/// Most readings that say together what a delay is now, and fewest: of less each speaks for itself.
const READINGS: usize = 32;
const LEAST_READINGS: usize = 8;
/// Readings of the delays that are kept: no output needs the samples before them.
const KEPT: usize = 4;

/// The fusion of samples, NaN where they were lost, as they arrive at the converters of a bank. Their delays
/// follow from the phases of a tone, block by block, as the changes within a period of the tone. Outputs
/// come when half of the block after the next one is there.
#[derive(Debug)]
pub struct PilotFusion {
    fusion: TrackedFusion,
    pilot: Pilot,
    delays: Vec<MovingDelay>,
    /// Samples of each channel that are not fused yet.
    waiting: Vec<Vec<f64>>,
    /// The first frame of them, and that of the next block.
    first: usize,
    next: usize,
    /// The delays in the middle of the last blocks.
    track: DelayTrack,
    /// Blocks in which the tone was not found.
    missed: usize,
}

/// The tone, as it reaches the samples.
#[derive(Debug)]
struct Pilot {
    fast_period: Seconds,
    ratio: usize,
    frequency: Hertz,
    /// What front ends and gains make of it.
    responses: Vec<Complex<f64>>,
    /// The offsets of the converters, which would leak into a low tone.
    offsets: Vec<f64>,
    /// The channel whose delay stays.
    reference: usize,
}

/// The delay of a channel now, and what the last blocks say of it.
#[derive(Debug, Clone)]
struct MovingDelay {
    now: FastPeriods,
    /// What it is a block later, by its course.
    later: FastPeriods,
    readings: VecDeque<Measured>,
}

impl Pilot {
    fn new(bank: &Bank, frequency: Hertz) -> Result<Self, MergeError> {
        let problem = Problem::of_bank(bank)?;
        let w = frequency.angular().per_fast_period(bank.fast_period);
        let response = |channel: &Channel| problem.response(channel.front_end, w) * channel.gain;
        let pilot = Self {
            fast_period: bank.fast_period,
            ratio: bank.ratio,
            frequency,
            responses: problem.channels.iter().map(response).collect(),
            offsets: bank.offsets.clone(),
            reference: bank.spec.as_ref().map_or(0, usual_reference),
        };
        match Phasor::is_mirrored(pilot.cycles(), FRAMES) {
            true => {
                let rate = Hertz(1.0 / bank.slow_period().0);
                Err(MergeError::Pilot { frequency, rate, apart: rate * Phasor::least_distance(FRAMES) })
            }
            false => Ok(pilot),
        }
    }

    /// Per sample of a converter.
    fn cycles(&self) -> f64 {
        self.frequency.0 * self.fast_period.0 * self.ratio as f64
    }

    fn period(&self) -> FastPeriods {
        FastPeriods(1.0 / (self.frequency.0 * self.fast_period.0))
    }

    /// By how much each channel is later than the reference in the middle of a block, up to whole periods;
    /// `None` if the tone is not found in all.
    fn lags<'a>(&self, block: impl Iterator<Item = &'a [f64]>) -> Option<Vec<Estimate<FastPeriods>>> {
        let phasor = |(part, offset): (&[f64], &f64)| {
            let own: Vec<f64> = part.iter().map(|x| x - offset).collect();
            Phasor::of(&own, self.cycles())
        };
        let found: Vec<Phasor> = block.zip(&self.offsets).map(phasor).collect::<Option<_>>()?;
        let own = found[self.reference];
        let radian = self.period() * (1.0 / TAU);
        let lag = |(phasor, response): (&Phasor, &Complex<f64>)| {
            let turned = phasor.value / response * (own.value / self.responses[self.reference]).conj();
            Estimate { value: radian * -turned.arg(), sigma: radian * phasor.deviation.hypot(own.deviation) }
        };
        Some(found.iter().zip(&self.responses).map(lag).collect())
    }

    fn time_of(&self, frame: usize) -> Seconds {
        self.fast_period * (frame * self.ratio) as f64
    }
}

impl MovingDelay {
    /// One more reading, known up to whole periods.
    fn take(&mut self, frame: f64, found: Estimate<FastPeriods>, period: FastPeriods) {
        let value = found.value.0 - ((found.value.0 - self.now.0) / period.0).round() * period.0;
        self.readings.push_back(Measured { x: frame, value, error: found.sigma.0, jitter: 0.0 });
        if self.readings.len() > READINGS {
            self.readings.pop_front();
        }
        let course = LearnedCourse::new(&by_scatter(self.readings.make_contiguous()));
        let course = course.filter(|_| self.readings.len() >= LEAST_READINGS);
        self.now.0 = course.as_ref().map_or(value, |course| course.at(frame).value);
        // At the end of the samples the course goes on as it was.
        self.later.0 = course.map_or(value, |course| course.at(frame + FRAMES as f64).value);
    }
}

impl PilotFusion {
    /// From the first frame on, by a tone of this analog frequency, which is known to 100 ppm.
    ///
    /// # Errors
    /// As [`TrackedFusion::new`], and [`MergeError::Pilot`] for a tone that folds onto its mirror image.
    pub fn new(bank: &Bank, tone: Hertz) -> Result<Self, MergeError> {
        let delays = bank.delays.iter().map(|delay| vec![*delay]).collect();
        let track = DelayTrack { times: vec![Seconds(0.0)], delays, half_widths: Vec::new() };
        let fusion = TrackedFusion::new(bank, &track)?.with_unknown_clocks();
        let moving = |delay: &Seconds| {
            let now = delay.in_fast_periods(bank.fast_period);
            MovingDelay { now, later: now, readings: VecDeque::new() }
        };
        Ok(Self {
            fusion,
            pilot: Pilot::new(bank, tone)?,
            delays: bank.delays.iter().map(moving).collect(),
            waiting: vec![Vec::new(); bank.channel_count()],
            first: 0,
            next: 0,
            track,
            missed: 0,
        })
    }

    /// Blocks so far.
    pub fn blocks(&self) -> usize {
        self.next / FRAMES
    }

    /// Those of them in which the tone was not found: the delays stay.
    pub fn missed_blocks(&self) -> usize {
        self.missed
    }

    /// Takes the next samples of each channel, as many of all, and gives the outputs that depend on no later
    /// ones.
    ///
    /// # Errors
    /// [`MergeError::Singular`]; [`MergeError::Track`] for delays that jump by a sample and more.
    pub fn push(&mut self, channels: &[Vec<f64>]) -> Result<Vec<f64>, MergeError> {
        self.waiting.iter_mut().zip(channels).for_each(|(waiting, samples)| waiting.extend(samples));
        let mut outputs = Vec::new();
        while self.first + self.waiting[0].len() >= self.next + FRAMES {
            self.measure();
            self.fusion.follow(&self.track)?;
            self.next += FRAMES;
            outputs.extend(self.fuse_up_to(self.next - FRAMES / 2)?);
        }
        Ok(outputs)
    }

    /// The last outputs, and how good all of them are.
    ///
    /// # Errors
    /// As [`TrackedFusion::finish`].
    pub fn finish(mut self) -> Result<(Vec<f64>, PredictedQuality), MergeError> {
        if self.next > 0 {
            let later = self.delays.iter().map(|delay| delay.later).collect::<Vec<_>>();
            self.add(self.next + FRAMES / 2, KEPT, &later);
            self.fusion.follow(&self.track)?;
        }
        let mut outputs = self.fuse_up_to(usize::MAX)?;
        let (last, quality) = self.fusion.finish()?;
        outputs.extend(last);
        Ok((outputs, quality))
    }

    fn fuse_up_to(&mut self, frame: usize) -> Result<Vec<f64>, MergeError> {
        let count = (frame - self.first).min(self.waiting[0].len());
        self.first += count;
        let next: Vec<Vec<f64>> =
            self.waiting.iter_mut().map(|samples| samples.drain(..count).collect()).collect();
        self.fusion.push(&next)
    }

    /// Adds the delays in the middle of the next block. Where the tone is not found they stay.
    fn measure(&mut self) {
        let (from, middle) = (self.next - self.first, self.next + FRAMES / 2);
        match self.pilot.lags(self.waiting.iter().map(|samples| &samples[from..from + FRAMES])) {
            Some(lags) => self.take(middle as f64, lags),
            None => self.missed += 1,
        }
        // The first ones take the place of those of the bank.
        let keep = if self.next == 0 { 0 } else { KEPT };
        let now = self.delays.iter().map(|delay| delay.now).collect::<Vec<_>>();
        self.add(middle, keep, &now);
    }

    /// Adds the delays at a frame to the last ones.
    fn add(&mut self, frame: usize, keep: usize, delays: &[FastPeriods]) {
        keep_last(&mut self.track.times, keep, self.pilot.time_of(frame));
        for (all, delay) in self.track.delays.iter_mut().zip(delays) {
            keep_last(all, keep, delay.in_seconds(self.pilot.fast_period));
        }
    }

    fn take(&mut self, frame: f64, lags: Vec<Estimate<FastPeriods>>) {
        let (reference, period) = (self.delays[self.pilot.reference].now, self.pilot.period());
        for (delay, lag) in self.delays.iter_mut().zip(lags) {
            delay.take(frame, Estimate { value: reference + lag.value, ..lag }, period);
        }
    }
}

/// Adds a value after the last `keep` ones.
fn keep_last<T>(all: &mut Vec<T>, keep: usize, value: T) {
    all.drain(..all.len().saturating_sub(keep));
    all.push(value);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design;
    use crate::spec::Spec;

    const SPEC: &str = "fast_rate = 48000\nratio = 2\n\
        [target]\nfilter = { family = \"butterworth\", order = 4, cutoff = 14000 }\n\
        [signal]\nband = 18000\n[[channel]]\ndelay = 0\nbits = 16\n\
        [[channel]]\ndelay = \"0.9 samples\"\nbits = 16\n\
        [design]\nmethod = \"h2\"\ntaps = 48\n";
    const PILOT: f64 = 1007.0;

    fn bank() -> Bank {
        let spec = Spec::from_toml(SPEC, "test").unwrap();
        design::design(&spec, &design::DesignOptions::without_proof()).unwrap().bank
    }

    /// What passes the Butterworth filter, which both converters and the target have: tones, and the pilot.
    fn value(t: f64) -> f64 {
        let passed = |f: f64| (1.0 + (f / 14_000.0).powi(8)).sqrt().recip();
        let tone = |k: u32| {
            let f = 3000.0 + 14_000.0 * f64::from(k) / 61.0;
            (TAU * f * t + f64::from(k * k)).cos() * passed(f)
        };
        0.01 * (0..61).map(tone).sum::<f64>() + 0.1 * (TAU * PILOT * t).cos() * passed(PILOT)
    }

    /// Two recordings whose clocks are 20 ppm apart from the delay of the spec on: 0.9 samples early.
    fn recordings(frames: usize) -> [Vec<f64>; 2] {
        let rounded = |x: f64| (x * 32768.0).round() / 32768.0;
        let own = |k: usize| k as f64 / 24_000.0;
        [
            (0..frames).map(|k| rounded(value(own(k)))).collect(),
            (0..frames).map(|k| rounded(value(own(k) * (1.0 + 2e-5) - 0.9 / 48_000.0))).collect(),
        ]
    }

    fn fused(channels: &[Vec<f64>; 2], cut: usize) -> (Vec<f64>, PredictedQuality, [usize; 2]) {
        let mut fusion = PilotFusion::new(&bank(), Hertz(PILOT)).unwrap();
        let mut samples = Vec::new();
        for first in (0..channels[0].len()).step_by(cut) {
            let end = (first + cut).min(channels[0].len());
            samples.extend(fusion.push(&channels.clone().map(|all| all[first..end].to_vec())).unwrap());
        }
        let blocks = [fusion.blocks(), fusion.missed_blocks()];
        let (last, quality) = fusion.finish().unwrap();
        samples.extend(last);
        (samples, quality, blocks)
    }

    fn snr(samples: &[f64], inner: std::ops::Range<usize>) -> f64 {
        let (mut error, mut power) = (0.0, 0.0);
        for n in inner {
            let truth = value(n as f64 / 48_000.0);
            error += (samples[n] - truth).powi(2);
            power += truth * truth;
        }
        10.0 * (power / error).log10()
    }

    /// The delay moves by a whole fast period in a second, and back to the instants of the other converter.
    #[test]
    fn delays_follow_a_tone() {
        let channels = recordings(24_000);
        let (samples, _, blocks) = fused(&channels, 24_000);
        assert_eq!((samples.len(), blocks), (48_000, [11, 0]));
        let found = snr(&samples, 8000..24_000);
        assert!(found > 55.0, "{found}");
        let (same, ..) = fused(&channels, 700);
        assert!(same == samples);
    }

    /// Where a channel is lost the delays stay, and the end is as good as the begin.
    #[test]
    fn a_tone_that_is_lost_leaves_the_delays() {
        let mut channels = recordings(24_000);
        channels[1][6144..8192].fill(f64::NAN);
        let (samples, _, blocks) = fused(&channels, 24_000);
        assert_eq!(blocks, [11, 1]);
        let found = snr(&samples, 20_000..24_000);
        assert!(found > 50.0, "{found}");
    }
}
