//! `--track` of `fuse` and `stream`, `stream --pilot` and `fuse --stamps`: delays and levels that change,
//! from a table or by a tone, and samples with stamps of their own.

use super::interrupt::interrupts;
use super::observer::RunObserver;
use super::print::{
    Failure, check_strict, failed, failed_at, is_dash, print, print_report, say_line, stopped, warn,
    with_remains,
};
use super::run::{BankRun, each_block, frames_of};
use super::written::{Mono, begin_recording, check_outputs};
use hybank::bank::Bank;
use hybank::calibrate::LevelChange;
use hybank::captures::{Converters, FileFormat, LevelTrack};
use hybank::files::{Bound, commit_all, read_text};
use hybank::io::table::{TableOptions, read_stamped};
use hybank::io::{MultiReader, RecordedFrames};
use hybank::merge::{DelayTrack, MergeError, PilotFusion, PredictedQuality, TrackedFusion, fuse_stamped};
use hybank::messages::{Quoted, counted};
use hybank::pipeline::{Block, FileOutputs, Warning};
use hybank::quantity::readable;
use hybank::runtime::FrameSource;
use hybank::sampling::median;
use hybank::units::{Hertz, Seconds};
use std::path::{Path, PathBuf};

/// Lines of more delays than a day has at ten a second.
const TABLE: Bound = Bound {
    bytes: 64 << 20,
    kind: "a table of delays",
    remedy: "give the file that was meant, or fewer lines",
};

/// Options of `fuse`.
#[derive(Debug, clap::Args)]
pub(super) struct InstantArgs {
    #[command(flatten)]
    pub(super) track: TrackArgs,
    /// Each capture is a table (.csv) whose first column says when its samples were taken: taps are made for
    /// these instants in place of the delays of the spec
    #[arg(long, conflicts_with_all = ["track", "bit_true", "algorithm", "gaps", "keep_latency", "measure", "report",
          "interleaved", "threads"], hide_short_help = true)]
    pub(super) stamps: bool,
}

/// The option that `fuse` and `stream` have.
#[derive(Debug, clap::Args)]
pub(super) struct TrackArgs {
    /// Follow what changes: a table (.csv), or what `align --trim` or `calibrate --drift` wrote
    ///
    /// The table has a time and the delay of each channel, both in seconds, with headings, as
    /// `time,delay 1,delay 2`. Columns with the gain of each channel, and then with its offset, may follow.
    /// Taps are made for the delays at hand in place of those of the spec, and samples lose the offset and
    /// the gain at hand; lost samples are left out. `stream` gives the samples of `fuse`, blocks of 64
    /// frames as soon as the 38 frames after them are there.
    #[arg(long, value_name = "FILE", conflicts_with_all =
          ["algorithm", "gaps", "report", "interleaved", "threads"])]
    track: Option<PathBuf>,
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
    /// By how much the gains and offsets of the table change, if it has them.
    #[serde(skip_serializing_if = "Option::is_none")]
    levels: Option<LevelChange>,
    /// The delays are those of a tone; what they err by is not in the prediction.
    #[serde(skip)]
    by_tone: bool,
    /// True if a signal ended the stream.
    interrupted: bool,
    warnings: Vec<String>,
}

impl TrackArgs {
    /// Refuses an output over the table.
    pub(super) fn check(&self, output: &Path) -> Result<(), Failure> {
        self.file().map_or(Ok(()), |table| check_outputs(&[output], &[table]))
    }

    /// The table, if one is given.
    pub(super) fn file(&self) -> Option<&Path> {
        self.track.as_deref()
    }
}

/// What fuses by a table.
pub(super) struct TableFusion {
    fusion: TrackedFusion,
    levels: Option<LevelTrack>,
    frames: usize,
}

/// What fuses by the delays, gains and offsets of a table.
pub(super) fn table_fusion(job: &BankRun<'_>, table: &Path) -> Result<MovingFusion, Failure> {
    let Drift { delays, levels } = read(table, job.bank)?;
    let corrected = levels.as_ref().map(LevelTrack::bank);
    let fusion = TrackedFusion::new(corrected.as_ref().unwrap_or(job.bank), &delays);
    let fusion = fusion.map_err(|error| match error {
        MergeError::Design(_) | MergeError::OwnRates => failed_at(job.bank_path, error),
        error => failed_at(table, error),
    })?;
    Ok(MovingFusion::Table(Box::new(TableFusion { fusion, levels, frames: 0 })))
}

