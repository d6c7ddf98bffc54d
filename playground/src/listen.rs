//! Virtual converters capture a signal, and the bank fuses it: the sound before and after.

use crate::answer::{Answer, Refusal, bank};
use hybank::analog::StrictlyProper;
use hybank::bank::{Bank, FrameSample};
use hybank::design::Problem;
use hybank::io::wav::WavReader;
use hybank::overview;
use hybank::pipeline::{Settings, fused};
use hybank::quantity::readable;
use hybank::simulate::{Analog, Captured, Recording, Source, Tone, capture, frames, interleaved};
use hybank::spec::{SignalSpec, Spec};
use hybank::units::{FastPeriods, Hertz, Seconds};
use serde::Serialize;
use std::f64::consts::{PI, TAU};
use std::io::Read;

/// Rates at which browsers play; a bank of another rate is played slower or faster, at [`USUAL_RATE`].
const PLAYABLE: std::ops::RangeInclusive<f64> = 8e3..=192e3;
const USUAL_RATE: f64 = 48e3;
/// Seconds of the signals that are made here, and of a recording at most.
const LENGTH: f64 = 2.0;
const MOST_SECONDS: f64 = 30.0;
/// Tones of the chord, and where the sweep begins and ends, relative to the band that is played.
const CHORD: [f64; 5] = [0.04, 0.11, 0.27, 0.52, 0.83];
const SWEEP: [f64; 2] = [0.01, 0.95];
/// Output samples at either end that the signal-to-noise ratio leaves out, beside the latency.
const SETTLING: usize = 200;

#[derive(Serialize)]
struct Playback {
    /// Samples per second at which to play.
    rate: f64,
    /// Samples of each of the three recordings, which follow: ideal, interleaved, fused.
    samples: usize,
    interleaved_snr: f64,
    fused_snr: f64,
    /// The signal, in a sentence.
    text: String,
    /// The spectra.
    svg: String,
}

/// A signal and what it is.
struct Signal {
    analog: Analog,
    /// Fast samples.
    samples: usize,
    text: String,
}

/// `input` is a bank file; for the signal `recording`, a WAV file follows it after a zero byte.
pub(crate) fn listen(signal: &str, input: &[u8]) -> Result<Answer, Refusal> {
    let split = input.iter().position(|byte| *byte == 0).unwrap_or(input.len());
    let bank = bank(&input[..split])?;
    let spec =
        bank.spec.as_ref().ok_or_else(|| Refusal::new("the bank has no spec, so nothing can be captured"))?;
    let signal = match signal {
        "sweep" => sweep(spec)?,
        "chord" => chord(spec)?,
        "recording" => recording(spec, input.get(split + 1..).unwrap_or_default())?,
        _ => return Err(Refusal::new(format!("\"{signal}\": the signals are sweep, chord and recording"))),
    };
    playback(&bank, spec, &signal)
}

fn playback(bank: &Bank, spec: &Spec, signal: &Signal) -> Result<Answer, Refusal> {
    // Latency 0: what is fused lines up with the time of the signal.
    let problem = Problem::new(spec, spec.wait()).map_err(Refusal::new)?;
    let frames = frames(&problem, &signal.analog, signal.samples, false).map_err(Refusal::new)?;
    let Captured { mut channels, target } = capture(&problem, &signal.analog, frames);
    for (samples, channel) in channels.iter_mut().zip(&spec.channels) {
        samples.iter_mut().for_each(|x| *x += channel.offset);
    }
    let channels = samples_of_frames(bank, &channels);
    let before = interleaved(&bank.sample_delays(), bank.ratio, bank.wait(), &channels);
    let after = fused(bank, &channels, Settings::default()).map_err(Refusal::new)?;
    let snr_of = |output: &[f64]| snr(&target, output, SETTLING + bank.latency);
    let chart =
        overview::spectra(spec.fast_period.rate(), &[("plain interleaving", &before), ("fused", &after)]);
    let playback = Playback {
        rate: played_at(spec),
        samples: target.len(),
        interleaved_snr: snr_of(&before),
        fused_snr: snr_of(&after),
        text: signal.text.clone(),
        svg: chart.to_svg().map_err(Refusal::new)?,
    };
    Answer::with_samples(&playback, &[&target, &before, &after])
}

/// The samples of each place in the frames, which converters with rates of their own fill in a row.
fn samples_of_frames(bank: &Bank, converters: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let of = |FrameSample { converter, number }: FrameSample| {
        converters[converter].iter().skip(number).step_by(bank.samples[converter]).copied().collect()
    };
    bank.layout().iter().map(of).collect()
}

