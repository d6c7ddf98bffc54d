//! `fuse --bit-true`: integer taps on the integers of the captures, as hardware has them.

use super::before_after;
use super::observer::RunObserver;
use super::output::begin_samples;
use super::print::{Failure, check_strict, failed, name, print, print_report, stopped, warn};
use super::run::{BankRun, each_block};
use hybank::files::commit_all;
use hybank::interchange::{BitTrue, WordSizes};
use hybank::io::{Container, MultiReader, OutputHeader, PcmFormat, RecordedFrames, SampleWriter};
use hybank::messages::Quoted;
use hybank::overview::BeforeAfter;
use hybank::pipeline::DroppedLatency;
use hybank::runtime::{FrameSource, Isa, SideBySide};

/// The options.
#[derive(Debug, Clone, Copy, clap::Args)]
pub(super) struct BitTrueArgs {
    /// Run the integer taps of the bank on the integers of the captures, as hardware and the exported C do:
    /// exact sums, each rounded to the nearest integer, halves upwards, and saturated at the bits of the
    /// captures. The output has their bits
    #[arg(long, conflicts_with_all = ["gaps", "algorithm", "bits", "threads", "report", "track"])]
    bit_true: bool,
    /// Bits of the accumulator with --bit-true; sums that do not fit wrap around
    #[arg(long, value_name = "BITS", requires = "bit_true", default_value_t = 64, value_parser = clap::value_parser!(u8).range(8..=64))]
    accumulator: u8,
}

/// How the words were used.
#[derive(Debug, serde::Serialize)]
struct BitTrueReport {
    samples: u64,
    rate: u64,
    frames: u64,
    latency_dropped: usize,
    bits: u32,
    accumulator_bits: u32,
    /// With so many bits no sum can wrap.
    needed_accumulator_bits: u32,
    /// Sums that wrapped.
    wrapped: u64,
    /// Output samples that saturated.
    saturated: u64,
    /// The figures of plain interleaving and of the output, with --measure.
    #[serde(skip_serializing_if = "Option::is_none")]
    measure: Option<BeforeAfter>,
}

impl BitTrueArgs {
    pub(super) fn is_wanted(self) -> bool {
        self.bit_true
    }

    /// Fuses all that `reader` gives.
    pub(super) fn fuse(
        self,
        job: &BankRun<'_>,
        reader: &mut MultiReader,
        observer: &mut RunObserver,
        measured: impl FnOnce() -> Result<Option<BeforeAfter>, Failure>,
    ) -> Result<(), Failure> {
        let rate = job.output_rate(reader)?;
        let format = integer_format(reader)?;
        let bits = converter_bits(reader).unwrap_or(8 * format.bytes() as u32);
        let words = WordSizes { input: bits, accumulator: self.accumulator.into(), output: bits };
        let model = BitTrue::new(job.bank, words)
            .map_err(|error| Failure::Input(format!("{}: {error}", name(job.bank_path))))?;
        let header = OutputHeader { container: Container::Wav, format, is_complex: false, rate };
        let output = begin_samples(job.output, header, job.args.force).map_err(stopped)?;
        let skip = if job.dropped == DroppedLatency::All { job.bank.output_delay() } else { 0 };
        let mut run =
            ModelRun { model, output, format, bits, skip, owed: skip, ratio: job.bank.ratio, samples: 0 };
        each_block(reader, observer, |_, recordings| run.process(recordings))?;
        let frames = reader.consumed();
        run.flush()?;
        let mut report = BitTrueReport {
            samples: run.samples,
            rate: rate.round() as u64,
            frames,
            latency_dropped: skip,
            bits,
            accumulator_bits: self.accumulator.into(),
            needed_accumulator_bits: run.model.needed_bits(),
            wrapped: run.model.wraps(),
            saturated: run.model.saturations(),
            measure: None,
        };
        let warnings: Vec<String> =
            reader.warnings().iter().map(ToString::to_string).chain(run.model.warnings()).collect();
        check_strict(&warnings, job.args.strict)?;
        commit_all(run.output.finish().map_err(stopped)?).map_err(failed)?;
        warnings.iter().for_each(|warning| warn(warning));
        report.measure = measured()?;
        match &report.measure {
            _ if job.args.json => print_report(&report, job.output),
            Some(figures) => print(&before_after::text(figures)),
            None => Ok(()),
        }
    }
}

