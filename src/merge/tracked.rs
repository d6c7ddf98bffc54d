//! Converters whose delays change: the fusion of their recordings by a table of delays over time.

use super::course::{InnerCourse, PredictedQuality};
use super::error::MergeError;
use super::{REACH, check_memory};
use crate::bank::Bank;
use crate::design;
use crate::instants::{Clock, ClockError, FusionSettings, LiveFusion, Recording, fuse};
use crate::spec::OneOrEach;
use crate::units::{FastPeriods, Hertz, Seconds};

/// Share of the rate of the converter below which stamps are those of something else.
const SPARSE: f64 = 0.5;

/// The delays of all converters at some times, on lines between them.
#[derive(Debug, Clone, PartialEq)]
pub struct DelayTrack {
    /// After the first frame, ascending.
    pub times: Vec<Seconds>,
    /// Those of each converter, as many as times: D_i as in a spec.
    pub delays: Vec<Vec<Seconds>>,
    /// Half-widths of the 95 % intervals in which they usually are, one for each converter; none if they are
    /// exact.
    pub half_widths: Vec<Seconds>,
}

/// The fused recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracked {
    /// At the fast rate.
    pub samples: Vec<f64>,
    /// The time of the first one: of the first frame, or by the stamps.
    pub begin: Seconds,
    /// How good they are.
    pub quality: PredictedQuality,
}

/// The fusion of samples, NaN where they were lost, as they arrive at the converters of a bank. Taps are
/// made for the delays of a table ([`crate::instants`]); those of the bank are not used.
#[derive(Debug)]
pub struct TrackedFusion {
    fusion: LiveFusion,
    bank: Bank,
    /// Frames so far.
    frames: usize,
    course: InnerCourse,
}

impl TrackedFusion {
    /// From the first frame on.
    ///
    /// # Errors
    /// [`MergeError`]: for a bank without a spec, a band or one rate of its converters; for a table of other
    /// converters, without delays, or of delays that jump by a sample and more.
    pub fn new(bank: &Bank, track: &DelayTrack) -> Result<Self, MergeError> {
        if bank.samples.iter().any(|samples| *samples != 1) {
            return Err(MergeError::OwnRates);
        }
        if track.delays.len() != bank.channel_count() {
            return Err(MergeError::Columns { given: track.delays.len(), wanted: bank.channel_count() });
        }
        if track.times.is_empty() {
            return Err(MergeError::NoDelays);
        }
        let recording = |i: usize| Ok(Recording::new(Vec::new(), clock(bank, track, i)?, i));
        let recordings: Vec<Recording> =
            (0..bank.channel_count()).map(recording).collect::<Result<_, MergeError>>()?;
        let settings = FusionSettings { first: FastPeriods(0.0), count: 0, reach: REACH };
        let estimator = design::instants_estimator(
            &with_instants(bank, &track.half_widths),
            settings.longest(&recordings),
        )?;
        let fusion = LiveFusion::new(estimator, recordings, settings.first, REACH);
        let course = InnerCourse::new(bank.fast_period * fusion.block() as f64);
        Ok(Self { fusion, bank: bank.clone(), frames: 0, course })
    }

    /// The same for delays that the table only begins with.
    pub(super) fn with_unknown_clocks(self) -> Self {
        Self { fusion: self.fusion.with_unknown_clocks(), ..self }
    }

    /// From now on the delays are those of another table: those of the one before, as far as there are
    /// samples.
    ///
    /// # Errors
    /// [`MergeError`] for delays that jump by a sample and more.
    pub(super) fn follow(&mut self, track: &DelayTrack) -> Result<(), MergeError> {
        let clocks = (0..self.bank.channel_count()).map(|i| clock(&self.bank, track, i));
        self.fusion.follow(clocks.collect::<Result<Vec<_>, _>>()?);
        Ok(())
    }

    /// Takes the next samples of each channel, as many of all, and gives the outputs that depend on no later
    /// ones.
    ///
    /// # Errors
    /// [`MergeError::Singular`].
    pub fn push(&mut self, channels: &[Vec<f64>]) -> Result<Vec<f64>, MergeError> {
        self.frames += channels.iter().map(Vec::len).min().unwrap_or(0);
        let own = |(i, samples): (usize, &Vec<f64>)| {
            samples.iter().map(|x| self.bank.corrected(i, *x)).collect::<Vec<f64>>()
        };
        let fused = self.fusion.push(channels.iter().enumerate().map(own))?;
        Ok(self.course.judged(fused))
    }

