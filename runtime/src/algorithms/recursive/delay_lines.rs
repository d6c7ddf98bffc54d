//! What a state matrix is made of: states that are nothing but past inputs, and what is left.

use super::StateMatrices;
use std::collections::BTreeMap;

/// An input some frames ago: (channel, frames).
pub type DelayedInput = (usize, usize);

/// A state-space filter with its delay lines taken out:
/// y = sum taps u + sum c x, x+ = sum a x + sum b u, where u are inputs of this frame and of earlier ones.
///
/// ```
/// use hybank_runtime::{DelayLines, StateMatrices};
/// // y[k] = u[k] + u[k - 1] / 4 + s[k] with s[k + 1] = s[k] / 2 + u[k]: the second state is u[k - 1].
/// let lines = DelayLines::new(&StateMatrices {
///     a: vec![vec![0.5, 0.0], vec![0.0, 0.0]],
///     b: vec![vec![1.0], vec![1.0]],
///     c: vec![vec![1.0, 0.25]],
///     d: vec![vec![1.0]],
/// });
/// assert_eq!((lines.a, lines.c), (vec![vec![0.5]], vec![vec![1.0]]));
/// assert_eq!(lines.taps.into_iter().collect::<Vec<_>>(), [((0, 0), vec![1.0]), ((0, 1), vec![0.25])]);
/// ```
#[derive(Debug)]
pub struct DelayLines {
    /// For each past input that the output takes, its M factors.
    pub taps: BTreeMap<DelayedInput, Vec<f64>>,
    /// For each past input that the states take, a factor for each state.
    pub b: BTreeMap<DelayedInput, Vec<f64>>,
    /// Row by row.
    pub a: Vec<Vec<f64>>,
    /// One list of M factors for each state.
    pub c: Vec<Vec<f64>>,
}

impl DelayLines {
    /// The matrices have fitting shapes.
    pub fn new(filter: &StateMatrices) -> Self {
        let delayed = delayed_inputs(filter);
        let core: Vec<usize> = (0..delayed.len()).filter(|&s| delayed[s].is_none()).collect();
        let read = |s: usize| filter.c.iter().map(move |row| row[s]);
        let mut delay_lines = Self {
            taps: BTreeMap::new(),
            b: BTreeMap::new(),
            a: core.iter().map(|&r| core.iter().map(|&s| filter.a[r][s]).collect()).collect(),
            c: core.iter().map(|&s| read(s).collect()).collect(),
        };
        let channels = filter.d.first().map_or(0, Vec::len);
        for i in 0..channels {
            add(&mut delay_lines.taps, (i, 0), filter.d.iter().map(|row| row[i]));
            add(&mut delay_lines.b, (i, 0), core.iter().map(|&r| filter.b[r][i]));
        }
        for (s, &place) in delayed.iter().enumerate() {
            let Some(place) = place else { continue };
            add(&mut delay_lines.taps, place, read(s));
            add(&mut delay_lines.b, place, core.iter().map(|&r| filter.a[r][s]));
        }
        delay_lines
    }

    /// Frames that the delay lines look back.
    pub(crate) fn history(&self) -> usize {
        self.taps.keys().chain(self.b.keys()).map(|&(_, frames)| frames).max().unwrap_or(0)
    }

    /// The states by twos such that each depends on the other one of its two at most; one may be alone.
    /// `None` if the states depend on one another in another way.
    pub fn sections(&self) -> Option<Vec<(usize, Option<usize>)>> {
        let n = self.a.len();
        let coupled = |i: usize, j: usize| i != j && (self.a[i][j] != 0.0 || self.a[j][i] != 0.0);
        let mut sections = Vec::new();
        let mut single = None;
        for i in 0..n {
            let mut partners = (0..n).filter(|&j| coupled(i, j));
            match (partners.next(), partners.next()) {
                (_, Some(_)) => return None,
                (Some(j), None) if i < j => sections.push((i, Some(j))),
                (Some(_), None) => {}
                (None, None) => match single.take() {
                    None => single = Some(i),
                    Some(other) => sections.push((other, Some(i))),
                },
            }
        }
        sections.extend(single.map(|i| (i, None)));
        Some(sections)
    }
}

fn add(
    terms: &mut BTreeMap<DelayedInput, Vec<f64>>,
    place: DelayedInput,
    factors: impl Iterator<Item = f64>,
) {
    let factors: Vec<f64> = factors.collect();
    if factors.iter().all(|&factor| factor == 0.0) {
        return;
    }
    match terms.get_mut(&place) {
        None => drop(terms.insert(place, factors)),
        Some(known) => known.iter_mut().zip(factors).for_each(|(sum, factor)| *sum += factor),
    }
}

