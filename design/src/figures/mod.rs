//! Figures of a bank in the user's terms: the signal-to-noise ratio of the spec's signal, the largest image
//! and the largest error of gain of a tone, and what the usual ways would give.
//!
//! # Tones
//! A tone at the analog frequency w gives the samples `g_i Phi_i(j w) e^{-j w D_i} e^{j w k M}` (h = 1), and
//! the bank answers with tones at w + 2 pi k / M ([`ToneOutput`]). The one for k = 0 against the target's
//! is the error of gain and phase; the others are images. The largest image over a band predicts the
//! spurious-free dynamic range. Delays and gains within the spec's `[uncertainty]` count as the mean over
//! Gaussian errors whose 95 % intervals are the stated ones, constant for each converter.
//!
//! # Signal-to-noise ratio
//! Variance of the target over the variance of the error, averaged over time, in decibels. For white noise
//! in the band of the spec's `[signal]`; for the spectrum |W|^2 where that is a filter; without the table
//! for white noise at all frequencies, as in the thesis. The front ends stand before the samples in any
//! case. The parts are the error from the signal, the noise of the converters, and what delays, gains and
//! offsets that are off add ([`Snr`]). All are integrals of amplitudes over frequency, so 200 dB are
//! resolved.
//!
//! # Usual ways
//! One channel alone with its Wiener filter, plain interleaving, each channel's own correction, and the
//! cubic spline through all samples, for the same signal, noise and uncertainty, from their exact
//! periodically time-varying responses. Each has an SNR, and an SFDR unless it is one channel alone. Beside
//! them stand the taps of least squares that are as long as the bank's. A bank of one channel is not
//! compared with one channel. Where the spec states no noise, all are compared with converters of 16 bits:
//! without any noise one channel alone would be exact wherever the signal fits into it.

mod correction;
mod powers;
mod reconstruction;
mod setup;
mod snr;
mod spline;
mod usual_ways;

pub use crate::design::{BandSource, FigureBand, ToneOutput};
pub use setup::Setup;
pub use snr::Snr;
pub use usual_ways::{Alone, UsualFigure, UsualWay};

use crate::design::{DesignError, Deviations, LiftedPlant, Problem, ToneResponse, Worst};
use hybank_core::bank::Bank;
use hybank_core::spec::{Band, Spec};
use hybank_core::units::{CyclesPerFastPeriod, Decibels, Hertz};
use hybank_verify::analog::resolved_band;
use reconstruction::Reconstruction;
use snr::Setting;

/// By how many decibels a bank must beat the usual ways to be recommended.
const LEAST_GAIN: Decibels = Decibels(1.0);

/// Share of the resolved band that a signal may take, so that a filter can end it.
const RESOLVED_SHARE: f64 = 0.9;

/// The figures of a bank.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Figures {
    /// The band of the tones, and of the signal where the spec has one.
    pub band: FigureBand,
    /// The signal-to-noise ratio of the bank.
    pub snr: Snr,
    /// The same with converters of 16 bits and a signal of the spec's rms; `None` where the spec states the
    /// noise of the converters.
    pub snr_16_bits_db: Option<Decibels>,
    /// The largest image relative to its tone; `None` where the bank loses a tone of the band altogether.
    pub image: Option<ToneFigure>,
    /// The largest image at worst over the box of the spec's `[uncertainty]`, to first order; `None` as for
    /// `image`, and where all delays and gains are exact.
    pub image_at_worst: Option<ToneFigure>,
    /// The largest relative error of gain and phase; `None` as for `image`.
    pub gain_error: Option<ToneFigure>,
    /// Whether the target is zero somewhere in the band; the tones there are left out.
    pub target_vanishes: bool,
    /// The usual ways, the best one first; least-squares taps come last.
    pub usual_ways: Vec<UsualFigure>,
    /// gamma for inputs of any spectrum; `None` without `[signal]`, where gamma says it.
    pub any_input: Option<f64>,
    /// How the bank was designed.
    #[serde(skip)]
    pub setup: Setup,
}

/// A figure of a tone.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct ToneFigure {
    /// The figure, relative to the tone.
    pub db: Decibels,
    /// The frequency of the tone at the analog input.
    pub hertz: Hertz,
}

impl ToneFigure {
    fn new(spec: &Spec, tone: &ToneOutput, ratio: f64) -> Self {
        let hertz = Hertz(tone.frequency.0 / spec.fast_period.0);
        Self { db: Decibels::of_amplitude(ratio), hertz }
    }
}

