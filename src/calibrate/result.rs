//! What a calibration found.

use super::measured::{Modulus, Tone};
use super::remark::Remark;
use crate::sine_fit::Estimate;
use crate::units::FastPeriods;

/// What a calibration found.
#[derive(Debug, Clone)]
pub struct Calibration {
    /// The reference channel, from 0.
    pub reference: usize,
    /// One per channel.
    pub channels: Vec<ChannelEstimate>,
    /// The tones, if there were any.
    pub tones: Vec<Tone>,
    /// Delays are known modulo this, if tones were used.
    pub modulus: Option<Modulus>,
    /// Frames that took part.
    pub frames: usize,
    /// Clipped samples of each channel, all left out.
    pub clipped: Vec<usize>,
    /// Square root of chi squared per degree of freedom: 1 where the model fits to the noise. `None` if
    /// there is nothing left to judge it by.
    pub misfit: Option<f64>,
    /// What a reader of the estimates must know.
    pub remarks: Vec<Remark>,
}

/// The values of one channel; `None` where the value of the spec stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChannelEstimate {
    /// D_i.
    pub delay: Option<Estimate<FastPeriods>>,
    /// g_i.
    pub gain: Option<Estimate<f64>>,
    /// o_i, in the unit of the samples.
    pub offset: Option<Estimate<f64>>,
    /// The factor of the cut-off frequency of Phi_i.
    pub cutoff: Option<Estimate<f64>>,
}
