//! Figures against closed forms, against stored digits of another route, against the error system, and
//! against tones through virtual converters.

use super::powers::{Conditions, NoisePowers, target_power};
use super::reconstruction::Reconstruction;
use super::snr::Ratios;
use super::*;
use crate::design::filters::FilterResponse;
use crate::design::{SampledSignal, analyze_mean, filters};
use crate::tests::designed;
use hybank_core::bank::SynthesisFilters;
use hybank_core::spec::{Band, SignalSpec};
use hybank_core::units::{FastPeriods, RadiansPerFastPeriod};
use hybank_linalg::Mat;
use std::f64::consts::TAU;
use std::fmt::Write;
use trials::random::Random;

mod uncertain;

/// A system in normalised time: front ends that are all alike, delays, and a band.
struct System {
    ratio: usize,
    latency: usize,
    filter: &'static str,
    delays: &'static [f64],
    band: f64,
}

impl System {
    fn spec(&self, design: &str) -> Spec {
        let mut text = format!(
            "fast_period = 1.0\nratio = {}\nlatency = {}\ntarget = {{ filter = {} }}\ndesign = {design}\n",
            self.ratio, self.latency, self.filter
        );
        for delay in self.delays {
            let _ = write!(text, "[[channel]]\ndelay = {delay:?}\n");
        }
        let mut spec = Spec::from_toml(&text, "spec.toml").unwrap();
        if self.band > 0.0 {
            spec.signal = Some(SignalSpec::in_band(Band::up_to(Hertz(self.band))));
        }
        spec
    }

    fn bank(&self, design: &str) -> Bank {
        designed(&self.spec(design)).bank
    }
}

const FIR_24: &str = "{ method = \"fir\", taps = 24 }";
const SINC: &str = "{ method = \"sinc\", taps = 2 }";

const BUTTERWORTH_4: &str = "{ family = \"butterworth\", order = 4, cutoff = 0.1875 }";
const BUTTERWORTH_2: &str = "{ family = \"butterworth\", order = 2, cutoff = 0.4167 }";
const RC: &str = "{ family = \"rc\", cutoff = 0.6 }";
const THESIS: System = System {
    ratio: 2,
    latency: 10,
    filter: "{ num = [0.25], den = [1.0, 1.0, 0.25] }",
    delays: &[1.2, 0.6],
    band: 0.0,
};

fn white(power: &f64) -> NoisePowers {
    NoisePowers { noise: *power, ..NoisePowers::default() }
}

/// Digits of theory by an independent program (white noise in the band, no converter noise): systems A, B,
/// E, G and H of a set of twelve.
#[test]
fn usual_ways_have_the_digits_of_another_program() {
    let inf = f64::INFINITY;
    let case = |ratio, filter, delays, band, spline, interleaving, alone| {
        (System { ratio, latency: 24, filter, delays, band }, [Some(spline), interleaving, Some(alone)])
    };
    let third = "{ family = \"butterworth\", order = 2, cutoff = 0.3 }";
    for (system, want) in [
        case(2, BUTTERWORTH_4, &[1.2, 0.6], 1.0 / 6.0, 47.887, Some(11.673), inf),
        case(2, BUTTERWORTH_2, &[1.2, 0.6], 0.4167, 17.375, Some(4.583), 4.296),
        case(4, BUTTERWORTH_2, &[2.7, 1.9, 1.1, 0.2], 0.375, 23.529, Some(12.189), 1.798),
        case(4, third, &[2.9, 1.5, 0.3], 0.2625, 30.603, None, 2.874),
        case(2, RC, &[1.3, 0.8, 0.1], 0.425, 42.007, None, 4.046),
    ] {
        let plain = without_signal(&system.spec(SINC), 24).unwrap();
        let signal = SampledSignal::of(&Problem::new(&system.spec(SINC), 24).unwrap());
        let channels = system.delays.len();
        let spread = vec![Deviations::default(); channels];
        let target = target_power(&signal);
        let conditions = Conditions { signal, noise: vec![NoisePowers::default(); channels], spread };
        let ways = usual_ways::ways(&plain);
        let ratios: Vec<Ratios> = conditions
            .powers(&ways)
            .iter()
            .map(|powers| Ratios {
                with_16_bits: Some(Decibels::of_power(target / powers.signal)),
                ..Ratios::default()
            })
            .collect();
        let figures = usual_ways::figures(&ways, &ratios, |_| None);
        let found = |way| figures.iter().find(|figure| figure.way == way).map(|figure| figure.snr_db.0);
        let ways = [UsualWay::CubicSpline, UsualWay::Interleaving, UsualWay::OneChannel];
        for (way, want) in ways.into_iter().zip(want) {
            let got = found(way);
            let agree = match (got, want) {
                (Some(got), Some(want)) if want == inf => got > 250.0,
                (Some(got), Some(want)) => (got - want).abs() < 6e-4,
                (got, want) => got == want,
            };
            assert!(agree, "{way:?} of {:?}: {got:?} {want:?}", system.delays);
        }
    }
}

