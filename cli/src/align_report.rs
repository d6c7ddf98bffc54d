//! What `align` prints.

use super::calibrate_report::{Interval, interval, periods, shown};
use super::print::{Failure, is_dash, show, warn};
use hybank::figures::Alone;
use hybank::sine_fit::Estimate;
use hybank::spec::Spec;
use hybank::track::{AlignedChannel, Alignment};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// The report of an alignment.
#[derive(Debug, serde::Serialize)]
pub(super) struct Report {
    /// The reference channel, from 1.
    reference: usize,
    /// Frames that all recordings have.
    frames: usize,
    /// Pieces that were compared, and those of them that gave delays.
    pieces: usize,
    measured: usize,
    channels: Vec<ChannelReport>,
    /// What one recorder gives, and all of them together.
    alone: Alone,
    one_suffices: bool,
    warnings: Vec<String>,
}

#[derive(Debug, serde::Serialize)]
struct ChannelReport {
    /// From 1.
    channel: usize,
    /// Samples to cut off at the beginning.
    skip: usize,
    /// Fast periods, at the first frame.
    delay_samples: Interval,
    drift_ppm: Interval,
    gain: Interval,
    offset: Interval,
}

impl ChannelReport {
    fn new(spec: &Spec, channel: usize, found: &AlignedChannel) -> Self {
        let h = spec.fast_period;
        let Estimate { value, sigma } = found.delay;
        let delay = Estimate { value: value.in_fast_periods(h), sigma: sigma.in_fast_periods(h) };
        let drift = Estimate { value: 1e6 * found.drift.value, sigma: 1e6 * found.drift.sigma };
        Self {
            channel,
            skip: found.skip,
            delay_samples: periods(delay),
            drift_ppm: interval(drift),
            gain: interval(found.gain),
            offset: interval(found.offset),
        }
    }
}

impl Report {
    pub(super) fn new(spec: &Spec, found: &Alignment, alone: Alone, mut warnings: Vec<String>) -> Self {
        let channels = found.channels.iter().enumerate();
        warnings.extend(found.warnings.iter().map(ToString::to_string));
        Self {
            reference: found.reference + 1,
            frames: found.frames,
            pieces: found.pieces,
            measured: found.measured,
            channels: channels.map(|(i, one)| ChannelReport::new(spec, i + 1, one)).collect(),
            alone,
            one_suffices: alone.suffices(),
            warnings,
        }
    }

    pub(super) fn print(&self, output: &Path, others: &[PathBuf], json: bool) -> Result<(), Failure> {
        self.warnings.iter().for_each(|warning| warn(warning));
        // Standard output carries the spec.
        if is_dash(output) { Ok(()) } else { show(self, json, |report| report.text(output, others)) }
    }

    fn text(&self, output: &Path, others: &[PathBuf]) -> String {
        let Self { frames, reference, pieces, measured, .. } = self;
        let mut text = format!(
            "{frames} frames in common, {measured} of {pieces} pieces measured, relative to channel {reference}:\n  \
             channel    cut off     delay (fast periods)      drift (ppm)               gain                      offset\n"
        );
        for channel in &self.channels {
            let ChannelReport { channel, skip, delay_samples, drift_ppm, gain, offset, .. } = channel;
            let [delay, drift, gain, offset] =
                [delay_samples, drift_ppm, gain, offset].map(|cell| shown(*cell));
            let _ = writeln!(text, "  {channel:<10} {skip:<11} {delay:<25} {drift:<25} {gain:<25} {offset}");
        }
        let Alone { channel, snr_db, together_db } = self.alone;
        let verdict = if self.one_suffices { "one recorder suffices" } else { "fuse them" };
        let _ = writeln!(
            text,
            "alone      channel {channel} gives {:.1} dB at best, all together {:.1} dB: {verdict}",
            snr_db.0, together_db.0
        );
        for path in others.iter().map(PathBuf::as_path).chain([output]) {
            let _ = writeln!(text, "{}", path.display());
        }
        text
    }
}
