//! Delays, gains and offsets of all channels at one frame, and gains and offsets over time.

use super::estimates::ChannelEstimate;
use crate::sampling::nonuniform::Measured;
use crate::sampling::{Known, LearnedCourse, usual_deviation};
use crate::sine_fit::Estimate;
use crate::spec::{ChannelSpec, HALF_WIDTH, Spec};
use crate::units::Seconds;
use serde::Serialize;

/// Readings whose scatter says how far they err, at least, and the share of the stated deviations that it
/// stays below.
const LEAST_SCATTERED: usize = 8;
const CLEARLY_LESS: f64 = 0.5;

/// The delays at one frame, and the gains and offsets where those change.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// The frame, from 0.
    pub frame: u64,
    /// D_i and its standard deviation; `None` for a channel of which the line says nothing.
    pub delays: Vec<Option<(Seconds, Seconds)>>,
    /// g_i of all channels; `None` if none of them changes.
    pub gains: Option<Vec<Known>>,
    /// o_i in the same way.
    pub offsets: Option<Vec<Known>>,
}

/// By how much the gain and the offset of a converter change; 0 where no change stands out of the noise.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct LevelChange {
    /// Largest over least gain, less 1.
    pub gain: f64,
    /// Largest less least offset, of full scale.
    pub offset: f64,
}

/// A line: absolute delays in seconds, gains and offsets, with the half-widths of their 95 % intervals.
#[derive(Serialize)]
struct ReadingLine {
    frame: u64,
    delay: Vec<Option<f64>>,
    half_width: Vec<Option<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    gain: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    gain_half_width: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    offset: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    offset_half_width: Option<Vec<f64>>,
}

impl Reading {
    /// The reading as a line of JSON.
    pub fn line(&self) -> String {
        let of_delays =
            |part: fn((Seconds, Seconds)) -> f64| self.delays.iter().map(|known| known.map(part)).collect();
        let values = |all: &Vec<Known>| all.iter().map(|known| known.value).collect();
        let half_widths = |all: &Vec<Known>| all.iter().map(|known| known.deviation * HALF_WIDTH).collect();
        let line = ReadingLine {
            frame: self.frame,
            delay: of_delays(|(delay, _)| delay.0),
            half_width: of_delays(|(_, sigma)| sigma.0 * HALF_WIDTH),
            gain: self.gains.as_ref().map(values),
            gain_half_width: self.gains.as_ref().map(half_widths),
            offset: self.offsets.as_ref().map(values),
            offset_half_width: self.offsets.as_ref().map(half_widths),
        };
        serde_json::to_string(&line).unwrap_or_default()
    }
}

/// What pieces of captures say of a value, over their middles; `nominal` where no two of them say anything.
pub(super) fn course(pieces: impl Iterator<Item = (f64, Estimate<f64>)>, nominal: f64) -> LearnedCourse {
    let measured = |(x, found): (f64, Estimate<f64>)| Measured {
        x,
        value: found.value,
        error: found.sigma,
        jitter: 0.0,
    };
    let steady = LearnedCourse::Steady(Known { value: nominal, deviation: 0.0 });
    LearnedCourse::new(&by_scatter(&pieces.map(measured).collect::<Vec<_>>())).unwrap_or(steady)
}

/// Readings with the deviation that they scatter by, where they state far larger ones: a signal beside a
/// tone counts as white noise there, and leaves the tone alone where it lies at other frequencies.
pub(crate) fn by_scatter(readings: &[Measured]) -> Vec<Measured> {
    // What a line through both neighbours leaves of one of three has the variance 3/2.
    let left = readings.windows(3).map(|three| {
        let beside = 0.5 * (three[0].value + three[2].value);
        (three[1].value - beside).abs() / (1.5_f64.sqrt() * three[1].error)
    });
    let scatter = if readings.len() < LEAST_SCATTERED { 1.0 } else { usual_deviation(left.collect()) };
    let share = if scatter < CLEARLY_LESS { scatter } else { 1.0 };
    readings.iter().map(|one| Measured { error: one.error * share, ..*one }).collect()
}

