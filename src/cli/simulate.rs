//! `hybank simulate`: what the slow converters would have captured.

use super::Failure;
use super::bank_file::load_spec_or_bank;
use super::recordings::{read_mono, write_mono};
use crate::design::{self, Problem};
use crate::io::PcmFormat;
use crate::simulate::{Analog, Captured, Recording, Source, capture, panels};
use crate::spec::Spec;
use std::path::{Path, PathBuf};

/// A bank in normalised time has no rate of its own; its captures are labelled as parts of this one, hertz.
const NORMALISED_RATE: f64 = 48_000.0;
/// Fewest fast samples of an analytic source where none are asked for (thesis 5.6).
const DEFAULT_SAMPLES: f64 = 200.0;
/// Most fast samples of a simulation: captures are made in memory.
const MOST_SAMPLES: usize = 1 << 28;
/// Most quadrature panels of a chirp for each converter: some ten seconds.
const MOST_PANELS: f64 = 2e7;

/// Simulates what the slow converters capture
///
/// Writes ch1.wav, ch2.wav, .. at the slow rate and target.wav, what an ideal fast converter gives, late by
/// the latency. Analytic sources are answered exactly; a WAV recording is taken as a periodic,
/// band-limited analog signal.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Sources:
  step@0.3                  0 before 0.3 s, 1 from then on (also 300ms, 5us, 2ns)
  tones:0.3,0.8             cosines of amplitude 1, angular frequencies in rad/s
  tones:440Hz,1kHz          the same in hertz
  chirp:50Hz..8kHz@2s       a linear sweep
  step@1+tones:440Hz        the sum
  FILE.wav                  a mono recording

Examples:
  hybank simulate spec.toml --source step@0.3 -o captures
  hybank simulate bank.json --source speech.wav -o captures
  hybank simulate bank.json --source tones:440Hz,1kHz --samples 96000 -o captures")]
pub(super) struct Args {
    /// A spec (TOML) or a bank (JSON)
    spec: PathBuf,
    /// The analog signal
    #[arg(long)]
    source: String,
    /// The folder for the captures; made if it is not there
    #[arg(short, long)]
    output: PathBuf,
    /// Fast samples to make (analytic sources; rounded up to whole ticks) [default: until all has happened, at least 200]
    #[arg(long)]
    samples: Option<usize>,
    /// Factor on the source
    #[arg(long, default_value_t = 1.0, allow_hyphen_values = true)]
    gain: f64,
    /// Replace existing files
    #[arg(long)]
    force: bool,
    /// Print a report as one JSON object
    #[arg(long)]
    json: bool,
}

#[derive(Debug, serde::Serialize)]
struct Report {
    files: Vec<String>,
    ticks: usize,
    slow_rate: u32,
    fast_rate: u32,
    latency: usize,
    warnings: Vec<String>,
}

/// Runs the verb.
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
        warnings.push(format!("the spec leaves the latency open; {latency} fast samples are used"));
    }
    let (signal, samples) = args.signal(&spec)?;
    let ticks = args.ticks(samples, spec.ratio)?;
    args.check_work(&problem, &signal, ticks)?;
    let mut captured = capture(&problem, &signal, ticks);
    args.scale(&mut captured)?;
    let mut files = vec![];
    for (i, samples) in captured.channels.iter().enumerate() {
        files.push((format!("ch{}.wav", i + 1), samples, rates.slow));
    }
    files.push(("target.wav".to_owned(), &captured.target, rates.fast));
    write_all(&args.output, &files, args.force)?;
    let names = files.iter().map(|(name, ..)| args.output.join(name).display().to_string()).collect();
    Report { files: names, ticks, slow_rate: rates.slow, fast_rate: rates.fast, latency, warnings }
        .print(args.json)
}