/// The mean-square optimum with 22 taps for the thesis example with noise, from its normal equations: the
/// covariance of 0.25 / (s + 0.5)^2 is (1 / 8) (1 + |t| / 2) e^{-|t| / 2}.
fn mean_square_optimum(noise: f64) -> Bank {
    let covariance = |t: f64| 0.125 * (1.0 + 0.5 * t.abs()) * (-0.5 * t.abs()).exp();
    let mut taps = vec![vec![0.0; 22]; 2];
    for p in 0..2 {
        let samples: Vec<(usize, usize)> = (0..2).flat_map(|i| (0..11).map(move |j| (i, j))).collect();
        let instant = |&(i, j): &(usize, usize)| -2.0 * j as f64 - THESIS.delays[i];
        let r = Mat::from_fn(22, 22, |a, b| {
            covariance(instant(&samples[a]) - instant(&samples[b])) + if a == b { noise * noise } else { 0.0 }
        });
        let b = Mat::from_fn(22, 1, |a, _| covariance(p as f64 - 10.0 - instant(&samples[a])));
        let best = hybank_linalg::solve_positive(&r, &b).unwrap();
        samples.iter().zip(&best).for_each(|(&(i, j), tap)| taps[i][p + 2 * j] = *tap);
    }
    let mut spec = THESIS.spec(SINC);
    spec.channels.iter_mut().for_each(|channel| channel.noise = noise);
    Bank { spec: Some(spec), latency: 10, ..Bank::bare(SynthesisFilters::Fir(taps), 2) }
}

/// Rms errors of that bank, without errors of the delays and with a second delay that is off by 0.5 and 3
/// fast periods (one deviation). By another route than frequencies: quadratic forms of the taps with
/// covariances, which for the cross terms are means over a grid of 4,000 delays.
#[test]
fn errors_of_noise_and_of_uncertain_delays_have_the_digits_of_covariances() {
    for (noise, spread, want) in [
        (1e-3, 0.0, 0.027_125_925_8),
        (1e-2, 0.0, 0.028_817_849_4),
        (1e-1, 0.0, 0.075_174_650_2),
        (1e-3, 0.5, 0.057_764_889_4),
        (1e-3, 3.0, 0.181_176_011_6),
    ] {
        let bank = mean_square_optimum(noise);
        let plain = without_signal(bank.spec.as_ref().unwrap(), 10).unwrap();
        let signal = SampledSignal::of(&plain);
        let spread = [0.0, spread]
            .map(|delay| Deviations { delay: FastPeriods(delay), ..Deviations::default() })
            .to_vec();
        let conditions = Conditions { signal, noise: plain.noise.iter().map(white).collect(), spread };
        let powers = conditions
            .powers(&[Reconstruction::Bank(FilterResponse::new(&bank.filters, bank.ratio).unwrap())])[0];
        let rms = (powers.late + powers.noise.total()).sqrt();
        assert!((rms / want - 1.0).abs() < 1e-5, "{noise} {:?}: {rms} {want}", conditions.spread);
    }
}

/// The error of a bank for white noise at all frequencies is the H2 norm of its error system.
#[test]
fn the_error_from_white_noise_is_that_of_the_error_system() {
    let rc = System { ratio: 3, latency: 12, filter: RC, delays: &[2.1, 0.9, 0.2], band: 0.0 };
    for (system, design, accuracy) in
        [(&THESIS, FIR_24, 2e-4), (&THESIS, "{ method = \"iir\" }", 2e-4), (&rc, FIR_24, 5e-3)]
    {
        let bank = system.bank(design);
        let signal = SampledSignal::of(&without_signal(bank.spec.as_ref().unwrap(), bank.latency).unwrap());
        let target = target_power(&signal);
        let conditions = Conditions {
            signal,
            noise: vec![white(&1.0); bank.channel_count()],
            spread: vec![Deviations::default(); bank.channel_count()],
        };
        let powers = conditions
            .powers(&[Reconstruction::Bank(FilterResponse::new(&bank.filters, bank.ratio).unwrap())])[0];
        let mean = analyze_mean(&bank).unwrap();
        let rms = powers.signal.sqrt();
        assert!((rms / mean.rms_error - 1.0).abs() < accuracy, "{rms} {}", mean.rms_error);
        assert!((powers.noise.total().sqrt() / mean.noise_gain - 1.0).abs() < 1e-4);
        let scale = crate::design::GammaScale::new(&bank, &[]).unwrap();
        assert!((target.sqrt() / scale.rms_reference - 1.0).abs() < accuracy);
    }
}