impl TableFusion {
    fn push(&mut self, mut channels: Vec<Vec<f64>>) -> Result<Vec<f64>, MergeError> {
        if let Some(levels) = &self.levels {
            levels.correct(self.frames, &mut channels);
        }
        self.frames += channels.first().map_or(0, Vec::len);
        self.fusion.push(&channels)
    }
}

/// What fuses by a tone beside the signal.
pub(super) fn pilot_fusion(job: &BankRun<'_>, tone: Hertz) -> Result<MovingFusion, Failure> {
    let fusion = PilotFusion::new(job.bank, tone).map_err(|error| failed_at(job.bank_path, error))?;
    Ok(MovingFusion::Pilot(Box::new(fusion)))
}

/// What fuses while delays move.
pub(super) enum MovingFusion {
    Table(Box<TableFusion>),
    Pilot(Box<PilotFusion>),
}

/// What is left at the end of the samples.
struct Last {
    samples: Vec<f64>,
    quality: PredictedQuality,
    levels: Option<LevelChange>,
    warning: Option<String>,
}

impl MovingFusion {
    fn push(&mut self, channels: Vec<Vec<f64>>) -> Result<Vec<f64>, MergeError> {
        match self {
            Self::Table(fusion) => fusion.push(channels),
            Self::Pilot(fusion) => fusion.push(&channels),
        }
    }

    fn finish(self) -> Result<Last, MergeError> {
        match self {
            Self::Table(table) => {
                let TableFusion { fusion, levels, .. } = *table;
                let (samples, quality) = fusion.finish()?;
                Ok(Last { samples, quality, levels: levels.as_ref().map(LevelTrack::change), warning: None })
            }
            Self::Pilot(fusion) => {
                let (blocks, missed) = (fusion.blocks(), fusion.missed_blocks());
                let (samples, quality) = fusion.finish()?;
                Ok(Last { samples, quality, levels: None, warning: of_missed(blocks, missed) })
            }
        }
    }
}

/// The warning of a pilot that was not found everywhere.
fn of_missed(blocks: usize, missed: usize) -> Option<String> {
    let blocks_of_all = counted(blocks, "block");
    match (blocks, missed) {
        (0, _) => Some(
            "the samples ended before the first block of 2048 frames of the pilot, so the delays are those of the bank"
                .into(),
        ),
        (_, 0) => None,
        _ => Some(format!(
            "the pilot was not found in {missed} of {blocks_of_all}, where the delays stayed as they were; check its \
             frequency and its level"
        )),
    }
}

/// Fuses what `reader` gives.
pub(super) fn run(
    job: &BankRun<'_>,
    fusion: MovingFusion,
    mut reader: MultiReader,
    observer: &mut RunObserver,
) -> Result<(), Failure> {
    let rate = job.output_rate(&reader)?;
    if reader.is_complex() {
        return Err(Failure::Input(
            "the samples are complex, and only real ones are fused by --track and --pilot".into(),
        ));
    }
    let mut outputs = job.outputs(rate, false)?;
    let mut kept = Vec::new();
    if job.is_live {
        // What is recorded live cannot be recorded again.
        kept = outputs.keep();
        reader.stop_at(interrupts());
    }
    let run = TrackedRun { job, outputs, rate, samples: 0, clipped: 0 };
    run.all(fusion, &mut reader, observer).map_err(|failure| with_remains(failure, &kept))
}

/// Outputs on their way.
struct TrackedRun<'a> {
    job: &'a BankRun<'a>,
    outputs: FileOutputs,
    rate: f64,
    samples: usize,
    clipped: u64,
}

