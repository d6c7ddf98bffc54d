//! Sums of integers in Verilog: each word as wide as its values need, with registers between the levels.

use crate::interchange::bit_true::Range;
use std::collections::HashMap;
use std::fmt::Write;

/// A signed word, and when it is there.
#[derive(Debug, Clone)]
pub(super) struct Word {
    pub(super) name: String,
    pub(super) range: Range,
    /// Registers between the input and this word.
    pub(super) stage: usize,
    /// Levels of adders since the last register.
    pub(super) level: usize,
}

impl Word {
    /// A word right after a register.
    pub(super) fn at(stage: usize, name: String, range: Range) -> Self {
        Self { name, range, stage, level: 0 }
    }

    pub(super) fn bits(&self) -> u32 {
        self.range.bits()
    }
}

/// A word times a signed power of two, which costs nothing.
#[derive(Debug, Clone)]
pub(super) struct ShiftedWord {
    pub(super) word: Word,
    pub(super) shift: u32,
    pub(super) is_negative: bool,
}

impl From<Word> for ShiftedWord {
    fn from(word: Word) -> Self {
        Self { word, shift: 0, is_negative: false }
    }
}

impl ShiftedWord {
    pub(super) fn range(&self) -> Range {
        self.word.range.times(if self.is_negative { -1 } else { 1 } << self.shift)
    }

    /// The term times plus or minus 2^`shift`.
    pub(super) fn scaled(mut self, shift: u32, is_negated: bool) -> Self {
        self.shift += shift;
        self.is_negative ^= is_negated;
        self
    }
}

/// What a sum of two terms, or its negative, is known by.
fn key(a: &ShiftedWord, b: &ShiftedWord, is_negated: bool) -> String {
    let mut parts = [a, b].map(|term| {
        let sign = if term.is_negative == is_negated { '+' } else { '-' };
        format!("{} {} {sign}", term.word.name, term.shift)
    });
    parts.sort();
    parts.join(" ")
}

/// The value as a word of so many bits holds it.
pub(super) fn wrapped(value: i128, bits: u32) -> String {
    let unused = i128::BITS - bits;
    constant(value << unused >> unused, bits)
}

/// A constant of so many bits.
pub(super) fn constant(value: i128, bits: u32) -> String {
    let least = Range::of_bits(bits).least;
    match value {
        -1 if bits == 1 => "1'sb1".to_owned(),
        // The modulus of the least value does not fit.
        _ if value == least => format!("{{1'b1, {}'d0}}", bits - 1),
        _ if value < 0 => format!("-{bits}'sd{}", -value),
        _ => format!("{bits}'sd{value}"),
    }
}

/// Text of Verilog, with what it costs.
#[derive(Debug)]
pub(super) struct Netlist {
    /// Levels of adders between two registers.
    levels: usize,
    /// Bits of the accumulator: sums are right modulo 2 to this power.
    accumulator: u32,
    /// Declarations.
    pub(super) text: String,
    /// What registers take at every clock.
    clocked: String,
    pub(super) adders: usize,
    pub(super) multipliers: usize,
    /// Bits.
    pub(super) registers: usize,
    /// Bits that nothing reads, by design.
    unused: Vec<String>,
    /// The same words a clock later.
    delayed: HashMap<String, Word>,
    /// Sums of two terms by their text, which serve wherever they are needed.
    sums: HashMap<String, Word>,
}

impl Netlist {
    pub(super) fn new(levels: u32, accumulator: u32) -> Self {
        Self {
            levels: levels as usize,
            accumulator,
            text: String::new(),
            clocked: String::new(),
            adders: 0,
            multipliers: 0,
            registers: 0,
            unused: Vec::new(),
            delayed: HashMap::new(),
            sums: HashMap::new(),
        }
    }

    /// The range of sums in the accumulator: all of it, if they may wrap.
    pub(super) fn held(&self, range: Range) -> Range {
        if self.holds(range) { range } else { Range::of_bits(self.accumulator) }
    }

    /// The range of a word that takes the lower bits of the accumulator after a shift.
    fn held_below(&self, range: Range, shift: u32) -> Range {
        let bits = self.accumulator.saturating_sub(shift).max(1);
        if range.bits() <= bits { range } else { Range::of_bits(bits) }
    }

    /// Whether no sum of this range wraps.
    pub(super) fn holds(&self, range: Range) -> bool {
        range.bits() <= self.accumulator
    }

    pub(super) fn declare_register(&mut self, name: &str, bits: u32) {
        let _ = writeln!(self.text, "    reg signed [{}:0] {name};", bits - 1);
        self.registers += bits as usize;
    }

    pub(super) fn declare_wire(&mut self, name: &str, bits: u32, value: &str) {
        let _ = writeln!(self.text, "    wire signed [{}:0] {name} = {value};", bits - 1);
    }

    /// A register that takes `value` at every clock.
    pub(super) fn register(&mut self, name: &str, bits: u32, value: &str) {
        self.declare_register(name, bits);
        self.clock(name, value);
    }

    /// A register, declared elsewhere, takes `value` at every clock.
    pub(super) fn clock(&mut self, name: &str, value: &str) {
        let _ = writeln!(self.clocked, "        {name} <= {value};");
    }

    /// The product with a constant, in a register. It will be shifted by `shift` at least, so it has no bit
    /// that the accumulator then cannot hold.
    pub(super) fn product(&mut self, x: &Word, factor: i128, shift: u32) -> Word {
        let range = self.held_below(x.range.times(factor), shift);
        let bits = range.bits();
        let factor_bits = Range::from(factor).bits();
        let value = match bits < factor_bits.max(x.bits()) {
            true => format!("{} * {}", self.sized(x, 0, bits), wrapped(factor, bits)),
            false => format!("{} * {}", x.name, constant(factor, factor_bits)),
        };
        self.multiply(x, format!("{}_times_{factor}", x.name), range, &value)
    }

