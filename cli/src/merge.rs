//! `hybank merge`: recordings of one event become one, at a higher rate.

use super::calibrate_report::{Interval, interval, shown};
use super::capture_args::{CaptureArgs, check_stdin};
use super::capture_file::{start, unread};
use super::choice::one_of;
use super::output::WIDTHS;
use super::print::{Failure, check_json, failed, failed_at, is_dash, name, show, warn};
use super::written::{Mono, begin_recording, check_output, write_text};
use hybank::captures::Captures;
use hybank::files::commit_all;
use hybank::io::table::read_stamped;
use hybank::io::{Container, PcmFormat};
use hybank::merge::{MergeSettings, Merged, Recorder, SourceEstimate, merge};
use hybank::messages::{Quoted, counted};
use hybank::quantity::{self, WrittenTime, readable};
use hybank::sine_fit::Estimate;
use hybank::units::Hertz;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Merges recordings of one event by several recorders or sensors into one
///
/// Finds when each recording began, how its clock drifts, its polarity and gain; measures the spectrum of
/// the signal and the noise; and estimates the signal at a higher rate from all samples at their own
/// instants. The recorders have equal front ends, which are flat over the band of the signal. Lost samples
/// are left out, and the clock of the first recording is that of the result.
///
/// Tables whose first column is a time (time, t, time_ms, ..) are merged by these times, which need not be
/// even; all of them count on one clock.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank merge left.wav right.wav -o merged.wav
  hybank merge a.wav b.wav c.wav -o merged.wav --rate 96kHz --json
  hybank merge imu1.csv imu2.csv -o merged.csv --rate 400Hz
  hybank merge logger.csv -o even.csv --rate 1kHz")]
pub(super) struct Args {
    /// Recordings of one event (WAV, SigMF, .flac, .csv, .npy, .mat, or raw with --format); of any length,
    /// and begun at any time. The first one's clock is the time
    #[arg(required = true)]
    recordings: Vec<PathBuf>,
    /// The result: WAV, or a table if its name ends in .csv; `-` is standard output
    #[arg(short, long)]
    output: PathBuf,
    /// Samples per second of the result, as 96kHz [default: the first recording's rate times the number of
    /// recordings of such rates]
    #[arg(long, value_name = "F", value_parser = quantity::frequency)]
    rate: Option<Hertz>,
    /// The highest frequency of the signal, as 18kHz [default: measured]
    #[arg(long, value_name = "F", value_parser = quantity::frequency)]
    band: Option<Hertz>,
    /// Take the spectrum as flat over the band instead of learning it from the recordings
    #[arg(long)]
    flat: bool,
    /// How far apart the recordings began at most, as 50ms or 2s
    #[arg(long, value_name = "TIME", value_parser = quantity::time, hide_short_help = true)]
    within: Option<WrittenTime>,
    /// Samples of the WAV file: integers, or floats
    #[arg(long, value_parser = one_of(WIDTHS), default_value = "32f")]
    bits: PcmFormat,
    #[command(flatten)]
    reading: CaptureArgs,
    /// Replace an existing output
    #[arg(long)]
    force: bool,
    /// Print a report as one JSON object on standard output
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> Result<(), Failure> {
    args.check()?;
    let mut warnings = Vec::new();
    let sources = args.sources(&mut warnings).inspect_err(|_| warnings.iter().for_each(|text| warn(text)))?;
    let first = sources[0].rate;
    let origin = sources[0].stamps.as_ref().and_then(|stamps| stamps.first()).map_or(0.0, |stamp| stamp.0);
    let names: Vec<String> = sources.iter().map(|source| source.name.clone()).collect();
    let settings = MergeSettings {
        rate: args.rate,
        band: args.band,
        learn: !args.flat,
        within: args.within.map(|time| time.in_seconds(first.period())),
    };
    let merged = merge(&sources, settings).map_err(failed)?;
    warnings.extend(merged.warnings.iter().map(ToString::to_string));
    warnings.extend(args.write(&merged, origin)?);
    let report = MergeReport::new(names, &merged, warnings);
    report.warnings.iter().for_each(|text| warn(text));
    if is_dash(&args.output) { Ok(()) } else { show(&report, args.json, |report| report.text(&args.output)) }
}

impl Args {
    fn check(&self) -> Result<(), Failure> {
        self.reading.check(false)?;
        check_stdin(self.recordings.iter().map(PathBuf::as_path))?;
        check_json(self.json, &self.output, "result")?;
        let inputs: Vec<&Path> = self.recordings.iter().map(PathBuf::as_path).collect();
        check_output(&self.output, &inputs, self.force)
    }

