//! `hybank demo`: designs, captures and fuses one example, and compares the error with other methods.

use super::Failure;
use super::bank_file::write_text;
use super::recordings::{Mono, write_recordings};
use crate::bank::Bank;
use crate::design::{self, Problem};
use crate::plot::{Chart, Series};
use crate::runtime::{Options, Precision, Stream};
use crate::simulate::{Analog, Captured, Source, Tone, capture, interleaved};
use crate::spec::{Method, Spec};
use crate::units::{Decibels, Hertz, Seconds};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Two 24 kHz converters in place of one at 48 kHz.
const SPEC: &str = include_str!("../../filters/speech-2x.toml");
const DURATION: Seconds = Seconds(2.0);
const STEP_AT: Seconds = Seconds(1.000_01);
/// Fast samples at the beginning that the error does not include, while the history of the filters fills.
const SETTLING: usize = 200;
/// Interval over which the error is averaged in the chart.
const ERROR_INTERVAL: Seconds = Seconds(0.02);

/// Compares hybank with other methods on a signal whose exact samples are known
///
/// Two virtual 24 kHz converters with delays of 1.2 and 0.6 fast samples capture a chirp, three tones and a
/// step. Two hybank banks, separate fractional delays, sinc interpolation and plain interleaving fuse the
/// captures to 48 kHz. Each result is compared with the exact fast samples. WAV files and charts are
/// written to a folder.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank demo
  hybank demo -o /tmp/demo --force")]
pub(super) struct Args {
    /// The folder to write to [default: hybank-demo, or the first unused hybank-demo-N]
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Replace files in an existing folder
    #[arg(long)]
    force: bool,
    /// Print the results as one JSON object
    #[arg(long)]
    json: bool,
}

/// One method with its fused samples and their error.
#[derive(Debug, serde::Serialize)]
struct Contender {
    name: &'static str,
    file: String,
    gamma: Option<f64>,
    lower: Option<f64>,
    rmse: f64,
    max_error: f64,
    /// 20 log10(rms of the target / rmse).
    snr_db: Decibels,
    #[serde(skip)]
    samples: Vec<f64>,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the one message for the user.
pub(super) fn run(args: &Args) -> Result<(), Failure> {
    let folder = args.folder()?;
    let spec = Spec::from_toml(SPEC, "filters/speech-2x.toml").map_err(Failure::input)?;
    let problem =
        Problem::new(&spec, design::latency(&spec).map_err(Failure::input)?).map_err(Failure::input)?;
    let frames = (DURATION / (spec.fast_period * spec.ratio as f64)) as usize;
    let signal = Analog::Known(signal().normalised(spec.fast_period));
    let captured = capture(&problem, &signal, frames);
    let contenders = contend(&spec, &problem, &captured)?;
    args.save(&folder, &spec, &captured, &contenders)?;
    if args.json {
        return super::print_json(&serde_json::json!({ "folder": folder, "contenders": contenders }));
    }
    super::print(&report(&folder, &contenders))
}

/// A chirp, three tones and a step.
fn signal() -> Source {
    let tone = |f: Hertz, amplitude: f64| Tone { omega: f.angular(), amplitude, phase: 0.3 };
    Source::Sum(vec![
        Source::Chirp { start: Hertz(50.0), end: Hertz(8000.0), length: DURATION, amplitude: 0.3 },
        Source::Tones(vec![tone(Hertz(440.0), 0.15), tone(Hertz(3100.0), 0.1), tone(Hertz(6300.0), 0.05)]),
        Source::Step { at: STEP_AT, height: 0.25 },
    ])
}

fn contend(spec: &Spec, problem: &Problem, captured: &Captured) -> Result<Vec<Contender>, Failure> {
    let mut contenders = Vec::new();
    for (name, method) in [
        ("hybank, FIR 24 taps", Method::Fir),
        ("hybank, IIR", Method::Iir),
        ("separate delays, 24 taps", Method::Separation),
        ("sinc interpolation, 24 taps", Method::Sinc),
    ] {
        let mut variant = spec.clone();
        variant.design = spec.design.with_method(method, spec.channels.len()).map_err(Failure::input)?;
        let bank = design::design_with(&variant, design::ProofSearch::Skip).map_err(Failure::input)?.bank;
        let samples = fuse(&bank, &captured.channels)?;
        contenders.push(Contender::judge(name, method.name(), Some(&bank), samples, &captured.target));
    }
    let plain = interleaved(&problem.delays(), problem.ratio, problem.latency, &captured.channels);
    contenders.push(Contender::judge("plain interleaving", "interleaved", None, plain, &captured.target));
    Ok(contenders)
}

fn fuse(bank: &Bank, channels: &[Vec<f64>]) -> Result<Vec<f64>, Failure> {
    let options = Options { precision: Precision::Double, ..Options::default() };
    let mut stream = Stream::new(&bank.plan(options).map_err(Failure::input)?);
    let count = channels.iter().map(Vec::len).min().unwrap_or(0);
    let frames: Vec<f64> = (0..count).flat_map(|k| channels.iter().map(move |channel| channel[k])).collect();
    let mut fast = vec![0.0; count * bank.ratio];
    stream.process(&frames, &mut fast).map_err(Failure::input)?;
    Ok(fast)
}

impl Contender {
    fn judge(name: &'static str, file: &str, bank: Option<&Bank>, samples: Vec<f64>, target: &[f64]) -> Self {
        let judged = SETTLING..target.len();
        let power = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>();
        let error = |n: usize| samples[n] - target[n];
        let error_power = power(&mut judged.clone().map(error));
        Self {
            name,
            file: format!("fused-{file}.wav"),
            gamma: bank.and_then(|bank| bank.gamma.norm),
            lower: bank
                .filter(|bank| matches!(bank.method, Method::Fir | Method::Iir))
                .and_then(|bank| bank.gamma.lower),
            rmse: (error_power / judged.len() as f64).sqrt(),
            max_error: judged.clone().map(|n| error(n).abs()).fold(0.0, f64::max),
            snr_db: Decibels::of_power(power(&mut target[judged].iter().copied()) / error_power),
            samples,
        }
    }
}

impl Args {
    fn folder(&self) -> Result<PathBuf, Failure> {
        let folder = match &self.output {
            Some(folder) => folder.clone(),
            None => unused_folder(),
        };
        if folder.exists() && !self.force {
            return Err(Failure::Input(format!(
                "{}: exists already; use --force to replace the files in it",
                folder.display()
            )));
        }
        std::fs::create_dir_all(&folder).map_err(|error| {
            Failure::Input(format!("{}: cannot create the folder: {error}", folder.display()))
        })?;
        Ok(folder)
    }