/// The largest and the least value of a course at some positions.
pub(super) fn extremes(course: &LearnedCourse, at: &[f64]) -> (f64, f64) {
    let values = || at.iter().map(|x| course.at(*x).value);
    (values().fold(f64::NEG_INFINITY, f64::max), values().fold(f64::INFINITY, f64::min))
}

/// The normal law whose 95 % interval holds the course and its intervals at some positions.
pub(super) fn range(course: &LearnedCourse, at: &[f64]) -> Estimate<f64> {
    let (most, least) = extremes(course, at);
    let deviation = at.iter().map(|x| course.at(*x).deviation).fold(0.0, f64::max);
    Estimate { value: 0.5 * (most + least), sigma: 0.5 * (most - least) / HALF_WIDTH + deviation }
}

/// The gains and offsets of all channels over time.
pub(crate) struct LevelCourses {
    gains: Vec<LearnedCourse>,
    offsets: Vec<LearnedCourse>,
}

impl LevelCourses {
    /// From what pieces say of all channels, each with its middle, in their order. The channels of `spec`
    /// have the values of which nothing is said.
    pub(crate) fn new<'a>(
        spec: &Spec,
        pieces: impl Iterator<Item = (f64, &'a [ChannelEstimate])> + Clone,
    ) -> Self {
        let all = |of: fn(&ChannelEstimate) -> Option<Estimate<f64>>, nominal: Vec<f64>| {
            let channel = |(i, nominal)| {
                let piece = |(x, channels): (f64, &[ChannelEstimate])| Some((x, of(&channels[i])?));
                course(pieces.clone().filter_map(piece), nominal)
            };
            nominal.into_iter().enumerate().map(channel).collect()
        };
        let nominal = |of: fn(&ChannelSpec) -> f64| spec.channels.iter().map(of).collect();
        Self {
            gains: all(|found| found.gain, nominal(|channel| channel.gain)),
            offsets: all(|found| found.offset, nominal(|channel| channel.offset)),
        }
    }

    /// Gains and offsets at x, of those that change in some channel.
    pub(crate) fn at(&self, x: f64) -> [Option<Vec<Known>>; 2] {
        [&self.gains, &self.offsets].map(|courses| {
            let some_change = courses.iter().any(LearnedCourse::changes);
            some_change.then(|| courses.iter().map(|course| course.at(x)).collect())
        })
    }

    /// The gain and the offset of a channel, of which the intervals hold the courses at some positions.
    pub(super) fn ranges(&self, channel: usize, at: &[f64]) -> [Estimate<f64>; 2] {
        [range(&self.gains[channel], at), range(&self.offsets[channel], at)]
    }

    /// By how much those of each channel change between some positions.
    pub(crate) fn changes(&self, at: &[f64]) -> Vec<LevelChange> {
        let of = |(gain, offset): (&LearnedCourse, &LearnedCourse)| {
            let ((most, least), (highest, lowest)) = (extremes(gain, at), extremes(offset, at));
            LevelChange { gain: (most / least).max(least / most) - 1.0, offset: highest - lowest }
        };
        self.gains.iter().zip(&self.offsets).map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_has_what_changes_and_intervals() {
        let known = |value: f64| Known { value, deviation: 0.5 };
        let reading = Reading {
            frame: 9,
            delays: vec![None, Some((Seconds(3e-6), Seconds(1e-8)))],
            gains: None,
            offsets: Some(vec![known(0.0), known(0.25)]),
        };
        let line: serde_json::Value = serde_json::from_str(&reading.line()).unwrap();
        let half = 0.5 * HALF_WIDTH;
        let want = serde_json::json!({
            "frame": 9, "delay": [null, 3e-6], "half_width": [null, 1e-8 * HALF_WIDTH],
            "offset": [0.0, 0.25], "offset_half_width": [half, half],
        });
        assert_eq!(line, want);
    }
}
