//! The shortest latency whose gamma is almost the best of all latencies.
//!
//! gamma is not unimodal in the latency, so the search rests on bounds: each latency has a lower bound that
//! costs nothing, and a design replaces it by an interval. Latencies are designed until no other one can
//! change the choice.

use crate::design::DesignError;

/// A longer latency is chosen only if it lowers gamma by more than this fraction.
pub(super) const WORTHWHILE: f64 = 1e-3;
/// Designs at most. Where that does not suffice, the choice is the best one under the assumption that gamma
/// falls up to its minimum.
const MOST_DESIGNS: usize = 40;

/// What is known of the gamma of one latency.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    /// The bound by which the most promising latency is found.
    guide: f64,
    lower: f64,
    /// Of the design, once there is one.
    upper: Option<f64>,
}

impl Candidate {
    fn upper(&self) -> f64 {
        self.upper.unwrap_or(f64::INFINITY)
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
    gamma: f64,
    /// The least gamma of all designs.
    best: f64,
}

impl Choice {
    /// The gamma above which `latency` does not change the choice.
    fn hopeless(choice: Option<Self>, latency: usize) -> f64 {
        match choice {
            None => f64::INFINITY,
            Some(choice) if latency < choice.latency => choice.best * (1.0 + WORTHWHILE),
            Some(choice) => choice.gamma / (1.0 + WORTHWHILE),
        }
    }
}

impl Search {
    /// From lower bounds of the gammas of the latencies 0, 1, .., and one for all of them.
    pub(super) fn new(guides: impl Iterator<Item = f64>, floor: f64) -> Self {
        let candidate = |guide: f64| Candidate { guide, lower: guide.max(floor), upper: None };
        Self { candidates: guides.map(candidate).collect() }
    }

    /// The shortest latency whose gamma is within [`WORTHWHILE`] of the least. `design(latency,
    /// hopeless)` gives bounds of gamma; it may end early with a lower bound above `hopeless`. `compared`
    /// receives the number of designs so far.
    ///
    /// # Errors
    /// The first error of `design`, if it succeeds for no latency.
    pub(super) fn shortest(
        mut self,
        compared: &dyn Fn(usize),
        mut design: impl FnMut(usize, f64) -> Result<(f64, f64), DesignError>,
    ) -> Result<usize, DesignError> {
        let mut failed = None;
        for designs in 0..MOST_DESIGNS {
            compared(designs);
            let choice = self.choice();
            let Some(latency) = self.next(choice) else { break };
            let candidate = &mut self.candidates[latency];
            match design(latency, Choice::hopeless(choice, latency)) {
                Ok((lower, upper)) => {
                    candidate.lower = candidate.lower.max(lower);
                    candidate.upper = Some(upper.max(candidate.lower));
                }
                Err(error) => {
                    failed.get_or_insert(error);
                    candidate.upper = Some(f64::INFINITY);
                }
            }
        }
        match (self.choice(), failed) {
            (Some(choice), _) => Ok(choice.latency),
            (None, Some(error)) => Err(error),
            (None, None) => Ok(0),
        }
    }

    fn choice(&self) -> Option<Choice> {
        let best = self.candidates.iter().map(Candidate::upper).fold(f64::INFINITY, f64::min);
        let enough = |candidate: &Candidate| candidate.upper() <= best * (1.0 + WORTHWHILE);
        let latency = self.candidates.iter().position(enough).filter(|_| best.is_finite())?;
        Some(Choice { latency, gamma: self.candidates[latency].upper(), best })
    }

    /// The latency to design next: the most promising one, as long as its guide is below that of the choice;
    /// then the middle one of the shorter latencies that may do as well; then the longer ones.
    fn next(&self, choice: Option<Choice>) -> Option<usize> {
        let open: Vec<usize> = (0..self.candidates.len())
            .filter(|&latency| {
                let Candidate { lower, upper, .. } = self.candidates[latency];
                upper.is_none() && lower <= Choice::hopeless(choice, latency)
            })
            .collect();
        let guide = |latency: usize| self.candidates[latency].guide;
        let promising = open.iter().copied().min_by(|&a, &b| guide(a).total_cmp(&guide(b)))?;
        let Some(choice) = choice else { return Some(promising) };
        if guide(promising) < guide(choice.latency) && self.candidates[promising].lower < choice.best {
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

    /// The choice for these gammas and guides, and the number of designs.
    fn choose(gammas: &[f64], guides: &[f64], floor: f64) -> (usize, usize) {
        let designs = Cell::new(0);
        let design = |latency: usize, _| {
            designs.set(designs.get() + 1);
            Ok((gammas[latency] * (1.0 - 1e-5), gammas[latency]))
        };
        let chosen = Search::new(guides.iter().copied(), floor).shortest(&|_| (), design).unwrap();
        (chosen, designs.get())
    }

    #[test]
    fn the_shortest_that_is_almost_the_best_is_chosen_whatever_the_shape() {
        // Two minima; a plateau; a plateau of which the second half is better by more than the share.
        let shapes: [(&[f64], usize); 4] = [
            (&[0.9, 0.3, 0.8, 0.2, 0.1, 0.1005, 0.7], 4),
            (&[0.9, 0.5, 0.10009, 0.1, 0.10005, 0.1, 0.6], 2),
            (&[0.9, 0.102, 0.102, 0.1, 0.1, 0.6], 3),
            (&[0.05, 0.9, 0.9], 0),
        ];
        for (gammas, expected) in shapes {
            for part in [1.0, 0.5, 0.1] {
                let guides: Vec<f64> = gammas.iter().map(|gamma| part * gamma).collect();
                assert_eq!(choose(gammas, &guides, 0.0).0, expected, "{gammas:?} {part}");
                assert_eq!(choose(gammas, &vec![0.0; gammas.len()], 0.04).0, expected, "{gammas:?}");
            }
        }
    }

    #[test]
    fn a_floor_that_is_reached_ends_the_search() {
        // gamma falls to the floor at latency 20 and stays there.
        let gammas: Vec<f64> = (0..100).map(|m| 1f64.max(1.5f64.powi(20 - m))).collect();
        let guides: Vec<f64> = gammas.iter().map(|gamma| 0.3 * gamma).collect();
        let (chosen, designs) = choose(&gammas, &guides, 1.0);
        assert_eq!(chosen, 20);
        assert!(designs < 12, "{designs}");
    }

    #[test]
    fn the_first_error_is_reported_if_there_is_no_design_at_all() {
        let search = Search::new([0.1, 0.2].into_iter(), 0.0);
        let error = search.shortest(&|_| (), |_, _| Err(DesignError::NoTaps)).unwrap_err();
        assert_eq!(error, DesignError::NoTaps);
        let search = Search::new([0.1, 0.2].into_iter(), 0.0);
        let one = |latency: usize, _| if latency == 0 { Err(DesignError::NoTaps) } else { Ok((0.3, 0.3)) };
        assert_eq!(search.shortest(&|_| (), one), Ok(1));
    }
}
