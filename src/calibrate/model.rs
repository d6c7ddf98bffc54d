//! The channels of a spec as a calibration sees them: nominal values and responses, what is fitted of them,
//! and the present values. Time counts in fast periods.

use super::error::CalibrateError;
use super::fit::{ChannelParameter, FittedValues};
use crate::analog::{AnalogError, StableFilter, StrictlyProper};
use crate::linalg::{CMat, Complex};
use crate::spec::{Band, ChannelSpec, Cutoff, FilterSpec, HALF_WIDTH, SignalSpec, Spec};
use crate::units::{Hertz, RadiansPerFastPeriod, Seconds};
use std::cmp::Ordering;
use std::f64::consts::TAU;
use std::ops::RangeInclusive;

/// Step of ln(cut-off) for central differences: the error of the difference, its square over six, and the
/// rounding, eps over it, are both far below a per cent of the slope.
const CUTOFF_STEP: f64 = 1e-4;
/// A filter is a low-pass if it passes constants with this share of its largest gain: all ripples are less.
const LOW_PASS: f64 = 0.1;
/// Most Nyquist zones of the fast rate below the signal: no converter's clock is steady enough for more.
const MOST_ZONES: f64 = 1e6;

/// Front ends, delays, gains and offsets of the channels, as the spec says.
///
/// With w in rad per fast period, channel i delivers of the analog signal e^{jwt} the samples
///
/// ```text
/// g_i Phi_i(j w / c_i) e^{jw(kM - D_i)} + o_i,   c_i = 1
/// ```
///
/// where c_i scales the cut-off frequency of its front end, or of one stage of it.
#[derive(Debug, Clone)]
pub(crate) struct ChannelModel {
    /// M.
    pub(super) ratio: usize,
    /// h.
    pub(super) fast_period: Seconds,
    /// D_i, fast periods.
    pub(super) delays: Vec<f64>,
    /// g_i.
    pub(super) gains: Vec<f64>,
    /// o_i.
    pub(super) offsets: Vec<f64>,
    pub(super) front_ends: Vec<StrictlyProper>,
    /// The standard deviations of ln c_i that the spec states.
    pub(super) stated_cutoffs: Vec<Option<f64>>,
    /// The stages that c_i scales, if it does not scale the whole front ends.
    stages: Option<Vec<FrontEndStage>>,
    /// The frequencies that the signal occupies, cycles per fast period.
    pub(super) band: RangeInclusive<f64>,
}

impl ChannelModel {
    /// The model of `spec`.
    ///
    /// # Errors
    /// [`CalibrateError::Filter`] for a filter that cannot be realised.
    pub(crate) fn new(spec: &Spec) -> Result<Self, CalibrateError> {
        let realise = |(i, channel): (usize, &ChannelSpec)| {
            realised(&channel.filter, spec.fast_period, &format!("channel {}", i + 1))
        };
        Ok(Self {
            ratio: spec.ratio,
            fast_period: spec.fast_period,
            delays: spec.delays_in_fast_periods().iter().map(|delay| delay.0).collect(),
            gains: spec.channels.iter().map(|channel| channel.gain).collect(),
            offsets: spec.channels.iter().map(|channel| channel.offset).collect(),
            front_ends: spec.channels.iter().enumerate().map(realise).collect::<Result<_, _>>()?,
            stated_cutoffs: (0..spec.channels.len()).map(|i| stated_cutoff(spec, i)).collect(),
            stages: None,
            band: occupied(spec)?,
        })
    }

    /// The same with the delays of another spec.
    pub(crate) fn with_delays(&self, spec: &Spec) -> Self {
        let delays = spec.delays_in_fast_periods().iter().map(|delay| delay.0).collect();
        Self { delays, ..self.clone() }
    }

    /// The same, where the cut-offs to be fitted are those of a part of the front ends of `spec`.
    ///
    /// # Errors
    /// [`CalibrateError::NoSuchStage`], [`CalibrateError::Stage`].
    pub(super) fn scaling(&self, part: Cutoff, spec: &Spec) -> Result<Self, CalibrateError> {
        let Cutoff::Stage(number) = part else { return Ok(Self { stages: None, ..self.clone() }) };
        let stage = |(i, channel): (usize, &ChannelSpec)| {
            let (channel, stages) = (i + 1, channel.filter.stages());
            if number >= stages.len() {
                let stage = number + 1;
                return Err(CalibrateError::NoSuchStage { channel, stage, stages: stages.len() });
            }
            FrontEndStage::new(stages, number, self.fast_period).map_err(|source| CalibrateError::Stage {
                channel,
                stage: number + 1,
                source: Box::new(source),
            })
        };
        let stages = spec.channels.iter().enumerate().map(stage).collect::<Result<_, _>>()?;
        Ok(Self { stages: Some(stages), ..self.clone() })
    }

