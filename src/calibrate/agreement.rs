//! Whether captures agree with a spec: silence, starts, polarities, gains, order and delays.

use super::contradiction::{Contradiction, by_delays};
use super::model::Model;
use super::record::{Record, repeated};
use super::starts::{Starts, starts};
use crate::spec::Spec;
use std::fmt;

/// Least frames of captures that are judged.
pub const LEAST_FRAMES: usize = 1024;
/// The number that suffices for the order and the delays.
pub const ENOUGH_FRAMES: usize = 16_384;
/// Samples of all channels that are looked at: starts that are seconds apart need long captures, and the
/// work is bounded.
const MOST_SAMPLES: usize = 1 << 18;
/// Most channels: the work grows with their cube.
const MOST_CHANNELS: usize = 32;
/// A channel is silent below this share of the rms of the loudest one; with a filter of its own below its
/// square.
const SILENT: f64 = 1e-3;
/// A gain this far from that of the spec, beyond what the spec allows, contradicts it. Converters that are
/// not calibrated differ by a few per cent.
const GAIN_ERROR: f64 = 0.05;
/// The spec explains captures that leave this share of their power unexplained.
const EXPLAINED: f64 = 0.1;

/// What captures say of a spec.
#[derive(Debug, Clone, PartialEq)]
pub struct Agreement {
    /// In what they contradict it.
    pub contradictions: Vec<Contradiction>,
    /// What they say beside that.
    pub verdict: Verdict,
}

/// What captures say beside contradictions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verdict {
    /// One alias per band, at the delays and gains of the spec, has this share of their power.
    Explained(f64),
    /// Aliases overlap, or the signal fits other starts as well: the captures do not tell.
    Untold,
    /// They have fewer than [`LEAST_FRAMES`] frames.
    Short,
    /// They hold no signal.
    Silence,
    /// There is one channel, or there are too many.
    Channels,
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Explained(share) => {
                let least = (1e4 * share).floor().min(9999.0) / 100.0;
                write!(
                    f,
                    "the captures agree with the spec, which explains at least {least} % of their power"
                )
            }
            Self::Untold => f.write_str("this signal does not tell whether the captures agree with the spec"),
            Self::Short => write!(
                f,
                "fewer than {LEAST_FRAMES} frames do not tell whether the captures agree with the spec"
            ),
            Self::Silence => f.write_str("the captures are silent"),
            Self::Channels => {
                write!(f, "captures are compared with the spec for 2 to {MOST_CHANNELS} channels")
            }
        }
    }
}

/// Frames of captures of so many channels that [`agreement`] needs at most; 0 if it cannot compare them.
pub fn frames_for_agreement(channels: usize) -> usize {
    let is_compared = (2..=MOST_CHANNELS).contains(&channels);
    if is_compared { (MOST_SAMPLES / channels).max(ENOUGH_FRAMES) } else { 0 }
}

/// What clearly contradicts `spec` in the first frames of captures; nothing where they do not tell.
pub fn contradictions(spec: &Spec, records: &[Record]) -> Vec<Contradiction> {
    agreement(spec, records).contradictions
}

/// Compares the first frames of captures, one per channel, with what `spec` says of them.
pub fn agreement(spec: &Spec, records: &[Record]) -> Agreement {
    let contradicted = |contradictions| Agreement { contradictions, verdict: Verdict::Untold };
    let nothing = |verdict| Agreement { contradictions: Vec::new(), verdict };
    let channels = spec.channels.len();
    if records.len() != channels || !(2..=MOST_CHANNELS).contains(&channels) {
        return nothing(Verdict::Channels);
    }
    let delays = spec.delays_in_fast_periods();
    if let Some((i, j)) = repeated(records).filter(|&(i, j)| delays[i] != delays[j]) {
        return contradicted(vec![Contradiction::Repeated { first: i + 1, second: j + 1 }]);
    }
    let shortest = records.iter().map(|record| record.samples.len()).min().unwrap_or(0);
    if shortest < LEAST_FRAMES {
        return nothing(Verdict::Short);
    }
    let levels: Vec<f64> = records.iter().map(deviation).collect();
    if levels.iter().all(|level| *level == 0.0) {
        return nothing(Verdict::Silence);
    }
    let silent = silent(spec, &levels);
    if !silent.is_empty() {
        return contradicted(silent);
    }
    let beginning: Vec<Record> = records.iter().map(|record| record.beginning(ENOUGH_FRAMES)).collect();
    let by_delays = by_delays(spec, &beginning).unwrap_or_default();
    if by_delays.iter().any(|found| matches!(found, Contradiction::WrongOrder { .. })) {
        return contradicted(by_delays);
    }
    match Model::new(spec).ok().and_then(|model| starts(&model, records)) {
        None => Agreement { contradictions: by_delays, verdict: Verdict::Untold },
        Some(found) => judged(spec, &found, by_delays),
    }
}

