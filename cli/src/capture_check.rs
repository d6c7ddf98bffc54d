//! Checks the first frames of a run for captures that contradict the spec of the bank, beside the filters.

use super::event::{Event, Events};
use hybank::bank::Bank;
use hybank::calibrate::{ENOUGH_FRAMES, Record, agreement, comparable, frames_for_agreement};
use hybank::io::PcmFrames;
use hybank::runtime::{Frames, Input, Isa};
use hybank::spec::Spec;
use std::thread::{Builder, JoinHandle};

/// What the check found.
#[derive(Debug, Default)]
pub(super) struct Checked {
    /// In what the captures contradict the spec.
    pub(super) warnings: Vec<String>,
    /// Whether they agree with it, for the end of a run.
    pub(super) verdict: String,
}

/// Keeps the first frames and judges them on a thread of its own.
pub(super) struct CaptureCheck {
    state: State,
    /// Frames that are judged.
    frames: usize,
    /// Where a warning goes as soon as it is known.
    events: Option<Events>,
}

enum State {
    /// Nothing to compare with, for this reason, or done.
    Idle(String),
    Collecting {
        spec: Box<Spec>,
        samples: Vec<Vec<f64>>,
    },
    Judging(JoinHandle<Checked>),
}

/// Where no thread can be started, or it died.
const UNJUDGED: &str = "the captures were not compared with the spec";

impl CaptureCheck {
    /// For the spec that `bank` carries, if it does, and if the samples are steady. With `events`
    /// warnings are reported as soon as they are known, after fewer frames, else at the end of the run.
    pub(super) fn new(bank: &Bank, is_steady: bool, events: Option<Events>) -> Self {
        let channels = bank.channel_count();
        let state = match comparable(bank.spec.as_ref(), is_steady) {
            Err(reason) => State::Idle(reason.to_string()),
            Ok(spec) => {
                State::Collecting { spec: Box::new(spec.clone()), samples: vec![Vec::new(); channels] }
            }
        };
        let frames = frames_for_agreement(channels);
        let frames = if events.is_some() { frames.min(ENOUGH_FRAMES) } else { frames };
        Self { state, frames, events }
    }

    /// Takes the frames of a block until there are enough; nothing after that.
    pub(super) fn observe(&mut self, recordings: &[PcmFrames<'_>]) {
        let State::Collecting { samples, .. } = &mut self.state else { return };
        let known = samples.first().map_or(0, Vec::len);
        let block = Frames::new(&recordings, 0..self.frames - known);
        let mut numbers = vec![0.0; block.frames() * block.channels()];
        block.load_f64(Isa::detect(), 0, &mut numbers);
        for (i, samples) in samples.iter_mut().enumerate() {
            samples.extend(numbers.iter().skip(i).step_by(block.channels()));
        }
        if known + block.frames() >= self.frames {
            self.judge();
        }
    }

    fn judge(&mut self) {
        let (spec, samples) = match std::mem::replace(&mut self.state, State::Idle(UNJUDGED.to_owned())) {
            State::Collecting { spec, samples } => (spec, samples),
            other => {
                self.state = other;
                return;
            }
        };
        let events = self.events.clone();
        let judge = move || {
            let found = judged(&spec, samples);
            if let Some(events) = events {
                found.warnings.iter().for_each(|text| events.tell(&Event::Warning { text: text.clone() }));
            }
            found
        };
        // Without a thread nothing is judged: the run matters more.
        if let Ok(thread) = Builder::new().spawn(judge) {
            self.state = State::Judging(thread);
        }
    }

    /// What was found, in short runs too.
    pub(super) fn finish(mut self) -> Checked {
        self.judge();
        let idle = |verdict| Checked { verdict, ..Checked::default() };
        match self.state {
            State::Judging(thread) => thread.join().unwrap_or_else(|_| idle(UNJUDGED.to_owned())),
            State::Idle(reason) => idle(reason),
            State::Collecting { .. } => idle(UNJUDGED.to_owned()),
        }
    }
}

fn judged(spec: &Spec, samples: Vec<Vec<f64>>) -> Checked {
    let records: Vec<Record> = samples.into_iter().map(Record::new).collect();
    let found = agreement(spec, &records);
    let warnings = found.contradictions.iter().map(ToString::to_string).collect();
    Checked { warnings, verdict: found.summary() }
}
