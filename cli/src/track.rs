//! Delay-scheduled taps: the options of `fuse` and `stream`, and what connects the
//! follower of delays to the pipeline.

use super::bank_file::read_text;
use super::event::{Event, Events};
use super::print::{Failure, failed};
use super::written::begin_beside;
use hybank::bank::Bank;
use hybank::files::AtomicFile;
use hybank::io::IoError;
use hybank::messages::Quoted;
use hybank::pipeline::{PipelineError, Retuner};
use hybank::runtime::{Algorithm, Options};
use hybank::track::{DelaySource, Follower, Logged, Reading, TrackError, Tracking};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

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
    #[arg(long, value_name = "FRAMES", requires = "track", default_value_t = Tracking::default().frames)]
    track_frames: usize,
    /// By how many ppm the rate of a clock may wander in a second
    #[arg(long, value_name = "PPM", requires = "track", default_value_t = Tracking::default().wander)]
    track_wander: f64,
}

impl TrackArgs {
    /// Refuses impossible combinations of options, before any file is read.
    pub(super) fn check(&self, algorithm: Algorithm) -> Result<(), Failure> {
        let usage = |message: String| Err(Failure::Usage(message));
        let Some(text) = self.track.as_deref() else { return Ok(()) };
        if algorithm == Algorithm::OverlapSave {
            let message = "--track changes the filters at single frames, and overlap-save filters in blocks; use direct";
            return usage(message.into());
        }
        let tracking = self.tracking();
        tracking.check_frames().map_err(|e| refused("--track-frames", &self.track_frames, e))?;
        tracking.check_wander().map_err(|e| refused("--track-wander", &self.track_wander, e))?;
        if Tracking::file(text).is_none() {
            Tracking::source(text).map_err(|error| refused("--track", &text, error))?;
        }
        if self.log().is_some_and(|log| log.as_os_str() == "-") {
            return usage("--track-log -: the log cannot go to standard output; give it a file".into());
        }
        Ok(())
    }

    /// The log.
    pub(super) fn log(&self) -> Option<&Path> {
        self.track_log.as_deref()
    }

    fn tracking(&self) -> Tracking {
        Tracking { frames: self.track_frames, wander: self.track_wander }
    }

    /// Whether delays are followed.
    pub(super) fn is_wanted(&self) -> bool {
        self.track.is_some()
    }

    /// The file of delays, which is an input.
    pub(super) fn input(&self) -> Option<&Path> {
        self.track.as_deref().and_then(Tracking::file)
    }

    /// What follows the delays of the channels, if that is asked for; `rate` is that of the output.
    pub(super) fn follower(&self, bank: &Bank, path: &Path, rate: f64) -> Result<Option<Follower>, Failure> {
        let Some(text) = self.track.as_deref() else { return Ok(None) };
        let source = match Tracking::file(text) {
            None => Tracking::source(text).map_err(|error| refused("--track", &text, error))?,
            Some(file) => {
                let name = file.display().to_string();
                let readings = Reading::parse(&read_text(file)?, &name, bank.channel_count());
                DelaySource::Readings(readings.map_err(failed)?)
            }
        };
        let follower = self.tracking().follower(bank, source, rate);
        follower.map(Some).map_err(|error| Failure::Input(format!("{}: {error}", Quoted(path))))
    }

    /// Begins the log; warnings go to `events`.
    pub(super) fn begin(&self, force: bool, events: Events) -> Result<Tracked, Failure> {
        let log = self.log().map(|path| begin_beside(path, force)).transpose()?;
        let record = TrackRecord { log, warnings: Vec::new() };
        Ok(Tracked { record: Arc::new(Mutex::new(record)), events })
    }
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
        follower: Follower,
        bank: &Bank,
        options: Options,
    ) -> Result<Retuner, PipelineError> {
        let (record, events) = (Arc::clone(&self.record), self.events.clone());
        follower.retuner(bank, options, move |log, warnings| {
            let warnings: Vec<String> = warnings.iter().map(ToString::to_string).collect();
            warnings.iter().for_each(|text| events.tell(&Event::Warning { text: text.clone() }));
            Ok(locked(&record).add(&log, warnings)?)
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

fn refused(option: &str, value: &dyn std::fmt::Display, error: TrackError) -> Failure {
    Failure::Usage(format!("{option} {value}: {error}"))
}

fn locked(record: &Mutex<TrackRecord>) -> MutexGuard<'_, TrackRecord> {
    record.lock().unwrap_or_else(PoisonError::into_inner)
}
