//! The instants of all samples on the clock of the first source, and their gains.

use super::error::{MergeError, MergeWarning};
use super::{Recorder, SourceEstimate};
use crate::align::{AlignSettings, AlignWarning, align};
use crate::calibrate::Record;
use crate::instants::{
    Clock, ClockError, Converter, Estimator, FusionSettings, Recording, Signals, Spectrum, fuse,
};
use crate::linalg::Complex;
use crate::sine_fit::Estimate;
use crate::spec::Spec;
use crate::units::{CyclesPerFastPeriod, FastPeriods, Hertz, Seconds};
use std::ops::RangeInclusive;

/// Relative difference of rates that count as one.
const SAME_RATE: f64 = 0.001;
/// Samples on either side from which a recording is brought to another rate.
const REACH: usize = 16;
/// The part of the lower one of two rates that is kept of a signal.
const KEPT: f64 = 0.45;
/// Means that differ by more standard deviations of the means of white samples differ by a bias.
const BIAS_SIGMAS: f64 = 3.0;

/// Recordings with their clocks, in periods of the output.
pub(super) struct Clocked {
    pub(super) recordings: Vec<Recording>,
    pub(super) found: Vec<SourceEstimate>,
    pub(super) gains: Vec<f64>,
    /// Relative to the gains.
    pub(super) gain_deviations: Vec<f64>,
    /// Of all instants of a recording.
    pub(super) delay_deviations: Vec<FastPeriods>,
    /// The mean of the first source, which is subtracted from all.
    pub(super) level: f64,
    pub(super) warnings: Vec<MergeWarning>,
}

/// Where all sources lie in time.
///
/// # Errors
/// [`MergeError`].
pub(super) fn placed(
    sources: &[Recorder],
    rate: Hertz,
    within: Option<Seconds>,
) -> Result<Clocked, MergeError> {
    if let Some(flat) = sources.iter().find(|source| is_flat(&source.record)) {
        return Err(MergeError::NoSignal { name: flat.name.clone() });
    }
    let has_stamps = |source: &&Recorder| source.stamps.is_some();
    match (sources.iter().find(has_stamps), sources.iter().find(|source| !has_stamps(source))) {
        (Some(stamped), Some(plain)) => {
            Err(MergeError::SomeStamps { stamped: stamped.name.clone(), plain: plain.name.clone() })
        }
        (Some(_), None) => by_stamps(sources, rate),
        _ if sources.len() == 1 => Ok(alone(&sources[0], rate)),
        _ => by_alignment(sources, rate, within),
    }
}

/// Whether all usable samples are equal.
fn is_flat(record: &Record) -> bool {
    let mut usable = record.samples.iter().zip(&record.keep).filter(|(_, keep)| **keep).map(|(x, _)| *x);
    let first = usable.next();
    usable.all(|x| Some(x) == first)
}

/// The samples, NaN where they are not usable, with the mean of those that are.
fn usable(record: &Record) -> (Vec<f64>, f64) {
    let samples: Vec<f64> =
        record.samples.iter().zip(&record.keep).map(|(x, keep)| if *keep { *x } else { f64::NAN }).collect();
    let there = samples.iter().filter(|x| x.is_finite());
    let (sum, count) = there.fold((0.0, 0_usize), |(sum, count), x| (sum + x, count + 1));
    (samples, sum / count.max(1) as f64)
}

fn recording(samples: &[f64], clock: Clock, number: usize, level: f64) -> Recording {
    Recording::new(samples.iter().map(|x| x - level).collect(), clock, number)
}

fn plain(start: Seconds) -> SourceEstimate {
    SourceEstimate { start, drift: None, gain: None, noise: 0.0, steps: Vec::new() }
}

