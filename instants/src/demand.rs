//! Instants without any pattern: the outputs of a block from all samples around it.

use super::around::Around;
use super::estimator::{Estimator, MeanSquare};
use super::recording::Recording;
use hybank_core::units::FastPeriods;
use hybank_linalg::{LinalgError, Mat};

/// Outputs of a block of which the error is computed, at least: it takes longer than the output itself.
const ERRORS: usize = 5;

/// The longest time between two outputs of a block.
pub(super) const LONGEST_BLOCK: FastPeriods = FastPeriods(64.0);

/// Outputs, and the mean of their errors.
pub(super) struct Outputs {
    pub(super) outputs: Vec<f64>,
    pub(super) error: MeanSquare,
}

/// How far from the outputs of a block samples may lie.
pub(super) fn within(estimator: &Estimator) -> FastPeriods {
    (estimator.signals().longest() - LONGEST_BLOCK) * 0.5
}

/// The target at ascending `instants`, from the samples between them and `reach` more of each recording on
/// either side.
///
/// With `a = C^-1 x` the outputs are `r' a`, so C is solved once for the block.
///
/// # Errors
/// [`LinalgError::NotPositiveDefinite`] for samples that are given twice.
pub(super) fn outputs(
    estimator: &Estimator,
    recordings: &[Recording],
    reach: usize,
    instants: &[FastPeriods],
) -> Result<Outputs, LinalgError> {
    let (Some(&origin), Some(&end)) = (instants.first(), instants.last()) else {
        return Ok(Outputs { outputs: Vec::new(), error: MeanSquare { signal: 0.0, noise: 0.0 } });
    };
    let within = within(estimator);
    let Around { samples, values, .. } = Around::new(recordings, origin..end, reach, within);
    if samples.is_empty() {
        let error = MeanSquare { signal: 1.0, noise: 0.0 };
        return Ok(Outputs { outputs: vec![0.0; instants.len()], error });
    }
    let instants: Vec<FastPeriods> = instants.iter().map(|instant| *instant - origin).collect();
    let set = estimator.set(&samples);
    let factor = set.factor()?;
    let solved = factor.solve(&Mat::from_column_slice(values.len(), 1, &values));
    let outputs = set.with_target(&instants).tr_mul(&solved).as_slice().to_vec();
    // An odd number: even ones would meet the same phase of a frame again and again.
    let every = (instants.len() / ERRORS).max(1) | 1;
    let looked_at: Vec<FastPeriods> = instants.iter().step_by(every).copied().collect();
    let with_target = set.with_target(&looked_at);
    let errors = set.best_errors(&factor.solve(&with_target), &with_target);
    Ok(Outputs { outputs, error: MeanSquare::mean(&errors) })
}
