//! `hybank demo`: designs, captures and fuses one example, and compares the error with other methods.

use super::contenders::{Contender, PartCaptures, SETTLING, contend};
use super::print::{Failure, failed, failed_at, show};
use super::written::{Mono, create_folder, write_recordings, write_text};
use hybank::design::{self, Problem};
use hybank::messages::Quoted;
use hybank::plot::{Chart, Marks, PlotError, Series};
use hybank::simulate::{Analog, Captured, Source, Tone, capture};
use hybank::spec::Spec;
use hybank::units::{Decibels, Hertz, Seconds};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Two 24 kHz converters in place of one at 48 kHz.
const SPEC: &str = include_str!("../filters/speech-2x.toml");
const DURATION: Seconds = Seconds(2.0);
const STEP_AT: Seconds = Seconds(1.000_01);

/// Compares hybank with other methods on a signal whose exact samples are known
///
/// Two virtual 24 kHz converters with delays of 1.2 and 0.6 fast samples capture a chirp, three tones and a
/// step. Two hybank banks, separate fractional delays, sinc interpolation, a cubic spline and plain
/// interleaving fuse the captures to 48 kHz. Each result is compared with the exact fast samples. WAV files
/// and charts are written to a folder.
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

pub(super) fn run(args: &Args) -> Result<(), Failure> {
    let folder = args.folder()?;
    let spec = Spec::from_toml(SPEC, "filters/speech-2x.toml").map_err(failed)?;
    let problem = Problem::new(&spec, design::Sizing::of(&spec).map_err(failed)?.latency).map_err(failed)?;
    let frames = (DURATION / (spec.fast_period * spec.ratio as f64)) as usize;
    let captured =
        |source: Source| capture(&problem, &Analog::Known(source.normalised(spec.fast_period)), frames);
    let parts = PartCaptures { in_band: captured(in_band()), step: captured(step()) };
    let contenders = contend(&spec, &problem, &parts)?;
    let pictures =
        Pictures { spec: &spec, captured: &parts.sum(), step: &parts.step.target, contenders: &contenders };
    args.save(&folder, &pictures)?;
    let report = serde_json::json!({ "folder": folder, "contenders": contenders });
    show(&report, args.json, |_| text(&folder, &contenders))
}

/// A chirp and three tones.
fn in_band() -> Source {
    let tone = |f: Hertz, amplitude: f64| Tone { omega: f.angular(), amplitude, phase: 0.3 };
    Source::Sum(vec![
        Source::Chirp { start: Hertz(50.0), end: Hertz(13_000.0), length: DURATION, amplitude: 0.3 },
        Source::Tones(vec![tone(Hertz(440.0), 0.15), tone(Hertz(3100.0), 0.1), tone(Hertz(12_300.0), 0.05)]),
    ])
}

fn step() -> Source {
    Source::Step { at: STEP_AT, height: 0.25 }
}

impl Args {
    fn folder(&self) -> Result<PathBuf, Failure> {
        let folder = self.output.clone().unwrap_or_else(unused_folder);
        if folder.exists() && !self.force {
            return Err(failed_at(&folder, "exists already; use --force to replace the files in it"));
        }
        create_folder(&folder)?;
        Ok(folder)
    }

