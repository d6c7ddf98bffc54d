//! The figures of recordings, with what they mean.

use crate::bank::{Bank, SynthesisFilters};
use crate::measure::{MeasureError, Measurement, Settings, Spur, measure};
use crate::simulate::interleaved;
use crate::units::Hertz;

/// Fast samples at either end that are not measured, beside the latency and the length of the filters: a
/// recursive bank settles in that time.
const MARGIN: usize = 512;
/// Least part of the recording that stays.
const LEAST_PART: usize = 2;

/// A figure: its name, its value, its unit and what it means.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Figure {
    /// As in the report.
    pub name: &'static str,
    /// Rounded.
    pub value: String,
    /// Of the value.
    pub unit: &'static str,
    /// In words.
    pub meaning: String,
}

/// The figures of a measurement in the order of the report.
pub fn column(measured: &Measurement) -> Vec<Figure> {
    let figure = |name, value: f64, digits: usize, unit, meaning: &str| Figure {
        name,
        value: format!("{value:.digits$}"),
        unit,
        meaning: meaning.to_owned(),
    };
    let db = |name, value: f64, meaning| figure(name, value, 2, "dB", meaning);
    let mut figures = vec![
        db("SINAD", measured.sinad.0, "tone over all else, from the residual of the sine fit"),
        figure("ENOB", measured.enob, 3, "bits", "from SINAD: (SINAD - 1.76) / 6.02"),
        figure(
            "ENOB, full scale",
            measured.enob_full_scale,
            3,
            "bits",
            "of a tone of full scale in the same noise",
        ),
        db("SNR", measured.snr.0, "tone over noise: no harmonics, no spurs"),
        db("THD", measured.thd.0, "harmonics over tone"),
    ];
    if let Some(interleaving) = measured.interleaving {
        figures.push(db("interleaving", interleaving.0, "interleaving spurs over tone"));
    }
    if let Some(spur) = measured.worst_interleaving() {
        let noise = if spur.above_noise { "" } else { ", below the noise" };
        let meaning = format!("at {:.3}: {}{noise}", spur.frequency, causes(spur));
        figures.push(figure("worst of these", spur.level.0, 2, "dBc", &meaning));
    }
    figures.push(figure("SFDR", measured.sfdr.0, 2, "dBc", "tone over the largest spur"));
    if let Some(sfdr) = measured.sfdr_without_interleaving {
        figures.push(figure("SFDR, converters", sfdr.0, 2, "dBc", "without interleaving spurs"));
    }
    figures.push(figure(
        "noise density",
        measured.noise_density.0,
        2,
        "dBFS/Hz",
        "relative to a sine of full scale",
    ));
    figures
}

/// All that is expected at a spur's frequency.
pub fn causes(spur: &Spur) -> String {
    spur.causes.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
}

/// The figures of both.
///
/// ```
/// use hybank::bank::{Bank, SynthesisFilters};
/// use hybank::overview::{BeforeAfter, DrawnRecording, column, spur_chart};
/// use hybank::{measure::Settings, units::Hertz};
/// // Two time-interleaved converters, the second one with a gain of 0.9, and a bank that corrects it.
/// let bank = Bank::bare(SynthesisFilters::Fir(vec![vec![1.0, 0.0], vec![0.0, 1.0 / 0.9]]), 2);
/// let signal: Vec<f64> = (0..8192).map(|n| 0.5 * (0.7 * f64::from(n)).sin()).collect();
/// let captures = [0, 1].map(|i| signal.iter().skip(i).step_by(2).map(|x| x * [1.0, 0.9][i]).collect());
/// let both = BeforeAfter::of(&bank, Hertz(48e3), &captures, &signal, Vec::new())?;
/// assert!(both.before.sinad.0 < 30.0 && both.after.sinad.0 > 200.0);
/// assert_eq!(column(&both.after)[0].name, "SINAD");
/// let drawn = DrawnRecording { label: "fused", measurement: Some(&both.after), comparison: None };
/// let chart = spur_chart(drawn, &Settings::default(), || unreachable!("it is measured"));
/// assert_eq!(chart.series[0].label, "fused");
/// # Ok::<(), hybank::overview::Unmeasured>(())
/// ```
#[derive(Debug, serde::Serialize)]
pub struct BeforeAfter {
    /// Of plain interleaving: each output sample is the input sample that was taken nearest to it.
    pub before: Measurement,
    /// Of the output of the bank.
    pub after: Measurement,
}

/// Why one of two recordings cannot be measured.
#[derive(Debug, thiserror::Error)]
#[error("{which}: {error}")]
pub struct Unmeasured {
    /// What it is.
    pub which: &'static str,
    /// Why.
    pub error: MeasureError,
}

impl BeforeAfter {
    /// Of captures, and of what `bank` made of them at the fast `rate`, with these tones, or the largest
    /// one.
    ///
    /// # Errors
    /// [`Unmeasured`].
    pub fn of(
        bank: &Bank,
        rate: Hertz,
        captures: &[Vec<f64>],
        fused: &[f64],
        tones: Vec<Hertz>,
    ) -> Result<Self, Unmeasured> {
        let rails = (f64::NEG_INFINITY, f64::INFINITY);
        let settings = Settings { tones, converters: bank.ratio, rails, ..Settings::default() };
        let of = |which, samples: &[f64]| {
            measure(inner(bank, samples), rate, &settings).map_err(|error| Unmeasured { which, error })
        };
        let plain = interleaved(&bank.sample_delays(), bank.ratio, bank.wait(), captures);
        Ok(Self { before: of("plain interleaving", &plain)?, after: of("the output", fused)? })
    }
}

/// The samples without those at the ends, where the filters lack input.
fn inner<'a>(bank: &Bank, samples: &'a [f64]) -> &'a [f64] {
    let taps = match &bank.filters {
        SynthesisFilters::Fir(taps) => taps.iter().map(Vec::len).max().unwrap_or(0),
        SynthesisFilters::StateSpace(_) => MARGIN,
    };
    let margin = (bank.latency + taps + MARGIN).min(samples.len() / (2 * LEAST_PART));
    &samples[margin..samples.len() - margin]
}
