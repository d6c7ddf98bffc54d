//! Delays, gains, offsets and cut-offs from a known waveform.
//!
//! With v_i = phi_i * f computed from the waveform's samples, least squares fits
//!
//! ```text
//! x_i[k] = g_i v_i(k M - D_i - L) + o_i + noise
//! ```
//!
//! to each channel. The lag L between waveform and captures is common; it is found by correlation and drops
//! out of the delays relative to the reference. With the derivative v' freed from its parts along 1 and v,
//! var(D_i) = s^2 / (g^2 sum v'^2).

mod channel;
mod lag;
#[cfg(test)]
mod tests;

use super::error::CalibrateError;
use super::estimates::Fitted;
use super::model::Model;
use super::parameters::{Kind, Point};
use super::record::Record;
use super::remark::Remark;
use super::settings::Settings;
use crate::linalg::Mat;
use crate::simulate::Recording;
use crate::spec::ChannelSpec;
use crate::units::FastPeriods;
use channel::{ChannelFit, FrontEnd, Solved};
use lag::lag_of;

/// Least samples of a waveform, and least frames that it covers.
const LEAST_SAMPLES: usize = 64;
const LEAST_FRAMES: usize = 64;

/// The samples of a known waveform.
#[derive(Debug, Clone, Copy)]
pub(super) struct Training<'a> {
    pub(super) samples: &'a [f64],
    pub(super) spacing: FastPeriods,
}

/// Calibrates from a known waveform.
pub(super) fn fit(
    model: &Model,
    written: &[ChannelSpec],
    records: &[Record],
    training: Training<'_>,
    settings: Settings,
) -> Result<Fitted, CalibrateError> {
    let Training { samples, spacing } = training;
    let is_usable = samples.len() >= LEAST_SAMPLES && samples.iter().all(|x| x.is_finite());
    if !(is_usable && spacing.0 > 0.0 && spacing.0.is_finite()) {
        return Err(CalibrateError::Waveform { samples: samples.len(), spacing });
    }
    let channels =
        Channels { model, written, records, recording: Recording::new(samples, spacing), settings };
    Ok(relative(model, &channels.solve()?, settings))
}

/// The problems of all channels.
struct Channels<'a> {
    model: &'a Model,
    written: &'a [ChannelSpec],
    records: &'a [Record],
    recording: Recording,
    settings: Settings,
}

impl Channels<'_> {
    /// The reference first: its lag is the best start for the others.
    fn solve(&self) -> Result<Vec<Solved>, CalibrateError> {
        let reference = self.settings.reference;
        let first = self.solve_from(reference, self.lag(reference)?)?;
        let lag = first.values.delay - self.model.delays[reference].0;
        let mut first = Some(first);
        let solved = |i| match first.take_if(|_| i == reference) {
            Some(first) => Ok(first),
            None => self.solve_other(i, lag),
        };
        (0..self.records.len()).map(solved).collect()
    }

    fn solve_other(&self, i: usize, lag: f64) -> Result<Solved, CalibrateError> {
        self.solve_from(i, lag).or_else(|refused| {
            // A capture of another channel begins elsewhere: its own correlation finds it.
            self.solve_from(i, self.lag(i)?).map_err(|_| refused)
        })
    }

    fn lag(&self, i: usize) -> Result<f64, CalibrateError> {
        lag_of(self.model, &self.records[i], &self.recording, i)
    }

    fn solve_from(&self, i: usize, lag: f64) -> Result<Solved, CalibrateError> {
        let Self { model, records, settings, .. } = self;
        let channel = ChannelFit {
            channel: i,
            record: &records[i],
            recording: &self.recording,
            front_end: FrontEnd { written: &self.written[i], fast_period: model.fast_period },
            ratio: model.ratio as f64,
            frames: records[i].samples.len(),
        };
        // The reference has the cut-off of the spec.
        let cutoff = settings.fit.cutoff && i != settings.reference;
        channel.solve(lag + model.delays[i].0, model.gains[i], cutoff)
    }
}

/// The values relative to the reference, with the errors of both.
fn relative(model: &Model, solved: &[Solved], settings: Settings) -> Fitted {
    let Settings { fit, reference } = settings;
    let mut point = Point::nominal(model, fit, reference);
    let first = &solved[reference];
    let gain_scale = first.values.gain / model.gains[reference];
    let count = point.parameters.len();
    let mut covariance = Mat::zeros(count, count);
    let variance =
        |solved: &Solved, column: usize| solved.covariance[(column, column)] * solved.colour.powi(2);
    let mut steps = vec![0.0; count];
    for (k, parameter) in point.parameters.iter().enumerate() {
        let own = &solved[parameter.channel];
        let nominal = model.delays[parameter.channel].0 - model.delays[reference].0;
        let gain = |solved: &Solved| variance(solved, 1) / solved.values.gain.powi(2);
        let (step, squares) = match parameter.kind {
            Kind::Delay => {
                (own.values.delay - first.values.delay - nominal, variance(own, 0) + variance(first, 0))
            }
            Kind::Gain => {
                let relative = own.values.gain / gain_scale / model.gains[parameter.channel];
                (relative.abs().ln(), gain(own) + gain(first))
            }
            Kind::Cutoff => (own.values.ln_cutoff, variance(own, 3)),
        };
        steps[k] = step;
        covariance[(k, k)] = squares;
    }
    point.advance(steps.into_iter());
    let mut fitted = Fitted::new(point, covariance);
    if fit.offset {
        let offset = |solved: &Solved| (solved.values.offset, variance(solved, 2).sqrt());
        fitted.offsets = Some(solved.iter().map(offset).collect());
    }
    fitted.frames = solved.iter().map(|solved| solved.frames).min().unwrap_or(0);
    let coloured = solved.iter().enumerate().filter(|(_, solved)| solved.colour > 1.0);
    let remark =
        |(i, solved): (usize, &Solved)| Remark::ResidualNotWhite { channel: i + 1, misfit: solved.colour };
    fitted.remarks.extend(coloured.map(remark));
    fitted
}