fn alone(source: &Recorder, rate: Hertz) -> Clocked {
    let (samples, level) = usable(&source.record);
    let clock = Clock::even(FastPeriods(0.0), FastPeriods(rate.0 / source.rate.0));
    Clocked {
        recordings: vec![recording(&samples, clock, 0, level)],
        found: vec![plain(Seconds(0.0))],
        gains: vec![1.0],
        gain_deviations: vec![0.0],
        delay_deviations: vec![FastPeriods(0.0)],
        level,
        warnings: Vec::new(),
    }
}

/// Number, mean and variance of the usable samples of a source whose stamps lie in a span.
struct SpanMean {
    count: f64,
    mean: f64,
    variance: f64,
}

impl SpanMean {
    /// `None` of fewer than two samples.
    fn new(source: &Recorder, span: &RangeInclusive<f64>) -> Option<Self> {
        let all = source.stamps.iter().flatten().zip(usable(&source.record).0);
        let there = all.filter(|(stamp, x)| span.contains(&stamp.0) && x.is_finite()).map(|(_, x)| x);
        let samples: Vec<f64> = there.collect();
        let count = samples.len() as f64;
        let mean = samples.iter().sum::<f64>() / count;
        let variance = samples.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count;
        (samples.len() > 1).then_some(Self { count, mean, variance })
    }
}

/// By how much the mean of a source differs from that of the first one, over the time that both have in
/// common; `None` if chance explains it.
fn bias(first: &Recorder, source: &Recorder) -> Option<f64> {
    let ends =
        |source: &Recorder| Some([source.stamps.as_ref()?.first()?.0, source.stamps.as_ref()?.last()?.0]);
    let [[begin, end], [own_begin, own_end]] = [ends(first)?, ends(source)?];
    let span = begin.max(own_begin)..=end.min(own_end);
    let (usual, own) = (SpanMean::new(first, &span)?, SpanMean::new(source, &span)?);
    let bias = own.mean - usual.mean;
    let by_chance = (usual.variance / usual.count + own.variance / own.count).sqrt();
    (bias.abs() > BIAS_SIGMAS * by_chance).then_some(bias)
}

fn by_stamps(sources: &[Recorder], rate: Hertz) -> Result<Clocked, MergeError> {
    let stamps = |source: &Recorder| source.stamps.clone().unwrap_or_default();
    let origin = stamps(&sources[0]).first().copied().unwrap_or(Seconds(0.0));
    let level = usable(&sources[0].record).1;
    let (mut recordings, mut found, mut warnings) = (Vec::new(), Vec::new(), Vec::new());
    for (number, source) in sources.iter().enumerate() {
        let bias = if number > 0 { bias(&sources[0], source) } else { None };
        let named =
            |bias| MergeWarning::Bias { name: source.name.clone(), first: sources[0].name.clone(), bias };
        warnings.extend(bias.map(named));
        let stamps = stamps(source);
        let instants: Vec<FastPeriods> =
            stamps.iter().map(|stamp| FastPeriods((stamp.0 - origin.0) * rate.0)).collect();
        let refused = |problem: ClockError| MergeError::Stamps { name: source.name.clone(), problem };
        let clock = Clock::stamps(&instants).map_err(refused)?;
        recordings.push(recording(&usable(&source.record).0, clock, number, level + bias.unwrap_or(0.0)));
        found.push(plain(stamps.first().map_or(Seconds(0.0), |first| *first - origin)));
    }
    let count = sources.len();
    Ok(Clocked {
        recordings,
        found,
        gains: vec![1.0; count],
        gain_deviations: vec![0.0; count],
        delay_deviations: vec![FastPeriods(0.0); count],
        level,
        warnings,
    })
}

