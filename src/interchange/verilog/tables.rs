//! Samples without the nonlinearity of their converters: a ROM per converter.

use super::netlist::{Netlist, Word};
use crate::interchange::bit_true::Range;
use crate::interchange::straightening::{GUARD_BITS, Straightening};
use std::fmt::Write;

/// The samples of a clock as the filters take them.
pub(super) struct Samples {
    /// Expressions of so many bits.
    pub(super) texts: Vec<String>,
    pub(super) bits: u32,
    /// Whether the expressions read a ROM, which needs a register.
    is_read: bool,
}

impl Samples {
    /// Of ports `x1`, `x2` and so on of `code_bits`.
    pub(super) fn new(
        netlist: &mut Netlist,
        count: usize,
        code_bits: u32,
        tables: Option<&Straightening>,
    ) -> Self {
        let ports = (1..=count).map(|i| format!("x{i}"));
        let Some(tables) = tables else {
            return Self { texts: ports.collect(), bits: code_bits, is_read: false };
        };
        let bits = tables.word_bits;
        write_tables(netlist, tables);
        let converters = tables.converters.iter().cycle();
        let text = |(port, &converter): (String, &usize)| match tables.tables[converter] {
            // A part of a word is unsigned, so it is an address.
            Some(_) => format!("straight{}[{port}[{}:0]]", converter + 1, code_bits - 1),
            None => netlist.sized(&Word::at(0, port, Range::of_bits(code_bits)), GUARD_BITS, bits),
        };
        Self { texts: ports.zip(converters).map(text).collect(), bits, is_read: true }
    }

    /// The samples as words, which tables have a clock later.
    pub(super) fn words(&self, netlist: &mut Netlist) -> Vec<Word> {
        let range = Range::of_bits(self.bits);
        let word = |(text, i): (&String, usize)| {
            if !self.is_read {
                return Word::at(0, text.clone(), range);
            }
            let name = format!("s{i}");
            netlist.register(&name, self.bits, text);
            Word::at(1, name, range)
        };
        self.texts.iter().zip(1..).map(word).collect()
    }
}

/// A code in two's complement is the address of its word.
fn write_tables(netlist: &mut Netlist, tables: &Straightening) {
    let top = tables.word_bits - 1;
    for (table, i) in tables.tables.iter().zip(1..).filter_map(|(table, i)| Some((table.as_ref()?, i))) {
        let half = table.len() / 2;
        let mut words = String::new();
        for (address, word) in table[half..].iter().chain(&table[..half]).enumerate() {
            let word = super::netlist::constant((*word).into(), tables.word_bits);
            let _ = writeln!(words, "        straight{i}[{address}] = {word};");
        }
        let _ = write!(
            netlist.text,
            "    // Channel {i} without its nonlinearity.\n    reg signed [{top}:0] straight{i} [0:{}];\n    \
             initial begin\n{words}    end\n",
            table.len() - 1
        );
    }
}
