//! Coefficients that a host writes through a port. There are two banks of words: one runs, and the other one
//! is written until a clock between two frames exchanges them.

use super::folded::Schedule;
use super::netlist::{Netlist, ShiftedWord, Word};
use crate::bank::FixedPoint;
use crate::interchange::ExportError;
use crate::interchange::bit_true::{IntegerFilters, Range};
use crate::interchange::layout::PolyphaseTaps;
use std::fmt::Write;

/// Words at successive addresses, one for each clock of a frame, or the same one for all of them.
#[derive(Debug)]
struct Memory {
    name: String,
    bits: u32,
    /// Bits of the address in it.
    index_bits: u32,
}

/// The port, and the words of a bank in the order of their addresses.
#[derive(Debug)]
pub(super) struct LoadPort {
    /// Bits of each tap; a tap of 0 bits has no multiplier.
    pub(super) tap_bits: PolyphaseTaps<i64>,
    sample_bits: u32,
    /// Lower bits of the address: the clock of a frame.
    index_bits: u32,
    memories: Vec<Memory>,
    words: Vec<i64>,
    /// Of all memories.
    pub(super) bits: usize,
}

impl LoadPort {
    /// For all taps of the bits that these have.
    ///
    /// # Errors
    /// [`ExportError::Accumulator`] for taps whose sums may not fit 64 bits.
    pub(super) fn new(
        taps: &FixedPoint,
        ratio: usize,
        frames: usize,
        clocks: usize,
        sample_bits: u32,
    ) -> Result<(Self, Schedule), ExportError> {
        let bits_of = |list: &Vec<i64>| (0..list.len()).map(|n| i64::from(taps.bits.bits(n))).collect();
        let tap_bits = PolyphaseTaps::new(&taps.integers.iter().map(bits_of).collect::<Vec<_>>(), ratio);
        let (constants, resting) = (vec![0; ratio], vec![0; tap_bits.channels]);
        let tap_bits = IntegerFilters { taps: tap_bits, constants, resting }.of_blocks(frames).taps;
        let schedule = Schedule::new(&tap_bits, clocks);
        let (memories, words) = (Vec::new(), Vec::new());
        let index_bits = schedule.index_bits();
        let port = Self { tap_bits, sample_bits, index_bits, memories, words, bits: 0 };
        let largest = (0..port.tap_bits.ratio).map(|p| port.sums(p).most).max().unwrap_or(0);
        match largest < 1 << 62 {
            true => Ok((port, schedule)),
            false => Err(ExportError::Accumulator { sum: (largest >> sample_bits) as u64, sample_bits }),
        }
    }

    /// What offsets of full scale add to a sum of a phase at most, and so at most the sum of its products.
    fn constants(&self, phase: usize) -> Range {
        let bits = self.tap_bits.of_phase(phase).map(|(_, bits)| bits as u32).filter(|bits| *bits > 0);
        let most: i128 = bits.map(|bits| 1_i128 << (bits + self.sample_bits - 2)).sum();
        Range { least: -most, most }
    }

    /// The sums of a phase.
    pub(super) fn sums(&self, phase: usize) -> Range {
        self.constants(phase).times(2)
    }

    /// Bits of an accumulator that no sum can leave.
    pub(super) fn needed_bits(&self) -> u32 {
        (0..self.tap_bits.ratio).map(|p| self.sums(p).bits()).max().unwrap_or(1)
    }

    /// The products of the sample `a` with its taps, unless all have 0 bits.
    pub(super) fn product(
        &mut self,
        netlist: &mut Netlist,
        a: &Word,
        name: &str,
        tap_bits: &[i64],
        taps: &[i64],
    ) -> Option<ShiftedWord> {
        let bits = tap_bits.iter().copied().max().filter(|bits| *bits > 0)?;
        let word = self.word(netlist, name, Range::of_bits(bits as u32), taps);
        Some(netlist.product_of(a, &word).into())
    }