/// The integer format that all inputs have, as it is written.
fn integer_format(reader: &MultiReader) -> Result<PcmFormat, Failure> {
    let mut formats =
        reader.headers().map(|(input, header)| (input, header.layout.format, header.is_complex));
    let Some((first, format, is_complex)) = formats.next() else {
        return Err(failed("--bit-true: there is no input"));
    };
    let written = match format {
        _ if is_complex => None,
        PcmFormat::S16Le | PcmFormat::S16Be => Some(PcmFormat::S16Le),
        PcmFormat::S24Le | PcmFormat::S24Be => Some(PcmFormat::S24Le),
        PcmFormat::S32Le | PcmFormat::S32Be => Some(PcmFormat::S32Le),
        _ => None,
    };
    let Some(written) = written else {
        return Err(Failure::Input(format!(
            "{}: --bit-true takes real integers of 16, 24 or 32 bits, and these are {}; convert the capture",
            Quoted(first),
            format.name()
        )));
    };
    match formats.find(|(_, other, _)| other.bytes() != format.bytes() || other.is_float()) {
        Some((input, other, _)) => Err(Failure::Input(format!(
            "{}: its samples are {}, and those of {} are {}; --bit-true needs words of the same bits",
            Quoted(input),
            other.name(),
            Quoted(first),
            format.name()
        ))),
        None => Ok(written),
    }
}

/// The bits of the converters, whose codes reach 1 - 2^(1 - bits) of full scale.
fn converter_bits(reader: &MultiReader) -> Option<u32> {
    let (_, header) = reader.headers().next()?;
    let (_, highest) = header.rails?;
    Some((1.0 - (1.0 - highest).log2()).round() as u32)
}

/// A model that runs.
struct ModelRun {
    model: BitTrue,
    output: SampleWriter,
    format: PcmFormat,
    /// Of the converters.
    bits: u32,
    /// Output samples that are still to be dropped.
    skip: usize,
    /// The latency that is dropped, and made up for at the end.
    owed: usize,
    ratio: usize,
    samples: u64,
}

impl ModelRun {
    /// Frames without a signal, until M samples have come out for each frame of the captures.
    fn flush(&mut self) -> Result<(), Failure> {
        let (frames, resting) = (self.owed.div_ceil(self.ratio), self.model.resting());
        let mut fast = self.model.filtered(&resting.repeat(frames));
        fast.truncate(self.owed);
        self.write(&fast)
    }

    fn process(&mut self, recordings: &[RecordedFrames<'_>]) -> Result<(), Failure> {
        let parts: Vec<_> = recordings.iter().map(|recording| recording.real).collect();
        let all = SideBySide::new(parts);
        let mut numbers = vec![0.0f64; all.frames() * all.channels()];
        all.load_f64(Isa::detect(), 0, &mut numbers);
        // A power of two: the product is the integer itself.
        let frames: Vec<i32> = numbers.iter().map(|x| (x * self.full_scale()) as i32).collect();
        let fast = self.model.filtered(&frames);
        self.write(&fast)
    }

    /// The integer that stands for 1.
    fn full_scale(&self) -> f64 {
        (f64::from(self.bits) - 1.0).exp2()
    }

    fn write(&mut self, fast: &[i32]) -> Result<(), Failure> {
        let dropped = self.skip.min(fast.len());
        self.skip -= dropped;
        let fast = &fast[dropped..];
        let size = self.format.bytes();
        let full_scale = self.full_scale();
        let mut bytes = vec![0; fast.len() * size];
        for (slot, y) in bytes.chunks_exact_mut(size).zip(fast) {
            self.format.encode(f64::from(*y) / full_scale, slot);
        }
        self.samples += fast.len() as u64;
        self.output.write(&bytes).map_err(stopped)
    }
}