/// With wrong starts or polarities delays mean nothing.
fn judged(spec: &Spec, found: &Starts, by_delays: Vec<Contradiction>) -> Agreement {
    let mut contradictions = shifted(spec, found);
    if contradictions.is_empty() {
        contradictions = by_delays;
    }
    contradictions.extend(gains(spec, found));
    let is_explained = found.implausible <= EXPLAINED;
    let verdict = if is_explained { Verdict::Explained(1.0 - found.implausible) } else { Verdict::Untold };
    Agreement { contradictions, verdict }
}

/// Root mean square of the deviations from the mean.
fn deviation(record: &Record) -> f64 {
    let kept = || record.samples.iter().zip(&record.keep).filter(|(_, keep)| **keep).map(|(x, _)| *x);
    let count = record.used().max(1) as f64;
    let mean = kept().sum::<f64>() / count;
    (kept().map(|x| (x - mean).powi(2)).sum::<f64>() / count).sqrt()
}

fn silent(spec: &Spec, levels: &[f64]) -> Vec<Contradiction> {
    let loudest = (0..levels.len()).max_by(|a, b| levels[*a].total_cmp(&levels[*b])).unwrap_or(0);
    let least = |i: usize| {
        let is_alike = spec.channels[i].filter == spec.channels[loudest].filter;
        levels[loudest] * if is_alike { SILENT } else { SILENT * SILENT }
    };
    let silent = (0..levels.len()).filter(|&i| levels[i] < least(i));
    silent.map(|i| Contradiction::Silent { channel: i + 1, level: levels[i] / levels[loudest] }).collect()
}

/// Wrong starts and polarities.
fn shifted(spec: &Spec, found: &Starts) -> Vec<Contradiction> {
    let seconds = |frames: i64| {
        let slow = spec.fast_period * spec.ratio as f64;
        (!spec.is_normalised()).then(|| slow * frames.unsigned_abs() as f64)
    };
    let start = |(i, &early): (usize, &i64)| {
        let whole = Contradiction::Start { channel: i + 1, early, seconds: seconds(early) };
        (early != 0).then_some(whole)
    };
    let starts = found.early.iter().enumerate().filter_map(start);
    let inverted = found.inverted.iter().enumerate().filter(|(_, inverted)| **inverted);
    starts.chain(inverted.map(|(i, _)| Contradiction::Inverted { channel: i + 1 })).collect()
}