    fn save(&self, folder: &Path, pictures: &Pictures<'_>) -> Result<(), Failure> {
        let Pictures { spec, captured, contenders, .. } = pictures;
        let fast = spec.fast_period.rate().0.round() as u32;
        let slow = fast / spec.ratio as u32;
        let channels = captured.channels.iter().enumerate();
        let mut files: Vec<_> = channels
            .map(|(i, samples)| {
                (folder.join(format!("ch{}.wav", i + 1)), Mono::wav(samples, f64::from(slow)))
            })
            .collect();
        files.push((folder.join("target.wav"), Mono::wav(&captured.target, f64::from(fast))));
        let fused = |contender: &'_ Contender| folder.join(&contender.file);
        files.extend(contenders.iter().map(|c| (fused(c), Mono::wav(&c.samples, f64::from(fast)))));
        let files: Vec<_> = files.iter().map(|(path, mono)| (path.as_path(), *mono)).collect();
        write_recordings(&files, self.force)?;
        for (name, svg) in pictures.all().map_err(failed)? {
            write_text(&folder.join(name), &svg, self.force)?;
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

fn text(folder: &Path, contenders: &[Contender]) -> String {
    let mut text = String::from(
        "Two 24 kHz converters, delays 1.2 and 0.6 fast samples, fused to 48 kHz.\n\
         Signal: chirp 50 Hz..13 kHz and three tones, all in the band of the spec (14 kHz), and a step.\n\
         Errors against the exact fast samples.\n\n\
         method                               SNR (dB): chirp, tones    step    max error\n",
    );
    for Contender { name, in_band, step, .. } in contenders {
        let (snr, step_snr, most) = (in_band.snr_db.0, step.snr_db.0, in_band.max_error + step.max_error);
        let _ = writeln!(text, "{name:<44} {snr:>16.1} {step_snr:>7.1} {most:>12.1e}");
    }
    let _ = writeln!(
        text,
        "\nThe third row has no [signal] in its spec: that bank counts inputs of any frequency alike."
    );
    let _ = writeln!(text, "The WAV files, step.svg and error.svg are in {}.", Quoted(folder));
    text
}

/// Interval over which the error is averaged.
const ERROR_INTERVAL: Seconds = Seconds(0.02);
/// Fast samples before and after the step that are drawn.
const BEFORE_STEP: usize = 12;
const AFTER_STEP: usize = 36;

/// What the pictures show.
struct Pictures<'a> {
    spec: &'a Spec,
    captured: &'a Captured,
    /// What an ideal fast converter gives for the step alone.
    step: &'a [f64],
    contenders: &'a [Contender],
}

impl Pictures<'_> {
    /// Names of files and their SVG text.
    fn all(&self) -> Result<[(&'static str, String); 2], PlotError> {
        Ok([("step.svg", self.around_the_step().to_svg()?), ("error.svg", self.errors().to_svg()?)])
    }

    /// The samples around the step: those of the first and the last contender as marks on the exact curve,
    /// and the step without the other signals.
    fn around_the_step(&self) -> Chart {
        let latency = self.spec.latency.unwrap_or(0);
        let centre = STEP_AT.in_fast_periods(self.spec.fast_period).0 as usize + latency;
        let time = |n: usize| (self.spec.fast_period * (n as f64 - latency as f64)).0 - STEP_AT.0;
        let window = centre - BEFORE_STEP..centre + AFTER_STEP;
        let curve = |label: &str, samples: &[f64]| Series {
            label: label.into(),
            points: window.clone().map(|n| (time(n) * 1e3, samples[n])).collect(),
        };
        let marks = |contender: &Contender| Marks {
            label: contender.name.into(),
            colour: None,
            are_rings: false,
            points: window.clone().map(|n| (time(n) * 1e3, contender.samples[n], String::new())).collect(),
        };
        let shown = self.contenders.first().into_iter().chain(self.contenders.last());
        let curves = vec![
            curve("ideal fast converter", &self.captured.target),
            curve("its response to the step alone", self.step),
        ];
        let title = "Around the step: chirp, tones and step through the converters";
        let chart = Chart::lines(title, "time after the step, ms", "amplitude, 1 = full scale", curves);
        Chart { marks: shown.map(marks).collect(), ..chart }
    }

    /// RMS error in decibels over intervals of 20 ms. The chirp sweeps with time, so time stands for
    /// frequency.
    fn errors(&self) -> Chart {
        let period = self.spec.fast_period;
        let interval = ERROR_INTERVAL.in_fast_periods(period).0 as usize;
        let target = &self.captured.target;
        let level = |samples: &[f64], start: usize| {
            let power: f64 = (start..start + interval).map(|n| (samples[n] - target[n]).powi(2)).sum::<f64>()
                / interval as f64;
            Decibels::of_power(power.max(1e-30)).0
        };
        let curve = |contender: &Contender| Series {
            label: contender.name.into(),
            points: (SETTLING..target.len() - interval)
                .step_by(interval)
                .map(|start| ((period * start as f64).0, level(&contender.samples, start)))
                .collect(),
        };
        let title = "Error while the chirp rises from 50 Hz to 13 kHz, step at 1 s";
        let curves = self.contenders.iter().map(curve).collect();
        Chart::lines(title, "time, s", "RMS error in 20 ms, dB of full scale", curves)
    }
}
