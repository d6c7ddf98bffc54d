//! `hybank simulate`: the captures of virtual slow converters.

use super::bank_file::{bad_flag, load_spec_or_bank};
use super::print::{Failure, InFile, show, warn};
use super::virtual_converters::{CommonReport, ConverterReport, ErrorArgs, integers};
use super::virtual_signal::{DescribedSignal, SignalArgs};
use super::written::{Mono, begin_recording, check_together, write_together};
use hybank::design::Problem;
use hybank::io::{Container, PcmFormat, SampleWriter, is_same_rate};
use hybank::messages::{Quoted, counted};
use hybank::overview::understood;
use hybank::quantity::readable;
use hybank::simulate::Sampler;
use hybank::spec::{ChannelSpec, Spec, SpecError};
use hybank::units::Hertz;
use std::path::PathBuf;

/// Simulates what the slow converters capture
///
/// Writes ch1.wav, ch2.wav, .. at the slow rate, and target.wav: the samples of the ideal fast converter,
/// in line with the output of `fuse`. The samples of a step, tone or chirp are exact to rounding. A WAV
/// recording is treated as a periodic, band-limited analog signal. The converters have the gains and
/// offsets of the spec, and the errors that are asked for; the target is ideal. Complex signals, as a
/// quadrature receiver delivers them, are written as SigMF recordings or raw: both parts pass the same
/// front ends and clocks. WAV files of converters with --bits hold integers of 16 or 24 bits, all others
/// 32-bit floats.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Sources:
  step@0.3                  0 before 0.3 s, 1 afterwards (units: s, ms, us, ns; s if left out)
  tones:440Hz,1kHz          cosines of amplitude 1; without units angular frequencies in rad/s
  chirp:50Hz..8kHz@2s       a linear sweep from 50 Hz to 8 kHz in 2 s
  ctones:100kHz,-250kHz     complex exponentials of amplitude 1, also of negative frequencies
  step@1+tones:440Hz        a sum
  FILE.wav                  a mono recording, or with --channel K one channel of a recording

Examples:
  hybank simulate spec.toml --source step@0.3 -o captures
  hybank simulate bank.json --source tones:440Hz,1kHz --samples 96000 -o captures
  hybank simulate spec.toml --source tones:440Hz -o captures --bits 12 --delay-error 10ns,-10ns
  hybank simulate spec.toml --source ctones:100kHz,-250kHz -o captures --to raw
  hybank simulate spec.toml --source i.wav --imaginary q.wav -o captures")]
pub(super) struct Args {
    /// A spec (TOML) or a bank (JSON)
    spec: PathBuf,
    #[command(flatten)]
    signal: SignalArgs,
    /// The folder for the captures; created if missing
    #[arg(short, long)]
    output: PathBuf,
    /// Kind of the files [default: wav, of complex samples sigmf]
    #[arg(long, value_name = "KIND")]
    to: Option<CaptureKind>,
    /// Fast samples to simulate, rounded up to whole frames [default: to the end of the source, at least
    /// 200]
    #[arg(long)]
    samples: Option<usize>,
    /// Factor by which the analog signal is multiplied
    #[arg(long, default_value_t = 1.0, hide_short_help = true)]
    gain: f64,
    /// Replace existing files
    #[arg(long)]
    force: bool,
    /// Print a report as one JSON object
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    errors: ErrorArgs,
}

#[derive(Debug, serde::Serialize)]
struct SimulationReport {
    /// The spec in units of the user.
    understood: String,
    /// The analog signal, in hertz and seconds.
    source: String,
    files: Vec<String>,
    frames: usize,
    is_complex: bool,
    slow_rate: serde_json::Value,
    fast_rate: serde_json::Value,
    /// Of the bank, if the spec says it.
    #[serde(skip_serializing_if = "Option::is_none")]
    latency: Option<usize>,
    #[serde(flatten)]
    common: CommonReport,
    converters: Vec<ConverterReport>,
    warnings: Vec<String>,
}