/// Which states are inputs of earlier frames: those that take over an input, or such a state, unchanged.
fn delayed_inputs(filter: &StateMatrices) -> Vec<Option<DelayedInput>> {
    let ones: Vec<(Option<usize>, Option<usize>)> =
        filter.a.iter().zip(&filter.b).map(|(a, b)| (only_one(a), only_one(b))).collect();
    let zero = |row: &[f64]| row.iter().all(|&x| x == 0.0);
    let mut delayed = vec![None; filter.a.len()];
    let mut followers = vec![Vec::new(); filter.a.len()];
    let mut found = Vec::new();
    for (s, &(from_state, from_input)) in ones.iter().enumerate() {
        match (from_state, from_input) {
            (None, Some(i)) if zero(&filter.a[s]) => found.push((s, (i, 1))),
            (Some(r), None) if zero(&filter.b[s]) => followers[r].push(s),
            _ => {}
        }
    }
    while let Some((s, (i, frames))) = found.pop() {
        delayed[s] = Some((i, frames));
        found.extend(followers[s].iter().map(|&next| (next, (i, frames + 1))));
    }
    delayed
}

/// The place of the one in a row of zeros and a one.
fn only_one(row: &[f64]) -> Option<usize> {
    let mut entries = row.iter().enumerate().filter(|(_, x)| **x != 0.0);
    match (entries.next(), entries.next()) {
        (Some((place, 1.0)), None) => Some(place),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filter(a: &[&[f64]], b: &[&[f64]], c: &[&[f64]], d: &[&[f64]]) -> StateMatrices {
        let rows = |m: &[&[f64]]| m.iter().map(|row| row.to_vec()).collect();
        StateMatrices { a: rows(a), b: rows(b), c: rows(c), d: rows(d) }
    }

    #[test]
    fn delay_lines_are_found_and_what_they_feed() {
        // States: a pole fed by u[k - 2] and u[k]; u[k - 2]; u[k - 1].
        let delay_lines = DelayLines::new(&filter(
            &[&[0.5, 3.0, 0.0], &[0.0, 0.0, 1.0], &[0.0, 0.0, 0.0]],
            &[&[2.0], &[0.0], &[1.0]],
            &[&[1.0, 7.0, 0.0]],
            &[&[9.0]],
        ));
        assert_eq!(delay_lines.a, [[0.5]]);
        assert_eq!(delay_lines.c, [[1.0]]);
        assert_eq!(delay_lines.b, BTreeMap::from([((0, 0), vec![2.0]), ((0, 2), vec![3.0])]));
        assert_eq!(delay_lines.taps, BTreeMap::from([((0, 0), vec![9.0]), ((0, 2), vec![7.0])]));
        assert_eq!(delay_lines.history(), 2);
    }

    #[test]
    fn rings_and_states_with_a_factor_are_no_delay_lines() {
        let ring = filter(&[&[0.0, 1.0], &[1.0, 0.0]], &[&[0.0], &[0.0]], &[&[1.0, 0.0]], &[&[0.0]]);
        assert_eq!(DelayLines::new(&ring).a, [[0.0, 1.0], [1.0, 0.0]]);
        let scaled = filter(&[&[0.0, 1.0], &[0.0, 0.0]], &[&[0.0], &[2.0]], &[&[1.0, 0.0]], &[&[0.0]]);
        assert_eq!(DelayLines::new(&scaled).a.len(), 2);
    }

    #[test]
    fn sections_pair_what_is_coupled_and_then_what_is_left() {
        let with = |pairs: &[(usize, usize)]| {
            let mut a = vec![vec![0.0; 5]; 5];
            (0..5).for_each(|i| a[i][i] = 0.5);
            pairs.iter().for_each(|&(i, j)| a[i][j] = 0.1);
            DelayLines { taps: BTreeMap::new(), b: BTreeMap::new(), a, c: vec![vec![]; 5] }.sections()
        };
        assert_eq!(with(&[]), Some(vec![(0, Some(1)), (2, Some(3)), (4, None)]));
        assert_eq!(with(&[(3, 1)]), Some(vec![(1, Some(3)), (0, Some(2)), (4, None)]));
        assert_eq!(with(&[(0, 1), (1, 2)]), None);
    }
}
