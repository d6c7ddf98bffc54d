//! `hybank simulate`: the captures of virtual slow converters.

mod converters;

use self::converters::{CommonReport, ConverterArgs, ConverterReport, Converters};
use super::Failure;
use super::bank_file::load_spec_or_bank;
use super::capture_file::{CaptureFile, Reading};
use super::folder::write_together;
use super::recordings::{Mono, begin_recording};
use super::say::name_leftovers;
use super::understood::understood;
use crate::design::{self, Problem};
use crate::files::refuse_overlaps;
use crate::simulate::{Analog, Delivered, Recording, Source, frames, target};
use crate::spec::Spec;
use crate::units::{FastPeriods, Hertz};
use std::path::{Path, PathBuf};

/// Fast rate in the WAV headers of captures in normalised time.
const NORMALISED_RATE: Hertz = Hertz(48_000.0);

/// Simulates what the slow converters capture
///
/// Writes ch1.wav, ch2.wav, .. at the slow rate, and target.wav: the samples of the ideal fast converter,
/// delayed by the latency. The samples of a step, tone or chirp are exact to rounding. A WAV recording is
/// treated as a periodic, band-limited analog signal. The converters have the gains and offsets of the spec,
/// and the errors that are asked for; the target is ideal.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Sources:
  step@0.3                  0 before 0.3 s, 1 afterwards (units: s, ms, us, ns; s if left out)
  tones:0.3,0.8             cosines of amplitude 1, angular frequencies in rad/s
  tones:440Hz,1kHz          the same, frequencies in hertz
  chirp:50Hz..8kHz@2s       a linear sweep from 50 Hz to 8 kHz in 2 s
  step@1+tones:440Hz        a sum
  FILE.wav                  a mono recording, or with --channel K one channel of a recording

Examples:
  hybank simulate spec.toml --source step@0.3 -o captures
  hybank simulate bank.json --source speech.wav -o captures
  hybank simulate bank.json --source tones:440Hz,1kHz --samples 96000 -o captures
  hybank simulate spec.toml --source music.wav --channel 2 -o captures
  hybank simulate spec.toml --source tones:440Hz -o captures --bits 12 --delay-error 10ns,-10ns")]
pub(super) struct Args {
    /// A spec (TOML) or a bank (JSON)
    spec: PathBuf,
    /// The analog signal
    #[arg(long)]
    source: String,
    /// Channel of the WAV recording, counted from 1; a mono recording needs none
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u16).range(1..))]
    channel: Option<u16>,
    /// The folder for the captures; created if missing
    #[arg(short, long)]
    output: PathBuf,
    /// Fast samples to simulate, rounded up to whole frames [default: to the end of the source, at least
    /// 200]
    #[arg(long)]
    samples: Option<usize>,
    /// Factor by which the analog signal is multiplied
    #[arg(long, default_value_t = 1.0, allow_hyphen_values = true)]
    gain: f64,
    /// Replace existing files
    #[arg(long)]
    force: bool,
    /// Print a report as one JSON object
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    converters: ConverterArgs,
}

#[derive(Debug, serde::Serialize)]
struct Report {
    /// The spec in units of the user.
    understood: String,
    /// The analog signal, in hertz and seconds.
    source: String,
    files: Vec<String>,
    frames: usize,
    slow_rate: u32,
    fast_rate: u32,
    latency: usize,
    #[serde(flatten)]
    common: CommonReport,
    converters: Vec<ConverterReport>,
    warnings: Vec<String>,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the one message for the user.
pub(super) fn run(args: &Args) -> Result<(), Failure> {
    if !args.gain.is_finite() {
        return Err(Failure::Usage(format!("--gain {} is not a finite number", args.gain)));
    }
    let spec = load_spec_or_bank(&args.spec)?;
    let named = |error: &dyn std::fmt::Display| Failure::Input(format!("{}: {error}", args.spec.display()));
    let latency = design::latency(&spec).map_err(|error| named(&error))?;
    let problem = Problem::new(&spec, latency).map_err(|error| named(&error))?;
    let (rates, mut warnings) = Rates::of(&spec).map_err(|message| named(&message))?;
    if spec.latency.is_none() {
        warnings.push(format!("the spec gives no latency; {latency} fast samples are used"));
    }
    let signal = args.signal(&spec)?;
    let Converters { common, each } = args.converters.converters(&spec, &signal)?;
    let samples = args.samples.unwrap_or_else(|| signal.usual_samples(spec.ratio));
    let frames = frames(&problem, &signal, samples, args.converters.is_jittered())
        .map_err(|error| Failure::Input(format!("{}: {error}", args.source)))?;
    let files = args.files(&rates, spec.channels.len())?;
    let (converters, mut reports): (Vec<_>, Vec<_>) = each.into_iter().unzip();
    let captures = converters.iter().zip(&mut reports).enumerate().map(|(i, (converter, report))| {
        let Delivered { samples, clipped } = converter.capture(&problem, i, (&signal, args.gain), frames);
        report.clipped = clipped;
        samples
    });
    let reference = std::iter::once_with(|| args.amplified(target(&problem, &signal, frames)));
    let recordings = files.iter().zip(captures.chain(reference));
    let recordings = recordings.map(|(file, samples)| Ok((file, args.checked(samples)?)));
    write_together(&args.output, recordings, |(file, samples)| {
        begin_recording(&file.path, Mono { samples: &samples, rate: file.rate }, args.force)
    })?;
    let files: Vec<String> = files.iter().map(|file| file.path.display().to_string()).collect();
    warnings.extend(clipping(&files, &reports));
    let (slow_rate, fast_rate) = (rates.slow, rates.fast);
    Report {
        understood: understood(&Spec { latency: Some(latency), ..spec }),
        source: args.source_text(),
        files,
        frames,
        slow_rate,
        fast_rate,
        latency,
        common,
        converters: reports,
        warnings,
    }
    .print(args.json)
}

/// Warnings of converters that clipped.
fn clipping<'a>(files: &'a [String], reports: &'a [ConverterReport]) -> impl Iterator<Item = String> + 'a {
    let clipped = files.iter().zip(reports).filter(|(_, report)| report.clipped > 0);
    clipped.map(|(file, report)| format!("{file}: {} samples were clipped at full scale", report.clipped))
}

/// A file to be written.
struct Output {
    path: PathBuf,
    /// Hertz.
    rate: u32,
}

impl Args {
    /// The source as it was understood.
    fn source_text(&self) -> String {
        self.source.parse().map_or_else(|_| self.source.clone(), |source: Source| source.to_string())
    }

