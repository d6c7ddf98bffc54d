//! Taps that follow the delays while a bank runs: the options of `fuse` and `stream`, and what connects the
//! follower of delays to the pipeline.

use super::bank_file::read_text;
use super::event::{Event, Events};
use super::print::Failure;
use super::written::begin_beside;
use crate::bank::Bank;
use crate::files::AtomicFile;
use crate::io::IoError;
use crate::messages::Quoted;
use crate::pipeline::{Change, PipelineError, Retuner};
use crate::quantity;
use crate::runtime::{Algorithm, Options, Stream};
use crate::track::{self, DelaySource, DriftModel, FollowSettings, Followed, Follower, Logged, Reading};
use crate::units::Seconds;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Least frames of a measurement.
const LEAST_FRAMES: usize = 256;
/// The rates of clocks at the beginning, over how far they wander in a second.
const FIRST_RATE: f64 = 100.0;

/// Options of the commands that can follow delays.
#[derive(Debug, clap::Args)]
pub(super) struct TrackArgs {
    /// Follow the delays of the channels while the bank runs, which needs taps designed with
    /// tracking = "affine". pilot=F measures them by a tone of the frequency F that sounds all the time,
    /// blind by any signal that leaves fewer aliases occupied than there are channels, and FILE.jsonl holds
    /// delays that were measured before: {"frame": 4096, "delay": [0, 12.5e-6], "half_width": 1e-9}
    #[arg(long, value_name = "pilot=F|blind|FILE.jsonl")]
    track: Option<String>,
    /// Write what is known of the delays as JSON lines, one per measurement; --track reads such a file
    #[arg(long, value_name = "FILE", requires = "track")]
    track_log: Option<PathBuf>,
    /// Frames of one measurement. It takes effect two measurements later
    #[arg(long, value_name = "FRAMES", requires = "track", default_value_t = 2048)]
    track_frames: usize,
    /// By how many ppm the rate of a clock may wander in a second
    #[arg(long, value_name = "PPM", requires = "track", default_value_t = 1.0)]
    track_wander: f64,
}

impl TrackArgs {
    /// Refuses impossible combinations of options, before any file is read.
    pub(super) fn check(&self, algorithm: Algorithm) -> Result<(), Failure> {
        let usage = |message: String| Err(Failure::Usage(message));
        let Some(text) = self.track.as_deref() else { return Ok(()) };
        if matches!(algorithm, Algorithm::OverlapSave { .. }) {
            let message = "--track changes the filters at single frames, and overlap-save filters in blocks; use direct";
            return usage(message.into());
        }
        if self.track_frames < LEAST_FRAMES {
            return usage(format!("--track-frames {}: at least {LEAST_FRAMES}", self.track_frames));
        }
        let is_ppm = self.track_wander > 0.0 && self.track_wander < 1e6;
        if !is_ppm {
            return usage(format!("--track-wander {}: a positive number of ppm", self.track_wander));
        }
        self.kind(text)?;
        if self.log().is_some_and(|log| log.as_os_str() == "-") {
            return usage("--track-log -: the log cannot go to standard output; give it a file".into());
        }
        Ok(())
    }

    /// The log.
    pub(super) fn log(&self) -> Option<&Path> {
        self.track_log.as_deref()
    }

    fn kind(&self, text: &str) -> Result<Kind, Failure> {
        let usage = |reason: &dyn std::fmt::Display| Failure::Usage(format!("--track {text}: {reason}"));
        if text == "blind" {
            return Ok(Kind::Source(DelaySource::AnySignal));
        }
        if let Some(pilot) = text.strip_prefix("pilot=") {
            let pilot = quantity::frequency(pilot.trim()).map_err(|error| usage(&error))?;
            let is_tone = pilot.0 > 0.0;
            return if is_tone {
                Ok(Kind::Source(DelaySource::Pilot(pilot)))
            } else {
                Err(usage(&"a pilot has a positive frequency"))
            };
        }
        if Path::new(text).extension().is_some_and(|extension| extension == "jsonl") {
            return Ok(Kind::File(PathBuf::from(text)));
        }
        Err(usage(&"give pilot=F, blind, or a file whose name ends in .jsonl"))
    }

    /// Whether delays are followed.
    pub(super) fn is_wanted(&self) -> bool {
        self.track.is_some()
    }