    fn save(
        &self,
        folder: &Path,
        spec: &Spec,
        captured: &Captured,
        contenders: &[Contender],
    ) -> Result<(), Failure> {
        let fast = spec.fast_period.rate().0.round() as u32;
        let slow = fast / spec.ratio as u32;
        let channels = captured.channels.iter().enumerate();
        let mut files: Vec<_> = channels
            .map(|(i, samples)| (folder.join(format!("ch{}.wav", i + 1)), Mono { samples, rate: slow }))
            .collect();
        files.push((folder.join("target.wav"), Mono { samples: &captured.target, rate: fast }));
        let fused = |contender: &'_ Contender| folder.join(&contender.file);
        files.extend(contenders.iter().map(|c| (fused(c), Mono { samples: &c.samples, rate: fast })));
        let files: Vec<_> = files.iter().map(|(path, mono)| (path.as_path(), *mono)).collect();
        write_recordings(&files, self.force)?;
        for (name, chart) in [
            ("step.svg", step_chart(spec, captured, contenders)),
            ("error.svg", error_chart(spec, captured, contenders)),
        ] {
            write_text(&folder.join(name), &chart.to_svg().map_err(Failure::input)?, self.force)?;
        }
        Ok(())
    }
}

fn unused_folder() -> PathBuf {
    let numbered = (2..).map(|n| PathBuf::from(format!("hybank-demo-{n}")));
    std::iter::once(PathBuf::from("hybank-demo"))
        .chain(numbered)
        .find(|path| !path.exists())
        .unwrap_or_default()
}

/// The samples around the step: target, the FIR bank and plain interleaving.
fn step_chart(spec: &Spec, captured: &Captured, contenders: &[Contender]) -> Chart {
    let centre = STEP_AT.in_fast_periods(spec.fast_period).0 as usize;
    let window = centre - 10..centre + 50;
    let points = |samples: &[f64]| {
        window.clone().map(|n| ((spec.fast_period * n as f64).0 * 1e3, samples[n])).collect()
    };
    let mut series = vec![Series { label: "exact fast samples".into(), points: points(&captured.target) }];
    for contender in [&contenders[0], &contenders[contenders.len() - 1]] {
        series.push(Series { label: contender.name.into(), points: points(&contender.samples) });
    }
    Chart { title: "Around the step".into(), x_label: "time (ms)".into(), y_label: "sample".into(), series }
}

/// RMS error in decibels over intervals of 20 ms. The chirp sweeps with time, so time stands for frequency.
fn error_chart(spec: &Spec, captured: &Captured, contenders: &[Contender]) -> Chart {
    let interval = ERROR_INTERVAL.in_fast_periods(spec.fast_period).0 as usize;
    let level = |samples: &[f64], start: usize| {
        let power: f64 =
            (start..start + interval).map(|n| (samples[n] - captured.target[n]).powi(2)).sum::<f64>()
                / interval as f64;
        Decibels::of_power(power.max(1e-30)).0
    };
    let curve = |contender: &Contender| Series {
        label: contender.name.into(),
        points: (SETTLING..captured.target.len() - interval)
            .step_by(interval)
            .map(|start| ((spec.fast_period * start as f64).0, level(&contender.samples, start)))
            .collect(),
    };
    Chart {
        title: "Error against the exact fast samples (chirp 50 Hz to 8 kHz)".into(),
        x_label: "time (s)".into(),
        y_label: "RMS error (dB)".into(),
        series: contenders.iter().map(curve).collect(),
    }
}

fn report(folder: &Path, contenders: &[Contender]) -> String {
    let mut text = String::from(
        "Two 24 kHz converters, delays 1.2 and 0.6 fast samples, fused to 48 kHz.\n\
         Signal: chirp 50 Hz..8 kHz, three tones, a step; error against the exact fast samples.\n\n\
         method                         gamma      RMSE       max error  SNR (dB)\n",
    );
    for contender in contenders {
        let gamma = contender.gamma.map_or_else(|| "-".to_owned(), |gamma| format!("{gamma:.6}"));
        let _ = writeln!(
            text,
            "{:<30} {:<10} {:<10.3e} {:<10.3e} {:>7.1}",
            contender.name, gamma, contender.rmse, contender.max_error, contender.snr_db.0
        );
    }
    if let Some(lower) = contenders[0].lower {
        let _ = writeln!(
            text,
            "\nNo bank with 24 taps per channel has a gamma below {lower:.6} (dual solution of the design problem)."
        );
    }
    let _ = writeln!(text, "The WAV files, step.svg and error.svg are in {}.", folder.display());
    text
}
