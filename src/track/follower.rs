//! Follows the delays of a spec's channels block by block.

use super::TrackError;
use super::error::NotMeasured;
use super::filter::{Coincidence, DelayFilter, DelayMeasurement, DelayState};
use super::log::{Logged, TrackWarning};
use super::readings::Reading;
use super::source::{DelaySource, check_pilot};
use super::timeline::Timeline;
use super::tracker::{DelayTracker, Lock, Taken};
use super::tracking::Tracking;
use crate::calibrate::Model;
use crate::spec::{ChannelSpec, HALF_WIDTH, Spec};
use crate::units::Seconds;

/// A delay counts as known when the half-width of its 95 % interval is below this, in fast periods, or below
/// this share of the smallest side of the box.
const KNOWN_HALF_WIDTH: f64 = 1e-3;
const KNOWN_SHARE: f64 = 0.02;
/// How far ahead it is reported that delays come together, in blocks.
const HORIZON_BLOCKS: f64 = 60.0;

/// What a block of samples led to.
#[derive(Debug, Clone, PartialEq)]
pub struct Followed {
    /// What is known at the centre of this block.
    pub log: Logged,
    /// What a user should know at once; each is said once.
    pub warnings: Vec<TrackWarning>,
}

/// Follows the delays of the channels of a spec.
///
/// Delays are relative to the reference channel of the spec's `[uncertainty]`. After each block the Kalman
/// filters take its measurement; without one, or with one that contradicts them, they go on as they are.
/// Readings that are known beforehand need no filter: what the readings before and after an instant say of
/// it together is used, as soon as a channel has readings of two frames.
#[derive(Debug, Clone)]
pub struct Follower {
    spec: Spec,
    source: DelaySource,
    settings: Tracking,
    reference: usize,
    /// The channels whose delays are followed.
    trackers: Vec<DelayTracker>,
    /// Standard deviation at which a delay counts as known.
    wanted: Seconds,
    /// The frame for which the filters' states hold.
    time: f64,
    /// Something was measured.
    is_started: bool,
    blocks: u64,
    /// All warnings so far, and those of this block.
    warned: Vec<TrackWarning>,
    warnings: Vec<TrackWarning>,
}

impl Follower {
    /// Begins with the delays of the spec and their intervals.
    ///
    /// # Errors
    /// [`TrackError`] for a spec without uncertain delays, or a pilot that cannot be measured.
    pub fn new(spec: &Spec, source: DelaySource, settings: Tracking) -> Result<Self, TrackError> {
        settings.check()?;
        if !spec.layout().is_plain() {
            return Err(TrackError::OwnRates);
        }
        let spec = spec.clone();
        let table = spec.uncertainty.clone().unwrap_or_default();
        let reference = table.reference_channel().unwrap_or(0);
        let of_all = table.delays(spec.channels.len());
        let is_followed = |&j: &usize| j != reference && of_all[j] > Seconds(0.0);
        let followed: Vec<usize> = (0..spec.channels.len()).filter(is_followed).collect();
        if followed.is_empty() {
            return Err(TrackError::NoUncertainDelay);
        }
        if let DelaySource::Pilot(pilot) = source {
            check_pilot(Model::new(&spec)?.slow_rate(), pilot, settings.frames)?;
        }
        let smallest = followed.iter().map(|&j| of_all[j].0).fold(f64::INFINITY, f64::min);
        let wanted =
            Seconds((KNOWN_HALF_WIDTH * spec.fast_period.0).max(KNOWN_SHARE * smallest) / HALF_WIDTH);
        let frame = spec.fast_period * spec.ratio as f64;
        let (mut trackers, mut warnings) = (Vec::new(), Vec::new());
        for &j in &followed {
            let timeline = match &source {
                DelaySource::Readings(readings) => Timeline::new(readings, j, frame, settings.rate_walk()),
                DelaySource::Pilot(_) | DelaySource::AnySignal => Ok(None),
            };
            let timeline = timeline.unwrap_or_else(|reason| {
                warnings.push(TrackWarning::NotSmoothed { channel: j + 1, reason });
                None
            });
            // Each begins with the delay of the spec and its interval.
            let (delay, sigma) = (spec.channels[j].delay, of_all[j].0 / HALF_WIDTH);
            let state = DelayState::known(delay, sigma, settings.rate_deviation());
            let filter = DelayFilter::new(state, settings.rate_walk());
            trackers.push(DelayTracker::new(j, filter, timeline));
        }
        Ok(Self {
            spec,
            source,
            settings,
            reference,
            trackers,
            wanted,
            time: 0.0,
            is_started: false,
            blocks: 0,
            warned: warnings.clone(),
            warnings,
        })
    }

    /// Takes the samples of the next block, a list per channel; NaN where one is missing.
    pub fn follow(&mut self, samples: &[Vec<f64>]) -> Followed {
        let frames = self.settings.frames as u64;
        let first = self.blocks * frames;
        self.blocks += 1;
        let centre = first as f64 + 0.5 * (frames as f64 - 1.0);
        let measured = self.measure(samples, first, centre);
        self.advance_to(centre);
        let time = self.frame_time() * centre;
        self.trackers.iter_mut().for_each(|tracker| tracker.look_up(time));
        let (measured, reason) = match measured {
            Ok(measured) => (measured, None),
            Err(reason) => (vec![None; self.spec.channels.len()], Some(reason.to_string())),
        };
        let log = self.logged(centre, measured, reason);
        if let Some(warning) = self.coincidence() {
            self.warn(warning);
        }
        Followed { log, warnings: std::mem::take(&mut self.warnings) }
    }

