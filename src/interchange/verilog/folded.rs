//! A frame at every C clocks: filters in direct form. Each multiplier takes C samples of the history one
//! after another, with their coefficients from a ROM; a tree adds the products of a phase, and an
//! accumulator adds the clocks.

use super::VerilogOptions;
use super::netlist::{Netlist, Term, Word, constant};
use super::output::{Output, wrapped};
use crate::interchange::bit_true::IntegerFilters;
use crate::interchange::range::Range;
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
    pub(super) fn new(filters: &IntegerFilters, clocks: usize) -> Self {
        let taps = &filters.taps;
        let all = (0..taps.lags).flat_map(|j| (0..taps.channels).map(move |i| (i, j)));
        let is_used = |&(i, j): &(usize, usize)| (0..taps.ratio).any(|p| taps.get(i, p, j) != 0);
        let samples: Vec<(usize, usize)> = all.filter(is_used).collect();
        let clocks = clocks.min(samples.len()).max(1);
        Self { samples, clocks }
    }

    /// The taps of a phase for the samples of each multiplier.
    fn coefficients(&self, filters: &IntegerFilters, phase: usize) -> Vec<Vec<i64>> {
        let tap = |&(i, j): &(usize, usize)| filters.taps.get(i, phase, j);
        self.samples.chunks(self.clocks).map(|samples| samples.iter().map(tap).collect()).collect()
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
    options: &VerilogOptions,
    output: Output,
) -> (usize, usize) {
    let bits = options.words.input;
    write_history(netlist, filters, schedule, bits);
    let mut cases = vec![String::new(); schedule.clocks];
    for (m, samples) in schedule.samples.chunks(schedule.clocks).enumerate() {
        netlist.declare_register(&format!("a{m}"), bits);
        for (case, (i, j)) in cases.iter_mut().zip(samples) {
            let _ = write!(case, " a{m} <= x{}_{j};", i + 1);
        }
    }
    let mut rom = 0;
    let mut phases = Vec::new();
    for p in 0..filters.taps.ratio {
        let mut products = Vec::new();
        for (m, taps) in schedule.coefficients(filters, p).iter().enumerate() {
            let Some(range) = range(taps) else { continue };
            let name = format!("q{p}_{m}");
            netlist.declare_register(&name, range.bits());
            rom += range.bits() as usize * schedule.clocks;
            for (step, case) in cases.iter_mut().enumerate() {
                let tap = taps.get(step).copied().unwrap_or(0);
                let _ = write!(case, " {name} <= {};", constant(tap.into(), range.bits()));
            }
            let a = Word::at(1, format!("a{m}"), Range::of_bits(bits));
            products.push(Term::from(netlist.product_of(&a, &Word::at(1, name, range))));
        }
        phases.push(netlist.sum(products));
    }
    let stage = phases.iter().flatten().map(|term| term.word.stage).max().unwrap_or(2);
    write_control(netlist, &cases, stage);
    for (p, products) in phases.into_iter().enumerate() {
        let products = products.map(|term| netlist.at_stage(term.word, stage));
        accumulate(netlist, filters, p, products, options, output);
    }
    (schedule.clocks + stage + 2, rom)
}

/// The coefficients of a multiplier, unless all are zero.
fn range(taps: &[i64]) -> Option<Range> {
    let hull = |range: Range, tap: &i64| range.hull(i128::from(*tap).into());
    let range = taps.iter().fold(Range::from(0), hull);
    (range != Range::from(0)).then_some(range)
}

/// The last samples of each channel. After the reset they are those without a signal.
fn write_history(netlist: &mut Netlist, filters: &IntegerFilters, schedule: &Schedule, bits: u32) {
    let (mut reset, mut shift) = (String::new(), String::new());
    for i in 0..filters.taps.channels {
        let lags = schedule.lags(i);
        if lags == 0 {
            netlist.leave(format!("x{}", i + 1));
        }
        for j in 0..lags {
            let name = format!("x{}_{j}", i + 1);
            let before = j.checked_sub(1).map_or_else(String::new, |j| format!("_{j}"));
            netlist.declare_register(&name, bits);
            let _ = writeln!(reset, "            {name} <= {};", constant(filters.resting[i].into(), bits));
            let _ = writeln!(shift, "            {name} <= x{}{before};", i + 1);
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
    filters: &IntegerFilters,
    phase: usize,
    products: Option<Word>,
    options: &VerilogOptions,
    output: Output,
) {
    let start = -i128::from(filters.constants[phase]);
    let sums = filters.sums(phase, options.words.input);
    // Where no sum wraps, the accumulator begins with the half that rounds. Sums on the way may leave its
    // bits and come back.
    let half = if netlist.holds(sums) { output.half() } else { 0 };
    let range = if netlist.holds(sums) { sums.plus(half.into()) } else { netlist.held(sums) };
    let (name, bits) = (format!("z{phase}"), range.bits());
    let stage = products.as_ref().map_or(2, |word| word.stage);
    let begin = wrapped(start + half, bits);
    let product = products.map(|word| format!(" + {}", netlist.sized(&word, 0, bits))).unwrap_or_default();
    netlist.adders += usize::from(!product.is_empty());
    netlist.register(&name, bits, &format!("(first[{}] ? {begin} : {name}){product}", stage - 1));
    output.write(netlist, phase, &Word::at(stage + 1, name, range), output.half() - half);
}