    /// The product of two words, in a register.
    pub(super) fn product_of(&mut self, a: &Word, b: &Word) -> Word {
        let exact = a.range.times(b.range.least).hull(a.range.times(b.range.most));
        let range = self.held(exact);
        let bits = range.bits();
        let value = match bits < a.bits().max(b.bits()) {
            true => format!("{} * {}", self.sized(a, 0, bits), self.sized(b, 0, bits)),
            false => format!("{} * {}", a.name, b.name),
        };
        self.multiply(a, format!("{}_times_{}", a.name, b.name), range, &value)
    }

    fn multiply(&mut self, x: &Word, name: String, range: Range, value: &str) -> Word {
        self.register(&name, range.bits(), value);
        self.multipliers += 1;
        Word::at(x.stage + 1, name, range)
    }

    /// The word at a later stage.
    pub(super) fn at_stage(&mut self, word: Word, stage: usize) -> Word {
        let mut word = word;
        while word.stage < stage {
            word = self.later(word);
        }
        word
    }

    fn later(&mut self, word: Word) -> Word {
        if let Some(known) = self.delayed.get(&word.name) {
            return known.clone();
        }
        let later = Word::at(word.stage + 1, format!("{}_d", word.name), word.range);
        self.register(&later.name, word.bits(), &word.name);
        self.delayed.insert(word.name, later.clone());
        later
    }

    /// The sum of all terms by a tree of adders; the earliest ones are added first.
    pub(super) fn sum(&mut self, mut terms: Vec<ShiftedWord>) -> Option<ShiftedWord> {
        loop {
            terms.sort_by_key(|term| std::cmp::Reverse((term.word.stage, term.word.level)));
            let first = terms.pop()?;
            let Some(second) = terms.pop() else { return Some(first) };
            let sum = self.sum_of_two(first, second);
            terms.push(sum);
        }
    }

    fn sum_of_two(&mut self, a: ShiftedWord, b: ShiftedWord) -> ShiftedWord {
        let stage = a.word.stage.max(b.word.stage);
        let shift = a.shift.min(b.shift);
        let is_negative = a.is_negative && b.is_negative;
        let [a, b] = [a, b].map(|term| ShiftedWord {
            word: self.at_stage(term.word, stage),
            shift: term.shift - shift,
            is_negative: term.is_negative && !is_negative,
        });
        let level = a.word.level.max(b.word.level) + 1;
        let range = self.held(a.range().plus(b.range()));
        let (key, negated) = (key(&a, &b, false), key(&a, &b, true));
        if let Some(word) = self.sums.get(&key) {
            return ShiftedWord { word: word.clone(), shift, is_negative };
        }
        if let Some(word) = self.sums.get(&negated) {
            return ShiftedWord { word: word.clone(), shift, is_negative: !is_negative };
        }
        let name = format!("sum{}", self.sums.len() + 1);
        let value = self.total(&[&a, &b], range.bits());
        let word = if level >= self.levels {
            self.register(&name, range.bits(), &value);
            Word::at(stage + 1, name, range)
        } else {
            self.declare_wire(&name, range.bits(), &value);
            Word { name, range, stage, level }
        };
        self.sums.insert(key, word.clone());
        ShiftedWord { word, shift, is_negative }
    }

    /// The sum of at most two terms as an expression of so many bits.
    pub(super) fn total(&mut self, terms: &[&ShiftedWord], bits: u32) -> String {
        let mut terms = terms.to_vec();
        terms.sort_by_key(|term| term.is_negative);
        let mut text = String::new();
        for term in &terms {
            text += match (term.is_negative, text.is_empty()) {
                (true, true) => "-",
                (true, false) => " - ",
                (false, true) => "",
                (false, false) => " + ",
            };
            text += &self.sized(&term.word, term.shift, bits);
        }
        let is_negated = terms.first().is_some_and(|term| term.is_negative);
        self.adders += terms.len().saturating_sub(1) + usize::from(is_negated);
        if terms.is_empty() { constant(0, bits) } else { text }
    }

    /// The word times 2^`shift`, extended by its sign or cut to so many bits.
    pub(super) fn sized(&mut self, word: &Word, shift: u32, bits: u32) -> String {
        let (name, own) = (&word.name, word.bits());
        let taken = own.min(bits.saturating_sub(shift));
        if taken < own {
            self.unused.push(format!("{name}[{}:{taken}]", own - 1));
        }
        if taken == 0 {
            return constant(0, bits);
        }
        let fill = bits - shift - taken;
        let body = if taken < own { format!("{name}[{}:0]", taken - 1) } else { name.clone() };
        let mut parts = Vec::new();
        if fill > 0 {
            parts.push(format!("{{{fill}{{{name}[{}]}}}}", own - 1));
        }
        parts.push(body);
        if shift > 0 {
            parts.push(format!("{shift}'d0"));
        }
        if parts.len() == 1 { parts.remove(0) } else { format!("{{{}}}", parts.join(", ")) }
    }

    /// Notes what nothing reads, so that linters know that it is meant.
    pub(super) fn leave(&mut self, bits: String) {
        self.unused.push(bits);
    }

    /// The body of the module. What nothing else reads is read by a wire whose name linters know, and which
    /// synthesis takes away.
    pub(super) fn body(&self) -> String {
        let Self { text, clocked, unused, .. } = self;
        let mut text = format!("{text}    always @(posedge clk) begin\n{clocked}    end\n");
        if !unused.is_empty() {
            let _ = writeln!(text, "    wire unused = &{{1'b0, {}}};", unused.join(", "));
        }
        text
    }
}
