//! The search for the noise of recordings.

use hybank_linalg::LinalgError;

/// By what the variance of the noise changes from trial to trial: 10 dB where nothing is known, because far
/// below the right value the likelihood is flat, then 3 and 1 dB.
const COARSE: f64 = 10.0;
const MIDDLE: f64 = 1.995_262_314_968_879_6;
const FINE: f64 = 1.258_925_411_794_167_2;

/// Share of the gain of a first step that a further one must have: where the likelihood is flat, it has
/// none.
const FURTHER: f64 = 0.1;

/// Noises, over the power of the signal in each recording, and how badly they predict.
pub(super) struct NoiseSearch<'a> {
    levels: Vec<f64>,
    least: f64,
    misfit: Misfit<'a>,
}

/// How badly samples that are left out are predicted with these levels.
pub(super) type Misfit<'a> = &'a dyn Fn(&[f64]) -> Result<f64, LinalgError>;

impl<'a> NoiseSearch<'a> {
    /// From these levels on.
    pub(super) fn new(levels: Vec<f64>, misfit: Misfit<'a>) -> Result<Self, LinalgError> {
        let least = misfit(&levels)?;
        Ok(Self { levels, least, misfit })
    }

    /// The levels found.
    pub(super) fn levels(&self) -> &[f64] {
        &self.levels
    }

    /// Changes all levels together, which may be wrong by decades or are nearly right.
    pub(super) fn together(&mut self, are_near: bool) -> Result<(), LinalgError> {
        let all: Vec<usize> = (0..self.levels.len()).collect();
        let factors = [COARSE, MIDDLE, FINE].into_iter().skip(usize::from(are_near));
        factors.map(|factor| self.walk(&all, factor, 0.0)).try_for_each(|found| found.map(|_| ()))
    }

    /// Changes one level, if the first step is better by `gain`.
    pub(super) fn alone(&mut self, one: usize, gain: f64) -> Result<(), LinalgError> {
        if self.walk(&[one], MIDDLE, gain)? {
            self.walk(&[one], FINE, FURTHER * gain)?;
        }
        Ok(())
    }

    /// Walks up with the levels of `some`, or else down, as long as that is better; the first step must be
    /// better by `gain`, the others by a share of it. Whether there was one.
    fn walk(&mut self, some: &[usize], factor: f64, gain: f64) -> Result<bool, LinalgError> {
        for step in [factor, 1.0 / factor] {
            let mut found = false;
            while self.take_if_better(self.stepped(some, step), if found { FURTHER * gain } else { gain })? {
                found = true;
            }
            if found {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn stepped(&self, some: &[usize], step: f64) -> Vec<f64> {
        let mut levels = self.levels.clone();
        some.iter().for_each(|&i| levels[i] *= step);
        levels
    }

    /// Takes these levels if they are better by `gain`, and says whether they are.
    pub(super) fn take_if_better(&mut self, levels: Vec<f64>, gain: f64) -> Result<bool, LinalgError> {
        let found = (self.misfit)(&levels)?;
        let is_better = found + gain < self.least;
        if is_better {
            (self.levels, self.least) = (levels, found);
        }
        Ok(is_better)
    }
}
