//! The analog signal that `simulate` is asked for.

use super::capture_file::{CaptureFile, ReadingRules};
use super::print::Failure;
use hybank::design::Problem;
use hybank::messages::Quoted;
use hybank::simulate::{self, Analog, ComplexSource, MOST_SAMPLES, Periodic, Source};
use hybank::spec::Spec;
use hybank::units::FastPeriods;
use std::path::Path;

/// What the signal is.
#[derive(Debug, clap::Args)]
pub(super) struct SignalArgs {
    /// The analog signal
    #[arg(long)]
    source: String,
    /// The imaginary part of a complex signal: a real source or FILE.wav
    #[arg(long, value_name = "SOURCE", hide_short_help = true)]
    imaginary: Option<String>,
    /// Channel of each WAV recording, counted from 1; a mono recording needs none
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u16).range(1..), hide_short_help = true)]
    channel: Option<u16>,
}

impl SignalArgs {
    /// The sources, which may be names of files.
    pub(super) fn names(&self) -> impl Iterator<Item = &Path> {
        std::iter::once(&self.source).chain(&self.imaginary).map(Path::new)
    }
}

/// An analog signal in normalised time.
pub(super) struct DescribedSignal {
    pub(super) analog: simulate::Signal,
    /// As it was understood.
    pub(super) text: String,
    /// As it was given.
    pub(super) given: String,
}

impl DescribedSignal {
    /// From --source and --imaginary.
    pub(super) fn read(args: &SignalArgs, spec: &Spec) -> Result<Self, Failure> {
        let reader = SignalReader { args, spec };
        reader.check_channel()?;
        let (mut analog, text) = reader.source()?;
        let Some(part) = &args.imaginary else {
            return Ok(Self { analog, text, given: args.source.clone() });
        };
        if analog.imaginary.is_some() {
            return Err(Failure::Usage(format!(
                "--imaginary: the source {} has an imaginary part of its own; give one of the two",
                Quoted(&args.source)
            )));
        }
        let (imaginary, its_text) = reader.imaginary(part)?;
        analog.imaginary = Some(imaginary);
        let text = format!("{text}, and as imaginary part {its_text}");
        Ok(Self { analog, text, given: format!("{} --imaginary {part}", args.source) })
    }

    /// Warns of tones without a unit in a spec whose time is in seconds.
    pub(super) fn warning(&self, spec: &Spec) -> Option<String> {
        let is_doubtful = !spec.is_normalised() && has_bare_tones(&self.given);
        is_doubtful
            .then(|| "a frequency of a tone without a unit is in rad/s; write tones:440Hz for hertz".into())
    }

    pub(super) fn is_complex(&self) -> bool {
        self.analog.imaginary.is_some()
    }

    /// As [`simulate::Signal::frames`].
    pub(super) fn frames(
        &self,
        problem: &Problem,
        samples: Option<usize>,
        jittered: bool,
    ) -> Result<usize, Failure> {
        let frames = self.analog.frames(problem, samples, jittered);
        frames.map_err(|error| Failure::Input(format!("{}: {error}", Quoted(&self.given))))
    }
}

struct SignalReader<'a> {
    args: &'a SignalArgs,
    spec: &'a Spec,
}

impl SignalReader<'_> {
    /// Refuses --channel where there is no recording.
    fn check_channel(&self) -> Result<(), Failure> {
        let given = [Some(&self.args.source), self.args.imaginary.as_ref()];
        match self.args.channel {
            Some(channel) if !given.into_iter().flatten().any(|source| is_recording(source)) => {
                Err(Failure::Usage(format!(
                    "--channel {channel}: the source {} is no WAV recording; leave the option out",
                    Quoted(&self.args.source)
                )))
            }
            _ => Ok(()),
        }
    }

    /// The source, and its text.
    fn source(&self) -> Result<(simulate::Signal, String), Failure> {
        let text = &self.args.source;
        if is_recording(text) {
            let real = self.recording(text)?;
            return Ok((simulate::Signal { real, imaginary: None }, Quoted(text).to_string()));
        }
        let source: ComplexSource =
            text.parse().map_err(|error| Failure::Usage(format!("--source: {error}")))?;
        Ok((simulate::Signal::of_source(&source, self.spec.fast_period), source.to_string()))
    }

    fn imaginary(&self, text: &str) -> Result<(Analog, String), Failure> {
        if is_recording(text) {
            return Ok((self.recording(text)?, Quoted(text).to_string()));
        }
        let source: Source = text.parse().map_err(|error| Failure::Usage(format!("--imaginary: {error}")))?;
        Ok((Analog::Known(source.normalised(self.spec.fast_period)), source.to_string()))
    }

    fn recording(&self, text: &str) -> Result<Analog, Failure> {
        let path = Path::new(text);
        let reading = ReadingRules::channel(self.args.channel.map(usize::from), MOST_SAMPLES);
        let recording = CaptureFile::read(path, reading)?;
        let (rate, samples) = (recording.rate, recording.finite(path)?);
        // In normalised time the recording's own rate is the fast rate.
        let fast = if self.spec.is_normalised() { rate } else { self.spec.fast_period.rate() };
        Ok(Analog::Recorded(Periodic::new(&samples, FastPeriods(fast / rate))))
    }
}

/// Whether a tone of a source such as `step@1+tones:440,1kHz` has a number without a unit.
fn has_bare_tones(source: &str) -> bool {
    let tones = source.split('+').filter_map(|part| part.split_once("tones:"));
    tones.flat_map(|(_, list)| list.split(',')).any(|tone| tone.trim().parse::<f64>().is_ok())
}

fn is_recording(source: &str) -> bool {
    Path::new(source).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("wav"))
}

#[cfg(test)]
mod tests {
    use super::has_bare_tones;

    #[test]
    fn tones_without_a_unit_are_found() {
        for (source, is_bare) in [
            ("tones:440", true),
            ("tones:440Hz,1e3", true),
            ("step@1+ctones:-2", true),
            ("tones:440Hz,1 kHz", false),
            ("step@1", false),
            ("speech.wav", false),
        ] {
            assert_eq!(has_bare_tones(source), is_bare, "{source}");
        }
    }
}
