//! Recordings of one event by recorders that were started by hand and have clocks of their own.
//!
//! Probes of one recording are looked for in the other, which gives the lag and roughly its drift. Then the
//! stretches of all recordings at one instant are compared, piece by piece: delays with their intervals,
//! gains and offsets. A smoothing spline goes through the delays, as through any readings that are known
//! beforehand.

mod bend;
mod clock;
mod coincidence;
mod course;
mod error;
mod local;
mod noise;
mod path;
mod pieces;
mod steps;
mod zeros;

pub use clock::{ClockCourse, ClockStep};
pub use error::{AlignError, AlignWarning};

use crate::calibrate::{
    CalibrationSettings, CalibrationSignal, CalibrationWarning, ChannelEstimate, FittedValues, LevelChange,
    LevelCourses, Reading, Record, check, check_parts, line,
};
use crate::design::DesignError;
use crate::figures::Alone;
use crate::sine_fit::Estimate;
use crate::spec::Spec;
use crate::units::{FastPeriods, Seconds};
use course::{Course, mean};
use path::Disagree;
use pieces::{PieceEstimate, Pieces};
use std::ops::Range;
use steps::{Lags, Mended, mended, spliced};
pub(crate) use zeros::lost_zeros;

/// Least samples that all recordings have in common.
const LEAST_SAMPLES: usize = 1024;
/// Samples of a piece. Within one a clock drifts by a tenth of a sample, and the shortest pieces still
/// measure.
const LONGEST_PIECE: usize = 4096;
const SHORTEST_PIECE: usize = 256;
const DRIFT_OF_PIECE: f64 = 0.1;
/// The length below which drift does not shorten a piece further: shorter ones resolve too few frequencies.
const SHORT_PIECE: usize = 1024;
/// Number of pieces.
const LEAST_PIECES: usize = 4;
const MOST_PIECES: usize = 1024;

/// Passes in which pieces are measured: where a clock changes its rate, what it drifts within a piece is
/// known after the first, up to a share of what it drifted before.
const MOST_PASSES: usize = 3;

/// Rms of a recording, relative to full scale, below which it holds nothing to measure by: less than half a
/// step of 24 bits and of any converter.
const LEAST_LEVEL: f64 = 1e-8;

/// How recordings are aligned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlignSettings {
    /// The channel, from 0, whose clock is the time and whose delay, gain and offset are those of the spec.
    pub reference: usize,
    /// How far apart the recordings began at most, if that is known.
    pub within: Option<Seconds>,
}

/// How recordings lie in time.
#[derive(Debug, Clone)]
pub struct Alignment {
    /// The reference channel, from 0.
    pub reference: usize,
    /// One per channel.
    pub channels: Vec<AlignedChannel>,
    /// Frames that all recordings have from their first common one on.
    pub frames: usize,
    /// Pieces that were compared.
    pub pieces: usize,
    /// Pieces that gave delays.
    pub measured: usize,
    /// The delays over these frames, at both ends and where they were measured and do not contradict the
    /// others. Gains and offsets that change. All are on smooth courses.
    pub readings: Vec<Reading>,
    /// By how much the gain and the offset of each channel change.
    pub changes: Vec<LevelChange>,
    /// The spec with the delays, gains and offsets, and with an uncertainty that holds the course of each
    /// delay: or, if that is longer than a slow period, all delays of one. With the band of a signal it has
    /// its rms and the noise of the recorders.
    pub spec: Spec,
    /// What a reader of the values must know.
    pub warnings: Vec<AlignWarning>,
    /// Over these frames; `None` if the spec states no band of the signal.
    alone: Option<Alone>,
    clocks: Vec<ClockCourse>,
}

impl Alignment {
    /// What one recorder gives, and all together: in the mean over the frames if the spec states the band of
    /// the signal, else by the delays of the spec.
    ///
    /// # Errors
    /// As [`Alone::new`].
    pub fn alone(&self) -> Result<Alone, DesignError> {
        self.alone.map_or_else(|| Alone::new(&self.spec), Ok)
    }

    /// When the samples of the recording of a channel, from 0, were taken. The reference has its own time.
    ///
    /// ```text
    /// let clock = alignment.instants(1);
    /// clock.at(480.0)             // instant of sample 480, in samples of the reference
    /// clock.deviation(480.0)      // its standard deviation
    /// ```
    ///
    /// # Panics
    /// If there is no such channel.
    pub fn instants(&self, channel: usize) -> &ClockCourse {
        &self.clocks[channel]
    }

    /// Whether a recording has zeros that are no samples.
    pub fn has_lost_zeros(&self) -> bool {
        self.warnings.iter().any(|warning| matches!(warning, AlignWarning::Zeros { .. }))
    }