    /// The constant of the offsets in the sum of a phase, at the first clock of a frame.
    pub(super) fn constant(&mut self, netlist: &mut Netlist, phase: usize, constant: i64) -> Word {
        let range = netlist.held(self.constants(phase));
        self.word(netlist, &format!("c{phase}"), range, &[constant])
    }

    /// The sample of a channel where there is no signal.
    pub(super) fn resting(
        &mut self,
        netlist: &mut Netlist,
        channel: usize,
        bits: u32,
        resting: i64,
    ) -> String {
        let words = vec![resting; 1 << self.index_bits];
        let memory = self.memory(netlist, &format!("x{}", channel + 1), bits, 0, words);
        format!("{memory}[active]")
    }

    /// A register that takes the word of each clock.
    fn word(&mut self, netlist: &mut Netlist, name: &str, range: Range, words: &[i64]) -> Word {
        let mut words = words.to_vec();
        words.resize(1 << self.index_bits, 0);
        let memory = self.memory(netlist, name, range.bits(), self.index_bits, words);
        let step = if self.index_bits == 0 { "" } else { ", step" };
        netlist.register(name, range.bits(), &format!("{memory}[{{active{step}}}]"));
        Word::at(1, name.to_owned(), range)
    }

    fn memory(
        &mut self,
        netlist: &mut Netlist,
        name: &str,
        bits: u32,
        index_bits: u32,
        words: Vec<i64>,
    ) -> String {
        let (name, length) = (format!("{name}_words"), 2 << index_bits);
        let _ = writeln!(netlist.text, "    reg signed [{}:0] {name} [0:{}];", bits - 1, length - 1);
        self.bits += length * bits as usize;
        self.words.extend(words);
        self.memories.push(Memory { name: name.clone(), bits, index_bits });
        name
    }

    pub(super) fn data_bits(&self) -> u32 {
        self.memories.iter().map(|memory| memory.bits).max().unwrap_or(1)
    }

    fn address_bits(&self) -> u32 {
        (self.words.len() - 1).ilog2() + 1
    }

    /// Ports of the module.
    pub(super) fn ports(&self) -> Vec<String> {
        let (address, data) = (self.address_bits() - 1, self.data_bits() - 1);
        vec![
            "input wire load_write".to_owned(),
            format!("input wire [{address}:0] load_address"),
            format!("input wire [{data}:0] load_data"),
            "input wire commit".to_owned(),
        ]
    }

    /// Writes what puts a word into its memory, and what exchanges the banks.
    pub(super) fn write(&self, netlist: &mut Netlist) {
        let (top, low) = (self.address_bits() - 1, self.index_bits);
        let mut cases = String::new();
        for (number, Memory { name, bits, index_bits }) in self.memories.iter().enumerate() {
            let index = match index_bits {
                0 => String::new(),
                bits => format!(", load_address[{}:0]", bits - 1),
            };
            let label = format!("{}'d{number}", top + 1 - low);
            let _ = writeln!(
                cases,
                "            {label}: {name}[{{~active{index}}}] <= load_data[{}:0];",
                bits - 1
            );
        }
        netlist.registers += 1;
        let _ = write!(
            netlist.text,
            "    // Which words run; the others are written.\n    reg active;\n    initial active = 1'b0;\n    \
             always @(posedge clk) begin\n        if (commit & in_ready) active <= ~active;\n        \
             if (load_write)\n            case (load_address[{top}:{low}])\n{cases}            \
             default: ;\n            endcase\n    end\n"
        );
    }

    /// The words of the bank, one a line, hexadecimal, as `$readmemh` reads them.
    pub(super) fn text(&self) -> String {
        let bits = self.data_bits();
        let (mask, digits) = (u64::MAX >> (64 - bits), bits.div_ceil(4) as usize);
        self.words.iter().map(|word| format!("{:0digits$x}\n", *word as u64 & mask)).collect()
    }

    pub(super) fn word_count(&self) -> usize {
        self.words.len()
    }
}