    /// The last outputs, and how good all of them are.
    ///
    /// # Errors
    /// [`MergeError::NoSamples`] if there were none; as [`TrackedFusion::push`].
    pub fn finish(self) -> Result<(Vec<f64>, PredictedQuality), MergeError> {
        let Self { fusion, bank, frames, mut course } = self;
        if frames == 0 {
            return Err(MergeError::NoSamples);
        }
        let fused = fusion.finish(frames.saturating_mul(bank.ratio))?;
        Ok((course.judged(fused), course.quality()))
    }
}

/// The bank for samples whose instants are known so well: how uncertain the delays of its spec are, which
/// may be how far they move, says nothing of them.
fn with_instants(bank: &Bank, half_widths: &[Seconds]) -> Bank {
    let mut bank = bank.clone();
    if let Some(spec) = bank.spec.as_mut() {
        let stated = spec.uncertainty.get_or_insert_default();
        stated.delay = (!half_widths.is_empty()).then(|| OneOrEach::Each(half_widths.to_vec()));
    }
    bank
}

/// Fuses the recordings of the converters of a bank, each sample of which has its time stamp; NaN where
/// samples were lost. Front ends, band and noise are those of the bank's spec, its delays are not used. The
/// outputs lie on fast periods after the first stamp of the first converter, as far as all converters reach.
///
/// # Errors
/// [`MergeError`]: for a bank without a spec or a band, for stamps that do not ascend or have no time in
/// common.
pub fn fuse_stamped(
    bank: &Bank,
    channels: &[Vec<f64>],
    stamps: &[Vec<Seconds>],
) -> Result<Tracked, MergeError> {
    let origin = stamps.first().and_then(|own| own.first()).copied().ok_or(MergeError::NoSamples)?;
    let clock = |(i, own): (usize, &Vec<Seconds>)| {
        let instants: Vec<FastPeriods> =
            own.iter().map(|stamp| (*stamp - origin).in_fast_periods(bank.fast_period)).collect();
        let name = format!("channel {}", i + 1);
        Clock::stamps(&instants).map_err(|problem| MergeError::Stamps { name, problem })
    };
    let clocks: Vec<Clock> = stamps.iter().enumerate().map(clock).collect::<Result<_, _>>()?;
    let last = |(clock, samples): (&Clock, &Vec<f64>)| clock.at(samples.len().saturating_sub(1) as f64).0;
    let begin = clocks.iter().map(|clock| clock.at(0.0).0).fold(0.0, f64::max).ceil();
    let end = clocks.iter().zip(channels).map(last).fold(f64::INFINITY, f64::min).floor();
    let longest = channels.iter().map(Vec::len).max().unwrap_or(0);
    if end < begin {
        let seconds = bank.fast_period.0 * (end - begin).max(0.0);
        return Err(MergeError::Overlap { seconds, samples: longest });
    }
    for (i, (clock, samples)) in clocks.iter().zip(channels).enumerate() {
        check_rate(bank, i, clock, samples.len())?;
    }
    let count = (end - begin) as usize + 1;
    let settings = FusionSettings { first: FastPeriods(begin), count, reach: REACH };
    check_memory(settings.count)?;
    let recording = |((i, samples), clock): ((usize, &Vec<f64>), Clock)| {
        Recording::new(samples.iter().map(|x| bank.corrected(i, *x)).collect(), clock, i)
    };
    let recordings: Vec<Recording> = channels.iter().enumerate().zip(clocks).map(recording).collect();
    let estimator = design::instants_estimator(&with_instants(bank, &[]), settings.longest(&recordings))?;
    let fused = fuse(&estimator, &recordings, settings)?;
    let mut course = InnerCourse::new(bank.fast_period * fused.block as f64);
    let samples = course.judged(fused);
    Ok(Tracked { samples, begin: origin + bank.fast_period * begin, quality: course.quality() })
}

