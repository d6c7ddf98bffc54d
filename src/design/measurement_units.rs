//! Units in which every measurement is of about unit size.
//!
//! A gain g of channel i is undone by its filter: `F_i H_i = (F_i / g) (g H_i)`, so gamma does not depend on
//! it. The decompositions of double precision do: next to a large measurement a small one is lost to
//! rounding. The units are powers of two, so a change of units rounds nothing.

use super::DesignError;
use super::lifting::JointState;
use super::merging::MergedChannels;
use super::problem::{Channel, Problem};
use crate::linalg::power_of_two;
use crate::lti::gramian::controllability_root;

/// Sizes within this factor of one are not changed.
const USUAL: f64 = 16.0;

impl Problem {
    /// For each channel the unit u_i in which it is designed: u_i times the measurement has about unit size.
    ///
    /// # Errors
    /// [`DesignError::Lti`] if a decomposition does not converge.
    pub(super) fn measurement_units(&self) -> Result<Vec<f64>, DesignError> {
        Ok(self.measurement_sizes()?.into_iter().map(unit).collect())
    }

    /// The root mean square of the samples of each channel for white noise of unit density at the analog
    /// input, without the noise of the converter.
    ///
    /// # Errors
    /// As [`Problem::measurement_units`].
    pub(super) fn measurement_sizes(&self) -> Result<Vec<f64>, DesignError> {
        let joint = JointState::new(self)?;
        let (transition, input) = joint.over(self.ratio as f64)?;
        let outputs = joint.c() * controllability_root(&transition, &input)?;
        let size = |channel: &Channel| channel.gain.abs() * outputs.row(channel.front_end).norm();
        Ok(self.channels.iter().map(size).collect())
    }
}

/// The power of two that brings `size` near one; one if it is near one.
fn unit(size: f64) -> f64 {
    if (1.0 / USUAL..=USUAL).contains(&size) { 1.0 } else { 1.0 / power_of_two(size) }
}

impl MergedChannels {
    /// The same channels with measurements of about unit size.
    ///
    /// # Errors
    /// As [`Problem::measurement_units`].
    pub(super) fn of_unit_size(mut self) -> Result<Self, DesignError> {
        let units = self.problem.measurement_units()?;
        for (channel, unit) in self.problem.channels.iter_mut().zip(&units) {
            channel.gain *= unit;
            channel.converter_gain *= unit;
        }
        self.problem.noise.iter_mut().zip(&units).for_each(|(power, unit)| *power *= unit * unit);
        self.shares.iter_mut().for_each(|share| share.share *= units[share.representative]);
        Ok(self)
    }
}
