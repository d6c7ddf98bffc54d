//! Watches the first frames of a run for captures that contradict the spec of the bank, beside the filters.

use super::journal::{Event, Journal};
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
    /// Where a warning goes as soon as it is known.
    journal: Option<Journal>,
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
        Self { state: spec.map_or(State::Idle, collecting), journal: None }
    }

    /// Nothing to watch.
    pub(super) fn idle() -> Self {
        Self { state: State::Idle, journal: None }
    }

    /// Warnings are reported as soon as they are known.
    pub(super) fn live(self, journal: Journal) -> Self {
        Self { journal: Some(journal), ..self }
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
        let journal = self.journal.clone();
        let judge = move || {
            let found = judged(&spec, samples);
            let reported = journal.iter().flat_map(|journal| found.iter().map(move |text| (journal, text)));
            reported.for_each(|(journal, text)| journal.report(Event::Warning { text: text.clone() }));
            found
        };
        // Without a thread nothing is judged: the run matters more.
        self.state = Builder::new().spawn(judge).map_or(State::Idle, State::Judging);
    }

    /// The warnings, of short runs too.
    pub(super) fn finish(mut self) -> Vec<String> {
        if matches!(self.state, State::Collecting { .. }) {
            self.judge();
        }
        match self.state {
            State::Judging(thread) => thread.join().unwrap_or_default(),
            _ => Vec::new(),
        }
    }
}

fn judged(spec: &Spec, samples: Vec<Vec<f64>>) -> Vec<String> {
    let records: Vec<Record> = samples.into_iter().map(Record::new).collect();
    contradictions(spec, &records).iter().map(ToString::to_string).collect()
}
