//! Whether captures agree with a spec: levels, starts, polarities, gains, order and delays.

use super::contradiction::Contradiction;
use super::delays::{Delays, delays_told};
use super::model::ChannelModel;
use super::record::{Record, repeated};
use super::starts::{Starts, starts};
use crate::spec::Spec;

/// Least frames of captures that are judged.
const LEAST_FRAMES: usize = 1024;
/// The number that suffices for the order and the delays.
pub const ENOUGH_FRAMES: usize = 16_384;
/// Samples of all channels that are looked at: starts that are seconds apart need long captures, and the
/// work is bounded.
const MOST_SAMPLES: usize = 1 << 18;
/// Most channels: the work grows with their cube.
const MOST_CHANNELS: usize = 32;
/// A channel has no signal below this share of the rms of the strongest one; with a filter of its own below
/// the square of it.
const LEAST_LEVEL: f64 = 1e-3;
/// A gain this far from that of the spec, beyond what the spec allows, contradicts it. Converters that are
/// not calibrated differ by a few per cent.
const GAIN_ERROR: f64 = 0.05;
/// The means of two channels, less their offsets in the spec, differ by this share of the rms where
/// converters are not calibrated: an image of -40 dB.
const OFFSET_SHARE: f64 = 0.02;
/// Samples of this size, of full scale, are no samples of a converter.
const BEYOND_FULL_SCALE: f64 = 1e3;
/// Decibels that the comparison of short spectra can vouch for.
const MOST_VOUCHED: f64 = 120.0;
/// Decibels below which captures are not said to agree.
const LITTLE_VOUCHED: f64 = 20.0;
/// The spec explains captures that leave this share of their power unexplained.
const UNEXPLAINED_SHARE: f64 = 0.1;

/// What captures say of a spec.
#[derive(Debug, Clone, PartialEq)]
pub struct Agreement {
    /// In what they contradict it.
    pub contradictions: Vec<Contradiction>,
    /// What they say beside that.
    pub verdict: Verdict,
}

/// What captures say beside contradictions.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Verdict {
    /// One alias per band, at the delays and gains of the spec, has this share of their power. The rest is
    /// what a bank for the spec gets wrong, whatever it promises.
    #[error("{}", explained(vouched(*.0)))]
    Explained(f64),
    /// The same, and the signal does not tell its delays.
    #[error(
        "the captures do not contradict the spec, but this signal does not show whether its delays are right"
    )]
    DelaysUntold(f64),
    /// Aliases overlap, or the signal fits other starts as well.
    #[error("this signal does not tell whether the captures agree with the spec")]
    Undecided,
    /// They have fewer than 1024 frames.
    #[error("fewer than {LEAST_FRAMES} frames do not tell whether the captures agree with the spec")]
    Short,
    /// They hold no signal.
    #[error("the frames that were compared with the spec hold no signal")]
    NoSignal,
    /// There is one channel, or there are too many.
    #[error("captures are compared with the spec for 2 to {MOST_CHANNELS} channels")]
    Channels,
    /// Complex samples, or delays that are followed.
    #[error("captures are not compared with the spec where they are complex or their delays are followed")]
    Unsteady,
    /// Converters have rates of their own.
    #[error("captures of converters with rates of their own are not compared with the spec")]
    OwnRates,
    /// There is no spec.
    #[error("the bank carries no spec with which the captures could be compared")]
    NoSpec,
    /// Nothing compared them.
    #[error("the captures were not compared with the spec")]
    Unjudged,
}

/// Captures that vouch for little say that something is wrong, and not what.
fn explained(snr: f64) -> String {
    if snr < LITTLE_VOUCHED {
        format!(
            "the captures fit the spec only to an SNR of {snr:.0} dB: look at their starts, delays and gains, and at their noise"
        )
    } else {
        format!(
            "the captures agree with the spec: delays and gains that leave an SNR below about {snr:.0} dB would show"
        )
    }
}

/// The SNR in decibels where a spec explains this share of the power, at most [`MOST_VOUCHED`].
fn vouched(share: f64) -> f64 {
    (-10.0 * (1.0 - share).log10()).min(MOST_VOUCHED)
}

impl From<Verdict> for Agreement {
    fn from(verdict: Verdict) -> Self {
        Self { contradictions: Vec::new(), verdict }
    }
}

impl Agreement {
    /// In what the captures contradict the spec, in words.
    pub fn warnings(&self) -> Vec<String> {
        self.contradictions.iter().map(ToString::to_string).collect()
    }

