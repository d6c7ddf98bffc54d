//! What `calibrate` prints.

use super::print::{Failure, explained, is_dash, show, warn};
use hybank::calibrate::{
    Calibration, CalibrationWarning, ChannelChange, ChannelEstimate, LevelChange, Track,
};
use hybank::messages::Quoted;
use hybank::runtime::Nonlinearity;
use hybank::sine_fit::Estimate;
use hybank::spec::{HALF_WIDTH, Spec};
use hybank::units::FastPeriods;
use std::fmt::Write as _;
use std::path::Path;

/// A held-out value contradicts the calibration if it is this many half-widths away: six standard
/// deviations.
const CONTRADICTION: f64 = 3.0;

/// A value and the half-width of its 95 % interval.
#[derive(Debug, Clone, Copy, serde::Serialize)]
pub(super) struct Interval {
    value: f64,
    half_width: f64,
}

#[derive(Debug, serde::Serialize)]
struct CalibratedChannel {
    /// From 1.
    channel: usize,
    /// Fast periods; absent where the value of the spec stands.
    #[serde(skip_serializing_if = "Option::is_none")]
    delay_samples: Option<Interval>,
    /// Seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    delay: Option<Interval>,
    #[serde(skip_serializing_if = "Option::is_none")]
    gain: Option<Interval>,
    #[serde(skip_serializing_if = "Option::is_none")]
    offset: Option<Interval>,
    /// Factor of the cut-off frequency.
    #[serde(skip_serializing_if = "Option::is_none")]
    cutoff: Option<Interval>,
    /// As in a spec; absent if it was not fitted, an empty list where it does not help.
    #[serde(skip_serializing_if = "Option::is_none")]
    nonlinearity: Option<Nonlinearity>,
    /// Clipped samples, which were left out.
    clipped: usize,
}

#[derive(Debug, serde::Serialize)]
struct ToneReport {
    /// Hertz.
    frequency: Interval,
    /// Nyquist zone of the slow rate, from 1.
    zone: usize,
    amplitude: f64,
}

/// How far held-out captures are from the calibrated spec.
#[derive(Debug, serde::Serialize)]
struct CheckReport {
    channels: Vec<CheckedChannel>,
    /// The largest deviation over the half-width of its interval.
    worst: f64,
    agrees: bool,
}

#[derive(Debug, serde::Serialize)]
struct CheckedChannel {
    channel: usize,
    /// Fast periods.
    #[serde(skip_serializing_if = "Option::is_none")]
    delay_samples: Option<Interval>,
    #[serde(skip_serializing_if = "Option::is_none")]
    gain: Option<Interval>,
}

/// How converters changed.
#[derive(Debug, serde::Serialize)]
pub(super) struct DriftReport {
    /// Blocks of the captures, and those that were calibrated.
    blocks: usize,
    measured: usize,
    channels: Vec<ChangedChannel>,
}

/// By how much; 0 where no change stands out of the noise.
#[derive(Debug, serde::Serialize)]
struct ChangedChannel {
    channel: usize,
    /// Fast periods.
    delay_samples: f64,
    #[serde(flatten)]
    levels: LevelChange,
}

impl From<&Track> for DriftReport {
    fn from(track: &Track) -> Self {
        let channel = |(change, channel): (&ChannelChange, usize)| ChangedChannel {
            channel,
            delay_samples: change.delay.0,
            levels: change.levels,
        };
        let channels = track.changes.iter().zip(1..).map(channel).collect();
        Self { blocks: track.blocks, measured: track.measured, channels }
    }
}

impl DriftReport {
    fn text(&self) -> String {
        let mut text = format!("drift      {} of {} blocks measured\n", self.measured, self.blocks);
        for ChangedChannel { channel, delay_samples, levels } in &self.channels {
            let delay = (*delay_samples > 0.0).then(|| format!("delay {delay_samples:.1e} fast periods"));
            let changes: Vec<String> = delay.into_iter().chain(level_changes(*levels)).collect();
            let changes = if changes.is_empty() { "steady".to_owned() } else { changes.join(", ") };
            let _ = writeln!(text, "  channel {channel}: {changes}");
        }
        text
    }
}