/// Converters that sample exactly in turn, and one converter that samples fast enough: no error, no images.
#[test]
fn perfect_interleaving_is_exact() {
    let unity = |ratio: usize| {
        let taps = (0..ratio).map(|i| (0..ratio).map(|n| f64::from(u8::from(n == i))).collect()).collect();
        Bank::bare(SynthesisFilters::Fir(taps), ratio)
    };
    for (ratio, delays) in [(1, &[0.0][..]), (4, &[3.0, 2.0, 1.0, 0.0][..])] {
        let system = System { ratio, latency: ratio - 1, filter: RC, delays, band: 0.3 };
        let bank = Bank { spec: Some(system.spec(SINC)), latency: ratio - 1, ..unity(ratio) };
        let figures = Figures::new(&bank).unwrap();
        assert!(figures.snr.total_db > Decibels(270.0), "{figures:?}");
        let below = |figure: Option<ToneFigure>| figure.unwrap().db.0 < -280.0;
        assert!(below(figures.image) && below(figures.gain_error), "{figures:?}");
        assert!(!figures.is_worthwhile(), "{figures:?}");
        // Noise of 16 bits at a quarter of full scale: -98.09 dB of full scale plus 12.04, and gain 1.
        let sixteen = figures.snr_16_bits_db.unwrap().0;
        assert!((sixteen - (101.105 - 12.041 - 3.0103 + 3.0103)).abs() < 0.01, "{figures:?}");
    }
}

/// A gain that is 1 % too large on one of two channels: the image is 0.5 % / 1.005, the gain error 0.5 %.
#[test]
fn a_mismatch_of_gains_has_its_closed_form() {
    let system = System { ratio: 2, latency: 1, filter: RC, delays: &[1.0, 0.0], band: 0.4 };
    let mut spec = system.spec(SINC);
    spec.channels[0].gain = 1.01;
    let taps = vec![vec![1.0, 0.0], vec![0.0, 1.0]];
    let bank = Bank { spec: Some(spec), latency: 1, ..Bank::bare(SynthesisFilters::Fir(taps), 2) };
    let figures = Figures::new(&bank).unwrap();
    let db = |ratio: f64| Decibels::of_amplitude(ratio).0;
    assert!((figures.image.unwrap().db.0 - db(0.005 / 1.005)).abs() < 1e-9, "{figures:?}");
    assert!((figures.gain_error.unwrap().db.0 - db(0.005)).abs() < 1e-9, "{figures:?}");
    // The error is 1 % of every second sample.
    assert!((figures.snr.total_db.0 + db(0.01 / 2f64.sqrt())).abs() < 1e-3, "{figures:?}");
}

/// A target with a zero within the band: its tones are left out, and said to be.
#[test]
fn a_target_that_vanishes_in_the_band_gives_no_infinities() {
    let notch = "{ num = [1.0, 0.0, 1.0], den = [1.0, 3.0, 3.0, 1.0] }";
    let system = System { ratio: 2, latency: 12, filter: notch, delays: &[1.1, 0.0], band: 0.3 };
    let bank = system.bank(FIR_24);
    // The grid need not meet 1 / (2 pi); its neighbours have small targets.
    let figures = Figures::new(&bank).unwrap();
    assert!(figures.gain_error.unwrap().db.0.is_finite() && figures.image.unwrap().db.0.is_finite());
    let zero = Bank { filters: SynthesisFilters::Fir(vec![vec![0.0]; 2]), ..bank };
    let figures = Figures::new(&zero).unwrap();
    assert_eq!(figures.image, None, "{figures:?}");
    assert!((figures.snr.total_db.0).abs() < 1e-9 && !figures.is_worthwhile(), "{figures:?}");
}