    fn is_table(&self) -> bool {
        self.output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv"))
    }

    /// All recordings; what was tolerated joins the `warnings`.
    fn sources(&self, warnings: &mut Vec<String>) -> Result<Vec<Recorder>, Failure> {
        let mut sources = Vec::new();
        for path in &self.recordings {
            match self.stamped(path)? {
                Some(stamped) => sources.extend(stamped),
                None => sources.push(self.recorded(path, warnings)?),
            }
        }
        Ok(sources)
    }

    /// The columns of a table with time stamps; `None` if the file is none.
    fn stamped(&self, path: &Path) -> Result<Option<Vec<Recorder>>, Failure> {
        if is_dash(path) || !path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv")) {
            return Ok(None);
        }
        let Some(table) = read_stamped(path, &self.reading.table.options()).map_err(failed)? else {
            return Ok(None);
        };
        let [first, .., last] = table.stamps.as_slice() else {
            return Err(failed_at(path, "it has fewer than 2 lines of samples; give a longer recording"));
        };
        let rate = Hertz((table.stamps.len() - 1) as f64 / (*last - *first).0);
        let many = table.columns.len() > 1;
        let source = |(k, samples): (usize, Vec<f64>)| Recorder {
            name: if many { format!("{} column {}", name(path), k + 2) } else { name(path) },
            record: hybank::calibrate::Record::new(samples),
            rate,
            step: 0.0,
            stamps: Some(table.stamps.clone()),
        };
        Ok(Some(table.columns.into_iter().enumerate().map(source).collect()))
    }

    fn recorded(&self, path: &Path, warnings: &mut Vec<String>) -> Result<Recorder, Failure> {
        let mut reader = start(&[path.to_path_buf()], self.reading.format().options(1, 1))?;
        Captures::check_mono(&reader).map_err(unread)?;
        let format = reader.headers().next().map(|(_, header)| header.layout.format);
        let captures = Captures::read(&mut reader, usize::MAX).map_err(unread)?;
        warnings.extend(reader.warnings().iter().map(ToString::to_string));
        let rate = captures.rate.ok_or_else(|| {
            failed_at(
                path,
                "it states no rate; give a WAV or SigMF recording, or a table with a column of time",
            )
        })?;
        let record = captures.channels[0].record(None);
        if captures.channels[0].imaginary.is_some() {
            return Err(failed_at(path, "its samples are complex, and only real ones can be merged"));
        }
        // A step of integers, of which full scale is 1.
        let integer = format.filter(|format| !format.is_float());
        let step = integer.map_or(0.0, |format| 2.0_f64.powi(1 - 8 * format.bytes() as i32));
        Ok(Recorder { name: name(path), record, rate, step, stamps: None })
    }

    /// Writes the result, and says what could not be kept; times of a table count from that of the first
    /// sample of the first recording, `origin`.
    fn write(&self, merged: &Merged, origin: f64) -> Result<Option<String>, Failure> {
        let (samples, rate) = (&merged.samples, merged.rate.0);
        if self.is_table() {
            let begin = origin + merged.begin.0;
            let line = |(n, x): (usize, &f64)| format!("{},{x}\n", begin + n as f64 / rate);
            let lines: String = samples.iter().enumerate().map(line).collect();
            write_text(&self.output, &("time,x\n".to_owned() + &lines), self.force)?;
            return Ok(None);
        }
        let mono = Mono { samples, imaginary: None, rate, format: self.bits, container: Container::Wav };
        let files = begin_recording(&self.output, mono, self.force)?;
        commit_all(files).map_err(failed)?;
        Ok(mono.clipped())
    }
}

/// The report of merged recordings.
#[derive(Debug, serde::Serialize)]
struct MergeReport {
    /// Samples of the result, and how many each second.
    samples: usize,
    rate: f64,
    /// The sample of the first recording, from 0, at whose instant the result begins, and that instant after
    /// its first sample, in seconds.
    first_sample: usize,
    first_seconds: f64,
    recordings: Vec<RecordingReport>,
    predicted_snr_db: f64,
    worst_second_db: f64,
    /// Seconds after the first sample of the result.
    worst_second_at: f64,
    mean_db: f64,
    /// The recording, from 1, that alone does as well.
    one_suffices: Option<usize>,
    warnings: Vec<String>,
}