pub(super) fn run(args: &Args) -> Result<(), Failure> {
    if !args.gain.is_finite() {
        return Err(Failure::Usage(format!("--gain {} is not a finite number", args.gain)));
    }
    // Its outputs are recordings, which no measurement of a spec is.
    let spec = load_spec_or_bank(&args.spec)?.for_outputs(&[])?;
    // The converters do not know what the spec says of the signal. Without latency the target lies on the
    // time axis of the output of `fuse`.
    let errors = args.errors.errors();
    let bad = |refused: SpecError| bad_flag(refused.path(), refused.problem());
    let truth = errors.true_spec(&spec).map_err(bad)?;
    let problem = Problem::new(&Spec { signal: None, ..truth }, spec.wait()).in_file(&args.spec)?;
    let signal = DescribedSignal::read(&args.signal, &spec)?;
    let kind = args.kind(signal.is_complex())?;
    let (rates, mut warnings) = Rates::of(&spec, kind).in_file(&args.spec)?;
    warnings.extend(signal.warning(&spec));
    let converters = errors.converters(&spec, signal.analog.parts()).map_err(bad)?;
    let frames = signal.frames(&problem, args.samples, errors.is_jittered())?;
    let outputs = args.outputs(kind, signal.is_complex(), &rates);
    args.check_outputs(&outputs)?;
    let reports = spec.channels.iter().zip(&converters);
    let mut reports: Vec<_> = reports.map(|(of, each)| ConverterReport::new(of, &each.errors)).collect();
    let run = CaptureRun { args, problem: &problem, signal: &signal, frames };
    let captures = converters.iter().zip(&mut reports).enumerate();
    let captures = captures.map(|(i, (each, report))| run.capture(i, &each.converter, &mut report.clipped));
    let recordings = outputs.iter().zip(captures.chain(std::iter::once_with(|| run.target())));
    run.write(recordings, kind.container())?;
    let files: Vec<String> = outputs.iter().map(|output| output.path.display().to_string()).collect();
    let clipped = files.iter().zip(&reports).filter(|(_, report)| report.clipped > 0);
    warnings.extend(clipped.map(|(file, report)| {
        format!("{}: {} samples were clipped at full scale", Quoted(file), report.clipped)
    }));
    let report = SimulationReport {
        understood: understood(&spec),
        is_complex: signal.is_complex(),
        source: signal.text,
        files,
        frames,
        slow_rate: rates.shown(),
        fast_rate: number(rates.fast),
        latency: spec.latency,
        common: CommonReport::new(&errors, &spec),
        converters: reports,
        warnings,
    };
    report.warnings.iter().for_each(|warning| warn(warning));
    show(&report, args.json, SimulationReport::text)
}

/// A rate, or one for each converter, with its unit.
fn rate(hertz: &serde_json::Value) -> String {
    if let Some(list) = hertz.as_array() {
        return list.iter().map(rate).collect::<Vec<_>>().join(" and ");
    }
    hertz.as_f64().map_or_else(|| hertz.to_string(), |hertz| readable(hertz, "S/s"))
}

/// Real parts, and imaginary parts of complex samples.
type SampleParts = (Vec<f64>, Option<Vec<f64>>);

/// What is captured.
struct CaptureRun<'a> {
    args: &'a Args,
    problem: &'a Problem,
    signal: &'a DescribedSignal,
    frames: usize,
}

