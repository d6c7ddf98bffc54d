//! Delay-scheduled taps of a pipeline.

use super::follower::{DelayChange, Followed, Follower};
use super::tracker::FollowSettings;
use super::{DelaySource, Logged, TrackError, TrackWarning};
use crate::bank::Bank;
use crate::pipeline::{Change, PipelineError, Retuner};
use crate::quantity;
use crate::runtime::{Options, Stream};
use std::path::Path;

/// Least frames of a measurement.
const LEAST_FRAMES: usize = 256;
/// The rates of clocks at the beginning, over how far they wander in a second.
const FIRST_RATE: f64 = 100.0;

/// How delays are followed, as a user asks for it.
///
/// ```
/// use hybank::design::{Options, design};
/// use hybank::io::{PcmFormat, PcmFrames, SampleLayout};
/// use hybank::pipeline::{Pipeline, Settings};
/// use hybank::{spec::Spec, track::Tracking};
/// let spec = r#"
///     fast_rate = 96000.0
///     ratio = 2
///     latency = 3
///     target = { filter = { num = [1e4], den = [1.0, 1e4] } }
///     channel = [{ delay_samples = 0.0 }, { delay_samples = 1.0 }]
///     design = { method = "fir", taps = 6, tracking = "affine" }
///     uncertainty = { delay_samples = 0.01 }
/// "#;
/// let bank = design(&Spec::from_toml(spec, "spec.toml")?, &Options::without_proof())?.bank;
/// let follower = Tracking::default().follower(&bank, Tracking::source("pilot=9kHz")?, 96e3)?;
/// let (sender, logs) = std::sync::mpsc::channel();
/// let retuner = follower.retuner(&bank, Default::default(), move |log, _| {
///     sender.send(log).expect("the receiver is there");
///     Ok(())
/// })?;
/// let plan = bank.plan(Default::default())?;
/// let settings = Settings { is_retuned: true, ..Settings::default() };
/// let pipeline = Pipeline::new(&bank, &plan, settings, PcmFormat::S16Le, false);
/// let mut pipeline = pipeline.retuned_by(retuner)?;
/// let layout = SampleLayout::packed(PcmFormat::S16Le);
/// let silence = PcmFrames { layout, channels: 2, bytes: &[0; 4 * 4096] };
/// pipeline.push(&[silence], &mut |_| Ok(()))?;
/// pipeline.finish()?;
/// // In silence nothing is measured, and the delays stay.
/// let logs: Vec<_> = logs.iter().collect();
/// assert_eq!(logs.len(), 2);
/// assert!(logs.iter().all(|log| log.measured == [None, None] && log.delay[1] == bank.delays[1]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tracking {
    /// Frames of one measurement.
    pub frames: usize,
    /// By how many parts per million the rate of a clock may wander in a second.
    pub wander: f64,
}

impl Default for Tracking {
    fn default() -> Self {
        Self { frames: 2048, wander: 1.0 }
    }
}

impl Tracking {
    /// The file of delays that were measured before, where `text` names one.
    pub fn file(text: &str) -> Option<&Path> {
        Some(Path::new(text)).filter(|path| path.extension().is_some_and(|extension| extension == "jsonl"))
    }

    /// A tone of the frequency F, `pilot=F`, or any signal, `blind`.
    ///
    /// # Errors
    /// [`TrackError::Source`] for another text.
    pub fn source(text: &str) -> Result<DelaySource, TrackError> {
        let refused = |reason: String| TrackError::Source { reason };
        if text == "blind" {
            return Ok(DelaySource::AnySignal);
        }
        let Some(pilot) = text.strip_prefix("pilot=") else {
            let reason = "give pilot=F, blind, or a file whose name ends in .jsonl";
            return Err(refused(reason.to_owned()));
        };
        let pilot = quantity::frequency(pilot.trim()).map_err(|error| refused(error.to_string()))?;
        if pilot.0 > 0.0 {
            return Ok(DelaySource::Pilot(pilot));
        }
        Err(refused("a pilot has a positive frequency".to_owned()))
    }

    /// Refuses too few frames of a measurement.
    ///
    /// # Errors
    /// [`TrackError::Frames`].
    pub fn check_frames(&self) -> Result<(), TrackError> {
        if self.frames < LEAST_FRAMES { Err(TrackError::Frames { least: LEAST_FRAMES }) } else { Ok(()) }
    }

    /// Refuses clocks that do not wander, or that are none.
    ///
    /// # Errors
    /// [`TrackError::Wander`].
    pub fn check_wander(&self) -> Result<(), TrackError> {
        if self.wander > 0.0 && self.wander < 1e6 { Ok(()) } else { Err(TrackError::Wander) }
    }

    /// What follows the delays of the channels of `bank` by `source`; `rate` hertz is that of the output.
    ///
    /// # Errors
    /// [`TrackError`].
    pub fn follower(&self, bank: &Bank, source: DelaySource, rate: f64) -> Result<Follower, TrackError> {
        self.check_frames()?;
        self.check_wander()?;
        // A bank in normalised time counts in units that the recordings say.
        let unit = if bank.is_normalised() { 1.0 / rate } else { 1.0 };
        let wander = 1e-6 * self.wander;
        let settings = FollowSettings {
            block_frames: self.frames,
            rate_walk: (wander * unit.sqrt()).powi(2),
            rate_deviation: FIRST_RATE * wander,
            rate_change: wander * unit,
        };
        Follower::new(bank, source, settings)
    }
}

impl Follower {
    /// Starts the thread that follows the delays; the filters are those of `bank` with `options`. After each
    /// measurement `record` gets the delays with their half-widths, and the warnings.
    ///
    /// # Errors
    /// As [`Retuner::start`].
    pub fn retuner(
        mut self,
        bank: &Bank,
        options: Options,
        mut record: impl FnMut(Logged, Vec<TrackWarning>) -> Result<(), PipelineError> + Send + 'static,
    ) -> Result<Retuner, PipelineError> {
        let (bank, mut followed) = (bank.clone(), bank.clone());
        let offsets = bank.offsets.clone();
        let mut changed = move |changes: Vec<DelayChange>| -> Result<Vec<Change>, PipelineError> {
            let change = |change: DelayChange| {
                followed.filters = bank.filters_at(&change.errors);
                let (frame, shifts) = (change.frame as u64, change.shifts);
                Ok(Change { frame, stream: Stream::new(&followed.plan(options)?), shifts })
            };
            changes.into_iter().map(change).collect()
        };
        let [first, second] = self.beginning();
        let beginning = [changed(first)?, changed(second)?];
        let retuner = Retuner::start(self.block_frames(), &offsets, move |samples| {
            let Followed { changes, log, warnings } = self.follow(samples);
            record(log, warnings)?;
            changed(changes)
        })?;
        Ok(retuner.beginning_with(beginning))
    }
}