impl Args {
    /// The signal in fast periods and how many fast samples it lasts.
    fn signal(&self, spec: &Spec) -> Result<(Analog, usize), Failure> {
        let path = Path::new(&self.source);
        if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("wav")) {
            let (samples, rate) = read_mono(path)?;
            // In normalised time the recording's own rate is the fast one.
            let fast = if spec.fast_period == 1.0 { f64::from(rate) } else { 1.0 / spec.fast_period };
            let recording = Recording::new(&samples, fast / f64::from(rate));
            let length = (recording.duration() * (1.0 + 1e-12)).floor() as usize;
            return Ok((
                Analog::Recorded(recording),
                self.samples.unwrap_or(length / spec.ratio * spec.ratio),
            ));
        }
        let source: Source =
            self.source.parse().map_err(|error| Failure::Usage(format!("--source: {error}")))?;
        let source = source.in_unit(spec.fast_period);
        let length =
            source.duration().unwrap_or(0.0).ceil().clamp(DEFAULT_SAMPLES, MOST_SAMPLES as f64 + 1.0);
        Ok((Analog::Known(source), self.samples.unwrap_or(length as usize)))
    }

    /// A chirp, or a front end behind which one is captured, may be too fast for its quadrature.
    fn check_work(&self, problem: &Problem, signal: &Analog, ticks: usize) -> Result<(), Failure> {
        let Analog::Known(source) = signal else { return Ok(()) };
        let span = ticks as f64 * problem.ratio as f64;
        let work = problem.front_ends.iter().map(|filter| panels(filter, source, span)).fold(0.0, f64::max);
        if work <= MOST_PANELS {
            return Ok(());
        }
        Err(Failure::Input(format!(
            "{}: the chirp or a front end is too fast for the fast rate: {work:.1e} integration steps, at most \
             {MOST_PANELS:.0e} are made; check the units of frequencies and fast_period, or ask for fewer --samples",
            self.source
        )))
    }

    /// Applies the gain; what a 32-bit float cannot hold is refused, not written as infinity.
    fn scale(&self, captured: &mut Captured) -> Result<(), Failure> {
        let recordings = captured.channels.iter_mut().chain(std::iter::once(&mut captured.target));
        for x in recordings.flatten() {
            *x *= self.gain;
            if x.is_nan() || x.abs() > f64::from(f32::MAX) {
                return Err(Failure::Input(format!(
                    "{}: a captured sample is {x:e}, more than a 32-bit float holds; use a smaller --gain",
                    self.source
                )));
            }
        }
        Ok(())
    }

    fn ticks(&self, samples: usize, ratio: usize) -> Result<usize, Failure> {
        if samples == 0 {
            return Err(Failure::Input(format!(
                "{}: shorter than one slow sample, nothing to capture",
                self.source
            )));
        }
        if samples > MOST_SAMPLES {
            return Err(Failure::Input(format!(
                "{}: {samples} fast samples, but a simulation holds at most {MOST_SAMPLES}; ask for fewer with --samples",
                self.source
            )));
        }
        Ok(samples.div_ceil(ratio))
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
        let slow = if spec.fast_period == 1.0 {
            (NORMALISED_RATE / ratio).round().max(1.0)
        } else {
            1.0 / (spec.fast_period * ratio)
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
                warnings
                    .push(format!("WAV headers hold whole hertz: {rate} Hz is written as {}", rate.round()));
            }
        }
        Ok((Self { slow: slow.round() as u32, fast: fast.round() as u32 }, warnings))
    }
}

fn write_all(folder: &Path, files: &[(String, &Vec<f64>, u32)], force: bool) -> Result<(), Failure> {
    std::fs::create_dir_all(folder)
        .map_err(|error| Failure::Input(format!("{}: cannot make the folder: {error}", folder.display())))?;
    // All or nothing: look at every name before the first file is written.
    let taken = files.iter().map(|(name, ..)| folder.join(name)).find(|path| path.symlink_metadata().is_ok());
    if let (false, Some(path)) = (force, taken) {
        return Err(Failure::Input(format!("{}: exists already; use --force to replace it", path.display())));
    }
    files.iter().try_for_each(|(name, samples, rate)| {
        write_mono(&folder.join(name), samples, *rate, PcmFormat::F32Le, force)
    })
}

impl Report {
    fn print(&self, json: bool) -> Result<(), Failure> {
        for warning in &self.warnings {
            eprintln!("hybank: warning: {warning}");
        }
        if json {
            return super::print_json(self);
        }
        super::print(&format!(
            "{} ticks at {} Hz, target at {} Hz late by {} samples:\n  {}\n",
            self.ticks,
            self.slow_rate,
            self.fast_rate,
            self.latency,
            self.files.join("\n  ")
        ))
    }
}
