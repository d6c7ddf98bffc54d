//! The pictures of a bank.

use crate::bank::{Bank, SynthesisFilters};
use crate::design::responses::{analysis_gains, fir_response, front_end_gains, impulse_responses};
use crate::design::{self, DesignError, norm_at};
use crate::figures::{ToneOutput, tone_curve};
use crate::linalg::Complex;
use crate::plot::{AxisScale, Chart, Curves, Guide, Series};
use crate::quantity::scale_of;
use crate::spec::SignalSpec;
use crate::spec::{ErrorPoint, FrameSample};
use crate::units::{FastPeriods, Hertz};
use std::f64::consts::TAU;

/// Frequencies of a curve.
const POINTS: usize = 601;
/// Decades of a logarithmic axis of frequencies, and those of them above half the fast rate in the picture
/// of the front ends.
const DECADES: f64 = 3.0;
const ABOVE_NYQUIST: f64 = 0.5;
/// Gains below this are drawn there, in decibels.
const FLOOR_DB: f64 = -200.0;
/// Group delays are drawn where the gain is within this many decibels of the largest.
const PASS_BAND_DB: f64 = 60.0;
/// Channels that a picture shows.
const MOST_CHANNELS: usize = 6;
/// The smallest tap that a picture shows, relative to the largest.
const SEEN: f64 = 1e-3;
/// Largest error of a delay that is drawn, and the points up to it on either side.
const DELAY_ERROR: FastPeriods = FastPeriods(0.02);
const DELAY_ERRORS: i32 = 5;

/// A picture and what it shows.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Of its file, without extension.
    pub name: &'static str,
    /// For a reader who sees it for the first time.
    pub caption: &'static str,
    /// The curves.
    pub chart: Chart,
}

/// All pictures of a bank with a spec.
///
/// # Errors
/// [`DesignError`] if the bank has no spec or does not fit it.
pub fn pictures(bank: &Bank) -> Result<Vec<Picture>, DesignError> {
    let responses = impulse_responses(bank);
    let picture = |name, caption, chart| Picture { name, caption, chart };
    Ok(vec![
        picture(
            "tones",
            "What the bank makes of a tone, by its frequency at the analog input: the largest image, and the error of gain \
             and phase, both relative to the tone.",
            tones(bank)?,
        ),
        picture("front-ends", "What the target and the converters pass.", front_ends(bank)?),
        picture(
            "analysis",
            "The gains of the norm-equivalent analysis filters: what reaches the samples of each front end at the fast \
             rate, with all that aliases there.",
            analysis(bank)?,
        ),
        picture("filters", "What each synthesis filter passes, at the fast rate.", gains(bank, &responses)),
        picture("phase", "The phase of each synthesis filter, where it passes.", phases(bank, &responses)),
        picture(
            "group-delay",
            "By how much each synthesis filter delays, where it passes.",
            group_delays(bank, &responses),
        ),
        picture(
            "impulse-responses",
            "What each synthesis filter gives for one sample: its taps, those of the channels side by side.",
            impulses(bank, &responses),
        ),
        picture(
            "error",
            "The largest gain from the signal's source to the error. Its maximum is gamma; the lower bound is \
             computed for banks of this method and size.",
            error(bank)?,
        ),
        picture(
            "delay-error",
            "gamma if the true delay of one channel is not that of the bank.",
            delay_error(bank)?,
        ),
    ])
}

/// Images and errors of gain over the band of the figures.
fn tones(bank: &Bank) -> Result<Chart, DesignError> {
    let tones = tone_curve(bank, POINTS)?;
    let (factor, x_label) = axis(tones.last().map_or(Hertz(1.0), |(hertz, _)| *hertz));
    let curve = |label: &str, of: fn(&ToneOutput) -> f64| Series {
        label: label.into(),
        points: tones.iter().map(|(hertz, tone)| (hertz.0 * factor, decibels(of(tone)))).collect(),
    };
    let (image, gain_error) =
        (curve("largest image", |tone| tone.image), curve("error of gain and phase", |tone| tone.gain_error));
    let (title, x_label) = ("Images and error of gain", format!("input {x_label}"));
    Ok(Chart::lines(title, x_label, "relative to the tone, dB", vec![image, gain_error]))
}

fn decibels(gain: f64) -> f64 {
    (20.0 * gain.log10()).max(FLOOR_DB)
}

fn channel(i: usize) -> String {
    format!("channel {}", i + 1)
}

/// The synthesis filters' names: that of the channel, and the number of its sample where it has several per
/// frame.
fn filter_names(bank: &Bank) -> Vec<String> {
    let name = |FrameSample { converter, number }| match bank.samples[converter] {
        1 => channel(converter),
        _ => format!("{}, sample {}", channel(converter), number + 1),
    };
    bank.layout().iter().map(name).collect()
}

/// The unit of a frequency axis up to `most`, and the factor that brings hertz there.
fn axis(most: Hertz) -> (f64, String) {
    let (factor, unit) = scale_of(most.0, "Hz");
    (factor, format!("frequency, {unit}"))
}