/// 10 log10 of the power of the target over that of the error, without `skipped` samples at either end.
fn snr(target: &[f64], output: &[f64], skipped: usize) -> f64 {
    let skipped = skipped.min(target.len() / 4);
    let compared = skipped..target.len() - skipped;
    let power = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>();
    let error = power(&mut compared.clone().map(|n| output[n] - target[n]));
    10.0 * (power(&mut target[compared].iter().copied()) / error).log10()
}

fn is_playable(spec: &Spec) -> bool {
    PLAYABLE.contains(&spec.fast_period.rate().0)
}

fn played_at(spec: &Spec) -> f64 {
    if is_playable(spec) { spec.fast_period.rate().0 } else { USUAL_RATE }
}

/// Fast samples of a signal that is made here.
fn usual_samples(spec: &Spec) -> usize {
    (LENGTH * played_at(spec)) as usize
}

/// The end of the band that the target passes and the signal occupies, at most half of the fast rate.
fn band(spec: &Spec) -> Result<Hertz, Refusal> {
    let target = StrictlyProper::new(&spec.target, spec.fast_period).map_err(Refusal::new)?;
    let edge = target.half_power_frequency().0.min(PI);
    let passed = edge / TAU / spec.fast_period.0;
    let occupied = spec.signal.as_ref().and_then(SignalSpec::band).map_or(passed, |band| band.high.0);
    Ok(Hertz(passed.min(occupied)))
}

/// The description of a signal that is made here, with the rate at which it is played.
fn with_rate(spec: &Spec, signal: String) -> String {
    if is_playable(spec) {
        return signal;
    }
    let rates = [USUAL_RATE, spec.fast_period.rate().0].map(|rate| readable(rate, "S/s"));
    format!("{signal}, played at {} in place of {}", rates[0], rates[1])
}

fn sweep(spec: &Spec) -> Result<Signal, Refusal> {
    let (band, samples) = (band(spec)?, usual_samples(spec));
    let [start, end] = SWEEP.map(|share| Hertz(share * band.0));
    let length = Seconds(spec.fast_period.0 * samples as f64);
    let source = Source::Chirp { start, end, length, amplitude: 1.0 };
    let text =
        with_rate(spec, format!("A sweep from {} to {}", readable(start.0, "Hz"), readable(end.0, "Hz")));
    Ok(Signal { analog: Analog::Known(source.normalised(spec.fast_period)), samples, text })
}

fn chord(spec: &Spec) -> Result<Signal, Refusal> {
    let band = band(spec)?;
    let tones = CHORD.map(|share| Hertz(share * band.0));
    let tone = |f: Hertz| Tone { omega: f.angular(), amplitude: 1.0 / CHORD.len() as f64, phase: 0.3 };
    let source = Source::Tones(tones.map(tone).to_vec());
    let listed = tones.map(|f| readable(f.0, "Hz")).join(", ");
    let text = with_rate(spec, format!("Tones of {listed}"));
    Ok(Signal {
        analog: Analog::Known(source.normalised(spec.fast_period)),
        samples: usual_samples(spec),
        text,
    })
}

/// The first channel of a WAV file.
fn recording(spec: &Spec, file: &[u8]) -> Result<Signal, Refusal> {
    let mut reader = WavReader::new(file, "the recording").map_err(Refusal::new)?;
    let header = reader.header().clone();
    let rate = Hertz(f64::from(header.rate));
    let most = (MOST_SECONDS * rate.0) as usize;
    // One frame more tells whether the recording goes on.
    let mut bytes = Vec::new();
    let longest = ((most + 1) * header.frame_bytes()) as u64;
    reader.by_ref().take(longest).read_to_end(&mut bytes).map_err(Refusal::new)?;
    let format = header.layout.format;
    let all = bytes.chunks_exact(header.frame_bytes()).map(|frame| format.decode(frame));
    let samples: Vec<f64> = all.take(most).map(|x| if x.is_finite() { x } else { 0.0 }).collect();
    if samples.is_empty() {
        return Err(Refusal::new("the recording has no samples"));
    }
    let fast = if is_playable(spec) { spec.fast_period.rate() } else { rate };
    let recording = Recording::new(&samples, FastPeriods(fast / rate));
    let analog = Analog::Recorded(recording);
    Ok(Signal {
        samples: analog.usual_samples(spec.ratio),
        analog,
        text: recording_text(spec, header.channels, bytes.len() / header.frame_bytes() > most),
    })
}

fn recording_text(spec: &Spec, channels: usize, is_cut: bool) -> String {
    let mut text = String::from("The recording");
    if channels > 1 {
        text += ", its first channel";
    }
    if is_cut {
        text += &format!(", its first {MOST_SECONDS} s");
    }
    if !is_playable(spec) {
        text += ", as if its rate were that of the bank";
    }
    text
}
