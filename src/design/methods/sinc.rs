//! A comparison method: sinc interpolation of recurrent nonuniform samples (thesis 5.6.3).

use super::{Settings, Synthesis};
use crate::design::DesignError;
use crate::design::plant::LiftedPlant;
use crate::sampling::Recurrent;

/// Yen's interpolation of the recurrent nonuniform samples, for ideal front ends and the gains of the
/// converters, truncated to `settings.taps` taps per channel.
///
/// # Errors
/// [`DesignError::SincNeedsNyquist`] unless N = M; [`DesignError::Sampling`] for delays that coincide
/// modulo the slow period.
pub(crate) fn synthesise(plant: &LiftedPlant, settings: &Settings) -> Result<Synthesis, DesignError> {
    let (problem, channels, ratio) = (plant.problem(), plant.channels(), plant.ratio());
    if channels != ratio {
        return Err(DesignError::SincNeedsNyquist { channels, ratio });
    }
    let offsets: Vec<f64> = problem.channels.iter().map(|channel| -channel.delay.0).collect();
    let sets = Recurrent::new(&offsets, ratio)?;
    let taps = |i: usize| {
        let mut taps = sets.taps(i, problem.latency as f64, settings.taps);
        taps.iter_mut().for_each(|tap| *tap /= problem.channels[i].converter_gain);
        taps
    };
    Synthesis::of_taps(plant, (0..channels).map(taps).collect())
}