impl Figures {
    /// Of a bank with its spec.
    ///
    /// # Errors
    /// [`DesignError::NoSpec`] for a bank without front ends, [`DesignError::Lti`] for unstable filters,
    /// [`DesignError::Analog`] as for a design.
    pub fn new(bank: &Bank) -> Result<Self, DesignError> {
        let spec = bank.spec.as_ref().ok_or(DesignError::NoSpec)?;
        let plain = without_signal(spec, bank.latency)?;
        let band = FigureBand::new(spec, &plain);
        let tones = ToneResponse::of_bank(&bank.filters, plain.clone(), Deviations::of_spec(spec))?;
        let Worst { image, image_at_worst, gain_error, vanishes } = tones.worst(band.cycles(spec));
        let setting = Setting::new(spec, bank.latency)?;
        let ways = usual_ways::usual_ways(bank, spec, setting.problem(), band.cycles(spec))?;
        let ratios = setting.ratios(&ways);
        let own = setting.ratio_of_bank(bank)?;
        let sfdr = |way: &Reconstruction| {
            // One channel alone has its images as they are.
            way.is_relative().then_some(())?;
            let tones = ToneResponse::new(setting.filters(way), plain.clone(), Deviations::of_spec(spec));
            tones.worst(band.cycles(spec)).image.map(|tone| -Decibels::of_amplitude(tone.image))
        };
        Ok(Self {
            band,
            snr: own.snr,
            snr_16_bits_db: own.with_16_bits,
            image: image.map(|tone| ToneFigure::new(spec, &tone, tone.image)),
            image_at_worst: image_at_worst.map(|tone| ToneFigure::new(spec, &tone, tone.image_at_worst)),
            gain_error: gain_error.map(|tone| ToneFigure::new(spec, &tone, tone.gain_error)),
            target_vanishes: vanishes,
            usual_ways: usual_ways::figures(&ways, &ratios, sfdr),
            any_input: any_input(bank, spec, &plain)?,
            setup: Setup::new(bank, spec),
        })
    }

    /// The ratio by which the bank is compared with the usual ways: that of `snr`, or with converters of 16
    /// bits where the spec states no noise.
    pub fn compared_snr(&self) -> Decibels {
        self.snr_16_bits_db.unwrap_or(self.snr.total_db)
    }

    /// By how much the bank beats the best of the usual ways.
    pub fn gain_over_usual_ways(&self) -> Option<Decibels> {
        Some(self.compared_snr() - self.usual_ways.first()?.snr_db)
    }

    /// Whether the bank beats the usual ways by a decibel.
    pub fn is_worthwhile(&self) -> bool {
        self.gain_over_usual_ways().is_some_and(|gain| gain >= LEAST_GAIN)
    }
}

/// Only the signal-to-noise ratio of [`Figures`].
///
/// # Errors
/// As [`Figures::new`].
pub fn snr(bank: &Bank) -> Result<Snr, DesignError> {
    let spec = bank.spec.as_ref().ok_or(DesignError::NoSpec)?;
    Ok(Setting::new(spec, bank.latency)?.ratio_of_bank(bank)?.snr)
}

/// The two figures that errors of the channels change most.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct KeyFigures {
    /// The signal-to-noise ratio, all parts together.
    pub snr_db: Decibels,
    /// The largest image relative to its tone; `None` where the bank loses a tone of the band altogether.
    pub image_db: Option<Decibels>,
}

impl KeyFigures {
    /// Those of the [`Figures`] of `bank`.
    ///
    /// # Errors
    /// As [`Figures::new`].
    pub fn new(bank: &Bank) -> Result<Self, DesignError> {
        let spec = bank.spec.as_ref().ok_or(DesignError::NoSpec)?;
        let plain = without_signal(spec, bank.latency)?;
        let band = FigureBand::new(spec, &plain).cycles(spec);
        let Worst { image, .. } =
            ToneResponse::of_bank(&bank.filters, plain, Deviations::of_spec(spec))?.worst(band);
        let image_db = image.map(|tone| Decibels::of_amplitude(tone.image));
        Ok(Self { snr_db: snr(bank)?.total_db, image_db })
    }
}

/// A band for the signal of a spec that has none: what the target passes, with a tenth of the resolved band
/// to spare where the target passes more.
///
/// # Errors
/// As [`Problem::new`].
pub fn target_band(spec: &Spec) -> Result<Option<Band>, DesignError> {
    let problem = without_signal(spec, spec.latency.unwrap_or(0))?;
    let FigureBand { low_hertz, high_hertz, .. } =
        FigureBand::new(&Spec { signal: None, ..spec.clone() }, &problem);
    let roomy = resolved_band(spec) * RESOLVED_SHARE;
    let high = if low_hertz < roomy { Hertz(high_hertz.0.min(roomy.0)) } else { high_hertz };
    Ok((low_hertz < high).then_some(Band { low: low_hertz, high }))
}

/// The tones of `bank` at `points` frequencies of the band of its [`Figures`], with the fast period of the
/// spec.
///
/// # Errors
/// As [`Figures::new`].
pub fn tone_curve(bank: &Bank, points: usize) -> Result<Vec<(Hertz, ToneOutput)>, DesignError> {
    let spec = bank.spec.as_ref().ok_or(DesignError::NoSpec)?;
    let plain = without_signal(spec, bank.latency)?;
    let band = FigureBand::new(spec, &plain).cycles(spec);
    let tones = ToneResponse::of_bank(&bank.filters, plain, Deviations::of_spec(spec))?.curve(band, points);
    let hertz = |CyclesPerFastPeriod(f): CyclesPerFastPeriod| Hertz(f / spec.fast_period.0);
    Ok(tones.into_iter().map(|tone| (hertz(tone.frequency), tone)).collect())
}

/// The front ends themselves, without the spectrum of the signal.
fn without_signal(spec: &Spec, latency: usize) -> Result<Problem, DesignError> {
    Problem::new(&Spec { signal: None, ..spec.clone() }, latency)
}

fn any_input(bank: &Bank, spec: &Spec, plain: &Problem) -> Result<Option<f64>, DesignError> {
    match spec.signal {
        Some(_) => Ok(Some(LiftedPlant::new(plain).bank_norm(&bank.filters)?.gain)),
        None => Ok(None),
    }
}

#[cfg(test)]
mod tests;
