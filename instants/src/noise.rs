//! The search for the noise of recordings.

use hybank_linalg::LinalgError;

/// How far the noise may lie below the signal: recorders have no more.
const DECADES: i32 = 12;
/// By what the variance of the noise changes from trial to trial after that: 3 and 1 dB.
const FACTORS: [f64; 2] = [1.995_262_314_968_879_6, 1.258_925_411_794_167_2];

/// Noises, over the power of the signal in each recording, and how badly they predict.
pub(super) struct NoiseSearch {
    levels: Vec<f64>,
    misfit: f64,
}

/// How badly samples that are left out are predicted with these levels.
pub(super) type Misfit<'a> = &'a dyn Fn(&[f64]) -> Result<f64, LinalgError>;

impl NoiseSearch {
    pub(super) fn new(recordings: usize) -> Self {
        Self { levels: vec![1.0; recordings], misfit: f64::INFINITY }
    }

    /// The levels found.
    pub(super) fn levels(&self) -> &[f64] {
        &self.levels
    }

    /// The best decade for all: far below the right value the likelihood is flat, and a walk would stay
    /// there.
    pub(super) fn decades(&mut self, misfit: Misfit<'_>) -> Result<(), LinalgError> {
        let count = self.levels.len();
        for decade in 0..=DECADES {
            self.take_if_better(vec![10.0_f64.powi(-decade); count], misfit, 0.0)?;
        }
        Ok(())
    }

    /// Walks with the levels of `some` together; the first step must be better by `gain`.
    pub(super) fn walk(&mut self, some: &[usize], misfit: Misfit<'_>, gain: f64) -> Result<(), LinalgError> {
        for step in FACTORS.into_iter().flat_map(|factor| [factor, 1.0 / factor]) {
            let mut gain = gain;
            loop {
                let mut levels = self.levels.clone();
                some.iter().for_each(|&i| levels[i] *= step);
                if !self.take_if_better(levels, misfit, gain)? {
                    break;
                }
                gain = 0.0;
            }
        }
        Ok(())
    }

    fn take_if_better(
        &mut self,
        levels: Vec<f64>,
        misfit: Misfit<'_>,
        gain: f64,
    ) -> Result<bool, LinalgError> {
        let found = misfit(&levels)?;
        let is_better = found + gain < self.misfit;
        if is_better {
            (self.levels, self.misfit) = (levels, found);
        }
        Ok(is_better)
    }
}