/// The same filters as taps and as matrices have the same figures.
#[test]
fn recursive_banks_have_the_figures_of_their_taps() {
    let system =
        System { ratio: 3, latency: 12, filter: BUTTERWORTH_2, delays: &[2.1, 0.9, 0.2], band: 0.35 };
    let fir = system.bank(FIR_24);
    let block = filters::to_block(&filters::lifted(&fir.filters, 3));
    let recursive = Bank { filters: SynthesisFilters::StateSpace(block), ..fir.clone() };
    let [a, b] = [fir, recursive].map(|bank| Figures::new(&bank).unwrap());
    assert!((a.snr.total_db - b.snr.total_db).0.abs() < 1e-3, "{a:?} {b:?}");
    for (a, b) in [(a.image, b.image), (a.gain_error, b.gain_error)] {
        let (a, b) = (a.unwrap(), b.unwrap());
        assert!((a.db - b.db).0.abs() < 1e-5 && (a.hertz - b.hertz).0.abs() < 1e-3, "{a:?} {b:?}");
    }
}

/// A bank of one channel is that channel alone.
#[test]
fn one_channel_is_not_compared_with_itself() {
    use UsualWay::{CubicSpline, Interleaving, LeastSquares, OneChannel, OwnCorrection};
    for (ratio, delays, want) in [
        (1, &[0.0][..], &[Interleaving, CubicSpline, LeastSquares][..]),
        (2, &[0.0], &[CubicSpline, LeastSquares]),
        (2, &[1.0, 0.0], &[Interleaving, OwnCorrection, CubicSpline, OneChannel, LeastSquares]),
    ] {
        let system = System { ratio, latency: 6, filter: BUTTERWORTH_2, delays, band: 0.2 };
        let figures = Figures::new(&system.bank(FIR_24)).unwrap();
        let found: Vec<UsualWay> = figures.usual_ways.iter().map(|figure| figure.way).collect();
        assert_eq!(found.len(), want.len(), "{found:?}");
        assert!(want.iter().all(|way| found.contains(way)), "{found:?}");
        let Setup { ratio: m, channels, .. } = figures.setup;
        assert_eq!((m, channels), (ratio, delays.len()));
    }
}

/// Skews of a hundredth of a sample: plain interleaving errs by w s, each channel's own correction by its
/// square and less, and least squares by neither. No spline is drawn there.
#[test]
fn own_corrections_leave_what_is_of_second_order() {
    let delays = &[3.01, 1.992, 1.009, 0.0];
    let system = System { ratio: 4, latency: 24, filter: RC, delays, band: 0.4 };
    let figures = Figures::new(&system.bank("{ method = \"fir\", taps = 64 }")).unwrap();
    let found =
        |way| figures.usual_ways.iter().find(|figure| figure.way == way).map(|figure| figure.snr_db.0);
    let [plain, own, least] = [UsualWay::Interleaving, UsualWay::OwnCorrection, UsualWay::LeastSquares]
        .map(|way| found(way).unwrap());
    println!("{plain} {own} {least}");
    assert!(own > 1.6 * plain && own < 2.4 * plain, "{plain} {own}");
    assert!(least > own + 10.0 && least >= figures.compared_snr().0 - 0.1, "{own} {least}");
    assert_eq!(found(UsualWay::CubicSpline), None);
    assert_eq!(figures.usual_ways.last().map(|figure| figure.way), Some(UsualWay::LeastSquares));
}

/// Two converters in turn of which one is late by s: a tone w has the image |tan(w s / 2)|.
#[test]
fn the_sfdr_of_plain_interleaving_is_that_of_its_skew() {
    let system = System { ratio: 2, latency: 12, filter: RC, delays: &[1.02, 0.0], band: 0.4 };
    let figures = Figures::new(&system.bank(FIR_24)).unwrap();
    let plain = figures.usual_ways.iter().find(|figure| figure.way == UsualWay::Interleaving).unwrap();
    let want = -20.0 * (0.5 * TAU * 0.4 * 0.02_f64).tan().log10();
    assert!((plain.sfdr_db.unwrap().0 - want).abs() < 1e-6, "{plain:?} {want}");
}

