//! `fuse --track` and `fuse --stamps`: delays that change, from a table, and samples with stamps of their
//! own.

use super::capture_file::unread;
use super::print::{Failure, check_strict, failed, failed_at, is_dash, print, print_report, warn};
use super::run::BankRun;
use super::written::{Mono, begin_recording};
use hybank::bank::Bank;
use hybank::captures::{Captures, Converters, FileFormat};
use hybank::files::{Bound, commit_all, read_text};
use hybank::io::MultiReader;
use hybank::io::table::{TableOptions, read_stamped};
use hybank::merge::{DelayTrack, MergeError, Tracked, fuse_stamped, fuse_tracked};
use hybank::messages::{Quoted, counted};
use hybank::quantity::readable;
use hybank::units::Seconds;
use std::path::{Path, PathBuf};

/// Lines of more delays than a day has at ten a second.
const TABLE: Bound = Bound {
    bytes: 64 << 20,
    kind: "a table of delays",
    remedy: "give the file that was meant, or fewer lines",
};

/// The option.
#[derive(Debug, clap::Args)]
pub(super) struct TrackArgs {
    /// Follow delays that change: drift.jsonl of `align --trim`, or a table (.csv) of a time and the delay
    /// of each channel, both in seconds, with headings, as `time,delay 1,delay 2`. Taps are made for the
    /// delays at hand in place of those of the spec; lost samples are left out
    #[arg(long, value_name = "FILE", conflicts_with_all =
          ["bit_true", "algorithm", "gaps", "keep_latency", "measure", "report", "interleaved", "threads"])]
    track: Option<PathBuf>,
    /// Each capture is a table (.csv) whose first column says when its samples were taken: taps are made for
    /// these instants in place of the delays of the spec
    #[arg(long, conflicts_with_all = ["track", "bit_true", "algorithm", "gaps", "keep_latency", "measure", "report",
          "interleaved", "threads"])]
    stamps: bool,
}

#[derive(Debug, serde::Serialize)]
struct TrackedReport {
    samples: usize,
    rate: f64,
    /// When the first sample was taken: after the first frame, or by the stamps.
    begin: f64,
    predicted_snr_db: f64,
    worst_second_db: f64,
    /// After the first sample.
    worst_second_at: f64,
    warnings: Vec<String>,
}

impl TrackArgs {
    /// Whether samples have stamps.
    pub(super) fn has_stamps(&self) -> bool {
        self.stamps
    }

    /// The table, if one is given.
    pub(super) fn file(&self) -> Option<&Path> {
        self.track.as_deref()
    }
}

/// Fuses what `reader` gives by the delays of a table.
pub(super) fn fuse(job: &BankRun<'_>, table: &Path, mut reader: MultiReader) -> Result<(), Failure> {
    let track = read(table, job.bank)?;
    let rate = job.output_rate(&reader)?;
    if reader.is_complex() {
        return Err(Failure::Input(
            "--track: the samples are complex, and only real ones are fused by a table".into(),
        ));
    }
    let captures = Captures::read(&mut reader, usize::MAX).map_err(unread)?;
    let channels: Vec<Vec<f64>> = captures.channels.into_iter().map(|channel| channel.samples).collect();
    let tracked = fuse_tracked(job.bank, &channels, &track).map_err(|error| match error {
        MergeError::Design(_) | MergeError::OwnRates => failed_at(job.bank_path, error),
        MergeError::NoSamples => failed(error),
        error => failed_at(table, error),
    })?;
    write(job, &tracked, rate, reader.warnings().iter().map(ToString::to_string).collect())
}