    /// Whether the captures agree with the spec of a bank, in a line; what clips is not in the SNR.
    pub fn summary(&self, is_clipped: bool) -> String {
        match self.contradictions.len() {
            0 if is_clipped => format!("{}; clipping is not counted", self.verdict),
            0 => self.verdict.to_string(),
            1 => "the captures do not agree with the spec of the bank, see the warning".to_owned(),
            count => {
                format!("the captures do not agree with the spec of the bank, see the {count} warnings")
            }
        }
    }
}

/// The spec of a bank with which captures can be compared. They are steady if they are real and their delays
/// are not followed.
///
/// # Errors
/// The [`Verdict`] that says why captures cannot be compared.
pub fn comparable(spec: Option<&Spec>, is_steady: bool) -> Result<&Spec, Verdict> {
    match spec {
        _ if !is_steady => Err(Verdict::Unsteady),
        None => Err(Verdict::NoSpec),
        Some(spec) if !spec.layout().is_plain() => Err(Verdict::OwnRates),
        Some(spec) => Ok(spec),
    }
}

/// Frames of captures of so many channels that [`agreement`] needs at most; 0 if it cannot compare them.
pub fn frames_for_agreement(channels: usize) -> usize {
    let is_compared = (2..=MOST_CHANNELS).contains(&channels);
    if is_compared { (MOST_SAMPLES / channels).max(ENOUGH_FRAMES) } else { 0 }
}

/// Compares the first frames of captures, one per channel, with what `spec` says of them. Only what is clear
/// is a contradiction.
pub fn agreement(spec: &Spec, records: &[Record]) -> Agreement {
    let contradicted = |contradictions| Agreement { contradictions, verdict: Verdict::Undecided };
    let channels = spec.channels.len();
    if records.len() != channels || !(2..=MOST_CHANNELS).contains(&channels) {
        return Agreement::from(Verdict::Channels);
    }
    let delays = spec.delays();
    let is_one = |i: usize, j: usize| delays[i].periods_since(delays[j], spec.ratio) == Some(0.0);
    if let Some((i, j)) = repeated(records).filter(|&(i, j)| !is_one(i, j)) {
        return contradicted(vec![Contradiction::Repeated { first: i + 1, second: j + 1 }]);
    }
    let shortest = records.iter().map(|record| record.samples.len()).min().unwrap_or(0);
    if shortest < LEAST_FRAMES {
        return Agreement::from(Verdict::Short);
    }
    let levels: Vec<f64> = records.iter().map(Record::rms).collect();
    if levels.iter().all(|level| *level == 0.0) {
        return Agreement::from(Verdict::NoSignal);
    }
    let beyond = (0..levels.len()).find(|i| levels[*i] > BEYOND_FULL_SCALE);
    if let Some(channel) = beyond.filter(|_| spec.full_scale.is_none()) {
        return contradicted(vec![Contradiction::Beyond { channel: channel + 1, level: levels[channel] }]);
    }
    let without_signal = without_signal(spec, &levels);
    if !without_signal.is_empty() {
        return contradicted(without_signal);
    }
    let Ok(model) = ChannelModel::new(spec) else { return Agreement::from(Verdict::Undecided) };
    let beginning: Vec<Record> = records.iter().map(|record| record.part(0..ENOUGH_FRAMES)).collect();
    let delays = delays_told(spec, &model, &beginning);
    if delays.contradictions.iter().any(|found| matches!(found, Contradiction::WrongOrder { .. })) {
        return contradicted(delays.contradictions);
    }
    match starts(&model, records) {
        None => contradicted(delays.contradictions),
        Some(found) => {
            let mut judged = judged(spec, &found, delays);
            judged.contradictions.extend(offsets(spec, &levels, records));
            judged
        }
    }
}

/// With wrong starts or polarities delays mean nothing.
fn judged(spec: &Spec, found: &Starts, delays: Delays) -> Agreement {
    let mut contradictions = shifted(spec, found);
    if contradictions.is_empty() {
        contradictions = delays.contradictions;
    }
    contradictions.extend(gains(spec, found));
    let share = (1.0 - found.implausible - unequal_gains(&found.gains)).max(0.0);
    let verdict = match found.implausible <= UNEXPLAINED_SHARE {
        true if delays.are_told => Verdict::Explained(share),
        true => Verdict::DelaysUntold(share),
        false => Verdict::Undecided,
    };
    Agreement { contradictions, verdict }
}

