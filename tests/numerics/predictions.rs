//! Predicted figures of random systems against those of virtual converters.

use hybank::bank::{Bank, SynthesisFilters};
use hybank::design::{DesignOptions, Problem, design};
use hybank::figures::{Figures, tone_curve};
use hybank::linalg::fourier;
use hybank::simulate::{Analog, Source, Tone, capture};
use hybank::spec::Spec;
use hybank::units::{Decibels, RadiansPerFastPeriod};
use std::f64::consts::TAU;
use std::fmt::Write;
use trials::random::Random;

/// The front ends themselves, without the spectrum of the signal.
fn without_signal(bank: &Bank) -> Problem {
    let spec = Spec { signal: None, ..bank.spec.clone().unwrap() };
    Problem::new(&spec, bank.latency).unwrap()
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
    let bank =
        design(&Spec::from_toml(&text, "spec.toml").unwrap(), &DesignOptions::without_proof()).unwrap().bank;
    let figures = Figures::new(&bank).unwrap();
    let SynthesisFilters::Fir(taps) = &bank.filters else { panic!("FIR") };
    let plain = without_signal(&bank);
    let (frames, settled) = (1021, 8);
    let simulated = |tones: &[usize], random: &mut Random| {
        let tone = |&bin: &usize| Tone {
            omega: RadiansPerFastPeriod(TAU * bin as f64 / (ratio * frames) as f64),
            amplitude: 1.0,
            phase: TAU * random.part(),
        };
        let signal = Analog::Known(Source::Tones(tones.iter().map(tone).collect()));
        let captured = capture(&plain, &signal, frames + settled);
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
    let lines: Vec<f64> = fourier::real_spectrum(&simulated(bin)).iter().map(|x| x.norm()).collect();
    let folded = bin.min(length - bin);
    let beside = lines.iter().enumerate().filter(|(k, _)| *k != folded).map(|(_, x)| *x).fold(0.0, f64::max);
    let measured = Decibels::of_amplitude(beside / lines[folded]).0;
    let curve = tone_curve(bank, 4001).unwrap();
    let place =
        curve.partition_point(|(hertz, _)| hertz.0 < bin as f64 / length as f64).clamp(1, curve.len() - 1);
    let [(low, below), (high, above)] = [&curve[place - 1], &curve[place]];
    let share = (bin as f64 / length as f64 - low.0) / (high.0 - low.0);
    let there = below.image + share * (above.image - below.image);
    let predicted = Decibels::of_amplitude(there).0;
    println!("seed {seed}: image {measured:.3} dB, predicted {predicted:.3} dB");
    assert!((measured - predicted).abs() < 0.01, "seed {seed}: {measured} dB, predicted {predicted} dB");
    assert!(predicted <= image.db.0 + 1e-9, "seed {seed}: {predicted} dB above the largest, {image:?}");
}

/// Within 0.5 dB; `HYBANK_TRIALS=30` tries thirty systems.
#[test]
fn predictions_agree_with_virtual_converters() {
    trials::trials(3).for_each(check_prediction);
}