    /// N.
    pub(super) fn channels(&self) -> usize {
        self.delays.len()
    }

    /// The channels that are not the reference.
    pub(super) fn others(&self, reference: usize) -> impl Iterator<Item = usize> + use<> {
        (0..self.channels()).filter(move |&i| i != reference)
    }

    /// 1 / (M h).
    pub(crate) fn slow_rate(&self) -> Hertz {
        (self.fast_period * self.ratio as f64).rate()
    }

    /// Phi_i(j w / c) with c = e^`ln_cutoff`, or this of one of its stages times the others at j w.
    pub(super) fn response(&self, i: usize, w: f64, ln_cutoff: f64) -> Complex<f64> {
        let scaled = RadiansPerFastPeriod(w * (-ln_cutoff).exp());
        match &self.stages {
            Some(stages) => stages[i].scaled.response(scaled) * stages[i].others_at(w),
            None => self.front_ends[i].response(scaled),
        }
    }

    /// The derivative of the logarithm of [`Self::response`] by ln c.
    pub(super) fn cutoff_slope(&self, i: usize, w: f64, ln_cutoff: f64) -> Complex<f64> {
        let at = |step: f64| self.response(i, w, ln_cutoff + step);
        (at(CUTOFF_STEP) / at(-CUTOFF_STEP)).ln() / (2.0 * CUTOFF_STEP)
    }

    /// g_i Phi_i(jw) e^{-jw D_i}, nominal.
    pub(crate) fn nominal(&self, i: usize, w: f64) -> Complex<f64> {
        self.response(i, w, 0.0) * Complex::from_polar(1.0, -w * self.delays[i]) * self.gains[i]
    }

    /// nu_k = (W + 2 pi k) / M, the analog frequency of an alias of the slow frequency W.
    pub(super) fn alias(&self, w: f64, alias: i32) -> f64 {
        (w + TAU * f64::from(alias)) / self.ratio as f64
    }

    /// The Nyquist zone of the fast rate, from 0, in which the middle of the signal lies.
    pub(super) fn fast_zone(&self) -> usize {
        (self.band.start() + self.band.end()).floor().min(MOST_ZONES) as usize
    }

    /// The `count` aliases k of the slow frequency W that a signal in the band occupies first: those nearest
    /// to the band, and of those in it the lowest ones.
    pub(super) fn occupied_aliases(&self, w: f64, count: usize) -> Vec<i32> {
        let outside = |alias: i32| {
            let cycles = self.alias(w, alias).abs() / TAU;
            ((self.band.start() - cycles).max(cycles - self.band.end()).max(0.0), cycles)
        };
        let highest = (self.band.start().min(MOST_ZONES) * self.ratio as f64).ceil() as i32;
        let reach = highest + count as i32;
        let mut aliases: Vec<i32> = (-reach..=reach).collect();
        aliases.sort_by(|a, b| outside(*a).partial_cmp(&outside(*b)).unwrap_or(Ordering::Equal));
        aliases.truncate(count);
        aliases
    }

    /// A_ik = g_i Phi_i(j nu_k / c_i) e^{-2 pi j k D_i / M}: the phase e^{-j W D_i / M} that all aliases
    /// share is removed from the spectral matrices.
    pub(super) fn steering(&self, point: &ChannelValues, w: f64, aliases: &[i32]) -> CMat {
        CMat::from_fn(self.channels(), aliases.len(), |i, column| {
            let alias = aliases[column];
            let cycles = (f64::from(alias) * point.delays[i] / self.ratio as f64).fract();
            self.response(i, self.alias(w, alias), point.ln_cutoffs[i])
                * Complex::from_polar(point.gain(i, self), -TAU * cycles)
        })
    }
}

/// One stage of a front end.
#[derive(Debug, Clone)]
struct FrontEndStage {
    scaled: StableFilter,
    /// The stages before and after it, if there are any.
    others: Option<StableFilter>,
}

