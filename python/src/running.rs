//! Runs that fill gaps or follow delays, through the pipeline of the command line.

use crate::errors::{HybankError, refused, warn};
use crate::formats::Format;
use crate::fuse::plan;
use crate::results::record;
use crate::sources;
use hybank::bank::Bank;
use hybank::io::IoError;
use hybank::pipeline::{Block, Gap, GapPolicy, Pipeline, PipelineError, Settings};
use hybank::runtime::{Algorithm, Options, PcmFrames, Plan, Precision};
use hybank::track::{DelaySource, Logged, Reading, Tracking};
use pyo3::prelude::*;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// How delays are followed.
#[derive(Clone)]
pub(crate) struct Follow {
    source: DelaySource,
    tracking: Tracking,
    /// The rate of the output in hertz.
    rate: f64,
}

impl Follow {
    /// Of `track`, the text of the command line's option or a list of readings.
    pub(crate) fn new(
        bank: &Bank,
        track: Option<&Bound<'_, PyAny>>,
        frames: usize,
        wander: f64,
        rate: Option<f64>,
    ) -> PyResult<Option<Self>> {
        let Some(track) = track else { return Ok(None) };
        let py = track.py();
        let source = source(bank, track).map_err(|error| match error.is_instance_of::<HybankError>(py) {
            true => refused(format!("track: {}", error.value(py))),
            false => error,
        })?;
        let tracking = Tracking { frames, wander };
        let prefixed = |keyword: &str, error| refused(format!("{keyword}: {error}"));
        tracking.check_frames().map_err(|error| prefixed("track_frames", error))?;
        tracking.check_wander().map_err(|error| prefixed("track_wander", error))?;
        Ok(Some(Self { source, tracking, rate: rate.unwrap_or(1.0 / bank.fast_period.0) }))
    }
}

fn source(bank: &Bank, track: &Bound<'_, PyAny>) -> PyResult<DelaySource> {
    let readings = |text: &str, name: &str| {
        Reading::parse(text, name, bank.channel_count()).map(DelaySource::Readings).map_err(refused)
    };
    match sources::path(track) {
        Some(path) if Tracking::file(&path.to_string_lossy()).is_some() => {
            readings(&sources::read(&path)?, &path.display().to_string())
        }
        Some(text) => Tracking::source(&text.to_string_lossy()).map_err(refused),
        None => {
            let lines = track.py().import("hybank._results")?.call_method1("lines", (track,))?;
            readings(&lines.extract::<String>()?, "the readings")
        }
    }
}

/// What a run does beside filtering.
#[derive(Clone, Default)]
pub(crate) struct Extras {
    pub(crate) gaps: Option<GapPolicy>,
    pub(crate) follow: Option<Follow>,
}

impl Extras {
    pub(crate) fn is_any(&self) -> bool {
        self.gaps.is_some() || self.follow.is_some()
    }

    pub(crate) fn settings(&self) -> Settings<'static> {
        Settings { gaps: self.gaps, is_retuned: self.follow.is_some(), ..Settings::default() }
    }
}

/// What is known of the delays, and what was not said yet.
#[derive(Default)]
struct Tracked {
    log: Vec<Logged>,
    warnings: Vec<String>,
}

/// A run. Its outputs are collected until they are taken.
pub(crate) struct Running<'a> {
    pub(crate) pipeline: Pipeline<'a>,
    tracked: Arc<Mutex<Tracked>>,
    /// Input frames.
    pub(crate) frames: u64,
    pub(crate) outputs: Outputs,
}

/// Outputs with their marks.
#[derive(Default)]
pub(crate) struct Outputs {
    pub(crate) samples: Vec<u8>,
    pub(crate) mask: Vec<u8>,
}

impl Outputs {
    fn add(&mut self, block: Block<'_>) -> Result<(), IoError> {
        self.samples.extend_from_slice(block.samples);
        self.mask.extend_from_slice(block.mask.unwrap_or_default());
        Ok(())
    }
}

impl<'a> Running<'a> {
    /// A run of `bank` at its beginning, with the plan of these settings, which are those of the extras.
    pub(crate) fn new(
        bank: &Bank,
        format: Format,
        algorithm: Algorithm,
        extras: &Extras,
        settings: Settings<'a>,
    ) -> PyResult<Self> {
        let plan: Plan = plan(bank, format, algorithm, settings)?;
        let mut pipeline = Pipeline::new(bank, &plan, settings, format.number, format.complex);
        let tracked = Arc::new(Mutex::new(Tracked::default()));
        if let Some(Follow { source, tracking, rate }) = &extras.follow {
            let options =
                Options { precision: Precision::of(format.number), algorithm, ..Options::default() };
            let follower = tracking.follower(bank, source.clone(), *rate).map_err(refused)?;
            let record = Arc::clone(&tracked);
            let retuner = follower.retuner(bank, settings.options(options), move |log, warnings| {
                let mut record = locked(&record);
                record.log.push(log);
                record.warnings.extend(warnings.iter().map(ToString::to_string));
                Ok(())
            });
            pipeline = retuner.and_then(|retuner| pipeline.retuned_by(retuner)).map_err(refused)?;
        }
        Ok(Self { pipeline, tracked, frames: 0, outputs: Outputs::default() })
    }

    pub(crate) fn push(&mut self, recordings: &[PcmFrames<'_>], frames: usize) -> Result<(), PipelineError> {
        self.frames += frames as u64;
        self.pipeline.push(recordings, &mut |block| self.outputs.add(block))
    }

    /// Frames without a signal, until so many samples were written since the beginning.
    pub(crate) fn flush(&mut self, until: u64) -> Result<(), PipelineError> {
        self.pipeline.flush(until, &mut |block| self.outputs.add(block))
    }

    /// The last samples of a stream: as many frames of them as the latency has.
    pub(crate) fn drain(&mut self) -> Result<(), PipelineError> {
        let plan = self.pipeline.plan();
        self.flush(self.pipeline.samples() + (plan.flush_frames() * plan.ratio()) as u64)
    }

    /// All gaps so far: those that have ended, then those that go on.
    pub(crate) fn gaps(&self) -> Vec<Gap> {
        self.pipeline.gaps().iter().copied().chain(self.pipeline.open_gaps()).collect()
    }

    /// What is known of the delays, also after the run.
    pub(crate) fn tracks(&self) -> Tracks {
        Tracks(Arc::clone(&self.tracked))
    }
}

/// What is known of the delays.
pub(crate) struct Tracks(Arc<Mutex<Tracked>>);

impl Tracks {
    /// A record per measurement.
    pub(crate) fn log(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        // A copy: the thread that follows the delays writes on.
        let log = py.detach(|| locked(&self.0).log.clone());
        record(py, &log)
    }

    /// Says what was not said yet.
    pub(crate) fn warn(&self, py: Python<'_>) -> PyResult<()> {
        let warnings = py.detach(|| std::mem::take(&mut locked(&self.0).warnings));
        warnings.iter().try_for_each(|text| warn(py, text))
    }
}

fn locked(tracked: &Mutex<Tracked>) -> MutexGuard<'_, Tracked> {
    tracked.lock().unwrap_or_else(PoisonError::into_inner)
}