/// What of the gain and the offset of a channel changes.
pub(super) fn level_changes(LevelChange { gain, offset }: LevelChange) -> Vec<String> {
    let gain = (gain > 0.0).then(|| format!("gain {gain:.1e} of itself"));
    let offset = (offset > 0.0).then(|| format!("offset {offset:.1e}"));
    gain.into_iter().chain(offset).collect()
}

/// The report of a calibration.
#[derive(Debug, serde::Serialize)]
pub(super) struct CalibrationReport {
    /// The reference channel, from 1.
    reference: usize,
    frames: usize,
    channels: Vec<CalibratedChannel>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    tones: Vec<ToneReport>,
    /// Delays are known modulo this many fast periods.
    #[serde(skip_serializing_if = "Option::is_none")]
    modulus_samples: Option<f64>,
    /// 1 where the model fits to the noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    misfit: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    check: Option<CheckReport>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) drift: Option<DriftReport>,
    notes: Vec<String>,
    pub(super) warnings: Vec<String>,
}

pub(super) fn interval(estimate: Estimate<f64>) -> Interval {
    Interval { value: estimate.value, half_width: HALF_WIDTH * estimate.sigma }
}

pub(super) fn periods(estimate: Estimate<FastPeriods>) -> Interval {
    interval(Estimate { value: estimate.value.0, sigma: estimate.sigma.0 })
}

impl CalibrationReport {
    pub(super) fn new(spec: &Spec, found: &Calibration) -> Self {
        let h = spec.fast_period;
        let channel = |(i, (estimate, clipped)): (usize, (&ChannelEstimate, &usize))| {
            let in_seconds = |estimate: Estimate<FastPeriods>| Interval {
                value: estimate.value.in_seconds(h).0,
                half_width: HALF_WIDTH * estimate.sigma.in_seconds(h).0,
            };
            CalibratedChannel {
                channel: i + 1,
                delay_samples: estimate.delay.map(periods),
                delay: estimate.delay.map(in_seconds),
                gain: estimate.gain.map(interval),
                offset: estimate.offset.map(interval),
                cutoff: estimate.cutoff.map(interval),
                nonlinearity: found.nonlinearity.as_ref().map(|curves| curves[i].clone()),
                clipped: *clipped,
            }
        };
        let tones = found.tones.iter().map(|tone| ToneReport {
            frequency: interval(Estimate { value: tone.frequency.value.0, sigma: tone.frequency.sigma.0 }),
            zone: tone.zone,
            amplitude: tone.amplitude.value,
        });
        let mut report = Self {
            reference: found.reference + 1,
            frames: found.frames,
            channels: found.channels.iter().zip(&found.clipped).enumerate().map(channel).collect(),
            tones: tones.collect(),
            modulus_samples: found.modulus.map(|modulus| modulus.0),
            misfit: found.misfit,
            check: None,
            drift: None,
            notes: Vec::new(),
            warnings: Vec::new(),
        };
        report.add(&found.warnings);
        report
    }

    /// Sorts warnings and notes.
    pub(super) fn add(&mut self, warnings: &[CalibrationWarning]) {
        for warning in warnings {
            let list = if warning.is_note() { &mut self.notes } else { &mut self.warnings };
            list.push(explained(warning));
        }
    }

