//! The signal-to-noise ratio with its parts.

use super::powers::{Conditions, NoisePowers, Powers, target_power};
use super::reconstruction::Reconstruction;
use crate::design::filters::FilterResponse;
use crate::design::{DesignError, Deviations, PeriodicFilters, Problem, SampledSignal};
use hybank_core::bank::Bank;
use hybank_core::spec::{ChannelSpec, ROUNDING_16_BITS, Spec, USUAL_RMS};
use hybank_core::units::Decibels;

/// Variance of the target over the variance of the error and of its parts, averaged over time.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize)]
pub struct Snr {
    /// All parts together.
    pub total_db: Decibels,
    /// The error from the signal, with the delays of the spec.
    pub signal_db: Decibels,
    /// The rounding of the samples to bits; `None` where the spec states none.
    pub bits_db: Option<Decibels>,
    /// The same of the noise of the converters.
    pub noise_db: Option<Decibels>,
    /// The same of their jitter.
    pub jitter_db: Option<Decibels>,
    /// What delays within the spec's `[uncertainty]` add to the error from the signal: the mean over
    /// Gaussian errors whose 95 % intervals are the stated ones, constant for each converter. `None` where
    /// all delays are exact.
    pub delays_db: Option<Decibels>,
    /// The same of the gains.
    pub gains_db: Option<Decibels>,
    /// The same of the offsets.
    pub offsets_db: Option<Decibels>,
}

/// The ratios of one way.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Ratios {
    pub(super) snr: Snr,
    /// The total with converters of 16 bits, where the spec states no noise.
    pub(super) with_16_bits: Option<Decibels>,
}

impl Ratios {
    /// The ratio by which ways are compared: with the noise of the converters, the stated or the assumed
    /// one.
    pub(super) fn with_noise(&self) -> Decibels {
        self.with_16_bits.unwrap_or(self.snr.total_db)
    }
}

/// The signal, the noise and the uncertainty for which ratios are computed.
pub(super) struct Setting {
    /// The noise is that of the spec, or that of 16 bits.
    conditions: Conditions,
    target: f64,
    noise_is_stated: bool,
}

impl Setting {
    /// Of any filters for a spec with this latency.
    ///
    /// # Errors
    /// As [`Problem::new`].
    pub(super) fn new(spec: &Spec, latency: usize) -> Result<Self, DesignError> {
        let of_converter = |channel: &ChannelSpec| NoisePowers {
            bits: channel.rounding().powi(2),
            noise: channel.noise.powi(2),
            jitter: 0.0,
        };
        let of_converters: Vec<NoisePowers> = spec.channels.iter().map(of_converter).collect();
        let mut noise = spec.layout().each(&of_converters);
        let jitter = Problem::jitter_shares(spec, latency)?;
        let signal = SampledSignal::of(&Problem::new(spec, latency)?);
        let target = target_power(&signal);
        let rms = spec.signal.as_ref().map(|signal| signal.rms);
        let is_noisy = |(own, jitter): (&NoisePowers, &f64)| own.total() + jitter > 0.0;
        let noise_is_stated = noise.iter().zip(&jitter).any(is_noisy);
        let scale = |rms: f64| target / (rms * rms);
        // Without a signal stated noise counts relative to unit density, as in the design.
        let full_scale = match rms {
            None if noise_is_stated => 1.0,
            rms => scale(rms.unwrap_or(USUAL_RMS)),
        };
        for (own, share) in noise.iter_mut().zip(jitter) {
            let bits = if noise_is_stated { own.bits } else { ROUNDING_16_BITS };
            *own = NoisePowers {
                bits: bits * full_scale,
                noise: own.noise * full_scale,
                jitter: share * target,
            };
        }
        let scaled = |spread: Deviations| Deviations { offset: spread.offset * full_scale.sqrt(), ..spread };
        let spread = Deviations::of_spec(spec).into_iter().map(scaled).collect();
        Ok(Self { conditions: Conditions { signal, noise, spread }, target, noise_is_stated })
    }

    /// The front ends, with the spectrum of the signal where it is a filter.
    pub(super) fn problem(&self) -> &Problem {
        self.conditions.signal.problem()
    }

    /// F of a way.
    pub(super) fn filters<'a>(&'a self, way: &'a Reconstruction) -> PeriodicFilters<'a> {
        let at = |theta| self.conditions.filters(way, theta, &self.conditions.signal.at(theta));
        PeriodicFilters { at: Box::new(at), lags: way.lags(), resonances: way.resonances() }
    }

    /// The ratio of the bank itself.
    ///
    /// # Errors
    /// [`DesignError::Lti`] for unstable filters.
    pub(super) fn ratio_of_bank(&self, bank: &Bank) -> Result<Ratios, DesignError> {
        let filters = FilterResponse::new(&bank.filters, bank.ratio)?;
        Ok(self.ratios(&[Reconstruction::Bank(filters)]).pop().unwrap_or_default())
    }

    /// The ratios of several ways.
    pub(super) fn ratios(&self, ways: &[Reconstruction]) -> Vec<Ratios> {
        self.conditions.powers(ways).iter().map(|powers| self.ratio(powers)).collect()
    }

    fn ratio(&self, powers: &Powers) -> Ratios {
        let Powers { signal, late, gains, offsets, noise, .. } = *powers;
        let db = |power: f64| Decibels::of_power(self.target / power);
        let of = |error: fn(&Deviations) -> f64, power: f64| {
            self.conditions.spread.iter().any(|spread| error(spread) > 0.0).then(|| db(power.max(0.0)))
        };
        let all = late + gains + offsets;
        let stated = if self.noise_is_stated { noise.total() } else { 0.0 };
        let of_noise = |power: f64| (self.noise_is_stated && power > 0.0).then(|| db(power));
        Ratios {
            snr: Snr {
                total_db: db(all + stated),
                signal_db: db(signal),
                bits_db: of_noise(noise.bits),
                noise_db: of_noise(noise.noise),
                jitter_db: of_noise(noise.jitter),
                delays_db: of(|spread| spread.delay.0, late - signal),
                gains_db: of(|spread| spread.gain, gains),
                offsets_db: of(|spread| spread.offset, offsets),
            },
            with_16_bits: (!self.noise_is_stated).then(|| db(all + noise.total())),
        }
    }
}
