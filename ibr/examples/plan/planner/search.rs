//! Choices of some candidates out of many by an error that they cause together.

/// Passes of exchanges, at most.
const PASSES: usize = 4;

/// Candidates and the error of any choice of them: a prediction, or the measured error of rendered views.
pub struct Search<F> {
    /// The number of candidates.
    pub candidates: usize,
    /// The error of the candidates with these numbers together.
    pub error: F,
}

impl<F: Fn(&[usize]) -> f64> Search<F> {
    /// `count` candidates, each of which reduces the error the most, given those before it: at most
    /// `count * candidates` errors.
    pub fn greedy(&self, count: usize) -> Vec<usize> {
        self.grown(Vec::new(), count)
    }

    /// The best of the greedy choices whose first candidates are the `starts` that are best alone: at most
    /// `starts` times as many errors as [`Search::greedy`].
    ///
    /// The first candidate of a greedy choice is best alone, which often is wrong for several.
    pub fn greedy_from_several(&self, starts: usize, count: usize) -> Vec<usize> {
        self.best_of(self.grown_from(starts, count), count)
    }

    /// The greedy choice after exchanges of single candidates as long as they help: a few times as many
    /// errors as [`Search::greedy`].
    pub fn exchanged(&self, count: usize) -> Vec<usize> {
        self.improved(self.greedy(count))
    }

    /// The best of the choices that grow greedily from each candidate as the first and are then improved by
    /// exchanges. As many errors as there are candidates times those of [`Search::exchanged`].
    pub fn starting_with_each(&self, count: usize) -> Vec<usize> {
        self.starting_with_several(self.candidates, count)
    }

    /// The same from the `starts` candidates that are best alone.
    pub fn starting_with_several(&self, starts: usize, count: usize) -> Vec<usize> {
        let choices = self.grown_from(starts, count);
        self.best_of(choices.into_iter().map(|chosen| self.improved(chosen)).collect(), count)
    }

    /// Greedy choices, each with another first candidate.
    fn grown_from(&self, starts: usize, count: usize) -> Vec<Vec<usize>> {
        let mut firsts: Vec<(f64, usize)> = (0..self.candidates).map(|i| ((self.error)(&[i]), i)).collect();
        firsts.sort_by(|a, b| a.0.total_cmp(&b.0));
        firsts.into_iter().take(starts).map(|(_, first)| self.grown(vec![first], count)).collect()
    }

    fn best_of(&self, choices: Vec<Vec<usize>>, count: usize) -> Vec<usize> {
        let scored = choices.into_iter().map(|chosen| ((self.error)(&chosen), chosen));
        let best = scored.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(Vec::new(), |(_, chosen)| chosen);
        best.into_iter().take(count).collect()
    }

    /// The candidates chosen and further ones, each of which reduces the error the most.
    fn grown(&self, mut chosen: Vec<usize>, count: usize) -> Vec<usize> {
        while chosen.len() < count.min(self.candidates) {
            let Some((next, _)) = self.best_beside(&chosen) else { break };
            chosen.push(next);
        }
        chosen
    }

    /// Replaces one candidate after the other by the best one in its place, until nothing changes.
    fn improved(&self, mut chosen: Vec<usize>) -> Vec<usize> {
        for _ in 0..PASSES {
            let before = chosen.clone();
            for k in 0..chosen.len() {
                let own = chosen.remove(k);
                let best = self.best_beside(&chosen).map_or(own, |(best, _)| best);
                chosen.insert(k, best);
            }
            if chosen == before {
                break;
            }
        }
        chosen
    }

    /// The candidate that reduces the error the most beside those chosen, and the error.
    fn best_beside(&self, chosen: &[usize]) -> Option<(usize, f64)> {
        let free = (0..self.candidates).filter(|i| !chosen.contains(i));
        let scored = free.map(|i| (i, (self.error)(&[chosen, &[i]].concat())));
        scored.min_by(|a, b| a.1.total_cmp(&b.1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points on a line, of which one shall lie close to 2 and one to 17; the middle is best alone.
    fn search() -> Search<impl Fn(&[usize]) -> f64> {
        let error = |chosen: &[usize]| {
            let nearest = |goal: f64| chosen.iter().map(|i| (*i as f64 - goal).powi(2)).fold(1e3, f64::min);
            nearest(2.0) + nearest(17.0)
        };
        Search { candidates: 20, error }
    }

    #[test]
    fn exchanges_mend_a_greedy_first_choice() {
        let search = search();
        let sorted = |mut chosen: Vec<usize>| {
            chosen.sort_unstable();
            chosen
        };
        assert!((search.error)(&search.greedy(2)) > 0.0);
        assert_eq!(sorted(search.exchanged(2)), [2, 17]);
        assert_eq!(sorted(search.starting_with_each(2)), [2, 17]);
        assert_eq!(sorted(search.starting_with_several(3, 2)), [2, 17]);
        assert!(search.starting_with_several(0, 2).is_empty() && search.greedy_from_several(0, 2).is_empty());
        // Without exchanges 2 or 17 must be a first; by itself each is worse than the middle.
        assert_eq!(sorted(search.greedy_from_several(20, 2)), [2, 17]);
        assert_eq!(search.greedy_from_several(1, 2), search.greedy(2));
        assert_eq!(search.greedy_from_several(20, 0), Vec::<usize>::new());
        assert_eq!(search.greedy(30).len(), 20);
        assert!(search.greedy(0).is_empty() && search.starting_with_each(0).is_empty());
    }
}
