//! What simpler ways to use recordings would give: one of them alone, and the mean of all.

use super::around::Around;
use super::estimator::MeanSquare;
use super::fusion::FusionSettings;
use super::model::{Model, TRIALS, instants};
use super::recording::Recording;
use hybank_core::units::FastPeriods;
use hybank_linalg::{LinalgError, Mat};

/// What the ways to use recordings give, in the mean over a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Ways {
    /// All samples.
    pub together: MeanSquare,
    /// Those of one recording, by its number.
    pub alone: Vec<MeanSquare>,
    /// The mean of what each recording gives alone.
    pub mean: MeanSquare,
}

impl Model {
    /// What all samples give, those of each recording alone, and the mean of these.
    ///
    /// # Errors
    /// [`LinalgError::NotPositiveDefinite`] for samples that are given twice.
    pub fn ways(&self, recordings: &[Recording], settings: FusionSettings) -> Result<Ways, LinalgError> {
        let at = |instant: &FastPeriods| self.ways_at(recordings, settings.reach, *instant);
        let all = instants(settings, TRIALS).iter().map(at).collect::<Result<Vec<_>, _>>()?;
        let of = |way: usize| MeanSquare::mean(&all.iter().map(|errors| errors[way]).collect::<Vec<_>>());
        let count = recordings.len();
        Ok(Ways { together: of(0), alone: (1..=count).map(of).collect(), mean: of(count + 1) })
    }

    /// The errors of all together, of each recording alone, and of their mean.
    fn ways_at(
        &self,
        recordings: &[Recording],
        reach: usize,
        instant: FastPeriods,
    ) -> Result<Vec<MeanSquare>, LinalgError> {
        let within = self.estimator.signals().longest() * 0.5;
        let Around { samples, places, .. } = Around::new(recordings, instant..instant, reach, within);
        let (target, count) = ([FastPeriods(0.0)], places.len());
        let set = self.estimator.set(&samples);
        let with_target = set.with_target(&target);
        let mut weights = Mat::zeros(samples.len(), count + 2);
        weights.column_mut(0).copy_from(&set.taps(&with_target)?.weights.column(0));
        for (i, place) in places.into_iter().enumerate() {
            let taps = self.estimator.taps(&samples[place.clone()], &target)?.weights;
            weights.view_mut((place.start, i + 1), (place.len(), 1)).copy_from(&taps);
            weights.view_mut((place.start, count + 1), (place.len(), 1)).copy_from(&(taps / count as f64));
        }
        Ok(set.errors(&weights, &Mat::from_fn(samples.len(), count + 2, |k, _| with_target[k])))
    }
}
