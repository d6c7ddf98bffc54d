//! A frame at every C clocks: filters in direct form. Each multiplier takes C samples of the history one
//! after another, with their coefficients from a ROM or from words that were loaded; a tree adds the
//! products of a phase, and an accumulator adds the clocks.

use super::load::LoadPort;
use super::netlist::{Netlist, ShiftedWord, Word, constant, wrapped};
use super::output::OutputRounding;
use super::tables::Samples;
use crate::interchange::bit_true::{IntegerFilters, Range};
use crate::interchange::layout::PolyphaseTaps;
use std::collections::BTreeMap;
use std::fmt::Write;

/// The samples of which some tap is not zero, as (channel, lag), for each multiplier those of its clocks.
#[derive(Debug)]
pub(super) struct Schedule {
    samples: Vec<(usize, usize)>,
    /// C.
    pub(super) clocks: usize,
}

impl Schedule {
    /// No more clocks than samples.
    pub(super) fn new(taps: &PolyphaseTaps<i64>, clocks: usize) -> Self {
        let all = (0..taps.lags).flat_map(|j| (0..taps.channels).map(move |i| (i, j)));
        let is_used = |&(i, j): &(usize, usize)| (0..taps.ratio).any(|p| taps.get(i, p, j) != 0);
        let samples: Vec<(usize, usize)> = all.filter(is_used).collect();
        let clocks = clocks.min(samples.len()).max(1);
        Self { samples, clocks }
    }

    /// Bits of the index of a clock.
    pub(super) fn index_bits(&self) -> u32 {
        usize::BITS - (self.clocks - 1).leading_zeros()
    }

    /// The taps of a phase at each clock of a multiplier. They are zero where it has no sample left.
    pub(super) fn taps(&self, taps: &PolyphaseTaps<i64>, phase: usize, multiplier: usize) -> Vec<i64> {
        let samples = self.samples.iter().skip(multiplier * self.clocks).take(self.clocks);
        let mut taps: Vec<i64> = samples.map(|&(i, j)| taps.get(i, phase, j)).collect();
        taps.resize(self.clocks, 0);
        taps
    }

    /// Lags of a channel.
    fn lags(&self, channel: usize) -> usize {
        self.samples.iter().filter(|(i, _)| *i == channel).map(|(_, j)| j + 1).max().unwrap_or(0)
    }
}

/// Writes the filters and gives the latency in clocks, and the bits of the ROM.
pub(super) fn folded(
    netlist: &mut Netlist,
    filters: &IntegerFilters,
    schedule: &Schedule,
    mut port: Option<&mut LoadPort>,
    samples: &Samples,
    output: OutputRounding,
) -> (usize, usize) {
    let bits = samples.bits;
    write_history(netlist, filters, schedule, port.as_deref_mut(), samples);
    let mut rom = Rom { cases: vec![String::new(); schedule.clocks], bits: 0, products: BTreeMap::new() };
    let mut products = vec![Vec::new(); filters.taps.ratio];
    for (m, samples) in schedule.samples.chunks(schedule.clocks).enumerate() {
        let a = Word::at(1, format!("a{m}"), Range::of_bits(bits));
        netlist.declare_register(&a.name, bits);
        for (case, (i, j)) in rom.cases.iter_mut().zip(samples) {
            let _ = write!(case, " {} <= x{}_{j};", a.name, i + 1);
        }
        for (p, products) in products.iter_mut().enumerate() {
            let (name, taps) = (format!("q{p}_{m}"), schedule.taps(&filters.taps, p, m));
            products.extend(match &mut port {
                Some(port) => port.product(netlist, &a, &name, &schedule.taps(&port.tap_bits, p, m), &taps),
                None => rom.product(netlist, &a, &name, &taps),
            });
        }
    }
    if let Some(port) = &mut port {
        for (p, products) in products.iter_mut().enumerate() {
            products.push(port.constant(netlist, p, -filters.constants[p]).into());
        }
    }
    let sums: Vec<_> = products.into_iter().map(|products| netlist.sum(products)).collect();
    let stage = sums.iter().flatten().map(|term| term.word.stage).fold(2, usize::max);
    write_control(netlist, &rom.cases, stage);
    for (p, sum) in sums.into_iter().enumerate() {
        let sum = sum.map(|term| ShiftedWord { word: netlist.at_stage(term.word, stage), ..term });
        let (start, sums) = match &port {
            Some(port) => (0, port.sums(p)),
            None => (-i128::from(filters.constants[p]), filters.sums(p, bits)),
        };
        accumulate(netlist, start, sums, p, sum, stage, output);
    }
    if let Some(port) = port {
        port.write(netlist);
        rom.bits = port.bits;
    }
    (schedule.clocks + stage + 2, rom.bits)
}

/// The coefficients of the multipliers, and the products with them.
struct Rom {
    /// What registers take at each clock of a frame.
    cases: Vec<String>,
    bits: usize,
    /// Products by the name of the sample and the coefficients. They serve all phases that have them.
    products: BTreeMap<(String, Vec<i64>), ShiftedWord>,
}

