//! Instants without any pattern: the outputs of a block from all samples around it.

use super::around::Around;
use super::estimator::{Estimator, MeanSquare};
use super::recording::Recording;
use hybank_core::units::FastPeriods;
use hybank_linalg::{LinalgError, Mat};

/// Outputs of a block of which the error is computed, at most: it takes longer than the output itself.
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
    let looked_at: Vec<FastPeriods> =
        looked_at(origin, instants.len()).into_iter().map(|k| instants[k]).collect();
    let with_target = set.with_target(&looked_at);
    let errors = set.best_errors(&factor.solve(&with_target), &with_target);
    Ok(Outputs { outputs, error: MeanSquare::mean(&errors) })
}

/// The outputs of a block of `count` whose error is computed: one somewhere in each of equal parts.
/// Multiples of the golden ratio say where, so that over many blocks every phase of any pattern is met
/// equally often.
fn looked_at(origin: FastPeriods, count: usize) -> Vec<usize> {
    let parts = ERRORS.min(count);
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let number = (origin.0 / count as f64).round() * parts as f64;
    let place = |part: usize| {
        let within = ((number + part as f64) * golden).rem_euclid(1.0);
        ((part as f64 + within) * count as f64 / parts as f64) as usize
    };
    (0..parts).map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Patterns of 2 to 16 outputs, in blocks of 64.
    #[test]
    fn errors_are_looked_at_in_all_phases() {
        for pattern in 2..=16 {
            let mut met = vec![0.0; pattern];
            for block in 0..2000 {
                let chosen = looked_at(FastPeriods(64.0 * f64::from(block)), 64);
                chosen.iter().for_each(|k| met[(64 * block as usize + k) % pattern] += 1.0);
            }
            let mean = 2000.0 * ERRORS as f64 / pattern as f64;
            assert!(met.iter().all(|count| (count / mean - 1.0_f64).abs() < 0.05), "{pattern}: {met:?}");
        }
    }

    #[test]
    fn errors_are_looked_at_within_the_block() {
        for count in 1..=64 {
            let chosen = looked_at(FastPeriods(-1e6 / 3.0), count);
            assert_eq!(chosen.len(), count.min(ERRORS));
            assert!(chosen.is_sorted() && chosen.iter().all(|k| *k < count), "{chosen:?}");
        }
    }
}