#[derive(Debug, serde::Serialize)]
struct RecordingReport {
    name: String,
    /// When its first sample was taken, after that of the first recording.
    start_seconds: f64,
    drift_ppm: Option<Interval>,
    gain: Option<Interval>,
    noise_dbfs: f64,
    /// Places where samples were lost: the first sample after it, and how many; below 0 too many.
    steps: Vec<StepReport>,
    /// What it gives alone.
    alone_db: f64,
}

#[derive(Debug, serde::Serialize)]
struct StepReport {
    sample: usize,
    lost: i64,
}

impl RecordingReport {
    fn new(name: String, found: &SourceEstimate, alone_db: f64) -> Self {
        let ppm = |drift: Estimate<f64>| Estimate { value: 1e6 * drift.value, sigma: 1e6 * drift.sigma };
        Self {
            name,
            start_seconds: found.start.0,
            drift_ppm: found.drift.map(|drift| interval(ppm(drift))),
            gain: found.gain.map(interval),
            noise_dbfs: 20.0 * found.noise.log10(),
            steps: found
                .steps
                .iter()
                .map(|step| StepReport { sample: step.samples.end, lost: step.lost })
                .collect(),
            alone_db,
        }
    }
}

impl MergeReport {
    fn new(names: Vec<String>, merged: &Merged, warnings: Vec<String>) -> Self {
        let quality = &merged.quality;
        let all = names.into_iter().zip(&merged.sources).zip(&quality.alone);
        Self {
            samples: merged.samples.len(),
            rate: merged.rate.0,
            first_sample: merged.first,
            first_seconds: merged.begin.0,
            recordings: all
                .map(|((name, found), alone)| RecordingReport::new(name, found, alone.0))
                .collect(),
            predicted_snr_db: quality.snr.0,
            worst_second_db: quality.worst_second.0,
            worst_second_at: quality.worst_at.0,
            mean_db: quality.mean.0,
            one_suffices: quality.sufficient().map(|i| i + 1),
            warnings,
        }
    }

    fn text(&self, output: &Path) -> String {
        let Self { samples, rate, first_sample, .. } = self;
        let mut text = format!(
            "{}: {} at {} = {}, from sample {first_sample} of {} on\n",
            Quoted(output),
            counted(*samples, "sample"),
            readable(*rate, "S/s"),
            readable(*samples as f64 / rate, "s"),
            Quoted(&self.recordings[0].name)
        );
        let names: Vec<String> = self.recordings.iter().map(|one| Quoted(&one.name).to_string()).collect();
        let width = names.iter().map(|name| name.chars().count()).fold("recording".len(), usize::max);
        let _ = writeln!(
            text,
            "  {:<width$}  began (s)      drift (ppm)               gain                      noise (dBFS)  alone (dB)",
            "recording"
        );
        for (one, name) in self.recordings.iter().zip(&names) {
            let [drift, gain] = [one.drift_ppm, one.gain].map(|cell| cell.map_or_else(|| "-".into(), shown));
            let _ = writeln!(
                text,
                "  {name:<width$}  {:<14.6} {drift:<25} {gain:<25} {:<13.1} {:.1}",
                one.start_seconds, one.noise_dbfs, one.alone_db
            );
            for StepReport { sample, lost } in &one.steps {
                let what = if *lost < 0 { "too many" } else { "lost" };
                let _ = writeln!(
                    text,
                    "    before sample {sample}: {} {what}",
                    counted(lost.unsigned_abs(), "sample")
                );
            }
        }
        let verdict = match self.one_suffices {
            Some(one) => format!("recording {one} alone does as well"),
            None => format!("the mean of what each gives alone has {:.1} dB", self.mean_db),
        };
        let _ = writeln!(
            text,
            "predicted SNR {:.1} dB, {:.1} dB in the worst second ({:.1} s after the beginning); {verdict}",
            self.predicted_snr_db, self.worst_second_db, self.worst_second_at
        );
        text
    }
}