fn nyquist(bank: &Bank) -> Hertz {
    Hertz(0.5 / bank.fast_period.0)
}

/// Over decades up to `top`, where a curve has [`POINTS`].
fn decades(top: Hertz) -> Vec<Hertz> {
    let step = DECADES / (POINTS - 1) as f64;
    (0..POINTS).rev().map(|k| top * 10f64.powf(-step * k as f64)).collect()
}

/// Analog filters go on above half the fast rate.
fn front_ends(bank: &Bank) -> Result<Chart, DesignError> {
    let frequencies = decades(nyquist(bank) * 10f64.powf(ABOVE_NYQUIST));
    let gains = front_end_gains(bank, &frequencies)?;
    Ok(of_target_and_channels(bank, "Gain of the front ends", &frequencies, &gains))
}

fn analysis(bank: &Bank) -> Result<Chart, DesignError> {
    let frequencies = decades(nyquist(bank));
    let gains = analysis_gains(bank, &frequencies)?;
    Ok(of_target_and_channels(bank, "Gain of the equivalent analysis filters", &frequencies, &gains))
}

/// Gains of the target and of each channel.
fn of_target_and_channels(bank: &Bank, title: &str, frequencies: &[Hertz], all: &[Vec<f64>]) -> Chart {
    let (factor, x_label) = axis(frequencies.last().copied().unwrap_or(nyquist(bank)));
    let curve = |index: usize| Series {
        label: index.checked_sub(1).map_or_else(|| "target".to_owned(), channel),
        points: frequencies
            .iter()
            .zip(all)
            .map(|(f, gains)| (f.0 * factor, decibels(gains[index])))
            .collect(),
    };
    let count = 1 + bank.channel_count().min(MOST_CHANNELS - 1);
    over_decades(bank, title, factor, x_label, (0..count).map(curve).collect())
}

/// Gains over decades of the frequency, with what limits the signal.
fn over_decades(bank: &Bank, title: &str, factor: f64, x_label: String, series: Vec<Series>) -> Chart {
    let guides = limits(bank).into_iter().map(|(label, at)| Guide { label, x: at.0 * factor }).collect();
    Chart { x_scale: AxisScale::Decades, guides, ..Chart::lines(title, x_label, "gain, dB", series) }
}

/// Half the rates, and the ends of the band.
fn limits(bank: &Bank) -> Vec<(String, Hertz)> {
    let slow = |samples: usize| Hertz(0.5 * samples as f64 / bank.slow_period().0);
    let mut limits = vec![("half the output rate".to_owned(), nyquist(bank))];
    for (i, &samples) in bank.samples.iter().enumerate() {
        let is_new = !bank.samples[..i].contains(&samples) && samples != bank.ratio;
        let of = if bank.samples.iter().all(|other| *other == samples) {
            "a converter".to_owned()
        } else {
            channel(i)
        };
        limits.extend(is_new.then(|| (format!("half the rate of {of}"), slow(samples))));
    }
    let band = bank.spec.as_ref().and_then(|spec| spec.signal.as_ref()).and_then(SignalSpec::band);
    let ends =
        band.into_iter().flat_map(|band| [("begin of the band", band.low), ("end of the band", band.high)]);
    limits.extend(ends.filter(|(_, end)| end.0 > 0.0).map(|(label, end)| (label.to_owned(), end)));
    limits
}

/// One curve per channel of a function of its response and group delay.
fn by_frequency(
    bank: &Bank,
    responses: &[Vec<f64>],
    frequencies: &[Hertz],
    value: impl Fn(Complex<f64>, f64) -> f64,
) -> (String, Vec<Series>) {
    let (factor, x_label) = axis(nyquist(bank));
    let curve = |(label, taps): (String, &Vec<f64>)| {
        let point = |frequency: &Hertz| {
            let w = frequency.angular().per_fast_period(bank.fast_period);
            let (response, delay) = fir_response(taps, w);
            (frequency.0 * factor, value(response, delay))
        };
        Series { label, points: frequencies.iter().map(point).collect() }
    };
    let series = filter_names(bank).into_iter().zip(responses).take(MOST_CHANNELS).map(curve);
    (x_label, series.collect())
}

/// Evenly from 0 to half the fast rate.
fn evenly(bank: &Bank) -> Vec<Hertz> {
    (0..POINTS).map(|k| nyquist(bank) * (k as f64 / (POINTS - 1) as f64)).collect()
}

fn gains(bank: &Bank, responses: &[Vec<f64>]) -> Chart {
    let frequencies = decades(nyquist(bank));
    let (x_label, series) =
        by_frequency(bank, responses, &frequencies, |response, _| decibels(response.norm()));
    over_decades(bank, "Gain of the synthesis filters", axis(nyquist(bank)).0, x_label, series)
}

