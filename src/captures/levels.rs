//! Gains and offsets of converters that change, on lines between some times.

use super::CaptureError;
use crate::bank::Bank;
use crate::calibrate::LevelChange;
use crate::runtime::Nonlinearity;
use crate::spec::{SpecProblem, check_gain, check_offset};
use crate::units::Seconds;

/// The gains and offsets of the converters of a bank at some times. Before the first time and after the last
/// one they stay.
#[derive(Debug, Clone, PartialEq)]
pub struct LevelTrack {
    bank: Bank,
    /// After the first frame, ascending.
    times: Vec<Seconds>,
    /// g_i of each converter, as in a spec, as many as times.
    gains: Vec<Vec<f64>>,
    /// o_i in the same way.
    offsets: Vec<Vec<f64>>,
}

impl LevelTrack {
    /// Of a bank at ascending times. Without gains or offsets these are those of the bank.
    ///
    /// # Errors
    /// [`CaptureError::Level`] for a gain or an offset that no spec may have; [`CaptureError::Polarity`].
    pub fn new(
        bank: &Bank,
        times: Vec<Seconds>,
        gains: Option<Vec<Vec<f64>>>,
        offsets: Option<Vec<Vec<f64>>>,
    ) -> Result<Self, CaptureError> {
        let steady = |values: &[f64]| values.iter().map(|value| vec![*value; times.len()]).collect();
        let gains = gains.unwrap_or_else(|| steady(&bank.gains));
        let offsets = offsets.unwrap_or_else(|| steady(&bank.offsets));
        check("gain", &gains, check_gain)?;
        check("offset", &offsets, check_offset)?;
        let changes_sign = |list: &Vec<f64>| list.iter().any(|gain| gain.signum() != list[0].signum());
        if let Some(i) = gains.iter().position(changes_sign) {
            return Err(CaptureError::Polarity { channel: i + 1 });
        }
        Ok(Self { bank: bank.clone(), times, gains, offsets })
    }

    /// The bank for samples that have been [corrected](Self::correct): how far its gains move is no
    /// uncertainty of theirs.
    pub fn bank(&self) -> Bank {
        let channels = self.bank.channel_count();
        let mut spec = self.bank.spec.clone();
        if let Some(uncertainty) = spec.as_mut().and_then(|spec| spec.uncertainty.as_mut()) {
            (uncertainty.gain, uncertainty.offset) = (None, None);
        }
        let nonlinearity = vec![Nonlinearity::default(); channels];
        Bank { spec, nonlinearity, offsets: vec![0.0; channels], ..self.bank.clone() }
    }

    /// Takes nonlinearity and offset out of samples from frame `first` on, and gives them the gain of the
    /// bank.
    pub fn correct(&self, first: usize, channels: &mut [Vec<f64>]) {
        for (i, samples) in channels.iter_mut().enumerate() {
            let (curve, nominal) = (&self.bank.nonlinearity[i], self.bank.gains[i]);
            for (frame, x) in (first..).zip(samples) {
                let time = self.bank.slow_period() * frame as f64;
                let straight = *x - curve.at(*x);
                *x = (straight - self.at(time, &self.offsets[i])) * nominal / self.at(time, &self.gains[i]);
            }
        }
    }

    /// The largest changes.
    pub fn change(&self) -> LevelChange {
        let ends = |list: &Vec<f64>| {
            let least = list.iter().copied().fold(f64::INFINITY, f64::min);
            (least, list.iter().copied().fold(f64::NEG_INFINITY, f64::max))
        };
        let gain = |(least, most): (f64, f64)| (most / least).max(least / most) - 1.0;
        LevelChange {
            gain: self.gains.iter().map(ends).map(gain).fold(0.0, f64::max),
            offset: self.offsets.iter().map(ends).map(|(least, most)| most - least).fold(0.0, f64::max),
        }
    }

    fn at(&self, time: Seconds, values: &[f64]) -> f64 {
        let after = self.times.partition_point(|known| *known <= time);
        let (Some(before), Some(value)) = (after.checked_sub(1), values.get(after)) else {
            return values[after.saturating_sub(1)];
        };
        let part = (time - self.times[before]) / (self.times[after] - self.times[before]);
        values[before] + part * (value - values[before])
    }
}

/// Refuses what no spec may have.
fn check(
    what: &'static str,
    of_converters: &[Vec<f64>],
    rule: impl Fn(f64) -> Result<(), SpecProblem>,
) -> Result<(), CaptureError> {
    for (list, channel) in of_converters.iter().zip(1..) {
        let refused = |problem| CaptureError::Level { what, channel, problem: Box::new(problem) };
        list.iter().try_for_each(|value| rule(*value)).map_err(refused)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bank::SynthesisFilters;

    /// One sample a second.
    #[test]
    fn levels_lie_on_lines_and_stay_beyond_them() {
        let mut bank = Bank::bare(SynthesisFilters::Fir(vec![vec![1.0]]), 1);
        (bank.gains, bank.offsets) = (vec![2.0], vec![0.5]);
        let times = || vec![Seconds(1.0), Seconds(3.0)];
        let track =
            LevelTrack::new(&bank, times(), Some(vec![vec![1.0, 2.0]]), Some(vec![vec![0.0, 0.5]])).unwrap();
        let mut samples = [[1.0; 5].to_vec()];
        track.correct(0, &mut samples);
        assert_eq!(samples[0], [2.0, 2.0, 2.0 * 0.75 / 1.5, 0.5, 0.5]);
        assert_eq!(track.change(), LevelChange { gain: 1.0, offset: 0.5 });
        assert_eq!(track.bank().offsets, [0.0]);
        let own = LevelTrack::new(&bank, times(), Some(vec![vec![1.0, 2.0]]), None).unwrap();
        assert_eq!(own.change(), LevelChange { gain: 1.0, offset: 0.0 });
        let refused =
            LevelTrack::new(&bank, times(), Some(vec![vec![1.0, f64::NAN]]), None).unwrap_err().to_string();
        assert!(refused.contains("gain of channel 1"), "{refused}");
        let refused = LevelTrack::new(&bank, times(), Some(vec![vec![1.0, -1.0]]), None).unwrap_err();
        assert!(matches!(refused, CaptureError::Polarity { channel: 1 }));
    }
}
