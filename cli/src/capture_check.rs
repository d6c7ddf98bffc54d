//! Checks the first frames of a run for captures that contradict the spec of the bank, beside the filters.

use hybank::bank::Bank;
use hybank::calibrate::{
    Agreement, ENOUGH_FRAMES, Record, Verdict, agreement, comparable, frames_for_agreement,
};
use hybank::io::{OfflineSamples, RecordedFrames};
use hybank::spec::Spec;
use std::thread::{Builder, JoinHandle};

/// Keeps the first frames and judges them on a thread of its own.
pub(super) enum CaptureCheck {
    /// Until there are `frames`.
    Collecting {
        spec: Box<Spec>,
        samples: Vec<Vec<f64>>,
        frames: usize,
    },
    Judging(JoinHandle<Agreement>),
    Done(Agreement),
}

impl CaptureCheck {
    /// For the spec that `bank` carries, if it does, and if the samples are steady. In a live run fewer
    /// frames are judged, so that the warnings come soon.
    pub(super) fn new(bank: &Bank, is_steady: bool, is_live: bool) -> Self {
        let channels = bank.channel_count();
        let most = if is_live { ENOUGH_FRAMES } else { usize::MAX };
        match comparable(bank.spec.as_ref(), is_steady) {
            Err(verdict) => Self::Done(verdict.into()),
            Ok(spec) => Self::Collecting {
                spec: Box::new(spec.clone()),
                samples: vec![Vec::new(); channels],
                frames: frames_for_agreement(channels).min(most),
            },
        }
    }

    /// Takes the frames of a block until there are enough.
    pub(super) fn observe(&mut self, recordings: &[RecordedFrames<'_>]) {
        let Self::Collecting { samples, frames, .. } = self else { return };
        let missing = *frames - samples.first().map_or(0, Vec::len);
        let Ok(OfflineSamples { channels: block, .. }) = OfflineSamples::of_frames(recordings, missing)
        else {
            *self = Self::Done(Verdict::Unjudged.into());
            return;
        };
        samples.iter_mut().zip(block).for_each(|(samples, more)| samples.extend(more));
        if samples.iter().all(|samples| samples.len() >= *frames) {
            self.judge();
        }
    }

    /// What was found, once, as soon as it is known.
    pub(super) fn news(&mut self) -> Option<Agreement> {
        matches!(self, Self::Judging(thread) if thread.is_finished()).then(|| self.finish())
    }

    /// Without a thread nothing is judged: the run matters more.
    fn judge(&mut self) {
        if let Self::Collecting { spec, samples, .. } = self {
            let (spec, samples) = (spec.clone(), std::mem::take(samples));
            let judge = move || agreement(&spec, &samples.into_iter().map(Record::new).collect::<Vec<_>>());
            let thread = Builder::new().spawn(judge);
            *self = thread.map_or_else(|_| Self::Done(Verdict::Unjudged.into()), Self::Judging);
        }
    }

    /// What was found, in short runs too.
    pub(super) fn finish(&mut self) -> Agreement {
        self.judge();
        let found = match std::mem::replace(self, Self::Done(Verdict::Unjudged.into())) {
            Self::Judging(thread) => thread.join().unwrap_or_else(|_| Verdict::Unjudged.into()),
            Self::Done(found) => found,
            Self::Collecting { .. } => Verdict::Unjudged.into(),
        };
        *self = Self::Done(found.clone());
        found
    }
}