fn by_alignment(sources: &[Recorder], rate: Hertz, within: Option<Seconds>) -> Result<Clocked, MergeError> {
    let own = sources[0].rate;
    let records: Vec<Record> = sources.iter().map(|source| at_rate(source, own)).collect::<Result<_, _>>()?;
    // The spec counts in samples.
    let settings = AlignSettings { reference: 0, within: within.map(|time| Seconds(time.0 * own.0)) };
    let alignment = align(&spec(sources.len())?, &records, settings)?;
    let level = usable(&sources[0].record).1;
    let ratio = rate.0 / own.0;
    let (mut recordings, mut found) = (Vec::new(), Vec::new());
    for (number, source) in sources.iter().enumerate() {
        let (channel, course) = (alignment.channels[number], alignment.instants(number));
        let offset = if number == 0 { level } else { channel.offset.value + channel.gain.value * level };
        let samples = usable(&source.record).0.into_iter().map(|x| x - offset).collect();
        let spacing = if is_same(source.rate, own) { 1.0 } else { own.0 / source.rate.0 };
        let recording = course.recording(samples, number, spacing, ratio);
        found.push(SourceEstimate {
            start: Seconds(recording.clock().at(0.0).0 / rate.0),
            drift: Some(channel.drift),
            gain: Some(channel.gain),
            noise: 0.0,
            steps: course.steps().to_vec(),
        });
        recordings.push(recording);
    }
    let gains: Vec<Estimate<f64>> = alignment.channels.iter().map(|channel| channel.gain).collect();
    let deviation =
        |i: usize| FastPeriods(ratio * alignment.instants(i).usual_deviation(records[i].samples.len()));
    let delay_deviations = (0..sources.len()).map(deviation).collect();
    // Taps follow the delays, and the predicted error says what coincidences cost.
    let is_of_fixed = |warning: &AlignWarning| {
        matches!(
            warning,
            AlignWarning::FixedTaps { .. } | AlignWarning::Coincidence { .. } | AlignWarning::Values(_)
        )
    };
    let warnings = alignment.warnings.iter().filter(|warning| !is_of_fixed(warning)).cloned();
    Ok(Clocked {
        recordings,
        found,
        gains: gains.iter().map(|gain| gain.value).collect(),
        gain_deviations: gains.iter().map(|gain| gain.sigma / gain.value.abs()).collect(),
        delay_deviations,
        level,
        warnings: warnings.map(MergeWarning::from).collect(),
    })
}

fn is_same(one: Hertz, other: Hertz) -> bool {
    (one.0 / other.0 - 1.0).abs() < SAME_RATE
}

/// The record at the rate `own`, to be compared.
fn at_rate(source: &Recorder, own: Hertz) -> Result<Record, MergeError> {
    if is_same(source.rate, own) {
        return Ok(source.record.clone());
    }
    let (samples, level) = usable(&source.record);
    let period = own.0 / source.rate.0;
    let clock = Clock::even(FastPeriods(0.0), FastPeriods(period));
    let count = ((samples.len().max(1) - 1) as f64 * period) as usize + 1;
    let recordings = [recording(&samples, clock, 0, level)];
    let settings = FusionSettings { first: FastPeriods(0.0), count, reach: REACH };
    let band = CyclesPerFastPeriod(0.0)..CyclesPerFastPeriod(KEPT * (1.0 / period).min(1.0));
    let spectrum = Spectrum::flat(band, settings.longest(&recordings));
    let converters = vec![Converter::exact(0, 1.0, 1e-6)];
    let estimator = Estimator::new(Signals::new(&spectrum, &[&|_| Complex::from(1.0)], 0, converters));
    // The mean again, as it is among what is compared.
    let samples = fuse(&estimator, &recordings, settings)?.samples;
    Ok(Record::new(samples.into_iter().map(|x| x + level).collect()))
}

/// Recorders of one rate with equal front ends; time is in their periods.
fn spec(channels: usize) -> Result<Spec, MergeError> {
    let front = format!("{{ family = \"butterworth\", order = 2, cutoff = {KEPT} }}");
    let text = format!("fast_period = 1\nratio = 1\n[target]\nfilter = {front}\n")
        + &"[[channel]]\ndelay = 0\n".repeat(channels)
        + "[design]\nmethod = \"fir\"\n";
    Spec::from_toml(&text, "recorders")
        .map_err(|refused| MergeError::Count { channels, refused: refused.to_string() })
}