/// Gains that differ from the median of all; of two channels that of the second from the first.
fn gains(spec: &Spec, found: &Starts) -> Vec<Contradiction> {
    if found.unexplained > EXPLAINED {
        return Vec::new();
    }
    let mut sorted = found.gains.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = if sorted.len() == 2 { found.gains[0] } else { sorted[sorted.len() / 2] };
    let half_widths = spec.uncertainty.as_ref().map(|table| table.gains(spec.channels.len()));
    // Noise of one channel only would look like its gain.
    let allowed = GAIN_ERROR + 0.5 * found.unexplained;
    let contradiction = |(i, gain): (usize, &f64)| {
        let ratio = gain / usual;
        let stated =
            half_widths.as_ref().map_or(0.0, |widths| widths.iter().fold(widths[i], |a, b| a.max(*b)));
        let is_wrong = !((1.0 - allowed - stated)..=(1.0 + allowed + stated)).contains(&ratio);
        is_wrong.then_some(Contradiction::Gain { channel: i + 1, ratio, gain: ratio * spec.channels[i].gain })
    };
    found.gains.iter().enumerate().filter_map(contradiction).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::testbench::gaussian;
    use crate::random::Random;

    /// Two converters of 24 kHz, 1.2 and 0.6 fast samples late, after a low-pass of 9 kHz.
    fn speech() -> Spec {
        let text = "fast_rate = 48e3\nratio = 2\nlatency = 8\nchannel = [{ delay_samples = 1.2 }, { delay_samples = 0.6 }]\n\
                    target = { filter = { family = \"butterworth\", order = 4, cutoff = 9e3 } }";
        Spec::from_toml(text, "spec.toml").unwrap()
    }

    /// White noise after a low-pass of 3 kHz, at the instants of channel i: filtered noise on a grid of a
    /// tenth of a fast period.
    fn recorded(frames: usize, noise: f64, dice: &mut Random) -> Vec<Vec<f64>> {
        let fine = 10;
        let (mut y, mut z) = (0.0, 0.0);
        let pole: f64 = (-std::f64::consts::TAU * 3e3 / 480e3).exp();
        let wave: Vec<f64> = (0..(frames + 2) * 2 * fine)
            .map(|_| {
                y = pole * y + (1.0 - pole) * gaussian(dice);
                z = pole * z + (1.0 - pole) * y;
                z
            })
            .collect();
        let rms = (wave.iter().map(|x| x * x).sum::<f64>() / wave.len() as f64).sqrt();
        [12, 6]
            .map(|late| {
                (1..=frames)
                    .map(|k| wave[k * 2 * fine - late] / rms + noise * gaussian(dice))
                    .collect::<Vec<f64>>()
            })
            .to_vec()
    }

    fn found(records: &[Vec<f64>]) -> Agreement {
        let records: Vec<Record> = records.iter().map(|samples| Record::new(samples.clone())).collect();
        agreement(&speech(), &records)
    }

    #[test]
    fn captures_of_the_spec_agree_with_noise_and_without() {
        let mut dice = Random(51);
        for (frames, noise) in [(1024, 0.0), (20_000, 1e-3), (20_000, 0.1)] {
            let found = found(&recorded(frames, noise, &mut dice));
            assert_eq!(found.contradictions, [], "{frames} {noise}");
            assert!(matches!(found.verdict, Verdict::Explained(share) if share > 0.97), "{found:?}");
        }
        // Noise that drowns the signal, and channels without anything in common.
        assert_eq!(found(&recorded(20_000, 3.0, &mut dice)).contradictions, []);
        let apart = [recorded(20_000, 0.0, &mut dice).remove(0), recorded(20_000, 0.0, &mut dice).remove(1)];
        let found = found(&apart);
        assert_eq!((found.contradictions, found.verdict), (vec![], Verdict::Untold));
    }

    #[test]
    fn starts_are_told_from_one_sample_to_seconds() {
        let mut dice = Random(52);
        for early in [1_usize, 7, 300, 5000, 29_520] {
            let mut records = recorded(2 * early + 40_000, 0.03, &mut dice);
            records[0].drain(..early);
            let late = found(&records);
            let start = Contradiction::Start {
                channel: 2,
                early: early as i64,
                seconds: Some(crate::units::Seconds(2.0 / 48e3 * early as f64)),
            };
            assert_eq!(late.contradictions.first().map(ToString::to_string), Some(start.to_string()));
            assert_eq!(late.contradictions.len(), 1, "{late:?}");
            let mut records = recorded(2 * early + 40_000, 0.03, &mut dice);
            records[1].drain(..early);
            let [Contradiction::Start { channel: 2, early: told, .. }] = found(&records).contradictions[..]
            else {
                panic!("{early}")
            };
            assert_eq!(told, -(early as i64));
        }
    }

    #[test]
    fn polarity_gain_and_silence_are_told() {
        let mut dice = Random(53);
        let good = recorded(20_000, 0.01, &mut dice);
        let changed = |factor: f64| {
            let mut records = good.clone();
            records[1].iter_mut().for_each(|x| *x *= factor);
            found(&records).contradictions
        };
        assert_eq!(changed(-1.0), [Contradiction::Inverted { channel: 2 }]);
        assert_eq!(changed(0.98), []);
        let half = changed(0.5);
        let [Contradiction::Gain { channel: 2, ratio, .. }] = &half[..] else { panic!("{half:?}") };
        assert!((ratio - 0.5).abs() < 0.005, "{ratio}");
        assert!(matches!(&changed(-0.5)[..], [Contradiction::Inverted { .. }, Contradiction::Gain { .. }]));
        assert_eq!(changed(0.0), [Contradiction::Silent { channel: 2, level: 0.0 }]);
        let silent = [vec![0.0; 4096], vec![0.0; 4096]];
        assert_eq!(found(&silent).verdict, Verdict::Silence);
    }

    /// A tone fits many starts.
    #[test]
    fn a_tone_tells_nothing_of_whole_samples() {
        let tone = |late: f64| (0..8192).map(|k| (0.9 * (f64::from(k) - late)).sin()).collect::<Vec<f64>>();
        for early in 1..40 {
            let found = found(&[tone(0.6), tone(0.3 + f64::from(early))]);
            assert!(
                !found
                    .contradictions
                    .iter()
                    .any(|c| matches!(c, Contradiction::Start { early, .. } if early.abs() > 6)),
                "{early}: {found:?}"
            );
        }
    }
}