    /// Measures the block and lets the filters take what was found; `Err` says why nothing was.
    fn measure(
        &mut self,
        samples: &[Vec<f64>],
        first: u64,
        centre: f64,
    ) -> Result<Vec<Option<DelayMeasurement>>, NotMeasured> {
        if let DelaySource::Readings(readings) = &self.source {
            let frames = first..first + self.settings.frames as u64;
            let readings = Reading::within(readings, frames).to_vec();
            let mut latest = Err(NotMeasured::NoReading);
            for reading in readings {
                let of = |delay: &Option<(Seconds, Seconds)>| {
                    delay.map(|(delay, sigma)| DelayMeasurement { delay, variance: sigma.0 * sigma.0 })
                };
                let measured: Vec<_> = reading.delays.iter().map(of).collect();
                self.advance_to(reading.frame as f64);
                latest = Ok(self.take(reading.frame, measured));
            }
            return latest;
        }
        self.advance_to(centre);
        let mut expected = self.spec.clone();
        for tracker in &self.trackers {
            let j = tracker.channel;
            expected.channels[j].delay = tracker.state().delay;
        }
        let mut measured = self.source.measure(&expected, self.reference, samples)?;
        let walked = self.mean_of_block();
        measured.iter_mut().flatten().for_each(|measurement| measurement.variance += walked);
        Ok(self.take(first, measured))
    }

    /// A block shows the mean of a delay over it. With a rate that walks by q in a second, the variance of
    /// its distance from the delay at the centre of the time T is q T^3 / 320.
    fn mean_of_block(&self) -> f64 {
        let t = self.frame_time().0 * self.settings.frames as f64;
        self.settings.rate_walk() * t.powi(3) / 320.0
    }

    /// Updates the filters; a measurement that was refused is none.
    fn take(
        &mut self,
        frame: u64,
        mut measured: Vec<Option<DelayMeasurement>>,
    ) -> Vec<Option<DelayMeasurement>> {
        let mut lost = Vec::new();
        for tracker in &mut self.trackers {
            let j = tracker.channel;
            let Some(measurement) = measured[j] else { continue };
            self.is_started = true;
            match tracker.take(frame, measurement, self.settings.rate_deviation()) {
                Taken::Used => {}
                Taken::Refused => measured[j] = None,
                Taken::Restarted => lost.push(j + 1),
            }
        }
        let frame = self.time as u64;
        lost.into_iter().for_each(|channel| self.warn(TrackWarning::Lost { channel, frame }));
        measured
    }

    fn frame_time(&self) -> Seconds {
        self.spec.fast_period * self.spec.ratio as f64
    }

    fn advance_to(&mut self, frame: f64) {
        if frame > self.time {
            // The intervals of the spec are those of the first measurement: what it finds is no drift.
            if self.is_started {
                let elapsed = self.frame_time() * (frame - self.time);
                self.trackers.iter_mut().for_each(|tracker| tracker.advance(elapsed));
            }
            self.time = frame;
        }
    }

    /// Bounds of the delays of all channels at a frame; `None` without timelines.
    fn bounds(&self, frame: f64) -> Option<Vec<Option<Seconds>>> {
        let mut bounds = vec![None; self.spec.channels.len()];
        let (time, change) = (self.frame_time() * frame, self.settings.rate_change());
        for tracker in &self.trackers {
            bounds[tracker.channel] = tracker.timeline().and_then(|timeline| timeline.bound(time, change));
        }
        self.trackers.iter().any(|tracker| tracker.timeline().is_some()).then_some(bounds)
    }

    fn logged(&self, centre: f64, measured: Vec<Option<DelayMeasurement>>, reason: Option<String>) -> Logged {
        let mut log = Logged::of_reference(&self.spec, centre, self.frame_time(), reason);
        log.bound = self.bounds(centre);
        for tracker in &self.trackers {
            let j = tracker.channel;
            log.put(j, tracker.state(), tracker.lock(self.wanted), measured[j]);
        }
        log
    }

    /// Keeps a warning for the end of the block, unless one of its kind was given.
    fn warn(&mut self, warning: TrackWarning) {
        if !self.warned.iter().any(|known| known.is_like(&warning)) {
            self.warned.push(warning.clone());
            self.warnings.push(warning);
        }
    }

    /// Two channels that will sample at one instant; with more channels than needed, nothing is lost by
    /// that.
    fn coincidence(&self) -> Option<TrackWarning> {
        let channels = self.spec.channels.len();
        let is_known = self.trackers.iter().all(|tracker| tracker.lock(self.wanted) == Lock::Locked);
        if channels > self.spec.ratio || !is_known {
            return None;
        }
        let known = |channel: &ChannelSpec| DelayState::known(channel.delay, 0.0, 0.0);
        let mut states: Vec<DelayState> = self.spec.channels.iter().map(known).collect();
        self.trackers.iter().for_each(|tracker| states[tracker.channel] = tracker.state());
        let horizon = self.frame_time() * (HORIZON_BLOCKS * self.settings.frames as f64);
        let found = Coincidence::ahead(&states, &self.spec, horizon)?;
        let [a, b] = found.channels.map(|i| i + 1);
        Some(TrackWarning::Coincidence { channels: [a, b], at: self.frame_time() * self.time + found.after })
    }
}
