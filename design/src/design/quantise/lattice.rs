//! Closest points of a lattice: integers near given reals in a quadratic form.
//!
//! Minimises `|L' (x - c)|^2` over integer x in a box. The unknowns are decided from the last to the first,
//! each given the decisions before it (Babai's nearest plane). A bounded list of the cheapest partial
//! decisions is kept (a breadth-first sphere decoder).
//!
//! Sources: Babai, Combinatorica 6 (1986); Anderson and Mohan, IEEE Trans. Commun. 32 (1984) for the list.

use hybank_core::spec::WordLengths;
use hybank_linalg::Mat;

/// Partial decisions kept: with 8 of them banks of `filters/` lose up to 2.5 dB more at 8 bits, with one 6
/// dB.
const LIST_LENGTH: usize = 32;

/// Integers between two bounds, both included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct IntegerSpan {
    pub(super) least: f64,
    pub(super) most: f64,
}

impl IntegerSpan {
    /// The range of tap `n`.
    pub(super) fn of(bits: &WordLengths, n: usize) -> Self {
        let (least, most) = bits.span(n);
        Self { least: least as f64, most: most as f64 }
    }

    /// The integer of the span that is nearest to `value`.
    pub(super) fn nearest(self, value: f64) -> f64 {
        value.round_ties_even().clamp(self.least, self.most)
    }

    /// Whether it holds an integer other than zero on the side of `value`.
    pub(super) fn reaches(self, value: f64) -> bool {
        if value < 0.0 { self.least < 0.0 } else { self.most > 0.0 && value > 0.0 }
    }

    pub(super) fn contains(self, value: f64) -> bool {
        (self.least..=self.most).contains(&value)
    }
}

/// The unknowns decided so far, as deviations from the centre, with the value of the form.
#[derive(Clone)]
struct Partial {
    deviations: Vec<f64>,
    cost: f64,
}

/// An integer point near `centre` with a small `|L' (x - c)|^2`, L = `factor` lower triangular, x_i in
/// `spans[i]`. It is the closest one if there is one unknown or the form is diagonal; otherwise it may not
/// be.
pub(super) fn closest(factor: &Mat, centre: &[f64], spans: &[IntegerSpan]) -> Vec<f64> {
    let n = centre.len();
    let mut list = vec![Partial { deviations: vec![0.0; n], cost: 0.0 }];
    for i in (0..n).rev() {
        let mut longer: Vec<Partial> =
            list.iter().flat_map(|partial| decide(partial, i, factor, centre[i], spans[i])).collect();
        longer.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        longer.truncate(LIST_LENGTH);
        list = longer;
    }
    let best = &list[0].deviations;
    best.iter().zip(centre).map(|(deviation, c)| (c + deviation).round()).collect()
}

/// Unknown i at the two integers nearest to its best real value given the decisions made.
fn decide<'a>(
    partial: &'a Partial,
    i: usize,
    factor: &'a Mat,
    centre: f64,
    span: IntegerSpan,
) -> impl Iterator<Item = Partial> + 'a {
    let column = factor.column(i);
    let pull: f64 = (i + 1..partial.deviations.len()).map(|l| column[l] * partial.deviations[l]).sum();
    let weight = column[i];
    let best = centre - pull / weight;
    let nearest = span.nearest(best);
    let other = span.nearest(if best > nearest { nearest + 1.0 } else { nearest - 1.0 });
    let count = if other == nearest { 1 } else { 2 };
    [nearest, other].into_iter().take(count).map(move |x| {
        let mut next = partial.clone();
        next.deviations[i] = x - centre;
        next.cost += (weight * (x - best)).powi(2);
        next
    })
}