impl FrontEndStage {
    /// Number `number` (from 0) of these.
    fn new(stages: &[FilterSpec], number: usize, h: Seconds) -> Result<Self, AnalogError> {
        let others = [&stages[..number], &stages[number + 1..]].concat();
        let others =
            (!others.is_empty()).then(|| StableFilter::new(&FilterSpec::Cascade { cascade: others }, h));
        Ok(Self { scaled: StableFilter::new(&stages[number], h)?, others: others.transpose()? })
    }

    fn others_at(&self, w: f64) -> Complex<f64> {
        self.others.as_ref().map_or(Complex::ONE, |others| others.response(RadiansPerFastPeriod(w)))
    }
}

fn realised(filter: &FilterSpec, h: Seconds, place: &str) -> Result<StrictlyProper, CalibrateError> {
    let refused = |source| CalibrateError::Filter { place: place.to_owned(), source: Box::new(source) };
    StrictlyProper::new(filter, h).map_err(refused)
}

/// The standard deviation of ln c_i, also of the reference.
fn stated_cutoff(spec: &Spec, i: usize) -> Option<f64> {
    let half_width = spec.uncertainty.as_ref()?.cutoff.as_ref()?.of(i);
    (half_width > 0.0).then_some(half_width / HALF_WIDTH)
}

/// The signal's band in cycles per fast period; without one the Nyquist zone of the fast rate with the
/// frequency that the target passes best, where it is a band-pass.
fn occupied(spec: &Spec) -> Result<RangeInclusive<f64>, CalibrateError> {
    if let Some(Band { low, high }) = spec.signal.as_ref().and_then(SignalSpec::band) {
        return Ok(low.per_fast_period(spec.fast_period).0..=high.per_fast_period(spec.fast_period).0);
    }
    let target = realised(&spec.target, spec.fast_period, "the target")?;
    let gain = |w: f64| target.response(RadiansPerFastPeriod(w)).norm();
    let resonances = target.poles().iter().map(|pole| pole.im.abs());
    let best = resonances.max_by(|a, b| gain(*a).total_cmp(&gain(*b))).unwrap_or(0.0);
    let zone = if gain(0.0) > LOW_PASS * gain(best) { 0.0 } else { (2.0 * best / TAU).floor() };
    Ok(0.5 * zone..=0.5 * (zone + 1.0))
}

/// One fitted parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Parameter {
    /// From 0; the reference only with its cut-off.
    pub(super) channel: usize,
    pub(super) kind: ChannelParameter,
}

/// The present values of all channels.
#[derive(Debug, Clone)]
pub(super) struct ChannelValues {
    pub(super) parameters: Vec<Parameter>,
    /// Fast periods.
    pub(super) delays: Vec<f64>,
    /// ln(g_i / nominal).
    pub(super) ln_gains: Vec<f64>,
    /// ln c_i.
    pub(super) ln_cutoffs: Vec<f64>,
}

impl ChannelValues {
    /// The values of the spec.
    pub(super) fn nominal(model: &ChannelModel, fit: FittedValues, reference: usize) -> Self {
        let of = |channel| fit.kinds().into_iter().map(move |kind| Parameter { channel, kind });
        Self {
            parameters: model.others(reference).flat_map(of).collect(),
            delays: model.delays.clone(),
            ln_gains: vec![0.0; model.channels()],
            ln_cutoffs: vec![0.0; model.channels()],
        }
    }

    /// g_i.
    pub(super) fn gain(&self, i: usize, model: &ChannelModel) -> f64 {
        model.gains[i] * self.ln_gains[i].exp()
    }

    /// Adds a step of all parameters.
    pub(super) fn advance(&mut self, step: &[f64]) {
        for (parameter, step) in self.parameters.iter().zip(step) {
            let values = match parameter.kind {
                ChannelParameter::Delay => &mut self.delays,
                ChannelParameter::Gain => &mut self.ln_gains,
                ChannelParameter::Cutoff => &mut self.ln_cutoffs,
            };
            values[parameter.channel] += step;
        }
    }

    /// The value of a parameter.
    pub(super) fn value(&self, Parameter { channel, kind }: Parameter) -> f64 {
        match kind {
            ChannelParameter::Delay => self.delays[channel],
            ChannelParameter::Gain => self.ln_gains[channel],
            ChannelParameter::Cutoff => self.ln_cutoffs[channel],
        }
    }

    /// The index of a parameter.
    pub(super) fn index(&self, channel: usize, kind: ChannelParameter) -> Option<usize> {
        self.parameters.iter().position(|&p| p == Parameter { channel, kind })
    }
}
