//! Watches the first frames of a run for captures that contradict the spec of the bank, beside the filters.

use super::journal::{Event, Journal};
use crate::bank::Bank;
use crate::calibrate::{Agreement, ENOUGH_FRAMES, Record, agreement, frames_for_agreement};
use crate::io::PcmFrames;
use crate::spec::Spec;
use std::thread::{Builder, JoinHandle};

/// What the watch found.
#[derive(Debug, Default)]
pub(super) struct Watched {
    /// In what the captures contradict the spec.
    pub(super) warnings: Vec<String>,
    /// Whether they agree with it, for the end of a run.
    pub(super) verdict: String,
}

/// Keeps the first frames and judges them on a thread of its own.
pub(super) struct Watch {
    state: State,
    /// Frames that are judged.
    frames: usize,
    /// Where a warning goes as soon as it is known.
    journal: Option<Journal>,
}

enum State {
    /// Nothing to compare with, for this reason, or done.
    Idle(&'static str),
    Collecting {
        spec: Box<Spec>,
        samples: Vec<Vec<f64>>,
    },
    Judging(JoinHandle<Watched>),
}

impl Watch {
    /// For the spec that `bank` carries, if it does. Warnings come at the end of the run.
    pub(super) fn new(bank: &Bank) -> Self {
        let channels = bank.channel_count();
        let state = match bank.spec.clone() {
            None => State::Idle("the bank carries no spec with which the captures could be compared"),
            Some(spec) => State::Collecting { spec: Box::new(spec), samples: vec![Vec::new(); channels] },
        };
        Self { state, frames: frames_for_agreement(channels), journal: None }
    }

    /// Nothing to watch, for a reason.
    pub(super) fn idle(reason: &'static str) -> Self {
        Self { state: State::Idle(reason), frames: 0, journal: None }
    }

    /// Warnings are reported as soon as they are known, after fewer frames.
    pub(super) fn live(self, journal: Journal) -> Self {
        Self { journal: Some(journal), frames: self.frames.min(ENOUGH_FRAMES), ..self }
    }

    /// Takes the frames of a block until there are enough; nothing after that.
    pub(super) fn observe(&mut self, parts: &[PcmFrames<'_>]) {
        let State::Collecting { samples, .. } = &mut self.state else { return };
        let mut channels = samples.iter_mut();
        for part in parts {
            for (c, samples) in channels.by_ref().take(part.channels).enumerate() {
                let room = self.frames - samples.len();
                let (format, container) = (part.layout.format, part.layout.container);
                let frames = part.bytes.chunks_exact(part.frame_bytes()).take(room);
                samples.extend(frames.map(|frame| format.decode(&frame[c * container..])));
            }
        }
        if samples.iter().all(|samples| samples.len() >= self.frames) {
            self.judge();
        }
    }

    fn judge(&mut self) {
        let State::Collecting { spec, samples } = std::mem::replace(&mut self.state, UNJUDGED) else {
            return;
        };
        let journal = self.journal.clone();
        let judge = move || {
            let found = judged(&spec, samples);
            let all =
                journal.iter().flat_map(|journal| found.warnings.iter().map(move |text| (journal, text)));
            all.for_each(|(journal, text)| journal.report(Event::Warning { text: text.clone() }));
            found
        };
        // Without a thread nothing is judged: the run matters more.
        self.state = Builder::new().spawn(judge).map_or(UNJUDGED, State::Judging);
    }

    /// What was found, in short runs too.
    pub(super) fn finish(mut self) -> Watched {
        if matches!(self.state, State::Collecting { .. }) {
            self.judge();
        }
        match self.state {
            State::Judging(thread) => thread.join().unwrap_or_default(),
            State::Idle(reason) => Watched { warnings: Vec::new(), verdict: reason.to_owned() },
            State::Collecting { .. } => Watched::default(),
        }
    }
}

/// Why some runs are not watched.
pub(super) const UNWATCHED: &str =
    "captures are not compared with the spec where they are complex or their delays are followed";

/// Where no thread can be started.
const UNJUDGED: State = State::Idle("the captures were not compared with the spec");

fn judged(spec: &Spec, samples: Vec<Vec<f64>>) -> Watched {
    let records: Vec<Record> = samples.into_iter().map(Record::new).collect();
    let Agreement { contradictions, verdict } = agreement(spec, &records);
    let warnings: Vec<String> = contradictions.iter().map(ToString::to_string).collect();
    let verdict = match warnings.len() {
        0 => verdict.to_string(),
        1 => "the captures do not agree with the spec of the bank, see the warning".to_owned(),
        count => format!("the captures do not agree with the spec of the bank, see the {count} warnings"),
    };
    Watched { warnings, verdict }
}
