//! Simulated recordings of clocks that drift, against what was simulated.

use super::*;
use crate::calibrate::CalibrateError;
use crate::calibrate::testbench::gaussian;
use crate::design::Problem;
use crate::linalg::Complex;
use crate::random::Random;
use crate::simulate::{Analog, Periodic, Sampler};
use crate::spec::HALF_WIDTH;
use crate::units::FastPeriods;
use std::f64::consts::{PI, TAU};

/// Recorders of 8 kHz that pass 3 kHz, for a target of 1.5 kHz at the same rate.
fn spec(recorders: usize) -> Spec {
    let channels: String = (0..recorders).map(|_| "[[channel]]\ndelay_samples = 1\n".to_owned()).collect();
    let text = format!(
        "fast_rate = 8000.0\nratio = 1\nlatency = 16\n\
         target = {{ filter = {{ family = \"butterworth\", order = 4, cutoff = 1500.0 }} }}\n{channels}\
         [design]\nmethod = \"fir\"\ntaps = 32\n"
    );
    Spec::from_toml(&text, "spec.toml").unwrap()
}

fn settings() -> AlignSettings {
    AlignSettings { reference: 0, within: None }
}

/// One recorder.
#[derive(Debug, Clone, Copy)]
struct Recorder {
    /// Samples by which it began late.
    late: usize,
    /// Further delay, fast periods.
    delay: f64,
    ppm: f64,
    gain: f64,
    offset: f64,
}

const PLAIN: Recorder = Recorder { late: 0, delay: 0.0, ppm: 0.0, gain: 1.0, offset: 0.0 };

/// Noise with pauses, up to 2 kHz.
fn event(samples: usize, dice: &mut Random) -> Periodic {
    let (mut y, mut z) = (0.0, 0.0);
    let loud = |k: usize| if (k / 6000) % 4 == 3 { 0.0 } else { 0.2 };
    let wave: Vec<f64> = (0..samples)
        .map(|k| {
            y = 0.7 * y + 0.3 * loud(k) * dice.sample();
            z = 0.7 * z + 0.3 * y;
            z
        })
        .collect();
    Periodic::new(&wave, FastPeriods(1.0))
}

/// What the recorders deliver of an event, as long as each of `frames` says.
fn recorded(event: &Periodic, recorders: &[Recorder], frames: &[usize], noise: f64) -> Vec<Vec<f64>> {
    let spec = Spec { uncertainty: None, ..spec(recorders.len()) };
    let problem = Problem::new(&spec, 16).unwrap();
    let signal = Analog::Recorded(event.clone());
    let of = |(i, (recorder, frames)): (usize, (&Recorder, &usize))| {
        let converter = Sampler {
            delay_error: FastPeriods(recorder.delay),
            gain_error: recorder.gain - 1.0,
            offset: recorder.offset,
            drift: 1e-6 * recorder.ppm,
            noise,
            seed: 7,
            ..Sampler::ideal()
        };
        let all = converter.capture(&problem, i, &signal, 1.0, recorder.late + frames);
        all.samples[recorder.late..].to_vec()
    };
    recorders.iter().zip(frames).enumerate().map(of).collect()
}

/// Converters that clip at 1.
fn records(recordings: &[Vec<f64>]) -> Vec<Record> {
    recordings.iter().map(|samples| Record::within(samples.clone(), -1.0, 1.0)).collect()
}

fn aligned(recordings: &[Vec<f64>]) -> Result<Alignment, AlignError> {
    align(&spec(recordings.len()), &records(recordings), settings())
}

/// Each value of channel `i` against that of the recorders.
fn assert_is(found: &Alignment, recorders: &[Recorder], i: usize) {
    let (own, reference, channel) = (recorders[i], recorders[0], found.channels[i]);
    let first = |i: usize| (found.channels[i].skip + recorders[i].late) as f64;
    // Sample k of a recorder is taken at k / (1 + drift) - delay.
    let taken = |i: usize, k: f64| k / (1.0 + 1e-6 * recorders[i].ppm) - recorders[i].delay;
    let delay = taken(0, first(0)) - taken(i, first(i));
    let in_samples = |time: Seconds| time.in_fast_periods(Seconds(1.0 / 8000.0)).0;
    let (value, half) = (in_samples(channel.delay.value), in_samples(channel.delay.sigma));
    assert!(delay.abs() < 1.1, "{delay} {channel:?}");
    let miss = (value - 1.0 - delay).abs();
    assert!(miss < 5.0 * half + 2e-4 && miss < 0.02, "{value} {delay} {half:e} {own:?}");
    let drift = 1e6 * channel.drift.value - (own.ppm - reference.ppm);
    assert!(drift.abs() < 5e6 * channel.drift.sigma + 0.02, "{drift} {:?} {own:?}", channel.drift);
    let gain = own.gain / reference.gain;
    let miss = (channel.gain.value / gain - 1.0).abs();
    assert!(miss < 0.01, "{:?} {gain}", channel.gain);
    let offset = own.offset - reference.offset * gain;
    assert!(
        (channel.offset.value - offset).abs() < 2e-3 * gain.abs().max(1.0),
        "{:?} {offset}",
        channel.offset
    );
}