/// Refuses stamps that are so far apart that the bank was meant for something else.
fn check_rate(bank: &Bank, channel: usize, clock: &Clock, samples: usize) -> Result<(), MergeError> {
    let last = samples.saturating_sub(1) as f64;
    let found = Hertz(last / (bank.fast_period.0 * (clock.at(last).0 - clock.at(0.0).0)));
    let wanted = Hertz(bank.samples[channel] as f64 / bank.slow_period().0);
    if samples > 1 && found.0 < SPARSE * wanted.0 {
        return Err(MergeError::Sparse { name: format!("channel {}", channel + 1), found, wanted });
    }
    Ok(())
}

/// When a converter takes its samples: sample k at kM - D.
fn clock(bank: &Bank, track: &DelayTrack, converter: usize) -> Result<Clock, MergeError> {
    let period = bank.ratio as f64;
    let knot = |(time, delay): (&Seconds, &Seconds)| {
        let [nominal, delay] = [*time, *delay].map(|time| time.in_fast_periods(bank.fast_period).0);
        (nominal / period, FastPeriods(nominal - delay))
    };
    let knots: Vec<(f64, FastPeriods)> = track.times.iter().zip(&track.delays[converter]).map(knot).collect();
    // Before the first time and after the last one the delay stays.
    let earlier = knots.first().map(|&(sample, instant)| (sample - 1.0, instant - FastPeriods(period)));
    let later = knots.last().map(|&(sample, instant)| (sample + 1.0, instant + FastPeriods(period)));
    Clock::through(earlier.into_iter().chain(knots.iter().copied()).chain(later)).map_err(|problem| {
        // There are three knots and more.
        let frame = if let ClockError::NotAscending { sample } = problem { sample } else { 0.0 };
        MergeError::Track { channel: converter + 1, frame }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::Spec;
    use std::f64::consts::TAU;

    const SPEC: &str = "fast_rate = 48000\nratio = 2\n\
        [target]\nfilter = { family = \"butterworth\", order = 4, cutoff = 14000 }\n\
        [signal]\nband = 18000\n[[channel]]\ndelay = 0\nbits = 16\n\
        [[channel]]\ndelay = \"0.9 samples\"\ngain = -0.6\nbits = 16\n\
        [design]\nmethod = \"h2\"\ntaps = 48\n";

    /// Whole recordings at once.
    fn fuse_tracked(bank: &Bank, channels: &[Vec<f64>], track: &DelayTrack) -> Result<Tracked, MergeError> {
        let mut fusion = TrackedFusion::new(bank, track)?;
        let mut samples = fusion.push(channels)?;
        let (last, quality) = fusion.finish()?;
        samples.extend(last);
        Ok(Tracked { samples, begin: Seconds(0.0), quality })
    }

    fn bank() -> Bank {
        let spec = Spec::from_toml(SPEC, "test").unwrap();
        design::design(&spec, &design::DesignOptions::without_proof()).unwrap().bank
    }

    /// What passes the Butterworth filter, which both converters and the target have: tones.
    fn value(t: f64) -> f64 {
        let tone = |k: u32| {
            let f = 300.0 + 17_600.0 * (f64::from(k) / 61.0) * (1.0 + 0.2 * f64::from(k % 3)) / 1.4;
            (TAU * f * t + f64::from(k * k)).cos() / (1.0 + (f / 14_000.0).powi(8)).sqrt()
        };
        0.04 * (0..61).map(tone).sum::<f64>()
    }

    fn rounded(x: f64) -> f64 {
        (x * 32768.0).round() / 32768.0
    }

    /// A delay that drifts over a quarter of a slow period, known every 50 ms.
    #[test]
    fn taps_follow_a_drifting_delay() {
        let (bank, frames) = (bank(), 24_000);
        let delay = |t: f64| 18.75e-6 + 12e-6 * t * t;
        let times: Vec<Seconds> = (0..=20).map(|k| Seconds(0.05 * f64::from(k))).collect();
        let track = DelayTrack {
            delays: vec![vec![Seconds(0.0); 21], times.iter().map(|t| Seconds(delay(t.0))).collect()],
            half_widths: Vec::new(),
            times,
        };
        let own = |k: usize| k as f64 / 24_000.0;
        let first: Vec<f64> = (0..frames).map(|k| rounded(value(own(k)))).collect();
        let on_lines = |t: f64| {
            let k = ((t / 0.05) as usize).min(19);
            let part = t / 0.05 - k as f64;
            delay(0.05 * k as f64) * (1.0 - part) + delay(0.05 * (k + 1) as f64) * part
        };
        let second: Vec<f64> =
            (0..frames).map(|k| rounded(-0.6 * value(own(k) - on_lines(own(k))))).collect();
        let tracked = fuse_tracked(&bank, &[first, second], &track).unwrap();
        let inner = 200..2 * frames - 200;
        let (mut error, mut power) = (0.0, 0.0);
        for n in inner {
            let truth = value(n as f64 / 48_000.0);
            error += (tracked.samples[n] - truth).powi(2);
            power += truth * truth;
        }
        let snr = 10.0 * (power / error).log10();
        // Tones are no flat spectrum.
        assert!(
            (snr - tracked.quality.snr.0).abs() < 6.0,
            "{snr} measured, {} predicted",
            tracked.quality.snr
        );
        assert!(snr > 60.0 && tracked.quality.worst_second.0 <= tracked.quality.snr.0 + 1e-9, "{snr}");
    }

    /// The stamps of each converter jitter by a tenth of its period, and it loses samples.
    #[test]
    fn samples_with_stamps_of_their_own_are_fused() {
        let (bank, mut random) = (bank(), crate::random::Random(3));
        let mut stamped = |gain: f64, late: f64| {
            let stamps: Vec<Seconds> = (0..6000)
                .map(|k| Seconds(7.0 + (k as f64 + late + 0.2 * random.sample()) / 24_000.0))
                .collect();
            let samples: Vec<f64> = stamps.iter().map(|t| rounded(gain * value(t.0))).collect();
            (stamps, samples)
        };
        let (first, second) = (stamped(1.0, 0.0), stamped(-0.6, 0.45));
        let mut channels = [first.1, second.1];
        channels[1][3000] = f64::NAN;
        let tracked = fuse_stamped(&bank, &channels, &[first.0, second.0]).unwrap();
        let (mut error, mut power) = (0.0, 0.0);
        for (n, y) in tracked.samples.iter().enumerate().take(11_000).skip(200) {
            let truth = value(tracked.begin.0 + n as f64 / 48_000.0);
            error += (y - truth).powi(2);
            power += truth * truth;
        }
        let snr = 10.0 * (power / error).log10();
        assert!(
            snr > 45.0 && (snr - tracked.quality.snr.0).abs() < 8.0,
            "{snr} measured, {} predicted",
            tracked.quality.snr
        );
        let apart = [vec![Seconds(0.0), Seconds(1.0)], vec![Seconds(5.0), Seconds(6.0)]];
        let refused = fuse_stamped(&bank, &[vec![0.0; 2], vec![0.0; 2]], &apart).unwrap_err();
        assert!(refused.to_string().contains("in common"), "{refused}");
    }

    #[test]
    fn impossible_tables_are_refused() {
        let bank = bank();
        let channels = vec![vec![0.0; 100]; 2];
        let track = |delays: Vec<Vec<f64>>| DelayTrack {
            times: vec![Seconds(0.0), Seconds(1e-3)],
            delays: delays.into_iter().map(|column| column.into_iter().map(Seconds).collect()).collect(),
            half_widths: Vec::new(),
        };
        let refused = |delays| fuse_tracked(&bank, &channels, &track(delays)).unwrap_err().to_string();
        assert!(refused(vec![vec![0.0; 2]]).contains("1 column of delays, and the bank has 2 channels"));
        assert!(refused(vec![vec![0.0; 2], vec![0.0, 2e-3]]).contains("channel 2"));
        let none = DelayTrack { times: Vec::new(), delays: vec![Vec::new(); 2], half_widths: Vec::new() };
        assert_eq!(fuse_tracked(&bank, &channels, &none), Err(MergeError::NoDelays));
        let still = track(vec![vec![0.0; 2]; 2]);
        assert_eq!(fuse_tracked(&bank, &[vec![], vec![]], &still), Err(MergeError::NoSamples));
        assert_eq!(fuse_tracked(&bank, &channels, &still).unwrap().samples, vec![0.0; 200]);
        let bare = Bank { spec: None, ..bank.clone() };
        let error = fuse_tracked(&bare, &channels, &track(vec![vec![0.0; 2]; 2])).unwrap_err();
        assert!(error.to_string().contains("no spec"), "{error}");
    }
}
