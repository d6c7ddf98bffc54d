//! Follows the delays of a bank's channels block by block, and says how its taps are to change.

use super::TrackError;
use super::error::NotMeasured;
use super::filter::{Coincidence, DelayFilter, DelayMeasurement, DelayState};
use super::frame_shift::{least_half, shift_for};
use super::log::{Logged, TrackWarning};
use super::readings::Reading;
use super::source::{DelaySource, check_pilot};
use super::timeline::Timeline;
use super::tracker::{DelayTracker, FollowSettings, Lock, Taken};
use crate::bank::{Bank, SynthesisFilters};
use crate::calibrate::Model;
use crate::spec::{ChannelSpec, HALF_WIDTH, Spec};
use crate::units::{FastPeriods, Seconds};
use std::collections::VecDeque;

/// A delay counts as known when the half-width of its 95 % interval is below this, in fast periods, or below
/// this share of the smallest side of the box.
const KNOWN_HALF_WIDTH: f64 = 1e-3;
const KNOWN_SHARE: f64 = 0.02;
/// A delay moves by at most this between two changes of the taps, in fast periods, where a change every
/// [`LEAST_FRAMES`] frames suffices for that.
const LARGEST_STEP: f64 = 2e-4;
const LEAST_FRAMES: usize = 16;
/// How far ahead it is reported that delays come together, in blocks.
const HORIZON_BLOCKS: f64 = 60.0;

/// Delays at which the taps are to be from some frame on.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct DelayChange {
    /// Frame of the block two blocks later, from 0.
    pub(super) frame: usize,
    /// True delay minus that of the bank, per channel, with its shift; within the box for which the taps
    /// were designed.
    pub(super) errors: Vec<FastPeriods>,
    /// Shift of each channel: frame k takes its sample k + s, whose delay is smaller by s slow periods. Not
    /// zero only where the box holds all delays of a slow period.
    pub(super) shifts: Vec<i64>,
}

/// What a block of samples led to.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Followed {
    /// For the block two blocks later.
    pub(super) changes: Vec<DelayChange>,
    /// What is known at the centre of this block.
    pub(super) log: Logged,
    /// What a user should know at once; each is said once.
    pub(super) warnings: Vec<TrackWarning>,
}

/// Follows the delays of the channels of a bank.
///
/// Delays are relative to the reference channel of the spec's `[uncertainty]`. After each block the Kalman
/// filters take its measurement; without one, or with one that contradicts them, they go on as they are. The
/// delays for the block after the next one are those expected there. Readings that are known beforehand need
/// no filter: what the readings before and after an instant say of it together is used, as soon as a channel
/// has readings of two frames.
#[derive(Debug, Clone)]
pub struct Follower {
    spec: Spec,
    source: DelaySource,
    settings: FollowSettings,
    reference: usize,
    /// The channels whose delays the taps follow.
    trackers: Vec<DelayTracker>,
    /// Standard deviation at which a delay counts as known.
    wanted: Seconds,
    /// The frame for which the filters' states hold.
    time: f64,
    /// Something was measured.
    is_started: bool,
    blocks: u64,
    /// The shifts at the first frames of this block and of those whose changes are decided.
    shifts: VecDeque<Vec<i64>>,
    /// Those that were decided last.
    last_shifts: Vec<i64>,
    /// All warnings so far, and those of this block.
    warned: Vec<TrackWarning>,
    warnings: Vec<TrackWarning>,
}