impl CaptureRun<'_> {
    /// The samples of channel `i`, and how many of their parts `clipped`.
    fn capture(&self, i: usize, converter: &Sampler, clipped: &mut usize) -> SampleParts {
        let Self { problem, signal, frames, .. } = *self;
        let delivered = signal.analog.captured(problem, i, converter, self.args.gain, frames);
        *clipped = delivered.clipped;
        (delivered.samples, delivered.imaginary)
    }

    fn target(&self) -> SampleParts {
        self.signal.analog.target(self.problem, self.args.gain, self.frames)
    }

    /// All files appear together or not at all.
    fn write<'o>(
        &self,
        recordings: impl Iterator<Item = (&'o OutputFile, SampleParts)>,
        container: Container,
    ) -> Result<(), Failure> {
        let checked = recordings.map(|(output, samples)| Ok((output, self.checked(samples)?)));
        write_together(&self.args.output, checked, |(output, parts)| {
            let (samples, imaginary) = (&parts.0, parts.1.as_deref());
            let mono = Mono { samples, imaginary, rate: output.rate, format: output.format, container };
            begin_recording(&output.path, mono, self.args.force)
        })
    }

    /// A sample beyond the range of a 32-bit float is an error, not an infinity in the file.
    fn checked(&self, parts: SampleParts) -> Result<SampleParts, Failure> {
        let mut all = parts.0.iter().chain(parts.1.iter().flatten());
        match all.find(|x| x.is_nan() || x.abs() > f64::from(f32::MAX)) {
            None => Ok(parts),
            Some(x) => {
                let rule = match x.is_nan() {
                    true => "as a frequency of the source is far above the rates of the spec; use lower ones",
                    false => "beyond the range of a 32-bit float; use a smaller --gain",
                };
                Err(Failure::Input(format!("{}: a captured sample is {x:e}, {rule}", self.signal.given)))
            }
        }
    }
}

impl Args {
    /// The kind of the files that are written.
    fn kind(&self, is_complex: bool) -> Result<CaptureKind, Failure> {
        match self.to {
            Some(CaptureKind::Wav) if is_complex => Err(Failure::Usage(
                "--to wav: WAV files hold no complex samples; leave it out for SigMF recordings, or take --to raw"
                    .into(),
            )),
            Some(kind) => Ok(kind),
            None => Ok(if is_complex { CaptureKind::Sigmf } else { CaptureKind::Wav }),
        }
    }

    /// The recordings of the channels and of the target, in this order.
    fn outputs(&self, kind: CaptureKind, is_complex: bool, rates: &Rates) -> Vec<OutputFile> {
        // A WAV file has the integers of the converters.
        let codes =
            integers(self.errors.bits).filter(|_| kind == CaptureKind::Wav).unwrap_or(PcmFormat::F32Le);
        let slow = rates.slow.iter().zip(1..).map(|(&rate, i)| (format!("ch{i}"), rate, codes));
        let names = slow.chain([("target".to_owned(), rates.fast, PcmFormat::F32Le)]);
        let extension = kind.extension(is_complex);
        let output = |(name, rate, format): (String, f64, PcmFormat)| {
            let path = self.output.join(format!("{name}.{extension}"));
            OutputFile { path, rate, format }
        };
        names.map(output).collect()
    }

    /// Refuses outputs that are inputs or must not be replaced.
    fn check_outputs(&self, outputs: &[OutputFile]) -> Result<(), Failure> {
        let files: Vec<_> = outputs.iter().flat_map(|output| SampleWriter::files(&output.path)).collect();
        let files: Vec<_> = files.iter().map(PathBuf::as_path).collect();
        let inputs: Vec<_> = std::iter::once(self.spec.as_path()).chain(self.signal.names()).collect();
        check_together(&files, &inputs, self.force)
    }
}

impl SimulationReport {
    fn text(&self) -> String {
        let each = self.converters.iter().zip(1..).map(|(converter, channel)| converter.text(channel));
        let each: String = each.collect();
        format!(
            "{}\nsource: {}\n{} at {}, target at {} in line with the output of fuse:\n  {}\n{}{each}",
            self.understood,
            self.source,
            counted(self.frames, "frame"),
            rate(&self.slow_rate),
            rate(&self.fast_rate),
            self.files.iter().map(|file| Quoted(file).to_string()).collect::<Vec<_>>().join("\n  "),
            self.common.text()
        )
    }
}

/// Fast rate in the headers of captures in normalised time.
const NORMALISED_RATE: Hertz = Hertz(48_000.0);

/// The kind of the files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum CaptureKind {
    /// ch1.wav, real samples only
    Wav,
    /// ch1.sigmf-meta and ch1.sigmf-data
    Sigmf,
    /// ch1.f32, for complex samples ch1.cf32: little-endian 32-bit floats
    Raw,
}

