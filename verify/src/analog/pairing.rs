//! Pairing of zeros with poles, and the order of the sections.

use crate::arithmetic::Real;

use super::roots::{RootSet, Roots, steps};
use super::section::Biquad;

/// Pairs zeros with poles and orders the sections, low quality first, and those of one quality as they were
/// paired. Needs no more zeros than poles.
///
/// In each step the pair with the least ratio of frequencies is joined. If the zeros of a section were far
/// from its poles, its gain on one side of the spectrum would be tiny, and no later section could restore
/// the digits lost to rounding.
pub(super) fn pair_sections<T: Real>(poles: &RootSet<T>, zeros: &RootSet<T>) -> Vec<Biquad<T>> {
    let mut unpaired = UnpairedPoles { real: poles.real.clone(), upper: poles.upper.clone() };
    let mut pairs: Vec<Roots<T>> = zeros.upper.iter().map(|&(re, im)| Roots::Conjugate { re, im }).collect();
    let mut sections = Vec::new();
    while let Some((pair, group)) = closest_pair(&pairs, &unpaired) {
        sections.push(Biquad { zeros: pairs.remove(pair), poles: unpaired.take(group) });
    }
    sections.extend(unpaired.rest());
    let mut real_zeros = zeros.real.clone();
    while let Some((zero, section)) = closest_section(&real_zeros, &sections) {
        attach(&mut sections[section], real_zeros.remove(zero));
    }
    let rank = |section: &Biquad<T>| (section.poles.quality().ln() / SAME_QUALITY).round();
    sections.sort_by(|a, b| rank(a).total_cmp(&rank(b)));
    sections
}

/// Qualities that differ by less than this share are one. The pairs of poles of a band-pass come in twos of
/// one quality, and rounding must not decide about their order.
const SAME_QUALITY: f64 = 1e-6;

/// Poles not yet in a section.
struct UnpairedPoles<T> {
    real: Vec<T>,
    upper: Vec<(T, T)>,
}

/// Two poles that could take a pair of zeros.
#[derive(Debug, Clone, Copy)]
enum Group {
    /// A conjugate pair.
    Upper(usize),
    /// The real poles at this index and the next, neighbours in size.
    Real(usize),
}

impl<T: Real> UnpairedPoles<T> {
    fn groups(&self) -> impl Iterator<Item = Group> {
        let upper = (0..self.upper.len()).map(Group::Upper);
        upper.chain((1..self.real.len()).map(|i| Group::Real(i - 1)))
    }

    fn poles(&self, group: Group) -> Roots<T> {
        match group {
            Group::Upper(i) => Roots::Conjugate { re: self.upper[i].0, im: self.upper[i].1 },
            Group::Real(i) => Roots::Two(self.real[i], self.real[i + 1]),
        }
    }

    fn take(&mut self, group: Group) -> Roots<T> {
        let poles = self.poles(group);
        match group {
            Group::Upper(i) => drop(self.upper.remove(i)),
            Group::Real(i) => drop(self.real.drain(i..i + 2)),
        }
        poles
    }

    /// Sections without zeros for the remaining poles.
    fn rest(self) -> impl Iterator<Item = Biquad<T>> {
        let conjugate = self.upper.into_iter().map(|(re, im)| Roots::Conjugate { re, im });
        let single = self.real.into_iter().map(Roots::One);
        conjugate.chain(single).map(|poles| Biquad { poles, zeros: Roots::None })
    }
}

/// Factor on the distance of a zero that is slower than its pole. With a faster zero the states amplify low
/// frequencies, which is harmless. With a slower one the states have to cancel the direct term at low
/// frequencies.
const SLOW_ZERO_PENALTY: f64 = 4.0;

/// Added to the distance of a zero at the origin to a section that has a zero: more than any other distance.
/// A band-pass has one for each pair of poles; as resonators all sections have their gain in the band, while
/// high-passes followed by low-passes would differ by large factors there.
const SECOND_AT_ORIGIN: f64 = 1e3;

/// Distance of two frequencies on a logarithmic scale. A zero at the origin counts as very slow, so that it
/// is paired with the slowest pole.
fn distance(zero: f64, pole: f64) -> f64 {
    let ratio = (zero.abs().max(1e-3 * super::MIN_NORMALISED_POLE) / pole.abs()).ln();
    if ratio < 0.0 { -SLOW_ZERO_PENALTY * ratio } else { ratio }
}

/// The larger distance of a pair of zeros to the two poles.
fn pair_distance<T: Real>(zeros: Roots<T>, poles: Roots<T>) -> f64 {
    let w = zeros.natural_frequency();
    match poles {
        Roots::Two(p1, p2) => distance(w, p1.to_double()).max(distance(w, p2.to_double())),
        _ => distance(w, poles.natural_frequency()),
    }
}

fn closest_pair<T: Real>(pairs: &[Roots<T>], unpaired: &UnpairedPoles<T>) -> Option<(usize, Group)> {
    let candidates = (0..pairs.len()).flat_map(|i| unpaired.groups().map(move |group| (i, group)));
    let cost = |&(i, group): &(usize, Group)| steps(pair_distance(pairs[i], unpaired.poles(group)));
    candidates.min_by(|a, b| cost(a).total_cmp(&cost(b)))
}

fn closest_section<T: Real>(zeros: &[T], sections: &[Biquad<T>]) -> Option<(usize, usize)> {
    let open = (0..sections.len()).filter(|&k| sections[k].zeros.count() < sections[k].poles.count());
    let candidates = open.flat_map(|k| (0..zeros.len()).map(move |i| (i, k)));
    let cost = |&(i, k): &(usize, usize)| {
        let zero = zeros[i].to_double();
        let second = if zero == 0.0 && sections[k].zeros.count() > 0 { SECOND_AT_ORIGIN } else { 0.0 };
        steps(distance(zero, sections[k].poles.natural_frequency()) + second)
    };
    candidates.min_by(|a, b| cost(a).total_cmp(&cost(b)))
}

fn attach<T: Real>(section: &mut Biquad<T>, zero: T) {
    section.zeros = match section.zeros {
        Roots::One(other) => Roots::Two(other, zero),
        _ => Roots::One(zero),
    };
}
