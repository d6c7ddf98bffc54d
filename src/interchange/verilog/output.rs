//! From a sum to an output sample: rounded to the nearest integer, halves upwards, and saturated.

use super::netlist::{Netlist, Word, constant, wrapped};
use crate::interchange::bit_true::Range;

/// How sums become outputs.
#[derive(Debug, Clone, Copy)]
pub(super) struct OutputRounding {
    /// Of the outputs.
    pub(super) bits: u32,
    /// Bits that are rounded away; if negative, zeros that are appended.
    fraction_bits: i32,
}

impl OutputRounding {
    /// Sums have 64 bits at most, and outputs 32: beyond these limits nothing changes.
    pub(super) fn new(bits: u32, fraction_bits: i32) -> Self {
        Self { bits, fraction_bits: fraction_bits.clamp(-62, 72) }
    }

    /// What is added before the bits are cut off.
    pub(super) fn half(self) -> i128 {
        if self.fraction_bits > 0 { 1 << (self.fraction_bits - 1) } else { 0 }
    }

    /// Registers y<phase> with the output of `sum` plus `added`.
    pub(super) fn write(self, netlist: &mut Netlist, phase: usize, sum: &Word, added: i128) {
        let cut = self.fraction_bits.max(0) as u32;
        let shift = self.fraction_bits.min(0).unsigned_abs();
        let exact = sum.range.plus(added.into()).times(1 << shift);
        let bits = exact.bits().max(cut + 1);
        let name = format!("rounded{phase}");
        let mut value = netlist.sized(sum, shift, bits);
        if added != 0 {
            netlist.adders += 1;
            value += &format!(" + {}", constant(added << shift, bits));
        }
        netlist.declare_wire(&name, bits, &value);
        if cut > 0 {
            netlist.leave(format!("{name}[{}:0]", cut - 1));
        }
        let whole = Range { least: exact.least >> cut, most: exact.most >> cut };
        let value = match whole.bits() > self.bits {
            true => self.saturated(&name, bits, cut),
            false => self.extended(netlist, &name, bits, cut),
        };
        netlist.registers += self.bits as usize;
        netlist.clock(&format!("y{phase}"), &value);
    }

    /// The bits of the output, unless those above differ from its sign.
    fn saturated(self, name: &str, bits: u32, cut: u32) -> String {
        let (top, sign) = (bits - 1, cut + self.bits - 1);
        format!(
            "&{name}[{top}:{sign}] | ~|{name}[{top}:{sign}] ? {name}[{sign}:{cut}] : \
             {{{name}[{top}], {{{}{{~{name}[{top}]}}}}}}",
            self.bits - 1
        )
    }

    fn extended(self, netlist: &mut Netlist, name: &str, bits: u32, cut: u32) -> String {
        let (top, own) = (bits - 1, bits - cut);
        match self.bits.checked_sub(own) {
            None => {
                netlist.leave(format!("{name}[{top}:{}]", cut + self.bits));
                format!("{name}[{}:{cut}]", cut + self.bits - 1)
            }
            Some(0) => format!("{name}[{top}:{cut}]"),
            Some(fill) => format!("{{{{{fill}{{{name}[{top}]}}}}, {name}[{top}:{cut}]}}"),
        }
    }
}

/// The sum as the accumulator holds it, if `added` could take it out of its range.
pub(super) fn held_sum(netlist: &mut Netlist, phase: usize, sum: Word, added: i128) -> Word {
    let range = netlist.held(sum.range.plus(added.into()));
    if added == 0 {
        return sum;
    }
    let name = format!("held{phase}");
    let bits = range.bits();
    let value = format!("{} + {}", netlist.sized(&sum, 0, bits), wrapped(added, bits));
    netlist.adders += 1;
    netlist.declare_wire(&name, bits, &value);
    Word { name, range, ..sum }
}