#[test]
fn starts_drifts_polarities_gains_and_offsets_are_found() {
    let mut dice = Random(81);
    let event = event(160_000, &mut dice);
    for (late, delay, ppm, gain, offset, frames) in [
        (0, 0.0, 0.0, 1.0, 0.0, [60_000, 60_000]),
        (3, 0.31, 1.0, -1.0, 0.0, [60_000, 40_000]),
        (80_000, -0.2, -10.0, 0.1, 0.3, [150_000, 30_000]),
        (40_000, 0.4, 100.0, -10.0, -0.2, [120_000, 110_000]),
        (17_000, 0.1, -100.0, 3.0, 0.01, [40_000, 120_000]),
        (500, 0.1, 20.0, 1.0, 0.0, [3_000, 2_200]),
    ] {
        let two = [PLAIN, Recorder { late, delay, ppm, gain, offset }];
        let recordings = recorded(&event, &two, &frames, 1e-4);
        let found = aligned(&recordings).unwrap_or_else(|error| panic!("{two:?}: {error}"));
        assert_is(&found, &two, 1);
        // The other way round the roles change.
        let other = [Recorder { offset: 0.0, ..two[1] }, PLAIN];
        let recordings = recorded(&event, &other, &[frames[1], frames[0]], 1e-4);
        let found = aligned(&recordings).unwrap_or_else(|error| panic!("{other:?}: {error}"));
        assert_is(&found, &other, 1);
    }
}

#[test]
fn three_recorders_are_aligned_together() {
    let event = event(100_000, &mut Random(82));
    let three = [
        Recorder { late: 5_000, ppm: 10.0, ..PLAIN },
        Recorder { late: 20_000, delay: 0.3, ppm: -30.0, gain: -2.0, ..PLAIN },
        Recorder { delay: -0.4, ppm: 25.0, ..PLAIN },
    ];
    let found = aligned(&recorded(&event, &three, &[60_000, 60_000, 70_000], 1e-3)).unwrap();
    (1..3).for_each(|i| assert_is(&found, &three, i));
    // A delay stays in its box: a long one in that of all delays of a period, a short one in its own.
    let [_, fast, _] = &found.spec.uncertainty.clone().unwrap().delays(3)[..] else { panic!() };
    assert_eq!(fast.in_fast_periods(Seconds(1.0 / 8000.0)), FastPeriods(0.5));
    assert!(found.warnings.iter().all(|warning| matches!(warning, AlignWarning::FixedTaps { .. })));
    assert!(found.frames > 39_000 && found.frames < 60_001, "{}", found.frames);
}

#[test]
fn lost_and_clipped_samples_are_left_out() {
    let event = event(100_000, &mut Random(83));
    let two = [PLAIN, Recorder { late: 900, delay: 0.2, ppm: 15.0, ..PLAIN }];
    let mut recordings = recorded(&event, &two, &[60_000, 60_000], 1e-4);
    recordings[0][20_000..24_000].fill(f64::NAN);
    recordings[1].iter_mut().step_by(7001).for_each(|x| *x = 1.0);
    let found = aligned(&recordings).unwrap();
    assert_is(&found, &two, 1);
    let clipped = AlignWarning::Values(CalibrationWarning::Clipped { counts: vec![0, 9] });
    assert!(
        matches!(&found.warnings[..], [first, AlignWarning::FixedTaps { channel: 2, .. }] if *first == clipped)
    );
}

/// Tones of any frequency up to 0.7 of half the rate, which no two draws share.
struct Event(Vec<[f64; 2]>);

impl Event {
    fn new(dice: &mut Random) -> Self {
        Self((0..80).map(|_| [0.7 * PI * dice.part(), TAU * dice.part()]).collect())
    }

    /// Taken at first, first + step, .., with noise of this deviation.
    fn taken(&self, first: f64, step: f64, count: usize, noise: f64, dice: &mut Random) -> Vec<f64> {
        let level = 0.2 / (self.0.len() as f64).sqrt();
        let mut samples: Vec<f64> = (0..count).map(|_| noise * gaussian(dice)).collect();
        for [w, phase] in &self.0 {
            let mut pointer = Complex::from_polar(level, w * first + phase);
            let turn = Complex::from_polar(1.0, w * step);
            for sample in &mut samples {
                *sample += pointer.im;
                pointer *= turn;
            }
        }
        samples
    }
}