/// Each source of noise by itself, and all parts together are the total.
#[test]
fn the_parts_of_the_ratio_are_its_sum() {
    let system = System { ratio: 2, latency: 12, filter: BUTTERWORTH_2, delays: &[1.2, 0.1], band: 0.3 };
    let quiet = system.bank(FIR_24);
    let parts = |sources: [bool; 3]| {
        let mut bank = quiet.clone();
        for channel in &mut bank.spec.as_mut().unwrap().channels {
            channel.bits = sources[0].then_some(10);
            channel.noise = if sources[1] { 3e-4 } else { 0.0 };
            channel.jitter = hybank_core::units::Seconds(if sources[2] { 1e-3 } else { 0.0 });
        }
        Figures::new(&bank).unwrap().snr
    };
    let all = parts([true; 3]);
    let [bits, noise, jitter] = [[true, false, false], [false, true, false], [false, false, true]].map(parts);
    assert_eq!((bits.noise_db, noise.jitter_db, jitter.bits_db), (None, None, None));
    for (of_all, alone) in
        [(all.bits_db, bits.bits_db), (all.noise_db, noise.noise_db), (all.jitter_db, jitter.jitter_db)]
    {
        assert!((of_all.unwrap() - alone.unwrap()).0.abs() < 1e-3, "{all:?}");
    }
    let powers = [Some(all.signal_db), all.bits_db, all.noise_db, all.jitter_db];
    let sum: f64 = powers.into_iter().flatten().map(|db| 10f64.powf(-0.1 * db.0)).sum();
    assert!((all.total_db.0 + 10.0 * sum.log10()).abs() < 1e-3, "{all:?}");
}

/// A tone of amplitude 1.
struct Tone {
    omega: RadiansPerFastPeriod,
    phase: f64,
}

/// Tones at these bins of a period, with phases of their own.
fn drawn(bins: &[usize], period: usize, random: &mut Random) -> Vec<Tone> {
    let omega = |bin| RadiansPerFastPeriod(TAU * bin as f64 / period as f64);
    bins.iter().map(|&bin| Tone { omega: omega(bin), phase: TAU * random.part() }).collect()
}

/// Samples of the channels and of the target.
struct Captured {
    channels: Vec<Vec<f64>>,
    target: Vec<f64>,
}

/// Settled tones by their definition: `x_i[k]` = g_i (phi_i * f)(k M - D_i), `y_0[n]` = (phi_0 * f)(n - m0).
fn captured(problem: &Problem, tones: &[Tone], periods: usize) -> Captured {
    let through = |front_end: usize, instant: f64| {
        let of = |tone: &Tone| {
            let response = problem.front_ends[front_end].response(tone.omega);
            response.norm() * (tone.omega.0 * instant + tone.phase + response.arg()).sin()
        };
        tones.iter().map(of).sum::<f64>()
    };
    let samples = problem.channels.iter().map(|channel| {
        let delay = channel.delay.in_fast_periods().0;
        let instant = |k: usize| (k * problem.ratio) as f64 - delay;
        (0..periods).map(|k| channel.gain * through(channel.front_end, instant(k))).collect()
    });
    let wanted = |n: usize| through(problem.target, n as f64 - problem.latency as f64);
    Captured { channels: samples.collect(), target: (0..periods * problem.ratio).map(wanted).collect() }
}

/// The output of an FIR bank by its definition.
fn fused(taps: &[Vec<f64>], ratio: usize, captured: &[Vec<f64>]) -> Vec<f64> {
    let sample = |n: usize| {
        let (k, p) = (n / ratio, n % ratio);
        let of_channel = |(f, x): (&Vec<f64>, &Vec<f64>)| {
            (0..=k).take_while(|j| p + j * ratio < f.len()).map(|j| f[p + j * ratio] * x[k - j]).sum::<f64>()
        };
        taps.iter().zip(captured).map(of_channel).sum()
    };
    (0..captured[0].len() * ratio).map(sample).collect()
}

/// Tones at multiples of 1 / (M Q) that do not alias onto each other or onto their mirrors, spread evenly
/// over a band: over one period of Q frames their errors are orthogonal.
fn orthogonal_tones(random: &mut Random, [low, high]: [f64; 2], ratio: usize, frames: usize) -> Vec<usize> {
    let length = (ratio * frames) as f64;
    let wanted = frames / 5;
    let mut used = vec![false; frames];
    let mut tones = Vec::new();
    for part in 0..wanted {
        let place = low + (high - low) * (part as f64 + random.part()) / wanted as f64;
        let bin = (place * length) as usize + 1;
        let (alias, mirror) = (bin % frames, (frames - bin % frames) % frames);
        if !used[alias] && !used[mirror] && alias != mirror && (bin as f64) < high * length {
            used[alias] = true;
            used[mirror] = true;
            tones.push(bin);
        }
    }
    tones
}

