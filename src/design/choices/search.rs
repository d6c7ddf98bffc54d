//! The shortest latency whose error is almost the best of all latencies, for methods that minimise nothing.
//!
//! The error is not unimodal in the latency, so the search rests on bounds: each latency has a lower bound
//! that costs nothing, and a design replaces it by its error. Latencies are designed until no other one can
//! change the choice.

use super::worthwhile;
use crate::design::DesignError;

/// Designs at most. Where that does not suffice, the choice is the best one under the assumption that the
/// error falls up to its minimum.
const MOST_DESIGNS: usize = 40;

/// What is known of the error of one latency.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    lower: f64,
    /// Of the design, once there is one; infinite if it failed.
    error: Option<f64>,
}

impl Candidate {
    fn error(&self) -> f64 {
        self.error.unwrap_or(f64::INFINITY)
    }
}

/// All latencies from 0 on.
#[derive(Debug)]
pub(super) struct Search {
    candidates: Vec<Candidate>,
}

/// The shortest of the designed latencies that is almost the best one of them.
#[derive(Debug, Clone, Copy)]
struct Choice {
    latency: usize,
    error: f64,
    /// The least error of all designs.
    best: f64,
}

impl Choice {
    /// The error above which `latency` does not change the choice.
    fn hopeless(choice: Option<Self>, latency: usize) -> f64 {
        match choice {
            None => f64::INFINITY,
            Some(choice) if latency < choice.latency => choice.best * worthwhile(),
            Some(choice) => choice.error / worthwhile(),
        }
    }
}

impl Search {
    /// From lower bounds of the errors at the latencies 0, 1, ..
    pub(super) fn new(lower: impl Iterator<Item = f64>) -> Self {
        Self { candidates: lower.map(|lower| Candidate { lower, error: None }).collect() }
    }

    /// The shortest latency whose error is almost the least. `design(latency)` gives the error of a design;
    /// `compared` receives the number of designs so far.
    ///
    /// # Errors
    /// The first error of `design`, if it succeeds for no latency.
    pub(super) fn shortest(
        mut self,
        compared: &dyn Fn(usize),
        mut design: impl FnMut(usize) -> Result<f64, DesignError>,
    ) -> Result<usize, DesignError> {
        let mut failed = None;
        for designs in 0..MOST_DESIGNS {
            compared(designs);
            let choice = self.choice();
            let Some(latency) = self.next(choice) else { break };
            let designed = design(latency).map_err(|error| failed.get_or_insert(error).clone());
            self.candidates[latency].error = Some(designed.unwrap_or(f64::INFINITY));
        }
        match (self.choice(), failed) {
            (Some(choice), _) => Ok(choice.latency),
            (None, Some(error)) => Err(error),
            (None, None) => Ok(0),
        }
    }

    fn choice(&self) -> Option<Choice> {
        let best = self.candidates.iter().map(Candidate::error).fold(f64::INFINITY, f64::min);
        let enough = |candidate: &Candidate| candidate.error() <= best * worthwhile();
        let latency = self.candidates.iter().position(enough).filter(|_| best.is_finite())?;
        Some(Choice { latency, error: self.candidates[latency].error(), best })
    }

    /// The latency to design next: the most promising one, as long as its bound is below that of the choice;
    /// then the middle one of the shorter latencies that may do as well; then the longer ones.
    fn next(&self, choice: Option<Choice>) -> Option<usize> {
        let open: Vec<usize> = (0..self.candidates.len())
            .filter(|&latency| {
                let Candidate { lower, error } = self.candidates[latency];
                error.is_none() && lower <= Choice::hopeless(choice, latency)
            })
            .collect();
        let guide = |latency: usize| self.candidates[latency].lower;
        let promising = open.iter().copied().min_by(|&a, &b| guide(a).total_cmp(&guide(b)))?;
        let Some(choice) = choice else { return Some(promising) };
        if guide(promising) < guide(choice.latency).min(choice.best) {
            return Some(promising);
        }
        let shorter: Vec<usize> = open.into_iter().filter(|&latency| latency < choice.latency).collect();
        Some(shorter.get(shorter.len() / 2).copied().unwrap_or(promising))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    /// The choice for these errors and lower bounds, and the number of designs.
    fn choose(errors: &[f64], lower: &[f64]) -> (usize, usize) {
        let designs = Cell::new(0);
        let design = |latency: usize| {
            designs.set(designs.get() + 1);
            Ok(errors[latency])
        };
        let chosen = Search::new(lower.iter().copied()).shortest(&|_| (), design).unwrap();
        (chosen, designs.get())
    }

    #[test]
    fn the_shortest_that_is_almost_the_best_is_chosen_whatever_the_shape() {
        // Two minima; a plateau; a plateau of which the second half is better by more than the share.
        let shapes: [(&[f64], usize); 4] = [
            (&[0.9, 0.3, 0.8, 0.2, 0.1, 0.105, 0.7], 4),
            (&[0.9, 0.5, 0.1009, 0.1, 0.1005, 0.1, 0.6], 2),
            (&[0.9, 0.102, 0.102, 0.1, 0.1, 0.6], 3),
            (&[0.05, 0.9, 0.9], 0),
        ];
        for (errors, expected) in shapes {
            for part in [1.0, 0.5, 0.1, 0.0] {
                let lower: Vec<f64> = errors.iter().map(|error| part * error).collect();
                assert_eq!(choose(errors, &lower).0, expected, "{errors:?} {part}");
            }
        }
    }

    #[test]
    fn few_designs_suffice_where_the_bounds_are_near() {
        let errors: Vec<f64> = (0..100).map(|m| 1f64.max(1.5f64.powi(20 - m))).collect();
        let lower: Vec<f64> = errors.iter().map(|error| 0.995 * error).collect();
        let (chosen, designs) = choose(&errors, &lower);
        assert_eq!(chosen, 20);
        assert!(designs < 12, "{designs}");
    }

    #[test]
    fn the_first_error_is_reported_if_there_is_no_design_at_all() {
        let search = Search::new([0.1, 0.2].into_iter());
        let error = search.shortest(&|_| (), |_| Err(DesignError::NoTaps)).unwrap_err();
        assert_eq!(error, DesignError::NoTaps);
        let search = Search::new([0.1, 0.2].into_iter());
        let one = |latency: usize| if latency == 0 { Err(DesignError::NoTaps) } else { Ok(0.3) };
        assert_eq!(search.shortest(&|_| (), one), Ok(1));
    }
}