    /// By how much the delays move at most, where it is so much that fixed taps lose by it.
    pub fn largest_move(&self) -> Option<FastPeriods> {
        let moved = |warning: &AlignWarning| match warning {
            AlignWarning::FixedTaps { moved, .. } => Some(*moved),
            _ => None,
        };
        self.warnings.iter().filter_map(moved).max_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Whether a delay moves by so much that fixed taps lose by it.
    pub fn moves(&self) -> bool {
        self.largest_move().is_some()
    }

    /// The samples of a channel, from 0, without the steps of its recording: NaN for those that are lost or
    /// belong to neither side of a step. [`AlignedChannel::skip`] counts these.
    ///
    /// # Panics
    /// If there is no such channel.
    pub fn mended(&self, channel: usize, samples: &[f64]) -> Vec<f64> {
        spliced(samples, self.clocks[channel].steps(), f64::NAN)
    }
}

/// How the recording of one channel lies in time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlignedChannel {
    /// Samples before the first frame: what to cut off of [`Alignment::mended`].
    pub skip: usize,
    /// The delay at the first frame; it grows with the drift.
    pub delay: Estimate<Seconds>,
    /// By how much the clock is fast, relative to that of the reference: the slope of the line that is
    /// closest to the delays, of which each counts by its interval.
    pub drift: Estimate<f64>,
    /// g_i, below 0 for the opposite polarity.
    pub gain: Estimate<f64>,
    /// o_i.
    pub offset: Estimate<f64>,
}

/// Aligns the recordings of the channels of `spec`, in their order.
///
/// # Errors
/// [`AlignError`].
pub fn align(spec: &Spec, records: &[Record], settings: AlignSettings) -> Result<Alignment, AlignError> {
    let AlignSettings { reference, within } = settings;
    let fit = CalibrationSettings { fit: FittedValues::default(), reference };
    check(spec, records, fit)?;
    check_parts(records, &CalibrationSignal::Any)?;
    if !spec.layout().is_plain() {
        return Err(AlignError::Rates);
    }
    if let Some(i) = records.iter().position(|record| record.rms() < LEAST_LEVEL) {
        return Err(AlignError::Silent { channel: i + 1 });
    }
    enough(records.iter().map(|record| record.samples.len()).min().unwrap_or(0))?;
    let lost = lost_zeros(&records.iter().collect::<Vec<_>>(), &vec![1.0; records.len()]);
    let records: &[Record] =
        &records.iter().zip(&lost).map(|(record, rows)| record.without(rows)).collect::<Vec<_>>();
    let within = within.map_or(f64::INFINITY, |time| time / (spec.fast_period * spec.ratio as f64));
    let placed = |i: usize| match i == reference {
        true => Ok(Mended { record: records[i].clone(), steps: Vec::new(), lags: Lags::none() }),
        false => placed(records, reference, i, within),
    };
    let placed = (0..records.len()).map(placed).collect::<Result<Vec<_>, _>>()?;
    let mut lags: Vec<Lags> = placed.iter().map(|placed| placed.lags.clone()).collect();
    let steps: Vec<Vec<ClockStep>> = placed.iter().map(|placed| placed.steps.clone()).collect();
    let whole: Vec<Record> = placed.into_iter().map(|placed| placed.record).collect();
    let stretches = Stretches::new(&whole, reference, &lags)?;
    let pieces = stretches.firsts().len();
    let measured = |lags: &[Lags]| {
        let estimates = Pieces::new(spec, &whole, lags, fit, &stretches)?.measure()?;
        let few = AlignError::NotMeasured { measured: estimates.len(), pieces, reason: None };
        let course = Course::new(spec, reference, &steps, &estimates, &stretches).ok_or(few)?;
        Ok::<_, AlignError>((estimates, course))
    };
    let (mut estimates, mut course) = measured(&lags)?;
    for _ in 1..MOST_PASSES {
        let Some(better) = course.lags(&lags, &stretches) else { break };
        // Where channels sample at one instant the fit need not settle from there: what is known stays.
        let Ok(again) = measured(&better) else { break };
        (lags, (estimates, course)) = (better, again);
    }
    let mut found = alignment(spec, &whole, course, &estimates, pieces);
    found.measure_noise(records)?;
    let zeros = lost.iter().map(|rows| rows.iter().map(Range::len).sum());
    let zeros = (1..).zip(zeros).filter(|(_, zeros)| *zeros > 0);
    found.warnings.extend(zeros.map(|(channel, zeros)| AlignWarning::Zeros { channel, zeros }));
    Ok(found)
}

/// The recording of channel `i` with its steps mended, and where it lies beside the reference.
fn placed(records: &[Record], reference: usize, i: usize, within: f64) -> Result<Mended, AlignError> {
    let (own, other) = (&records[reference], &records[i]);
    let (reference, channel) = (reference + 1, i + 1);
    let line = line(own, other, within).map_err(|lags| match lags.is_empty() {
        true => AlignError::NothingInCommon { reference, channel },
        false => AlignError::Ambiguous { reference, channel, lags },
    })?;
    mended(own, other, line).map_err(|Disagree { agreeing, pieces }| AlignError::Disagree {
        reference,
        channel,
        agreeing,
        pieces,
    })
}