    /// The signal in normalised time.
    fn signal(&self, spec: &Spec) -> Result<Analog, Failure> {
        let path = Path::new(&self.source);
        if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("wav")) {
            let reading = Reading::channel(self.channel.map(usize::from), crate::simulate::MOST_SAMPLES);
            let CaptureFile { samples, rate, .. } = CaptureFile::read(path, reading)?.finite(path)?;
            // In normalised time the recording's own rate is the fast rate.
            let fast = if spec.is_normalised() { rate } else { spec.fast_period.rate() };
            let recording = Recording::new(&samples, FastPeriods(fast / rate));
            return Ok(Analog::Recorded(recording));
        }
        if let Some(channel) = self.channel {
            return Err(Failure::Usage(format!(
                "--channel {channel}: the source {} is no WAV recording; leave the option out",
                self.source
            )));
        }
        let source: Source =
            self.source.parse().map_err(|error| Failure::Usage(format!("--source: {error}")))?;
        Ok(Analog::Known(source.normalised(spec.fast_period)))
    }

    /// The channels' files and the target's; none of them may be an input.
    fn files(&self, rates: &Rates, channels: usize) -> Result<Vec<Output>, Failure> {
        let slow = (1..=channels).map(|i| (format!("ch{i}.wav"), rates.slow));
        let names = slow.chain([("target.wav".to_owned(), rates.fast)]);
        let files: Vec<_> = names.map(|(name, rate)| Output { path: self.output.join(name), rate }).collect();
        let outputs: Vec<_> = files.iter().map(|file| file.path.as_path()).collect();
        refuse_overlaps(&outputs, &[&self.spec, Path::new(&self.source)]).map_err(Failure::input)?;
        name_leftovers(&outputs);
        Ok(files)
    }

    fn amplified(&self, mut samples: Vec<f64>) -> Vec<f64> {
        samples.iter_mut().for_each(|x| *x *= self.gain);
        samples
    }

    /// A sample beyond the range of a 32-bit float is an error, not an infinity in the file.
    fn checked(&self, samples: Vec<f64>) -> Result<Vec<f64>, Failure> {
        match samples.iter().find(|x| x.is_nan() || x.abs() > f64::from(f32::MAX)) {
            None => Ok(samples),
            Some(x) => Err(Failure::Input(format!(
                "{}: a captured sample is {x:e}, beyond the range of a 32-bit float; use a smaller --gain",
                self.source
            ))),
        }
    }
}

/// Rates for WAV headers, whole hertz.
struct Rates {
    slow: u32,
    fast: u32,
}

impl Rates {
    fn of(spec: &Spec) -> Result<(Self, Vec<String>), String> {
        let ratio = spec.ratio as f64;
        let slow = if spec.is_normalised() {
            (NORMALISED_RATE / ratio).0.round().max(1.0)
        } else {
            (spec.fast_period * ratio).rate().0
        };
        let fast = slow * ratio;
        if fast > f64::from(u32::MAX) || slow < 0.5 {
            return Err(format!(
                "the rates of {slow} Hz and {fast} Hz do not fit a WAV header (1 to {} Hz); simulate a spec in \
                 normalised time (fast_period = 1)",
                u32::MAX
            ));
        }
        let mut warnings = Vec::new();
        for rate in [slow, fast] {
            if (rate - rate.round()).abs() > 1e-6 * rate {
                warnings.push(format!(
                    "WAV headers hold whole hertz: {rate} Hz is written as {} Hz",
                    rate.round()
                ));
            }
        }
        Ok((Self { slow: slow.round() as u32, fast: fast.round() as u32 }, warnings))
    }
}

impl Report {
    fn print(&self, json: bool) -> Result<(), Failure> {
        self.warnings.iter().for_each(|warning| super::warn(warning));
        if json {
            return super::print_json(self);
        }
        let each = self.converters.iter().zip(1..).map(|(converter, channel)| converter.text(channel));
        let each: String = each.collect();
        super::print(&format!(
            "{}\nsource: {}\n{} frames at {} Hz, target at {} Hz with a latency of {} samples:\n  {}\n{}{each}",
            self.understood,
            self.source,
            self.frames,
            self.slow_rate,
            self.fast_rate,
            self.latency,
            self.files.join("\n  "),
            self.common.text()
        ))
    }
}
