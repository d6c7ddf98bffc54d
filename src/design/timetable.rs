//! The instants at which a history of slow samples and the target are sampled, in the order of time.
//!
//! Frame 0 is the newest of J frames: sample j of channel i is taken at `-j M - D_i`. The joint analog state
//! passes from instant to instant (see `lifting`).

use super::DesignError;
use super::lifting::{JointState, SAME_INSTANT};
use super::problem::Problem;
use crate::linalg::Mat;
use std::ops::RangeInclusive;

/// What happens at an instant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Event {
    /// This channel is sampled, for this frame; 0 is the newest.
    Sample {
        /// Index of the channel.
        channel: usize,
        /// j.
        frame: usize,
    },
    /// The target sample of this index begins.
    Target(usize),
}

/// A phase of the slow period at which something happens, and the way to the next one.
#[derive(Debug)]
pub(super) struct Slot {
    /// Fast periods after the beginning of the slow period.
    phase: f64,
    source: Source,
    /// The way until the next slot; `None` if that is the same instant.
    pub(super) segment: Option<Segment>,
}

/// A stretch of time without a sample: x <- e^{A l} x + S w.
#[derive(Debug)]
pub(super) struct Segment {
    /// e^{A l}.
    pub(super) transition: Mat,
    /// S.
    pub(super) input: Mat,
}

/// Whose sample a slot takes.
#[derive(Debug, Clone, Copy)]
enum Source {
    /// A channel, sampled first in this slow period and last in frame 0's.
    Channel { channel: usize, periods: (i64, i64) },
    /// The target, at this fast sample of the slow period.
    Target(i64),
}

/// All instants of the history and of the targets, in ascending order.
#[derive(Debug)]
pub(super) struct Timetable {
    ratio: i64,
    slots: Vec<Slot>,
    periods: RangeInclusive<i64>,
    instants: RangeInclusive<i64>,
}

impl Timetable {
    /// Of the newest `frames` frames and of the target at `instants` (fast periods).
    ///
    /// # Errors
    /// [`DesignError`] if a decomposition fails.
    pub(super) fn new(
        problem: &Problem,
        frames: usize,
        instants: RangeInclusive<i64>,
    ) -> Result<Self, DesignError> {
        let ratio = problem.ratio as i64;
        let mut slots: Vec<Slot> = (0..ratio).map(|p| Slot::new(p as f64, Source::Target(p))).collect();
        for (i, channel) in problem.channels.iter().enumerate() {
            let newest = (-channel.delay.0 / ratio as f64).floor();
            let phase = -channel.delay.0 - newest * ratio as f64;
            let periods = (newest as i64 + 1 - frames as i64, newest as i64);
            slots.push(Slot::new(phase, Source::Channel { channel: i, periods }));
        }
        slots.sort_by(|a, b| a.phase.total_cmp(&b.phase));
        let phases: Vec<f64> = slots.iter().map(|slot| slot.phase).chain([ratio as f64]).collect();
        let joint = JointState::new(problem)?;
        for (slot, pair) in slots.iter_mut().zip(phases.windows(2)) {
            let length = pair[1] - pair[0];
            slot.segment = (length >= SAME_INSTANT).then(|| Segment::new(&joint, length)).transpose()?;
        }
        let targets = (instants.start().div_euclid(ratio), instants.end().div_euclid(ratio));
        let (first, last) = slots
            .iter()
            .filter_map(Slot::periods)
            .fold(targets, |all, these| (all.0.min(these.0), all.1.max(these.1)));
        Ok(Self { ratio, slots, periods: first..=last, instants })
    }

    /// The instants of the target, fast periods.
    pub(super) fn instants(&self) -> &RangeInclusive<i64> {
        &self.instants
    }

    /// All slots with what happens there, if anything, from the oldest to the newest.
    pub(super) fn steps(&self) -> impl DoubleEndedIterator<Item = (Option<Event>, &Slot)> {
        self.periods
            .clone()
            .flat_map(move |period| self.slots.iter().map(move |slot| (self.event(slot, period), slot)))
    }

    fn event(&self, slot: &Slot, period: i64) -> Option<Event> {
        match slot.source {
            Source::Channel { channel, periods: (first, last) } => {
                let frame = usize::try_from(last - period).ok()?;
                (period >= first).then_some(Event::Sample { channel, frame })
            }
            Source::Target(phase) => {
                let instant = period * self.ratio + phase;
                let index = || usize::try_from(instant - self.instants.start()).ok().map(Event::Target);
                if self.instants.contains(&instant) { index() } else { None }
            }
        }
    }
}

impl Slot {
    fn new(phase: f64, source: Source) -> Self {
        Self { phase, source, segment: None }
    }

    /// The first and the last slow period in which a channel is sampled, if there is a frame at all.
    fn periods(&self) -> Option<(i64, i64)> {
        match self.source {
            Source::Channel { periods: (first, last), .. } if first <= last => Some((first, last)),
            _ => None,
        }
    }
}

impl Segment {
    fn new(joint: &JointState, length: f64) -> Result<Self, DesignError> {
        let (transition, input) = joint.over(length)?;
        Ok(Self { transition, input })
    }
}