impl Follower {
    /// Begins with the delays of the bank and the intervals of its spec.
    ///
    /// # Errors
    /// [`TrackError`] for a bank whose taps do not follow delays, or a pilot that cannot be measured.
    pub(super) fn new(
        bank: &Bank,
        source: DelaySource,
        settings: FollowSettings,
    ) -> Result<Self, TrackError> {
        if matches!(bank.filters, SynthesisFilters::StateSpace(_)) {
            return Err(TrackError::Recursive);
        }
        if !bank.layout().is_plain() {
            return Err(TrackError::OwnRates);
        }
        let slopes = bank.tap_slopes.as_ref().ok_or(TrackError::NoTapSlopes)?;
        let spec = bank.spec.clone().ok_or(TrackError::NoSpec)?;
        let table = spec.uncertainty.clone().unwrap_or_default();
        let reference = table.reference_channel().unwrap_or(0);
        let of_all = table.delays(spec.channels.len());
        let is_followed = |&j: &usize| j != reference && slopes.follows(j) && of_all[j] > Seconds(0.0);
        let followed: Vec<usize> = (0..spec.channels.len()).filter(is_followed).collect();
        if followed.is_empty() {
            return Err(TrackError::NoTapSlopes);
        }
        if let DelaySource::Pilot(pilot) = source {
            check_pilot(Model::new(&spec)?.slow_rate(), pilot, settings.block_frames)?;
        }
        let smallest = followed.iter().map(|&j| of_all[j].0).fold(f64::INFINITY, f64::min);
        let wanted =
            Seconds((KNOWN_HALF_WIDTH * spec.fast_period.0).max(KNOWN_SHARE * smallest) / HALF_WIDTH);
        let frame = spec.fast_period * spec.ratio as f64;
        let (mut trackers, mut warnings) = (Vec::new(), Vec::new());
        for &j in &followed {
            let timeline = match &source {
                DelaySource::Readings(readings) => Timeline::new(readings, j, frame, settings.rate_walk),
                DelaySource::Pilot(_) | DelaySource::AnySignal => Ok(None),
            };
            let timeline = timeline.unwrap_or_else(|reason| {
                warnings.push(TrackWarning::NotSmoothed { channel: j + 1, reason });
                None
            });
            // Each begins with the delay of the spec and its interval.
            let (delay, sigma) = (spec.channels[j].delay, of_all[j].0 / HALF_WIDTH);
            let state = DelayState::known(delay, sigma, settings.rate_deviation);
            trackers.push(DelayTracker::new(
                j,
                of_all[j],
                DelayFilter::new(state, settings.rate_walk),
                timeline,
            ));
        }
        let no_shifts = vec![0; spec.channels.len()];
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
            shifts: VecDeque::from([no_shifts.clone(), no_shifts.clone()]),
            last_shifts: no_shifts,
            warned: warnings.clone(),
            warnings,
        })
    }

    /// Frames of a block.
    pub(super) fn block_frames(&self) -> usize {
        self.settings.block_frames
    }

    /// What is known beforehand of the first two blocks; nothing where delays are measured in the samples.
    pub(super) fn beginning(&mut self) -> [Vec<DelayChange>; 2] {
        if !matches!(self.source, DelaySource::Readings(_)) {
            return [Vec::new(), Vec::new()];
        }
        let changes = [0, self.settings.block_frames as u64].map(|first| self.changes(first));
        let shifts = changes.iter().filter_map(|block| Some(block.first()?.shifts.clone()));
        self.shifts = shifts.collect();
        changes
    }

    /// Takes the samples of the next block, a list per channel of the bank; NaN where one is missing. Each
    /// channel has the shift of the change at the first frame of the block; without such a change, no shift.
    pub(super) fn follow(&mut self, samples: &[Vec<f64>]) -> Followed {
        let frames = self.settings.block_frames as u64;
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
        self.warn_of_delays(centre);
        self.shifts.pop_front();
        let changes = self.changes(first + 2 * frames);
        self.shifts.extend(changes.first().map(|change| change.shifts.clone()));
        Followed { changes, log, warnings: std::mem::take(&mut self.warnings) }
    }

    /// Measures the block and lets the filters take what was found; `Err` says why nothing was.
    fn measure(
        &mut self,
        samples: &[Vec<f64>],
        first: u64,
        centre: f64,
    ) -> Result<Vec<Option<DelayMeasurement>>, NotMeasured> {
        if let DelaySource::Readings(readings) = &self.source {
            let frames = first..first + self.settings.block_frames as u64;
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
            expected.channels[j].delay = tracker.state().delay - self.shifted(j);
        }
        let mut measured = self.source.measure(&expected, self.reference, samples)?;
        let walked = self.mean_of_block();
        for (j, measurement) in measured.iter_mut().enumerate() {
            if let Some(measurement) = measurement {
                measurement.delay += self.shifted(j);
                measurement.variance += walked;
            }
        }
        Ok(self.take(first, measured))
    }

    /// By how much the samples of this block have a smaller delay than the channel.
    fn shifted(&self, j: usize) -> Seconds {
        self.frame_time() * self.block_shifts()[j] as f64
    }

    fn block_shifts(&self) -> &[i64] {
        self.shifts.front().map_or(&self.last_shifts, |shifts| shifts)
    }

    /// A block shows the mean of a delay over it. With a rate that walks by q in a second, the variance of
    /// its distance from the delay at the centre of the time T is q T^3 / 320.
    fn mean_of_block(&self) -> f64 {
        let t = self.frame_time().0 * self.settings.block_frames as f64;
        self.settings.rate_walk * t.powi(3) / 320.0
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
            match tracker.take(frame, measurement, self.settings.rate_deviation) {
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

    /// What is expected at a frame of the stream, for each followed channel.
    fn expected(&self, frame: f64) -> impl Iterator<Item = (&DelayTracker, DelayState)> {
        let (time, elapsed) = (self.frame_time() * frame, self.frame_time() * (frame - self.time));
        self.trackers.iter().map(move |tracker| (tracker, tracker.ahead(time, elapsed)))
    }

    /// Bounds of the delays of all channels at a frame; `None` without timelines.
    fn bounds(&self, frame: f64) -> Option<Vec<Option<Seconds>>> {
        let mut bounds = vec![None; self.spec.channels.len()];
        let (time, change) = (self.frame_time() * frame, self.settings.rate_change);
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
            log.shift[j] = self.block_shifts()[j];
        }
        log
    }

    /// The shift of a channel whose delay is known, after `shifts`, and the error of the delay that is left.
    fn shifted_error(&self, tracker: &DelayTracker, delay: Seconds, shifts: &[i64]) -> (i64, Seconds) {
        let (j, period) = (tracker.channel, self.frame_time());
        let error = delay - self.spec.channels[j].delay;
        let shift = shift_for(error, tracker.half, period, shifts[j]);
        (shift, error - period * shift as f64)
    }

    /// The shifts and delays of all channels at a frame of the stream.
    fn change(&mut self, frame: usize, at: f64) -> DelayChange {
        let mut errors = vec![FastPeriods(0.0); self.spec.channels.len()];
        let mut shifts = self.last_shifts.clone();
        for (tracker, state) in self.expected(at) {
            let (j, half) = (tracker.channel, tracker.half.0);
            let (shift, error) = self.shifted_error(tracker, state.delay, &shifts);
            errors[j] = Seconds(error.0.clamp(-half, half)).in_fast_periods(self.spec.fast_period);
            shifts[j] = shift;
        }
        self.last_shifts.clone_from(&shifts);
        DelayChange { frame, errors, shifts }
    }

    /// Changes within the block that begins at frame `first`, often enough for its drift.
    fn changes(&mut self, first: u64) -> Vec<DelayChange> {
        let frames = self.settings.block_frames;
        let middle = first as f64 + 0.5 * frames as f64;
        let fastest = self.expected(middle).map(|(_, state)| state.rate.abs()).fold(0.0, f64::max);
        let drift = fastest * (frames * self.spec.ratio) as f64;
        let most = (frames / LEAST_FRAMES).max(1);
        // NaN and infinity become the limits.
        let count = ((drift / LARGEST_STEP).ceil() as usize).clamp(1, most);
        let begin = |k: usize| k * frames / count;
        let change = |k: usize| {
            let middle = 0.5 * (begin(k) + begin(k + 1)) as f64 - 0.5;
            self.change(begin(k), first as f64 + middle)
        };
        (0..count).map(change).collect()
    }

    /// Keeps a warning for the end of the block, unless one of its kind was given.
    fn warn(&mut self, warning: TrackWarning) {
        if !self.warned.iter().any(|known| known.is_like(&warning)) {
            self.warned.push(warning.clone());
            self.warnings.push(warning);
        }
    }

    /// Of this block, not of those whose changes are decided: the recording may end before them.
    fn warn_of_delays(&mut self, centre: f64) {
        let (frame, enough) = (centre as u64, self.enough());
        let is_outside = |tracker: &&DelayTracker| {
            let (_, error) = self.shifted_error(tracker, tracker.state().delay, self.block_shifts());
            error.0.abs() >= tracker.half.0
        };
        let warning = |tracker: &DelayTracker| {
            let (channel, half) = (tracker.channel + 1, tracker.half);
            TrackWarning::OutsideTheBox { channel, half, frame, enough }
        };
        let outside: Vec<_> = self.trackers.iter().filter(is_outside).map(warning).collect();
        outside.into_iter().for_each(|warning| self.warn(warning));
        if let Some(warning) = self.coincidence() {
            self.warn(warning);
        }
    }

    /// The box that no delay leaves, where there is one: with as many channels as the ratio it holds delays
    /// that coincide.
    fn enough(&self) -> Option<Seconds> {
        let has_more = self.spec.channels.len() > self.spec.ratio;
        has_more.then(|| least_half(self.frame_time()))
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
        let horizon = self.frame_time() * (HORIZON_BLOCKS * self.settings.block_frames as f64);
        let found = Coincidence::ahead(&states, &self.spec, horizon)?;
        let [a, b] = found.channels.map(|i| i + 1);
        Some(TrackWarning::Coincidence { channels: [a, b], at: self.frame_time() * self.time + found.after })
    }
}