/// Samples by which the second recorder of a scene began late.
const LATE: f64 = 900.37;

/// Two recorders, of which the second one is fast by so many ppm, with the noise of a signal-to-noise ratio.
fn scene(ppm: f64, decibels: f64, count: usize, seed: u64) -> [Vec<f64>; 2] {
    let mut dice = Random(seed);
    let event = Event::new(&mut dice);
    let noise = 0.2 * f64::sqrt(0.5) * 10f64.powf(-0.05 * decibels);
    [(0.0, 1.0), (LATE, 1.0 / (1.0 + 1e-6 * ppm))]
        .map(|(first, step)| event.taken(first, step, count, noise, &mut dice))
}

#[test]
fn clocks_may_differ_by_2000_ppm() {
    for (ppm, seed) in [(1200.0, 21), (-1990.0, 22), (1990.0, 23)] {
        let found = aligned(&scene(ppm, 60.0, 100_000, seed)).unwrap();
        let Estimate { value, sigma } = found.channels[1].drift;
        assert!((1e6 * value - ppm).abs() < 5e6 * sigma && sigma < 1e-8, "{ppm}: {value:e} {sigma:e}");
        assert!(2 * found.measured > found.pieces, "{} of {}", found.measured, found.pieces);
        for k in [0.0, 30_000.5, 99_000.0] {
            let miss = found.instants(1).at(k) - LATE - k / (1.0 + 1e-6 * ppm);
            assert!(miss.abs() < 5.0 * found.instants(1).deviation(k), "{ppm} {k}: {miss:e}");
        }
    }
}

/// Where samples were lost or came in every sample still has its instant.
#[test]
fn steps_are_found_reported_and_followed() {
    for (ppm, steps) in [
        (20.0, vec![(40_000, 700)]),
        (0.0, vec![(30_000, -700), (52_000, 480), (80_000, 480)]),
        (1200.0, vec![(60_000, 1), (90_000, 20_000)]),
    ] {
        let [own, whole] = scene(ppm, 60.0, 120_000, 31);
        let (mut other, mut numbers, mut begin) = (Vec::new(), Vec::new(), 0);
        for &(place, lost) in &steps {
            other.extend_from_slice(&whole[begin..place]);
            numbers.extend(begin..place);
            // What comes in was recorded before.
            let surplus = i64::max(0, -lost) as usize;
            other.extend_from_slice(&whole[place - 5000..place - 5000 + surplus]);
            numbers.resize(other.len(), usize::MAX);
            begin = place + i64::max(0, lost) as usize;
        }
        other.extend_from_slice(&whole[begin..]);
        numbers.extend(begin..whole.len());
        let found = aligned(&[own, other.clone()]).unwrap();
        let clock = found.instants(1);
        let lost = |step: &ClockStep| step.lost;
        assert_eq!(
            clock.steps().iter().map(lost).collect::<Vec<_>>(),
            steps.iter().map(|s| s.1).collect::<Vec<_>>()
        );
        assert!(clock.steps().iter().all(|step| step.samples.len() < 20 + i64::max(0, -step.lost) as usize));
        let warned =
            found.warnings.iter().filter(|warning| matches!(warning, AlignWarning::Step { channel: 2, .. }));
        assert_eq!(warned.count(), steps.len());
        for (k, number) in numbers.iter().enumerate() {
            if clock.steps().iter().any(|step| step.samples.contains(&k)) {
                continue;
            }
            assert_ne!(*number, usize::MAX, "{k} came in");
            let miss = clock.at(k as f64) - LATE - *number as f64 / (1.0 + 1e-6 * ppm);
            assert!(miss.abs() < 1e-3, "{ppm} {k}: {miss:e}");
        }
        // Mended recordings are whole.
        assert_eq!(found.mended(1, &other).len(), whole.len());
    }
}

/// Of 40 draws 95 % of the values lie within their 95 % intervals, as far as chance allows.
#[test]
fn intervals_are_those_of_the_errors() {
    let (mut within, mut all) = (0, 0);
    // Every third draw takes both drifts in turns, too.
    let step = if trials::is_slow("intervals of recordings with all levels of noise") { 1 } else { 3 };
    for draw in (0..40).step_by(step) {
        let (ppm, decibels) = (20.0 * (draw % 2) as f64, 40.0 + 50.0 * draw as f64 / 39.0);
        let found = aligned(&scene(ppm, decibels, 64_000, 100 + draw)).unwrap();
        let (clock, rate) = (found.instants(1), 1.0 + 1e-6 * ppm);
        let mut add = |miss: f64, sigma: f64| {
            all += 1;
            within += i32::from(miss.abs() <= HALF_WIDTH * sigma);
        };
        for k in [1000.0, 20_000.0, 32_000.0, 45_000.0, 62_000.0] {
            add(clock.at(k) - LATE - k / rate, clock.deviation(k));
        }
        let AlignedChannel { drift, gain, offset, .. } = found.channels[1];
        add(drift.value - (rate - 1.0), drift.sigma);
        add(gain.value - 1.0, gain.sigma);
        add(offset.value, offset.sigma);
    }
    let share = f64::from(within) / f64::from(all);
    assert!((0.90..=0.98).contains(&share), "{within} of {all}");
}