impl CaptureKind {
    fn container(self) -> Container {
        if self == Self::Raw { Container::Raw } else { Container::Wav }
    }

    fn extension(self, is_complex: bool) -> &'static str {
        match self {
            Self::Wav => "wav",
            Self::Sigmf => "sigmf-meta",
            Self::Raw if is_complex => "cf32",
            Self::Raw => "f32",
        }
    }
}

/// A recording to be written.
struct OutputFile {
    path: PathBuf,
    /// Hertz.
    rate: f64,
    format: PcmFormat,
}

/// Rates of the headers, hertz.
struct Rates {
    /// Of each converter.
    slow: Vec<f64>,
    fast: f64,
}

impl Rates {
    /// Of a spec; WAV headers hold whole hertz, and the warnings say so.
    fn of(spec: &Spec, kind: CaptureKind) -> Result<(Self, Vec<String>), String> {
        let ratio = spec.ratio as f64;
        let frames = if spec.is_normalised() {
            (NORMALISED_RATE / ratio).0.round().max(1.0)
        } else {
            (spec.fast_period * ratio).rate().0
        };
        let own = |(channel, &samples): (&ChannelSpec, &usize)| match channel.rate {
            Some(rate) if !spec.is_normalised() => rate.0,
            _ => frames * samples as f64,
        };
        let slow = spec.channels.iter().zip(spec.layout().samples()).map(own).collect();
        let fast = match spec.layout().is_plain() || spec.is_normalised() {
            true => frames * ratio,
            false => spec.fast_period.rate().0,
        };
        let exact = Self { slow, fast };
        if kind == CaptureKind::Wav { exact.whole() } else { Ok((exact, Vec::new())) }
    }

    fn whole(self) -> Result<(Self, Vec<String>), String> {
        let Self { slow: all, fast } = self;
        let slow = all.iter().copied().fold(f64::INFINITY, f64::min);
        if fast > f64::from(u32::MAX) || slow < 0.5 {
            return Err(format!(
                "the rates of {slow} Hz and {fast} Hz do not fit a WAV header (1 to {} Hz); write SigMF recordings \
                 with --to sigmf",
                u32::MAX
            ));
        }
        let mut rates = [all.as_slice(), &[fast]].concat();
        rates.sort_by(f64::total_cmp);
        rates.dedup();
        let uneven = rates.into_iter().filter(|rate| !is_same_rate(rate.round(), *rate, 0.0));
        let warning =
            |rate: f64| format!("WAV headers hold whole hertz: {rate} Hz is written as {} Hz", rate.round());
        let warnings = uneven.map(warning).collect();
        Ok((Self { slow: all.iter().map(|rate| rate.round()).collect(), fast: fast.round() }, warnings))
    }

    /// The common slow rate, or that of each converter.
    fn shown(&self) -> serde_json::Value {
        match self.slow.as_slice() {
            [first, others @ ..] if others.iter().all(|rate| rate == first) => number(*first),
            all => all.iter().map(|&rate| number(rate)).collect(),
        }
    }
}

/// A rate as JSON: without a decimal point if it is whole.
fn number(rate: f64) -> serde_json::Value {
    let is_whole = rate.fract() == 0.0 && rate < (1u64 << 53) as f64;
    if is_whole { (rate as u64).into() } else { rate.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rates of the channels come in any order.
    #[test]
    fn a_rate_that_several_channels_have_is_warned_of_once() {
        let (rates, warnings) = Rates { slow: vec![10.4, 20.7, 10.4], fast: 20.7 }.whole().unwrap();
        assert_eq!((rates.slow, rates.fast), (vec![10.0, 21.0, 10.0], 21.0));
        let said = |rate: &str, whole: &str| {
            format!("WAV headers hold whole hertz: {rate} Hz is written as {whole} Hz")
        };
        assert_eq!(warnings, [said("10.4", "10"), said("20.7", "21")]);
    }
}