impl Rom {
    /// The products of the sample `a` with its taps at each clock, unless all are zero. What the taps have
    /// in common, a power of two or all of it, needs no ROM.
    fn product(&mut self, netlist: &mut Netlist, a: &Word, name: &str, taps: &[i64]) -> Option<ShiftedWord> {
        let nonzero = taps.iter().filter(|tap| **tap != 0);
        let shift = nonzero.map(|tap| tap.trailing_zeros()).min()?;
        let factors: Vec<i64> = taps.iter().map(|tap| tap >> shift).collect();
        let key = (a.name.clone(), factors);
        if let Some(known) = self.products.get(&key) {
            return Some(known.clone().scaled(shift, false));
        }
        let factors = &key.1;
        let first = factors[0];
        let term = match first.unsigned_abs() {
            _ if factors.iter().any(|factor| *factor != first) => {
                let word = self.word(netlist, name, factors);
                netlist.product_of(a, &word).into()
            }
            1 => ShiftedWord::from(a.clone()).scaled(0, first < 0),
            odd => ShiftedWord::from(netlist.product(a, odd.into(), 0)).scaled(0, first < 0),
        };
        self.products.insert(key, term.clone());
        Some(term.scaled(shift, false))
    }

    /// A register with the factor of each clock.
    fn word(&mut self, netlist: &mut Netlist, name: &str, factors: &[i64]) -> Word {
        let hull = |range: Range, factor: &i64| range.hull(i128::from(*factor).into());
        let range = factors.iter().fold(Range::from(0), hull);
        netlist.declare_register(name, range.bits());
        self.bits += range.bits() as usize * factors.len();
        for (case, factor) in self.cases.iter_mut().zip(factors) {
            let _ = write!(case, " {name} <= {};", constant((*factor).into(), range.bits()));
        }
        Word::at(1, name.to_owned(), range)
    }
}

/// The last samples of each channel. After the reset they are those without a signal.
fn write_history(
    netlist: &mut Netlist,
    filters: &IntegerFilters,
    schedule: &Schedule,
    mut port: Option<&mut LoadPort>,
    samples: &Samples,
) {
    let bits = samples.bits;
    let (mut reset, mut shift) = (String::new(), String::new());
    for i in 0..filters.taps.channels {
        let lags = schedule.lags(i);
        if lags == 0 {
            netlist.leave(format!("x{}", i + 1));
        }
        let resting = match &mut port {
            Some(port) => port.resting(netlist, i, bits, filters.resting[i]),
            None => constant(filters.resting[i].into(), bits),
        };
        for j in 0..lags {
            let name = format!("x{}_{j}", i + 1);
            let before = match j {
                0 => samples.texts[i].clone(),
                _ => format!("x{}_{}", i + 1, j - 1),
            };
            netlist.declare_register(&name, bits);
            let _ = writeln!(reset, "            {name} <= {resting};");
            let _ = writeln!(shift, "            {name} <= {before};");
        }
    }
    let _ = write!(
        netlist.text,
        "    wire take = in_valid & in_ready;\n    always @(posedge clk)\n        if (rst) begin\n{reset}        \
         end else if (take) begin\n{shift}        end\n"
    );
}

/// What counts the clocks of a frame, and what is read at each of them.
fn write_control(netlist: &mut Netlist, cases: &[String], stage: usize) {
    let last = cases.len() - 1;
    let bits = (usize::BITS - last.leading_zeros()).max(1);
    let step = |number: usize| format!("{bits}'d{number}");
    netlist.registers += bits as usize + 1 + 2 * stage + 2;
    netlist.adders += 1;
    let mut text = String::new();
    for (number, case) in cases.iter().enumerate() {
        let label = if number == last { "default".to_owned() } else { step(number) };
        let _ = writeln!(text, "            {label}: begin{case} end");
    }
    let _ = write!(
        netlist.text,
        "    // The clock of the frame.\n    reg busy;\n    reg [{top}:0] step;\n    \
         assign in_ready = ~busy | step == {last};\n    \
         // Whether each stage has the first or the last clock of a frame.\n    \
         reg [{of_first}:0] first;\n    reg [{of_last}:0] last;\n    assign out_valid = last[{of_last}];\n    \
         always @(posedge clk)\n        if (rst) begin\n            busy <= 1'b0;\n            \
         step <= {zero};\n            first <= {first_bits}'d0;\n            last <= {last_bits}'d0;\n        \
         end else begin\n            first <= {{first[{below_first}:0], busy & step == {zero}}};\n            \
         last <= {{last[{stage}:0], busy & step == {last}}};\n            \
         if (take) begin\n                busy <= 1'b1;\n                step <= {zero};\n            \
         end else if (step == {last}) busy <= 1'b0;\n            else step <= step + {one};\n        end\n    \
         // The samples and the coefficients of each multiplier.\n    \
         always @(posedge clk)\n        case (step)\n{text}        endcase\n",
        top = bits - 1,
        last = step(last),
        zero = step(0),
        one = step(1),
        of_first = stage - 1,
        below_first = stage - 2,
        of_last = stage + 1,
        first_bits = stage,
        last_bits = stage + 2,
    );
}

/// The accumulator of a phase, and its output.
fn accumulate(
    netlist: &mut Netlist,
    start: i128,
    sums: Range,
    phase: usize,
    sum: Option<ShiftedWord>,
    stage: usize,
    output: OutputRounding,
) {
    // Where no sum wraps, the accumulator begins with the half that rounds. Sums on the way may leave its
    // bits and come back.
    let half = if netlist.holds(sums) { output.half() } else { 0 };
    let range = if netlist.holds(sums) { sums.plus(half.into()) } else { netlist.held(sums) };
    let (name, bits) = (format!("z{phase}"), range.bits());
    let begin = wrapped(start + half, bits);
    netlist.adders += usize::from(sum.is_some());
    let sum = sum.map_or_else(String::new, |term| {
        let sign = if term.is_negative { '-' } else { '+' };
        format!(" {sign} {}", netlist.sized(&term.word, term.shift, bits))
    });
    netlist.register(&name, bits, &format!("(first[{}] ? {begin} : {name}){sum}", stage - 1));
    output.write(netlist, phase, &Word::at(stage + 1, name, range), output.half() - half);
}