/// Refuses recordings that have too few samples in common.
fn enough(frames: usize) -> Result<(), AlignError> {
    if frames < LEAST_SAMPLES { Err(AlignError::Overlap { frames, needed: LEAST_SAMPLES }) } else { Ok(()) }
}

/// What all recordings have, and how it is cut into pieces. Samples are those of the reference.
struct Stretches {
    first: f64,
    end: f64,
    /// Samples of a piece.
    length: usize,
}

impl Stretches {
    fn new(records: &[Record], reference: usize, lags: &[Lags]) -> Result<Self, AlignError> {
        let (mut first, mut end) = (0.0_f64, records[reference].samples.len() as f64);
        for (lags, record) in lags.iter().zip(records) {
            let samples = record.samples.len() as f64;
            first = first.max(-lags.at(-lags.at(0.0)));
            end = end.min(samples - lags.at(samples - lags.at(samples)));
        }
        let frames = (end - first).max(0.0) as usize;
        enough(frames)?;
        let fastest = lags.iter().map(|lags| lags.rate.abs()).fold(0.0, f64::max);
        let by_drift = ((DRIFT_OF_PIECE / fastest) as usize).clamp(SHORT_PIECE, LONGEST_PIECE);
        let length = 1 << by_drift.min(frames / LEAST_PIECES).max(SHORTEST_PIECE).ilog2();
        Ok(Self { first, end, length })
    }

    /// The first samples of all pieces.
    fn firsts(&self) -> Vec<usize> {
        let room = self.end - self.first - self.length as f64;
        let count = ((room / self.length as f64) as usize + 1).clamp(LEAST_PIECES, MOST_PIECES);
        let first = |number: usize| self.first.ceil() + (room * number as f64 / count as f64).floor();
        (0..count).map(|number| first(number) as usize).collect()
    }
}

/// An offset, or 0 where it is below the rounding of the samples.
fn without_rounding(offset: Estimate<f64>, record: &Record) -> Estimate<f64> {
    let is_rounding = offset.value.abs() < f64::EPSILON * record.rms();
    if is_rounding { Estimate { value: 0.0, ..offset } } else { offset }
}

fn alignment(
    spec: &Spec,
    records: &[Record],
    course: Course<'_>,
    estimates: &[PieceEstimate],
    pieces: usize,
) -> Alignment {
    let (skips, reference) = (course.skips(), course.reference());
    let left = records.iter().zip(&skips).map(|(record, skip)| record.samples.len().saturating_sub(*skip));
    let frames = left.min().unwrap_or(0);
    let channel = |i: usize| {
        let nominal = &spec.channels[i];
        let value = |of: fn(&ChannelEstimate) -> Option<Estimate<f64>>, nominal: f64| {
            let all = estimates.iter().filter_map(|estimate| of(&estimate.channels[i]));
            let found = (i != reference).then(|| mean(all)).flatten();
            found.unwrap_or(Estimate { value: nominal, sigma: 0.0 })
        };
        AlignedChannel {
            skip: skips[i],
            delay: course.delay(i, &skips),
            drift: course.drift(i),
            gain: value(|found| found.gain, nominal.gain),
            offset: without_rounding(value(|found| found.offset, nominal.offset), &records[i]),
        }
    };
    let mut channels: Vec<AlignedChannel> = (0..records.len()).map(channel).collect();
    let mut warnings = Vec::new();
    let counts: Vec<usize> = records.iter().map(|record| record.clipped).collect();
    if counts.iter().any(|&count| count > 0) {
        warnings.push(AlignWarning::Values(CalibrationWarning::Clipped { counts }));
    }
    for i in 0..channels.len() {
        let steps = course.steps(i).iter().cloned();
        warnings.extend(steps.map(|step| AlignWarning::Step { channel: i + 1, step }));
    }
    let measured = estimates.len();
    let (spec, raised) = course.spec(&channels, &mut warnings);
    channels.iter_mut().for_each(|channel| channel.delay.value += spec.fast_period * raised as f64);
    // With more channels than needed nothing is lost where two are one.
    if channels.len() <= spec.ratio {
        let lasts = spec.fast_period * (spec.ratio * frames) as f64;
        let met = coincidence::first_coincidence(&spec, &channels, lasts);
        warnings
            .extend(met.map(|(pair, at)| AlignWarning::Coincidence { channels: pair.map(|i| i + 1), at }));
    }
    let first = skips[reference] as f64;
    let levels = estimates.iter().map(|one| (one.centre - first, one.channels.as_slice()));
    let levels = LevelCourses::new(&spec, levels);
    let readings = course.readings(&skips, frames, raised, &levels);
    let at: Vec<f64> = readings.iter().map(|reading| reading.frame as f64).collect();
    let changes = levels.changes(&at);
    let clocks = course.into_clocks();
    Alignment {
        reference,
        channels,
        frames,
        pieces,
        measured,
        readings,
        changes,
        spec,
        warnings,
        alone: None,
        clocks,
    }
}

#[cfg(test)]
mod tests;