impl TrackedRun<'_> {
    fn all(
        mut self,
        mut fusion: MovingFusion,
        reader: &mut MultiReader,
        observer: &mut RunObserver,
    ) -> Result<(), Failure> {
        let by_tone = matches!(fusion, MovingFusion::Pilot(_));
        let interrupted = each_block(reader, observer, |_, recordings| {
            self.write(&fusion.push(channels(recordings)).map_err(failed)?)
        })?;
        let Last { samples: last, quality, levels, warning } = fusion.finish().map_err(failed)?;
        self.write(&last)?;
        let Self { job, outputs, rate, samples, clipped } = self;
        let clipped =
            (clipped > 0).then(|| format!("{}; {} keeps them", Warning::Clipped(clipped), job.lossless));
        let warnings: Vec<String> =
            reader.warnings().iter().map(ToString::to_string).chain(clipped).chain(warning).collect();
        check_strict(&warnings, job.args.strict)?;
        outputs.finish().map_err(stopped)?;
        warnings.iter().for_each(|text| warn(text));
        if interrupted {
            say_line(&format!("interrupted after {} frames, {samples} samples written", reader.consumed()));
        }
        report(
            job,
            TrackedReport {
                levels,
                by_tone,
                interrupted,
                warnings,
                ..TrackedReport::new(samples, rate, 0.0, quality)
            },
        )
    }

    fn write(&mut self, samples: &[f64]) -> Result<(), Failure> {
        let format = self.job.format;
        let mut bytes = vec![0; samples.len() * format.bytes()];
        for (slot, x) in bytes.chunks_exact_mut(format.bytes()).zip(samples) {
            self.clipped += u64::from(format.encode(*x, slot));
        }
        self.samples += samples.len();
        self.outputs.write(Block { samples: &bytes, mask: None }).map_err(stopped)
    }
}

/// The samples of all channels, as many of each.
fn channels(recordings: &[RecordedFrames<'_>]) -> Vec<Vec<f64>> {
    let frames = frames_of(recordings) as usize;
    let mut channels = Vec::new();
    for RecordedFrames { real, .. } in recordings {
        channels.extend((0..real.channels()).map(|channel| real.channel(channel).take(frames).collect()));
    }
    channels
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
    let (samples, rate) = (&tracked.samples, 1.0 / job.bank.fast_period.0);
    let mono = Mono { samples, imaginary: None, rate, format: job.format, container: job.container };
    let files = begin_recording(job.output, mono, job.args.force)?;
    let warnings: Vec<String> = mono.clipped().into_iter().collect();
    check_strict(&warnings, job.args.strict)?;
    commit_all(files).map_err(failed)?;
    warnings.iter().for_each(|text| warn(text));
    let report_of = TrackedReport::new(samples.len(), rate, tracked.begin.0, tracked.quality);
    report(job, TrackedReport { warnings, ..report_of })
}

/// What a table says of the converters.
struct Drift {
    delays: DelayTrack,
    levels: Option<LevelTrack>,
}

/// Reads the table: lines of JSON as `align` writes them, or a table with headings.
fn read(path: &Path, bank: &Bank) -> Result<Drift, Failure> {
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("jsonl")) {
        return read_lines(path, bank);
    }
    let table = read_stamped(path, &TableOptions::default()).map_err(failed)?.ok_or_else(|| {
        failed_at(
            path,
            "no table of delays: its first line has no headings of which the first is a time, as `time,delay 1,delay 2`",
        )
    })?;
    let (mut columns, channels) = (table.columns, bank.channel_count());
    let has_levels = columns.len() == 2 * channels || columns.len() == 3 * channels;
    let mut gains = has_levels.then(|| columns.split_off(channels));
    let offsets = gains.as_mut().filter(|all| all.len() > channels).map(|all| all.split_off(channels));
    Drift::new(path, bank, table.stamps, [Some(columns), gains, offsets])
}

impl Drift {
    /// Of columns of delays in seconds, gains and offsets.
    fn new(
        path: &Path,
        bank: &Bank,
        times: Vec<Seconds>,
        [delays, gains, offsets]: [Option<Vec<Vec<f64>>>; 3],
    ) -> Result<Self, Failure> {
        let has_levels = gains.is_some() || offsets.is_some();
        let levels = has_levels.then(|| LevelTrack::new(bank, times.clone(), gains, offsets));
        let levels = levels.transpose().map_err(|error| failed_at(path, error))?;
        let seconds = |column: Vec<f64>| column.into_iter().map(Seconds).collect();
        let delays = delays.unwrap_or_default().into_iter().map(seconds).collect();
        Ok(Self { delays: DelayTrack { times, delays, half_widths: Vec::new() }, levels })
    }
}

/// A line of `drift.jsonl`.
#[derive(Debug, serde::Deserialize)]
struct DriftLine {
    frame: u64,
    /// D_i in seconds; of a channel of which the line says nothing none.
    delay: Vec<Option<f64>>,
    #[serde(default)]
    half_width: Vec<Option<f64>>,
    /// g_i and o_i, where those of some channel change.
    gain: Option<Vec<f64>>,
    offset: Option<Vec<f64>>,
}