fn power(values: impl Iterator<Item = f64>) -> f64 {
    values.map(|x| x * x).sum()
}

/// Predicted and measured figures of a random system with virtual converters.
fn check_prediction(seed: u64) {
    let mut random = Random(seed);
    let ratio = random.count(2, 4);
    let channels = (ratio + random.below(2)).max(2);
    let order = random.count(1, 4);
    let cutoff = 0.15 + 0.35 * random.part();
    let band = 0.1 + 0.3 * random.part();
    let mut text = format!(
        "fast_period = 1.0\nratio = {ratio}\nlatency = 12\nsignal = {{ band = {band} }}\n\
         target = {{ filter = {{ family = \"butterworth\", order = {order}, cutoff = {cutoff} }} }}\n\
         design = {{ method = \"fir\", taps = {} }}\n",
        8 * ratio
    );
    for i in 0..channels {
        let delay = ratio as f64 * (i as f64 + 0.6 * random.part()) / channels as f64;
        let _ = write!(text, "[[channel]]\ndelay = {delay}\ngain = {}\n", 1.0 + 0.1 * random.sample());
    }
    let bank = designed(&Spec::from_toml(&text, "spec.toml").unwrap()).bank;
    let figures = Figures::new(&bank).unwrap();
    let SynthesisFilters::Fir(taps) = &bank.filters else { panic!("FIR") };
    let plain = without_signal(bank.spec.as_ref().unwrap(), bank.latency).unwrap();
    let (frames, settled) = (1021, 8);
    let simulated = |tones: &[usize], random: &mut Random| {
        let captured = captured(&plain, &drawn(tones, ratio * frames, random), frames + settled);
        let output = fused(taps, ratio, &captured.channels);
        let skip = settled * ratio;
        (output[skip..].to_vec(), captured.target[skip..].to_vec())
    };
    let tones = orthogonal_tones(&mut random, [0.0, band], ratio, frames);
    let (output, target) = simulated(&tones, &mut random);
    let error = power(output.iter().zip(&target).map(|(y, z)| y - z));
    let snr = Decibels::of_power(power(target.iter().copied()) / error).0;
    let predicted = figures.snr.signal_db.0;
    println!("seed {seed}: SNR {snr:.2} dB, predicted {predicted:.2} dB");
    assert!((snr - predicted).abs() < 0.5, "seed {seed}: {snr} dB, predicted {predicted} dB\n{text}");
    check_image(&figures, &bank, (ratio, frames), |bin| simulated(&[bin], &mut Random(1)).0, seed);
}

/// The largest line beside the tone of largest image, at the nearest frequency with whole periods.
fn check_image(
    figures: &Figures,
    bank: &Bank,
    (ratio, frames): (usize, usize),
    simulated: impl FnOnce(usize) -> Vec<f64>,
    seed: u64,
) {
    let image = figures.image.unwrap();
    let length = ratio * frames;
    // Within the band, also where the image is largest at its end.
    let bin = ((image.hertz.0 * length as f64).floor() as usize).max(1);
    let lines: Vec<f64> =
        hybank_linalg::fourier::real_spectrum(&simulated(bin)).iter().map(|x| x.norm()).collect();
    let folded = bin.min(length - bin);
    let beside = lines.iter().enumerate().filter(|(k, _)| *k != folded).map(|(_, x)| *x).fold(0.0, f64::max);
    let measured = Decibels::of_amplitude(beside / lines[folded]).0;
    let plain = without_signal(bank.spec.as_ref().unwrap(), bank.latency).unwrap();
    let exact = vec![Deviations::default(); bank.channel_count()];
    let tones = ToneResponse::of_bank(&bank.filters, plain, exact).unwrap();
    let there = tones.at(bin as f64 / length as f64);
    let predicted = Decibels::of_amplitude(there.image).0;
    println!("seed {seed}: image {measured:.3} dB, predicted {predicted:.3} dB");
    assert!((measured - predicted).abs() < 0.01, "seed {seed}: {measured} dB, predicted {predicted} dB");
    assert!(predicted <= image.db.0 + 1e-9, "seed {seed}: {predicted} dB above the largest, {image:?}");
}

/// Within 0.5 dB; `HYBANK_TRIALS=30` tries thirty systems.
#[test]
fn predictions_agree_with_virtual_converters() {
    trials::trials(3).for_each(check_prediction);
}