#[test]
fn recordings_of_which_most_pieces_disagree_are_refused() {
    let [own, mut other] = scene(0.0, 60.0, 80_000, 41);
    let [another, _] = scene(0.0, 60.0, 80_000, 42);
    other[20_000..].copy_from_slice(&another[20_000..]);
    let refused = aligned(&[own, other]).unwrap_err();
    assert!(
        matches!(refused, AlignError::Disagree { channel: 2, agreeing, pieces, .. } if 2 * agreeing < pieces),
        "{refused}"
    );
}

#[test]
fn what_cannot_be_aligned_is_refused_with_its_reason() {
    let mut dice = Random(84);
    let noise = |dice: &mut Random, count: usize| -> Vec<f64> { (0..count).map(|_| dice.sample()).collect() };
    let [a, b] = [(); 2].map(|()| noise(&mut dice, 20_000));
    let refused = |a: &[f64], b: &[f64]| aligned(&[a.to_vec(), b.to_vec()]).unwrap_err();
    assert_eq!(refused(&a, &b), AlignError::NothingInCommon { reference: 1, channel: 2 });
    assert_eq!(refused(&a, &[0.25; 5000]), AlignError::Silent { channel: 2 });
    assert_eq!(refused(&[f64::NAN; 5000], &b), AlignError::Silent { channel: 1 });
    let short = AlignError::Overlap { frames: 100, needed: 1024 };
    assert_eq!(refused(&a, &b[..100]), short);
    let tone = |early: f64| -> Vec<f64> { (0..20_000).map(|k| (0.3 * (k as f64 + early)).sin()).collect() };
    let ambiguous = refused(&tone(0.0), &tone(123.4));
    assert!(matches!(&ambiguous, AlignError::Ambiguous { lags, .. } if lags.len() > 1), "{ambiguous:?}");
    let one = align(&spec(2), &records(&[a]), settings()).unwrap_err();
    assert_eq!(one, AlignError::Spec(CalibrateError::ChannelCount { channels: 2, records: 1 }));
}

#[test]
fn taps_that_stay_are_named() {
    let event = event(120_000, &mut Random(85));
    let two = [PLAIN, Recorder { ppm: 60.0, ..PLAIN }];
    let recordings = recorded(&event, &two, &[60_000, 60_000], 1e-4);
    let found = aligned(&recordings).unwrap();
    assert!(
        matches!(
            found.warnings[..],
            [AlignWarning::FixedTaps { channel: 2, moved }] if (moved.0 - 3.6).abs() < 0.1
        ),
        "{:?}",
        found.warnings
    );
}

/// Delays of 0.5 and 1.0 fast periods are together when the second has moved by 0.45.
#[test]
fn recorders_that_come_to_sample_at_one_instant_are_named() {
    let text = "fast_rate = 8000.0\nratio = 2\nlatency = 16\ntarget = { filter = { family = \"rc\", cutoff = 1500.0 } }\n\
                channel = [{ delay_samples = 0.5 }, { delay_samples = 1.0 }]\n";
    let spec = Spec::from_toml(text, "spec.toml").unwrap();
    let exact = |value: f64| Estimate { value, sigma: 0.0 };
    let named = |drift: f64, frames: usize| {
        let channel = |i: usize| AlignedChannel {
            skip: 0,
            delay: Estimate { value: spec.channels[i].delay, sigma: Seconds(0.0) },
            drift: exact(if i == 0 { 0.0 } else { drift }),
            gain: exact(1.0),
            offset: exact(0.0),
        };
        let lasts = spec.fast_period * (2 * frames) as f64;
        coincidence::first_coincidence(&spec, &[channel(0), channel(1)], lasts).map(|(pair, at)| (pair, at.0))
    };
    let (channels, at) = named(-1e-5, 100_000).unwrap();
    let want = 0.45 / 8000.0 / 1e-5;
    assert!(channels == [0, 1] && (at - want).abs() < 1e-9 * want, "{channels:?} {at}");
    // The recordings end before, or the clocks are one.
    assert_eq!((named(-1e-5, 20_000), named(0.0, 100_000)), (None, None));
}