/// The mean square of the relative deviations of gains from their mean: the share of the power that lies in
/// images.
fn unequal_gains(gains: &[f64]) -> f64 {
    let mean = gains.iter().sum::<f64>() / gains.len() as f64;
    gains.iter().map(|gain| (gain / mean - 1.0).powi(2)).sum::<f64>() / gains.len() as f64
}

/// The channels whose level is far below that of the strongest one.
fn without_signal(spec: &Spec, levels: &[f64]) -> Vec<Contradiction> {
    let strongest = (0..levels.len()).max_by(|a, b| levels[*a].total_cmp(&levels[*b])).unwrap_or(0);
    let contradiction = |i: usize| {
        let is_alike = spec.channels[i].filter == spec.channels[strongest].filter;
        let least = if is_alike { LEAST_LEVEL } else { LEAST_LEVEL * LEAST_LEVEL };
        let level = levels[i] / levels[strongest];
        (level < least).then_some(Contradiction::NoSignal { channel: i + 1, level })
    };
    (0..levels.len()).filter_map(contradiction).collect()
}

/// Wrong starts and polarities.
fn shifted(spec: &Spec, found: &Starts) -> Vec<Contradiction> {
    let slow = spec.fast_period * spec.ratio as f64;
    let start = |(i, &early): (usize, &i64)| {
        let seconds = (!spec.is_normalised()).then(|| slow * early.unsigned_abs() as f64);
        (early != 0).then_some(Contradiction::Start { channel: i + 1, early, seconds })
    };
    let starts = found.early.iter().enumerate().filter_map(start);
    let inverted = found.signs.iter().enumerate().filter(|(_, sign)| **sign < 0.0);
    starts.chain(inverted.map(|(i, _)| Contradiction::Inverted { channel: i + 1 })).collect()
}

/// Gains that differ from the median of all; of two channels that of the second from the first.
fn gains(spec: &Spec, found: &Starts) -> Vec<Contradiction> {
    if found.unexplained > UNEXPLAINED_SHARE {
        return Vec::new();
    }
    let mut sorted = found.gains.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = if sorted.len() == 2 { found.gains[0] } else { sorted[sorted.len() / 2] };
    let stated = spec.uncertainty.as_ref().map(|table| table.gains(spec.channels.len()));
    let stated = stated.map_or(0.0, |widths| widths.into_iter().fold(0.0, f64::max));
    // Noise of one channel only would look like its gain.
    let allowed = GAIN_ERROR + 0.5 * found.unexplained + stated;
    let contradiction = |(i, gain): (usize, &f64)| {
        let ratio = gain / usual;
        let is_wrong = !((1.0 - allowed)..=(1.0 + allowed)).contains(&ratio);
        is_wrong.then_some(Contradiction::Gain { channel: i + 1, ratio, gain: ratio * spec.channels[i].gain })
    };
    found.gains.iter().enumerate().filter_map(contradiction).collect()
}

