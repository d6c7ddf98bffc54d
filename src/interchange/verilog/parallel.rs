//! A frame at every clock: filters in transposed form. Each input is multiplied once with each constant of
//! its channel, the products of one phase and lag are added by a tree, and a chain of accumulators adds the
//! lags.

use super::netlist::{Netlist, ShiftedWord, Word, wrapped};
use super::output::{OutputRounding, held_sum};
use super::tables::Samples;
use crate::interchange::bit_true::{IntegerFilters, Range};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Writes the filters and gives the latency in clocks.
pub(super) fn parallel(
    netlist: &mut Netlist,
    filters: &IntegerFilters,
    samples: &Samples,
    output: OutputRounding,
) -> usize {
    let taps = &filters.taps;
    let inputs = samples.words(netlist);
    let products: Vec<_> = inputs.iter().enumerate().map(|(i, x)| products(netlist, filters, i, x)).collect();
    let trees: Vec<Vec<Option<ShiftedWord>>> = (0..taps.ratio)
        .map(|p| (0..taps.lags).map(|j| tree(netlist, filters, &products, p, j)).collect())
        .collect();
    for (x, products) in inputs.iter().zip(&products) {
        if products.is_empty() {
            netlist.leave(x.name.clone());
        }
    }
    let stage = trees.iter().flatten().flatten().map(|term| term.word.stage).max().unwrap_or(0);
    let mut chain = AccumulatorChain { enabled: String::new(), reset: String::new(), stage };
    for (p, lags) in trees.into_iter().enumerate() {
        let word = chain.of_phase(netlist, filters, p, lags);
        let constant = -i128::from(filters.constants[p]);
        if netlist.holds(word.range.plus(constant.into())) {
            output.write(netlist, p, &word, constant + output.half());
        } else {
            // The accumulator wraps before its sum is rounded.
            let word = held_sum(netlist, p, word, constant);
            output.write(netlist, p, &word, output.half());
        }
    }
    chain.write(netlist);
    stage + 2
}

/// The odd part of a tap, with the shift that gives its size.
fn odd_part(tap: i64) -> (u64, u32) {
    let shift = tap.trailing_zeros();
    (tap.unsigned_abs() >> shift, shift)
}

/// The multiples of input `i` by the odd parts of its taps.
fn products(
    netlist: &mut Netlist,
    filters: &IntegerFilters,
    channel: usize,
    x: &Word,
) -> BTreeMap<u64, ShiftedWord> {
    let taps = &filters.taps;
    let own = &taps.values[channel * taps.ratio * taps.lags..][..taps.ratio * taps.lags];
    // The odd parts, with the least shift of each.
    let mut parts: BTreeMap<u64, u32> = BTreeMap::new();
    for (odd, shift) in own.iter().filter(|tap| **tap != 0).map(|tap| odd_part(*tap)) {
        parts.entry(odd).and_modify(|least| *least = shift.min(*least)).or_insert(shift);
    }
    let product = |(odd, shift): (u64, u32)| match odd {
        1 => (1, x.clone().into()),
        _ => (odd, netlist.product(x, odd.into(), shift).into()),
    };
    parts.into_iter().map(product).collect()
}

/// The sum of the products of one phase and lag.
fn tree(
    netlist: &mut Netlist,
    filters: &IntegerFilters,
    products: &[BTreeMap<u64, ShiftedWord>],
    phase: usize,
    lag: usize,
) -> Option<ShiftedWord> {
    let terms = products.iter().enumerate().filter_map(|(i, products)| {
        let tap = filters.taps.get(i, phase, lag);
        let (odd, shift) = (tap != 0).then(|| odd_part(tap))?;
        Some(products.get(&odd)?.clone().scaled(shift, tap < 0))
    });
    netlist.sum(terms.collect())
}

/// The accumulators of all phases, which take a frame when its products are there.
struct AccumulatorChain {
    /// Assignments with a frame, and those of the reset.
    enabled: String,
    reset: String,
    /// Where the products are there.
    stage: usize,
}

impl AccumulatorChain {
    /// The sum of a phase: z_j takes z_(j+1) and the products of lag j. After the reset the history is that
    /// of samples without a signal.
    fn of_phase(
        &mut self,
        netlist: &mut Netlist,
        filters: &IntegerFilters,
        phase: usize,
        lags: Vec<Option<ShiftedWord>>,
    ) -> Word {
        let taps = &filters.taps;
        let mut resting = 0;
        let mut last: Option<ShiftedWord> = None;
        for (j, products) in lags.into_iter().enumerate().rev() {
            if last.is_none() && products.is_none() && j > 0 {
                continue;
            }
            let of_lag = |i: usize| i128::from(taps.get(i, phase, j)) * i128::from(filters.resting[i]);
            resting += (0..taps.channels).map(of_lag).sum::<i128>();
            let products =
                products.map(|term| ShiftedWord { word: netlist.at_stage(term.word, self.stage), ..term });
            let terms: Vec<&ShiftedWord> = last.iter().chain(&products).collect();
            let range = terms.iter().fold(Range::from(0), |range, term| range.plus(term.range()));
            let range = netlist.held(range);
            let name = format!("z{phase}_{j}");
            let value = netlist.total(&terms, range.bits());
            netlist.declare_register(&name, range.bits());
            let _ = writeln!(self.enabled, "                {name} <= {value};");
            let _ = writeln!(self.reset, "            {name} <= {};", wrapped(resting, range.bits()));
            last = Some(Word::at(self.stage + 1, name, range).into());
        }
        // The loop ends with lag 0, which is never left out.
        last.map_or_else(|| Word::at(self.stage + 1, "1'b0".into(), Range::from(0)), |term| term.word)
    }

    fn write(self, netlist: &mut Netlist) {
        let Self { enabled, reset, stage } = self;
        let enable = if stage == 0 { "in_valid".to_owned() } else { format!("valid[{}]", stage - 1) };
        let _ = write!(
            netlist.text,
            "    // Whether there is a frame in each stage.\n    reg [{last}:0] valid;\n    \
             assign out_valid = valid[{last}];\n    \
             always @(posedge clk)\n        if (rst) begin\n            valid <= {bits}'d0;\n{reset}        \
             end else begin\n            valid <= {{valid[{stage}:0], in_valid}};\n            \
             if ({enable}) begin\n{enabled}            end\n        end\n",
            last = stage + 1,
            bits = stage + 2,
        );
        netlist.registers += stage + 2;
    }
}