/// Fuses tables whose samples have stamps.
pub(super) fn fuse_stamps(job: &BankRun<'_>, inputs: &[PathBuf], format: &FileFormat) -> Result<(), Failure> {
    let scale = Converters::from(job.bank).scale(format.full_scale);
    let (mut channels, mut stamps) = (Vec::new(), Vec::new());
    for path in inputs {
        let table = read_stamped(path, &format.table).map_err(failed)?.ok_or_else(|| {
            failed_at(path, "no table whose first column is a time, which --stamps needs; as `time,x` with lines of numbers")
        })?;
        for column in table.columns {
            channels.push(column.into_iter().map(|x| scale.of_number(x)).collect());
            stamps.push(table.stamps.clone());
        }
    }
    let wanted = job.bank.channel_count();
    if channels.len() != wanted {
        let (columns, channels) = (counted(channels.len(), "column"), counted(wanted, "channel"));
        return Err(failed_at(
            job.bank_path,
            format!("{channels}, but the tables have {columns} beside their times"),
        ));
    }
    let tracked = fuse_stamped(job.bank, &channels, &stamps).map_err(|error| match error {
        MergeError::Design(_) => failed_at(job.bank_path, error),
        error => failed(error),
    })?;
    write(job, &tracked, 1.0 / job.bank.fast_period.0, Vec::new())
}

/// Writes what was fused, and reports it.
fn write(job: &BankRun<'_>, tracked: &Tracked, rate: f64, warnings: Vec<String>) -> Result<(), Failure> {
    let samples = &tracked.samples;
    let mono = Mono { samples, imaginary: None, rate, format: job.format, container: job.container };
    let files = begin_recording(job.output, mono, job.args.force)?;
    let warnings: Vec<String> = warnings.into_iter().chain(mono.clipped()).collect();
    check_strict(&warnings, job.args.strict)?;
    commit_all(files).map_err(failed)?;
    warnings.iter().for_each(|text| warn(text));
    report(job, tracked, rate, warnings)
}

/// Reads the table of delays: lines of JSON as `align` writes them, or a table with headings.
fn read(path: &Path, bank: &Bank) -> Result<DelayTrack, Failure> {
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("jsonl")) {
        return read_lines(path, bank);
    }
    let table = read_stamped(path, &TableOptions::default()).map_err(failed)?.ok_or_else(|| {
        failed_at(
            path,
            "no table of delays: its first line has no headings of which the first is a time, as `time,delay 1,delay 2`",
        )
    })?;
    let seconds = |column: Vec<f64>| column.into_iter().map(Seconds).collect();
    Ok(DelayTrack { times: table.stamps, delays: table.columns.into_iter().map(seconds).collect() })
}

/// A line of `drift.jsonl`.
#[derive(Debug, serde::Deserialize)]
struct DriftLine {
    frame: u64,
    /// D_i in seconds; of a channel of which the line says nothing none.
    delay: Vec<Option<f64>>,
}

fn read_lines(path: &Path, bank: &Bank) -> Result<DelayTrack, Failure> {
    let text = read_text(path, TABLE).map_err(failed)?;
    let (mut times, mut delays) = (Vec::new(), vec![Vec::new(); bank.channel_count()]);
    for (number, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let refused = |problem: String| failed_at(path, format!("line {}: {problem}", number + 1));
        let DriftLine { frame, delay } =
            serde_json::from_str(line).map_err(|error| refused(error.to_string()))?;
        if delay.len() != delays.len() {
            return Err(refused(format!("{} for {} channels", counted(delay.len(), "delay"), delays.len())));
        }
        // A line that says nothing of a channel is left to the lines around it.
        let Some(delay) = delay.into_iter().collect::<Option<Vec<f64>>>() else { continue };
        times.push(Seconds(frame as f64 * bank.slow_period().0));
        delays.iter_mut().zip(delay).for_each(|(column, delay)| column.push(Seconds(delay)));
    }
    Ok(DelayTrack { times, delays })
}

fn report(job: &BankRun<'_>, tracked: &Tracked, rate: f64, warnings: Vec<String>) -> Result<(), Failure> {
    let report = TrackedReport {
        samples: tracked.samples.len(),
        rate,
        begin: tracked.begin.0,
        predicted_snr_db: tracked.snr.0,
        worst_second_db: tracked.worst_second.0,
        worst_second_at: tracked.worst_at.0,
        warnings,
    };
    if job.args.json {
        return print_report(&report, job.output);
    }
    if is_dash(job.output) {
        return Ok(());
    }
    print(&format!(
        "{}: {} at {}, predicted SNR {:.1} dB, {:.1} dB in the worst second ({:.1} s after the beginning)\n",
        Quoted(job.output),
        counted(report.samples, "sample"),
        readable(rate, "S/s"),
        report.predicted_snr_db,
        report.worst_second_db,
        report.worst_second_at
    ))
}
