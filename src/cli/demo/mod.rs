//! `hybank demo`: designs, captures and fuses one example, and compares the error with other methods.

mod contenders;
mod pictures;
mod spline;

use super::Failure;
use super::bank_file::write_text;
use super::recordings::{Mono, write_recordings};
use crate::design::{self, Problem};
use crate::simulate::{Analog, Source, Tone, capture, target};
use crate::spec::Spec;
use crate::units::{Hertz, Seconds};
use contenders::{Contender, contend};
use pictures::Pictures;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Two 24 kHz converters in place of one at 48 kHz.
const SPEC: &str = include_str!("../../../filters/speech-2x.toml");
const DURATION: Seconds = Seconds(2.0);
const STEP_AT: Seconds = Seconds(1.000_01);
/// Fast samples at the beginning that the error does not include, while the history of the filters fills.
const SETTLING: usize = 200;

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
    let step = Analog::Known(step().normalised(spec.fast_period));
    let step = target(&problem, &step, frames, problem.latency);
    let pictures = Pictures { spec: &spec, captured: &captured, step: &step, contenders: &contenders };
    args.save(&folder, &pictures)?;
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
        step(),
    ])
}

fn step() -> Source {
    Source::Step { at: STEP_AT, height: 0.25 }
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
        for (name, svg) in pictures.all().map_err(Failure::input)? {
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