impl DriftLine {
    /// Delays, gains and offsets, if the line says something of the delay of each channel.
    fn values(self) -> Option<[Option<Vec<f64>>; 3]> {
        Some([Some(self.delay.into_iter().collect::<Option<_>>()?), self.gain, self.offset])
    }
}

fn read_lines(path: &Path, bank: &Bank) -> Result<Drift, Failure> {
    let text = read_text(path, TABLE).map_err(failed)?;
    let (mut times, mut lines, mut half_widths) = (Vec::new(), Vec::new(), Vec::new());
    for (number, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let refused = |problem: String| failed_at(path, format!("line {}: {problem}", number + 1));
        let mut line: DriftLine = serde_json::from_str(line).map_err(|error| refused(error.to_string()))?;
        let wanted = bank.channel_count();
        let lengths =
            [Some(line.delay.len()), line.gain.as_ref().map(Vec::len), line.offset.as_ref().map(Vec::len)];
        for (what, length) in ["delay", "gain", "offset"].into_iter().zip(lengths) {
            if let Some(length) = length.filter(|length| *length != wanted) {
                return Err(refused(format!("{} for {wanted} channels", counted(length, what))));
            }
        }
        let time = Seconds(line.frame as f64 * bank.slow_period().0);
        let half_width = std::mem::take(&mut line.half_width);
        // A line that says nothing of a channel is left to the lines around it.
        let Some(values) = line.values() else { continue };
        let first = lines.first().unwrap_or(&values);
        if first.iter().zip(&values).any(|(first, own)| first.is_some() != own.is_some()) {
            return Err(refused(
                "gains or offsets are in some of the lines; give them in all or in none".into(),
            ));
        }
        times.push(time);
        lines.push(values);
        half_widths.push(half_width);
    }
    let column =
        |kind: usize, i: usize| lines.iter().filter_map(|line| Some(line[kind].as_ref()?[i])).collect();
    let columns = |kind: usize| -> Option<Vec<Vec<f64>>> {
        let is_given = kind == 0 || lines.first().is_some_and(|line| line[kind].is_some());
        is_given.then(|| (0..bank.channel_count()).map(|i| column(kind, i)).collect())
    };
    // At the ends, and beside lost samples, delays err far more than elsewhere.
    let usual = |i: usize| {
        let all = half_widths.iter().filter_map(|line| line.get(i).copied().flatten());
        Seconds(median(all.filter(|half_width| *half_width >= 0.0).collect()))
    };
    let usual = (0..bank.channel_count()).map(usual).collect();
    let mut drift = Drift::new(path, bank, times, [0, 1, 2].map(columns))?;
    drift.delays.half_widths = usual;
    Ok(drift)
}

impl TrackedReport {
    fn new(samples: usize, rate: f64, begin: f64, quality: PredictedQuality) -> Self {
        Self {
            samples,
            rate,
            begin,
            predicted_snr_db: quality.snr.0,
            worst_second_db: quality.worst_second.0,
            worst_second_at: quality.worst_at.0,
            levels: None,
            by_tone: false,
            interrupted: false,
            warnings: Vec::new(),
        }
    }
}

fn report(job: &BankRun<'_>, report: TrackedReport) -> Result<(), Failure> {
    if job.args.json {
        return print_report(&report, job.output);
    }
    if is_dash(job.output) {
        return Ok(());
    }
    print(&format!(
        "{}: {} at {}, predicted SNR {:.1} dB, {:.1} dB in the worst second ({:.1} s after the beginning){}{}\n",
        Quoted(job.output),
        counted(report.samples, "sample"),
        readable(report.rate, "S/s"),
        report.predicted_snr_db,
        report.worst_second_db,
        report.worst_second_at,
        if report.by_tone { ", if the delays are right" } else { "" },
        report.levels.map_or_else(String::new, level_text)
    ))
}

fn level_text(LevelChange { gain, offset }: LevelChange) -> String {
    let offsets =
        if offset > 0.0 { format!(", offsets by up to {offset:.2e} of full scale") } else { String::new() };
    format!("; samples corrected by the table, where gains change by up to {:.3} %{offsets}", 100.0 * gain)
}
