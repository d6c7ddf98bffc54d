//! Watches the first frames of a run for captures that contradict the spec of the bank, beside the filters.

use super::warn;
use crate::bank::Bank;
use crate::calibrate::{ENOUGH_FRAMES, Record, contradictions};
use crate::io::PcmFrames;
use crate::spec::Spec;
use std::thread::{Builder, JoinHandle};

/// Most channels that are watched.
const MOST_CHANNELS: usize = 32;

/// Keeps the first frames and judges them on a thread of its own.
pub(super) struct Watch {
    state: State,
    /// Whether a warning is printed as soon as it is known.
    is_live: bool,
}

enum State {
    /// Nothing to compare with, or done.
    Idle,
    Collecting {
        spec: Box<Spec>,
        samples: Vec<Vec<f64>>,
    },
    Judging(JoinHandle<Vec<String>>),
}

impl Watch {
    /// For the spec that `bank` carries, if it does. Warnings come at the end of the run.
    pub(super) fn new(bank: &Bank) -> Self {
        let channels = bank.channel_count();
        let spec = bank.spec.clone().filter(|_| (2..=MOST_CHANNELS).contains(&channels));
        let collecting =
            |spec| State::Collecting { spec: Box::new(spec), samples: vec![Vec::new(); channels] };
        Self { state: spec.map_or(State::Idle, collecting), is_live: false }
    }

    /// Warnings are printed as soon as they are known.
    pub(super) fn live(self) -> Self {
        Self { is_live: true, ..self }
    }

    /// Takes the frames of a block until there are enough; nothing after that.
    pub(super) fn observe(&mut self, parts: &[PcmFrames<'_>]) {
        let State::Collecting { samples, .. } = &mut self.state else { return };
        let mut channels = samples.iter_mut();
        for part in parts {
            for (c, samples) in channels.by_ref().take(part.channels).enumerate() {
                let room = ENOUGH_FRAMES - samples.len();
                let (format, container) = (part.layout.format, part.layout.container);
                let frames = part.bytes.chunks_exact(part.frame_bytes()).take(room);
                samples.extend(frames.map(|frame| format.decode(&frame[c * container..])));
            }
        }
        if samples.iter().all(|samples| samples.len() >= ENOUGH_FRAMES) {
            self.judge();
        }
    }

    fn judge(&mut self) {
        let State::Collecting { spec, samples } = std::mem::replace(&mut self.state, State::Idle) else {
            return;
        };
        let is_live = self.is_live;
        let judge = move || {
            let found = judged(&spec, samples);
            if is_live {
                found.iter().for_each(|text| warn(text));
            }
            found
        };
        // Without a thread nothing is judged: the run matters more.
        self.state = Builder::new().spawn(judge).map_or(State::Idle, State::Judging);
    }

    /// The warnings that were not printed yet, of short runs too.
    pub(super) fn finish(mut self) -> Vec<String> {
        if matches!(self.state, State::Collecting { .. }) {
            self.judge();
        }
        match self.state {
            State::Judging(thread) => thread.join().ok().filter(|_| !self.is_live).unwrap_or_default(),
            _ => Vec::new(),
        }
    }
}

fn judged(spec: &Spec, samples: Vec<Vec<f64>>) -> Vec<String> {
    let records: Vec<Record> = samples.into_iter().map(Record::new).collect();
    contradictions(spec, &records).iter().map(ToString::to_string).collect()
}