    /// The file of delays, which is an input.
    pub(super) fn input(&self) -> Option<&Path> {
        let text = self.track.as_deref()?;
        matches!(self.kind(text), Ok(Kind::File(_))).then(|| Path::new(text))
    }

    /// What follows the delays of the channels, if that is asked for; `rate` is that of the output.
    pub(super) fn follower(&self, bank: &Bank, path: &Path, rate: f64) -> Result<Option<Follower>, Failure> {
        let Some(text) = self.track.as_deref() else { return Ok(None) };
        let source = match self.kind(text)? {
            Kind::Source(source) => source,
            Kind::File(file) => {
                let (text, channels) = (read_text(&file)?, bank.channel_count());
                let name = file.display().to_string();
                DelaySource::Readings(Reading::parse(&text, &name, channels).map_err(Failure::input)?)
            }
        };
        // A bank in normalised time counts in units that the recordings say.
        let unit = if bank.fast_period == Seconds(1.0) { 1.0 / rate } else { 1.0 };
        let wander = 1e-6 * self.track_wander;
        let settings = FollowSettings {
            block_frames: self.track_frames,
            model: DriftModel { delay_walk: 0.0, rate_walk: wander * wander * unit },
            rate_deviation: FIRST_RATE * wander,
            rate_change: wander * unit,
        };
        let follower = Follower::new(bank, source, settings);
        follower.map(Some).map_err(|error| Failure::Input(format!("{}: {error}", Quoted(path))))
    }

    /// Begins the log; warnings go to `events`.
    pub(super) fn begin(&self, force: bool, events: Events) -> Result<Tracked, Failure> {
        let log = self.log().map(|path| begin_beside(path, force)).transpose()?;
        let record = TrackRecord { log, warnings: Vec::new() };
        Ok(Tracked { record: Arc::new(Mutex::new(record)), events })
    }
}

/// What --track says.
enum Kind {
    Source(DelaySource),
    File(PathBuf),
}

/// What is recorded of a run whose delays are followed.
#[derive(Default)]
pub(super) struct TrackRecord {
    /// What is known of the delays, a line per measurement.
    pub(super) log: Option<AtomicFile>,
    /// All warnings, which were reported at once.
    pub(super) warnings: Vec<String>,
}

/// The record, which the thread that follows the delays writes.
pub(super) struct Tracked {
    record: Arc<Mutex<TrackRecord>>,
    events: Events,
}

impl Tracked {
    /// Starts the thread, whose filters are those of `bank` with `options`.
    pub(super) fn retuner(
        &self,
        mut follower: Follower,
        bank: &Bank,
        options: Options,
    ) -> Result<Retuner, PipelineError> {
        let (bank, mut followed) = (bank.clone(), bank.clone());
        let (record, events) = (Arc::clone(&self.record), self.events.clone());
        Retuner::start(follower.block_frames(), &bank.offsets.clone(), move |samples| {
            let Followed { changes, log, warnings } = follower.follow(samples);
            let warnings: Vec<String> = warnings.iter().map(ToString::to_string).collect();
            warnings.iter().for_each(|text| events.report(Event::Warning { text: text.clone() }));
            locked(&record).add(&log, warnings)?;
            let change = |change: track::Change| {
                followed.filters = bank.filters_at(&change.errors);
                let (frame, shifts) = (change.frame as u64, change.shifts);
                Ok(Change { frame, stream: Stream::new(&followed.plan(options)?), shifts })
            };
            changes.into_iter().map(change).collect()
        })
    }

    /// The record of a run that is over.
    pub(super) fn take(self) -> TrackRecord {
        std::mem::take(&mut locked(&self.record))
    }
}

impl TrackRecord {
    fn add(&mut self, log: &Logged, warnings: Vec<String>) -> Result<(), IoError> {
        self.warnings.extend(warnings);
        let Some(file) = &mut self.log else { return Ok(()) };
        let line = serde_json::to_string(log).unwrap_or_default();
        writeln!(file, "{line}").map_err(IoError::system(file.name(), "write it"))
    }
}

fn locked(record: &Mutex<TrackRecord>) -> MutexGuard<'_, TrackRecord> {
    record.lock().unwrap_or_else(PoisonError::into_inner)
}