    /// Compares what held-out captures say with the calibrated spec. `checked` started from its values.
    pub(super) fn check(&mut self, calibrated: &Spec, found: &Calibration, checked: &Calibration) {
        let delays = calibrated.delays_in_fast_periods();
        let deviation = |value: f64, expected: f64, own: f64, before: f64| Interval {
            value: value - expected,
            half_width: HALF_WIDTH * own.hypot(before),
        };
        let channel = |(i, now): (usize, &ChannelEstimate)| {
            let before = &found.channels[i];
            let delay = now
                .delay
                .zip(before.delay)
                .map(|(now, before)| deviation(now.value.0, delays[i].0, now.sigma.0, before.sigma.0));
            let gain = now.gain.zip(before.gain).map(|(now, before)| {
                deviation(now.value, calibrated.channels[i].gain, now.sigma, before.sigma)
            });
            CheckedChannel { channel: i + 1, delay_samples: delay, gain }
        };
        let channels: Vec<CheckedChannel> = checked.channels.iter().enumerate().map(channel).collect();
        let all = channels.iter().flat_map(|c| [c.delay_samples, c.gain]).flatten();
        let worst = all.map(|interval| interval.value.abs() / interval.half_width).fold(0.0, f64::max);
        let agrees = worst <= CONTRADICTION;
        if !agrees {
            self.warnings.push(format!(
                "the held-out captures contradict the calibration: a value is {worst:.1} half-widths of its interval away; the \
                 converters have changed, or the front ends are not those of the spec"
            ));
        }
        self.check = Some(CheckReport { channels, worst, agrees });
    }

    /// `drift` is the file of the changes.
    pub(super) fn print(&self, output: &Path, drift: Option<&Path>, json: bool) -> Result<(), Failure> {
        self.warnings.iter().for_each(|warning| warn(warning));
        // Standard output carries the spec.
        if is_dash(output) { Ok(()) } else { show(self, json, |report| report.text(drift, output)) }
    }

    fn text(&self, drift: Option<&Path>, output: &Path) -> String {
        let mut text = format!("{} frames, relative to channel {}:\n", self.frames, self.reference);
        for tone in &self.tones {
            let _ = writeln!(text, "  tone       {} Hz, zone {}", shown(tone.frequency), tone.zone);
        }
        let _ = writeln!(text, "  channel    delay (fast periods)      gain                      offset");
        for channel in &self.channels {
            let cells = [channel.delay_samples, channel.gain, channel.offset]
                .map(|cell| cell.map_or("-".into(), shown));
            let _ = write!(text, "  {:<10} {:<25} {:<25} {}", channel.channel, cells[0], cells[1], cells[2]);
            if let Some(cutoff) = channel.cutoff {
                let _ = write!(text, "  cut-off x {}", shown(cutoff));
            }
            if let Some(curve) = &channel.nonlinearity {
                text += &nonlinearity_text(curve);
            }
            text.push('\n');
        }
        if let Some(modulus) = self.modulus_samples {
            let _ = writeln!(text, "delays are known modulo {modulus:.4} fast periods");
        }
        if let Some(misfit) = self.misfit {
            let _ = writeln!(text, "misfit     {misfit:.2} (1: the noise explains all differences)");
        }
        if let Some(check) = &self.check {
            let verdict = if check.agrees { "agree" } else { "do not agree" };
            let _ = writeln!(
                text,
                "held out   the captures {verdict}: at most {:.2} half-widths away",
                check.worst
            );
        }
        text.extend(self.drift.iter().map(DriftReport::text));
        self.notes.iter().for_each(|note| {
            let _ = writeln!(text, "note: {note}");
        });
        for path in drift.into_iter().chain([output]) {
            let _ = writeln!(text, "{}", Quoted(path));
        }
        text
    }
}

fn nonlinearity_text(curve: &Nonlinearity) -> String {
    let values = curve.values();
    let largest = values.iter().fold(0.0, |most: f64, a| most.max(a.abs()));
    match curve {
        _ if curve.is_straight() => "  no nonlinearity that helps".to_owned(),
        Nonlinearity::Polynomial(_) => {
            format!("  nonlinearity of order {}, up to {largest:.1e}", values.len() + 1)
        }
        Nonlinearity::Table { .. } => {
            format!("  nonlinearity of {} codes, up to {largest:.1e}", values.len())
        }
    }
}

/// Value and half-width, with as many digits as the half-width justifies.
pub(super) fn shown(interval: Interval) -> String {
    let Interval { value, half_width } = interval;
    if half_width.is_nan() || half_width <= 0.0 {
        return format!("{value}");
    }
    let digits = (1.0 - half_width.log10().floor()).clamp(0.0, 17.0) as usize;
    format!("{value:.digits$} ± {half_width:.1e}")
}