/// Means that differ from those of all channels by more than their offsets in the spec do.
fn offsets(spec: &Spec, levels: &[f64], records: &[Record]) -> Vec<Contradiction> {
    let stated = spec.uncertainty.as_ref().map(|table| table.offsets(records.len()));
    let stated = stated.unwrap_or_else(|| vec![0.0; records.len()]);
    let means: Vec<f64> =
        records.iter().zip(&spec.channels).map(|(record, channel)| record.mean() - channel.offset).collect();
    let usual = means.iter().sum::<f64>() / means.len() as f64;
    let contradiction = |(i, mean): (usize, &f64)| {
        let apart = mean - usual;
        let is_wrong = apart.abs() > stated[i] + OFFSET_SHARE * levels[i];
        let offset = apart + spec.channels[i].offset;
        is_wrong.then_some(Contradiction::Offset { channel: i + 1, apart, offset })
    };
    means.iter().enumerate().filter_map(contradiction).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::testbench::gaussian;
    use crate::random::Random;
    use std::f64::consts::TAU;

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
        let pole: f64 = (-TAU * 3e3 / 480e3).exp();
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
        assert_eq!((found.contradictions, found.verdict), (vec![], Verdict::Undecided));
    }

    /// A chirp leaves no band with one alias whose phase could be compared.
    #[test]
    fn a_chirp_with_a_wrong_delay_is_not_said_to_agree() {
        let chirp = |late: f64| {
            let phase = |t: f64| TAU * (50.0 * t + 0.5 * 12_950.0 * t * t);
            (1..24_000).map(|k| phase((2.0 * f64::from(k) - late) / 48e3).sin()).collect::<Vec<f64>>()
        };
        for late in [0.98, 0.3] {
            let Agreement { contradictions, verdict } = found(&[chirp(1.2), chirp(late)]);
            assert!(matches!(verdict, Verdict::DelaysUntold(share) if share > 0.9), "{late}: {verdict}");
            assert_eq!(contradictions, []);
        }
    }

    /// Two tones of two converters, rounded to so many bits of full scale.
    fn two_tones([a, b]: [f64; 2], bits: i32) -> [Vec<f64>; 2] {
        let unit = 2_f64.powi(bits - 1);
        [1.2, 0.6].map(|late| {
            let t = |k: i32| (2.0 * f64::from(k) - late) / 48e3;
            let x = |t: f64| 0.4 * (TAU * a * t + 0.1).sin() + 0.3 * (TAU * b * t + 0.7).sin();
            (0..16_384).map(|k| (unit * x(t(k))).round() / unit).collect()
        })
    }

    #[test]
    fn the_verdict_on_two_tones_does_not_depend_on_their_noise() {
        for tones in [[997.0, 3500.0], [440.0, 8000.0], [1000.0, 1300.0]] {
            for bits in [12, 20, 21, 22, 50] {
                let verdict = found(&two_tones(tones, bits)).verdict;
                assert!(
                    matches!(verdict, Verdict::Explained(share) if share > 1.0 - 1e-6),
                    "{tones:?} {bits}: {verdict}"
                );
            }
        }
    }

    #[test]
    fn an_inverted_channel_of_two_tones_is_not_said_to_be_another_one() {
        for tones in [[997.0, 3500.0], [440.0, 8000.0], [1000.0, 1300.0]] {
            let [first, mut second] = two_tones(tones, 16);
            second.iter_mut().for_each(|x| *x = -*x);
            let found = found(&[first, second]).contradictions;
            assert!(matches!(found[..], [Contradiction::Inverted { channel: 2 }]), "{tones:?} {found:?}");
        }
    }

    #[test]
    fn starts_are_recognised_from_one_sample_to_seconds() {
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
            let [Contradiction::Start { channel: 2, early: reported, .. }] =
                found(&records).contradictions[..]
            else {
                panic!("{early}")
            };
            assert_eq!(reported, -(early as i64));
        }
    }

    #[test]
    fn polarity_gain_and_missing_signals_are_reported() {
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
        assert_eq!(changed(0.0), [Contradiction::NoSignal { channel: 2, level: 0.0 }]);
        let zeros = [vec![0.0; 4096], vec![0.0; 4096]];
        assert_eq!(found(&zeros).verdict, Verdict::NoSignal);
    }

    #[test]
    fn offsets_and_wild_samples_are_reported_for_what_they_are() {
        let mut dice = Random(54);
        let good = recorded(20_000, 0.0, &mut dice);
        let with = |offsets: [f64; 2]| {
            let shifted =
                good.iter().zip(offsets).map(|(record, offset)| record.iter().map(|x| x + offset).collect());
            found(&shifted.collect::<Vec<_>>()).contradictions
        };
        assert_eq!(with([0.2, 0.2]), []);
        let apart = with([0.1, -0.05]);
        let [
            Contradiction::Offset { channel: 1, offset: first, .. },
            Contradiction::Offset { offset: second, .. },
        ] = apart[..]
        else {
            panic!("{apart:?}")
        };
        assert!((first - 0.075).abs() < 0.01 && (second + 0.075).abs() < 0.01, "{apart:?}");
        let wild = vec![good[0].clone(), good[1].iter().map(|x| 1e37 * x).collect()];
        let Contradiction::Beyond { channel: 2, .. } = found(&wild).contradictions[0] else { panic!() };
    }

    /// Half of a difference of 4 % is in each channel: 20 log10(2 / 0.04) = 34 dB.
    #[test]
    fn an_agreement_vouches_for_no_more_than_the_gains_allow() {
        assert!((vouched(1.0 - unequal_gains(&[1.0, 1.04])) - 34.0).abs() < 0.3);
        let mut dice = Random(55);
        let good = recorded(20_000, 0.0, &mut dice);
        let share = |gain: f64| {
            let scaled = good[1].iter().map(|x| gain * x).collect();
            let Verdict::Explained(share) = found(&[good[0].clone(), scaled]).verdict else {
                panic!("{gain}")
            };
            share
        };
        assert!((share(1.0) - share(1.04) - 3.85e-4).abs() < 4e-5, "{} {}", share(1.0), share(1.04));
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
