//! Taps that follow the delays while a bank runs: the options of `fuse` and `stream`, and what connects the
//! follower of delays to the pipeline.

use super::Failure;
use super::bank_file::read_text;
use crate::bank::Bank;
use crate::files::AtomicFile;
use crate::pipeline::{Pipeline, Retuned, Retuner, Retuning};
use crate::quantity;
use crate::runtime::{Algorithm, Options};
use crate::track::{Change, DriftModel, FollowSettings, Followed, Follower, Guide, Reading};
use crate::units::Seconds;
use std::path::{Path, PathBuf};

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

    /// Refuses to follow the delays of complex samples.
    pub(super) fn check_samples(&self, is_complex: bool) -> Result<(), Failure> {
        if self.is_wanted() && is_complex {
            return Err(Failure::Input("--track measures delays in real samples; these are complex".into()));
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
            return Ok(Kind::Guide(Guide::AnySignal));
        }
        if let Some(pilot) = text.strip_prefix("pilot=") {
            let pilot = quantity::frequency(pilot.trim()).map_err(|error| usage(&error))?;
            let is_tone = pilot.0 > 0.0;
            return if is_tone {
                Ok(Kind::Guide(Guide::Pilot(pilot)))
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

    /// The pipeline with filters that follow the delays, if that is asked for; `rate` is that of the output.
    pub(super) fn followed(
        &self,
        pipeline: Pipeline,
        bank: (&Bank, &Path),
        options: Options,
        rate: f64,
    ) -> Result<Pipeline, Failure> {
        let (bank, path) = bank;
        let Some(text) = self.track.as_deref() else { return Ok(pipeline) };
        let guide = match self.kind(text)? {
            Kind::Guide(guide) => guide,
            Kind::File(file) => {
                let (text, channels) = (read_text(&file)?, bank.channel_count());
                let name = file.display().to_string();
                Guide::Readings(Reading::parse(&text, &name, channels).map_err(Failure::input)?)
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
        let follower = Follower::new(bank, guide, settings);
        let follower = follower.map_err(|error| Failure::Input(format!("{}: {error}", path.display())))?;
        let retuner = Following { follower, bank: bank.clone() };
        pipeline.retuned_by(bank, options, Box::new(retuner)).map_err(Failure::running)
    }

    /// Begins the log.
    pub(super) fn begin_log(&self, force: bool) -> Result<Option<AtomicFile>, Failure> {
        self.log().map(|path| AtomicFile::create(path, force)).transpose().map_err(Failure::input)
    }
}

/// What --track says.
enum Kind {
    Guide(Guide),
    File(PathBuf),
}

/// The follower of delays as the pipeline sees it.
struct Following {
    follower: Follower,
    bank: Bank,
}

impl Retuner for Following {
    fn block_frames(&self) -> usize {
        self.follower.block_frames()
    }

    fn retune(&mut self, samples: &[Vec<f64>]) -> Retuned {
        let Followed { changes, log, warnings } = self.follower.follow(samples);
        let retuning = |Change { frame, errors, shifts }: Change| Retuning {
            frame,
            filters: self.bank.filters_at(&errors),
            shifts,
        };
        Retuned {
            changes: changes.into_iter().map(retuning).collect(),
            record: serde_json::to_string(&log).unwrap_or_default(),
            warnings: warnings.iter().map(ToString::to_string).collect(),
        }
    }
}