fn group_delays(bank: &Bank, responses: &[Vec<f64>]) -> Chart {
    let least = pass_band(bank, responses);
    let delay = |response: Complex<f64>, delay: f64| if response.norm() >= least { delay } else { f64::NAN };
    let (x_label, series) = by_frequency(bank, responses, &evenly(bank), delay);
    let title = "Group delay of the synthesis filters, where they pass";
    Chart::lines(title, x_label, "group delay, fast samples", series)
}

/// The phases without jumps of whole turns; where a filter does not pass they have no meaning.
fn phases(bank: &Bank, responses: &[Vec<f64>]) -> Chart {
    let least = pass_band(bank, responses);
    let phase = |response: Complex<f64>, _| if response.norm() >= least { response.arg() } else { f64::NAN };
    let (x_label, mut series) = by_frequency(bank, responses, &evenly(bank), phase);
    for curve in &mut series {
        let mut last = 0.0;
        for (_, phase) in curve.points.iter_mut().filter(|point| point.1.is_finite()) {
            *phase += TAU * ((last - *phase) / TAU).round();
            last = *phase;
        }
    }
    Chart::lines("Phase of the synthesis filters, where they pass", x_label, "phase, rad", series)
}

/// The least gain at which a filter passes.
fn pass_band(bank: &Bank, responses: &[Vec<f64>]) -> f64 {
    let (_, gains) = by_frequency(bank, responses, &evenly(bank), |response, _| response.norm());
    let largest = gains.iter().flat_map(|curve| &curve.points).map(|point| point.1).fold(0.0, f64::max);
    largest * 10f64.powf(-PASS_BAND_DB / 20.0)
}

fn impulses(bank: &Bank, responses: &[Vec<f64>]) -> Chart {
    let seen = match bank.filters {
        SynthesisFilters::Fir(_) => usize::MAX,
        SynthesisFilters::StateSpace(_) => seen(responses),
    };
    let curve = |(label, taps): (String, &Vec<f64>)| Series {
        label,
        points: taps.iter().take(seen).enumerate().map(|(n, tap)| (n as f64, *tap)).collect(),
    };
    let series = filter_names(bank).into_iter().zip(responses).take(MOST_CHANNELS).map(curve).collect();
    let chart = Chart::lines("Impulse responses of the synthesis filters", "fast samples", "tap", series);
    Chart { curves: Curves::Stems, ..chart }
}

/// The fast samples after which nothing can be seen of recursive filters, which go on without end.
fn seen(responses: &[Vec<f64>]) -> usize {
    let largest = responses.iter().flatten().fold(0.0, |most: f64, tap| most.max(tap.abs()));
    let last = |taps: &Vec<f64>| taps.iter().rposition(|tap| tap.abs() >= SEEN * largest);
    responses.iter().filter_map(last).max().map_or(0, |last| last + 1)
}

fn error(bank: &Bank) -> Result<Chart, DesignError> {
    let response = design::error_response(bank, POINTS)?;
    let (factor, x_label) = axis(Hertz(0.5 / bank.slow_period().0));
    let mut series = vec![Series {
        label: "error".into(),
        points: response.iter().map(|(f, gain)| (f.0 * factor, decibels(*gain))).collect(),
    }];
    let ends = [Hertz(0.0), Hertz(0.5 / bank.slow_period().0)];
    for (label, bound) in
        [("gamma, upper bound", bank.gamma.upper), ("computed lower bound", bank.gamma.lower)]
    {
        series.extend(bound.filter(|bound| *bound > 0.0).map(|bound| Series {
            label: label.into(),
            points: ends.iter().map(|f| (f.0 * factor, decibels(bound))).collect(),
        }));
    }
    let title = "Largest gain from the signal's source to the error";
    Ok(Chart::lines(title, x_label + ", modulo the slow rate", "gain, dB (h = 1)", series))
}

/// gamma where the delay of one channel is off.
fn delay_error(bank: &Bank) -> Result<Chart, DesignError> {
    let gamma = |channel: usize, step: i32| -> Result<(f64, f64), DesignError> {
        // Closer together where the errors are small: there gamma has a corner.
        let share = f64::from(step) / f64::from(DELAY_ERRORS);
        let mut point = ErrorPoint::none(bank.channel_count());
        point.delays[channel] = DELAY_ERROR * (share * share.abs());
        Ok((point.delays[channel].0, norm_at(bank, &point)?))
    };
    let curve = |channel: usize| -> Result<Series, DesignError> {
        let points = (-DELAY_ERRORS..=DELAY_ERRORS).map(|step| gamma(channel, step));
        Ok(Series { label: format!("channel {}", channel + 1), points: points.collect::<Result<_, _>>()? })
    };
    let series = (0..bank.channel_count().min(MOST_CHANNELS)).map(curve).collect::<Result<_, _>>()?;
    let title = "gamma with a delay that is not that of the bank";
    Ok(Chart::lines(title, "error of the delay, fast samples", "gamma (h = 1)", series))
}
