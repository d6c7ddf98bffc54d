//! Products with constants by shifts and adders: canonical signed digits, with the subexpressions that the
//! constants of an input share.
//!
//! R. I. Hartley, *Subexpression sharing in filters using canonic signed digit multipliers*, IEEE Trans.
//! Circuits and Systems II 43(10), 1996: the pair of digits that occurs most often, at any shift and with
//! both signs, becomes a symbol of its own, until no pair occurs twice.

use super::netlist::{Netlist, Term, Word};
use std::collections::{BTreeMap, BTreeSet};

/// A symbol times a signed power of two. Symbol 0 is the input, the others are pairs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Digit {
    symbol: usize,
    shift: u32,
    is_negative: bool,
}

/// Two symbols, the shift of the second one, and whether their signs differ.
type Pair = (usize, usize, u32, bool);

/// The multiples of `x` by the positive constants.
pub(super) fn multiples(netlist: &mut Netlist, x: &Word, constants: &BTreeSet<u64>) -> BTreeMap<u64, Term> {
    let mut numbers: Vec<Vec<Digit>> = constants.iter().map(|&constant| signed_digits(constant)).collect();
    let mut symbols = vec![Term::from(x.clone())];
    let term = |symbols: &[Term], digit: &Digit| {
        symbols[digit.symbol].clone().scaled(digit.shift, digit.is_negative)
    };
    while let Some((first, second, shift, is_negative)) = most_frequent(&numbers) {
        let pair = [
            Digit { symbol: first, shift: 0, is_negative: false },
            Digit { symbol: second, shift, is_negative },
        ];
        let sum = netlist.sum(pair.iter().map(|digit| term(&symbols, digit)).collect());
        symbols.extend(sum);
        let symbol = symbols.len() - 1;
        numbers.iter_mut().for_each(|number| replace(number, (first, second, shift, is_negative), symbol));
    }
    let sums =
        numbers.iter().map(|number| netlist.sum(number.iter().map(|digit| term(&symbols, digit)).collect()));
    constants.iter().copied().zip(sums).filter_map(|(constant, sum)| Some((constant, sum?))).collect()
}

/// The digits -1, 0 and 1 of which no two neighbours are other than 0; those that are 0 are left out.
fn signed_digits(constant: u64) -> Vec<Digit> {
    let digit = |shift, is_negative| Digit { symbol: 0, shift, is_negative };
    let mut rest = constant;
    let mut digits = Vec::new();
    for shift in 0.. {
        match rest & 3 {
            _ if rest == 0 => break,
            1 => digits.push(digit(shift, false)),
            3 => {
                digits.push(digit(shift, true));
                rest += 1;
            }
            _ => {}
        }
        rest >>= 1;
    }
    digits
}

fn pair(a: &Digit, b: &Digit) -> Pair {
    (a.symbol, b.symbol, b.shift - a.shift, a.is_negative != b.is_negative)
}

/// The pair with the most occurrences that do not overlap, if it has two.
fn most_frequent(numbers: &[Vec<Digit>]) -> Option<Pair> {
    let mut counts: BTreeMap<Pair, usize> = BTreeMap::new();
    for number in numbers {
        let mut pairs = BTreeSet::new();
        for (k, a) in number.iter().enumerate() {
            pairs.extend(number[k + 1..].iter().map(|b| pair(a, b)));
        }
        for pair in pairs {
            *counts.entry(pair).or_default() += occurrences(number, pair).len();
        }
    }
    let frequent = counts.into_iter().filter(|(_, count)| *count > 1);
    frequent.max_by_key(|(pair, count)| (*count, std::cmp::Reverse(*pair))).map(|(pair, _)| pair)
}

/// Places of a pair that do not overlap.
fn occurrences(number: &[Digit], wanted: Pair) -> Vec<(usize, usize)> {
    let mut taken = vec![false; number.len()];
    let mut found = Vec::new();
    for (k, a) in number.iter().enumerate() {
        let second = (k + 1..number.len()).find(|&l| !taken[l] && pair(a, &number[l]) == wanted);
        if let (false, Some(l)) = (taken[k], second) {
            taken[l] = true;
            found.push((k, l));
        }
    }
    found
}

/// Writes `symbol` for each occurrence of a pair. The digits stay in the order of their shifts.
fn replace(number: &mut Vec<Digit>, pair: Pair, symbol: usize) {
    let places = occurrences(number, pair);
    places.iter().for_each(|&(first, _)| number[first].symbol = symbol);
    let mut index = 0;
    number.retain(|_| {
        index += 1;
        places.iter().all(|&(_, second)| second != index - 1)
    });
}
