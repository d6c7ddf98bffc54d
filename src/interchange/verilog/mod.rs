//! A bank of integer taps as a module in Verilog-2001, with the bits of [`BitTrue`].
//!
//! Words are as wide as their exact ranges, which follow from the taps and the bits of the samples, or as
//! the accumulator where that is less. Adders of a tree have registers in between. Taps are constants, or
//! words that a host loads.

mod folded;
mod load;
mod netlist;
mod output;
mod parallel;
mod tables;
mod testbench;

use super::bit_true::{BitTrue, IntegerFilters, WordSizes};
use super::c99;
use super::error::{ExportError, check_straight};
use super::straightening::{GUARD_BITS, Straightening};
use crate::bank::{Bank, FixedPoint};
use crate::spec::WordLengths;
use folded::{Schedule, folded};
use load::LoadPort;
use netlist::Netlist;
use output::OutputRounding;
use parallel::parallel;
use std::num::NonZeroU32;
use tables::Samples;
pub use testbench::MOST_RANDOM_FRAMES;

/// The circuit that is wanted. The default takes a frame at every clock, and has a register after every
/// adder, an accumulator that never wraps, and outputs of the bits of the samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct VerilogOptions {
    /// Bits of the samples; `None` for those of the spec's widest converter.
    pub input_bits: Option<u32>,
    /// Bits of the outputs; `None` for those of the samples.
    pub output_bits: Option<u32>,
    /// Bits of the accumulator, in which sums wrap around; `None` for as many as no sum can leave.
    pub accumulator_bits: Option<u32>,
    /// Clocks between two frames. With more than one, each multiplier serves as many taps.
    pub clocks_per_frame: NonZeroU32,
    /// Frames that a clock takes. With more than one, `clocks_per_frame` must be 1.
    pub frames_per_clock: NonZeroU32,
    /// Levels of adders between two registers.
    pub pipeline: NonZeroU32,
    /// Whether taps and offsets are written through a port.
    pub is_loadable: bool,
}

impl Default for VerilogOptions {
    fn default() -> Self {
        let one = NonZeroU32::MIN;
        let (input_bits, output_bits, accumulator_bits) = (None, None, None);
        Self {
            input_bits,
            output_bits,
            accumulator_bits,
            clocks_per_frame: one,
            frames_per_clock: one,
            pipeline: one,
            is_loadable: false,
        }
    }
}

impl VerilogOptions {
    fn words(&self, bank: &Bank) -> Result<WordSizes, ExportError> {
        let channels = bank.spec.iter().flat_map(|spec| &spec.channels);
        let widest = channels.filter_map(|channel| channel.bits).max();
        let input = self.input_bits.or(widest).ok_or(ExportError::NoInputBits)?;
        let (accumulator, output) = (self.accumulator_bits.unwrap_or(64), self.output_bits.unwrap_or(input));
        Ok(WordSizes { input, accumulator, output })
    }

    fn check_clocks(&self) -> Result<(), ExportError> {
        let (frames, clocks) = (self.frames_per_clock.get(), self.clocks_per_frame.get());
        let most = MOST_FRAMES_PER_CLOCK;
        let is_circuit = frames == 1 || clocks == 1 && frames <= most;
        if is_circuit { Ok(()) } else { Err(ExportError::Clocks { frames, clocks, most }) }
    }
}

/// Frames of a clock, at most: each has ports of its own.
const MOST_FRAMES_PER_CLOCK: u32 = 64;

/// What a circuit takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct Circuit {
    /// Clocks from a frame to its outputs.
    pub latency_clocks: usize,
    /// Clocks between two frames at least.
    pub clocks_per_frame: usize,
    /// Frames that a clock takes.
    pub frames_per_clock: usize,
    /// Operators * of two words, or of a word and a constant that is no power of two.
    pub multipliers: usize,
    /// Operators + and -.
    pub adders: usize,
    /// Bits of all registers.
    pub registers: usize,
    /// Bits of the coefficients, where multipliers serve several taps or the coefficients are loaded, and of
    /// the tables of nonlinearities.
    pub rom_bits: usize,
    /// Words of a bank that are loaded; 0 where the circuit holds one bank for ever.
    pub load_words: usize,
    /// Bits of the port of these words.
    pub load_data_bits: u32,
    /// Bits with which no sum can wrap.
    pub needed_accumulator_bits: u32,
    /// Bits of the accumulator; fewer than needed wrap.
    pub accumulator_bits: u32,
}

/// A bank as a module in Verilog.
#[derive(Debug)]
pub struct Verilog {
    /// Name of the module.
    name: String,
    /// Whether the module says when it takes a frame.
    has_ready: bool,
    /// The module.
    pub text: String,
    /// What a port of coefficients takes, as `$readmemh` reads it: the words of this bank by their
    /// addresses.
    pub load: Option<String>,
    /// What it takes.
    pub circuit: Circuit,
    model: BitTrue,
    bank: Bank,
    options: VerilogOptions,
}

impl Verilog {
    /// The module `name` of a bank.
    ///
    /// # Errors
    /// [`ExportError`] for a name that is no identifier, for sizes that are out of range or that neither the
    /// options nor the spec say, and for a bank without integer taps.
    pub fn new(bank: &Bank, name: &str, options: &VerilogOptions) -> Result<Self, ExportError> {
        check_name(name)?;
        let integers = bank.fixed_point.as_ref().ok_or(ExportError::NoIntegers { format: "Verilog" })?;
        let words = options.words(bank)?;
        options.check_clocks()?;
        if options.is_loadable {
            check_straight(bank)?;
        }
        let model = BitTrue::new(bank, words)?;
        let (frames, clocks) =
            (options.frames_per_clock.get() as usize, options.clocks_per_frame.get() as usize);
        let filters = &model.filters.modulo(words.accumulator).of_blocks(frames);
        let mut netlist = Netlist::new(options.pipeline.get(), words.accumulator);
        let output = OutputRounding::new(words.output, model.fraction_bits);
        let loaded =
            options.is_loadable.then(|| LoadPort::new(integers, bank.ratio, frames, clocks, words.input));
        let (mut port, schedule) = match loaded.transpose()? {
            Some((port, schedule)) => (Some(port), Some(schedule)),
            None => (None, (clocks > 1).then(|| Schedule::new(&filters.taps, clocks))),
        };
        let needed = port.as_ref().map_or_else(|| model.needed_bits(), LoadPort::needed_bits);
        let tables = model.straightening.as_ref();
        tables.map_or(Ok(()), Straightening::check_circuit)?;
        let samples = Samples::new(&mut netlist, filters.taps.channels, words.input, tables);
        let (latency_clocks, rom_bits) = match &schedule {
            None => (parallel(&mut netlist, filters, &samples, output), 0),
            Some(schedule) => folded(&mut netlist, filters, schedule, port.as_mut(), &samples, output),
        };
        let circuit = Circuit {
            latency_clocks,
            clocks_per_frame: schedule.as_ref().map_or(1, |schedule| schedule.clocks),
            frames_per_clock: frames,
            multipliers: netlist.multipliers,
            adders: netlist.adders,
            registers: netlist.registers,
            rom_bits: rom_bits + tables.map_or(0, Straightening::bits),
            load_words: port.as_ref().map_or(0, LoadPort::word_count),
            load_data_bits: port.as_ref().map_or(0, LoadPort::data_bits),
            needed_accumulator_bits: needed,
            accumulator_bits: needed.min(words.accumulator),
        };
        let has_ready = schedule.is_some();
        let module = ports(filters, words, has_ready, port.as_ref()) + &netlist.body();
        let is_word = |word: &str| word == name;
        if module.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').any(is_word) {
            return Err(ExportError::NameOfSignal { name: name.to_owned() });
        }
        let layout = layout(bank, integers, words, options);
        let text = about(bank, &model, words, &circuit, &layout) + &format!("module {name} (\n") + &module;
        Ok(Self {
            name: name.to_owned(),
            has_ready,
            text: text + "endmodule\n",
            load: port.map(|port| format!("// {}\n// {layout}\n{}", c99::title(bank), port.text())),
            circuit,
            model,
            bank: bank.clone(),
            options: *options,
        })
    }

    /// A test of the module: names and texts of its files. Its frames are impulses, full-scale steps, those
    /// that make the largest and the least sum of each phase, and `random` random ones. It loads two banks
    /// into a loadable module: this one, and one with other taps and offsets between two frames.
    ///
    /// # Errors
    /// [`ExportError::Frames`] for more random frames than [`MOST_RANDOM_FRAMES`].
    pub fn testbench(&self, random: u32) -> Result<Vec<(String, String)>, ExportError> {
        testbench::files(self, random)
    }
}

/// Words that no module can have as its name.
const KEYWORDS: &str = "always and assign automatic begin buf bufif0 bufif1 case casex casez cell cmos config \
    deassign default defparam design disable edge else end endcase endconfig endfunction endgenerate endmodule \
    endprimitive endspecify endtable endtask event for force forever fork function generate genvar highz0 \
    highz1 if ifnone incdir include initial inout input instance integer join large liblist library localparam \
    macromodule medium module nand negedge nmos nor noshowcancelled not notif0 notif1 or output parameter pmos \
    posedge primitive pull0 pull1 pulldown pullup pulsestyle_ondetect pulsestyle_onevent rcmos real realtime \
    reg release repeat rnmos rpmos rtran rtranif0 rtranif1 scalared showcancelled signed small specify \
    specparam strong0 strong1 supply0 supply1 table task time tran tranif0 tranif1 tri tri0 tri1 triand trior \
    trireg unsigned use vectored wait wand weak0 weak1 while wire wor xnor xor";

fn check_name(name: &str) -> Result<(), ExportError> {
    let refused = ExportError::Name { name: name.to_owned(), language: "Verilog" };
    match c99::is_identifier(name) && !KEYWORDS.split_whitespace().any(|word| word == name) {
        true => Ok(()),
        false => Err(refused),
    }
}

fn about(bank: &Bank, model: &BitTrue, words: WordSizes, circuit: &Circuit, layout: &str) -> String {
    let Circuit { latency_clocks, clocks_per_frame, multipliers, adders, registers, rom_bits, .. } = circuit;
    let frames = circuit.frames_per_clock;
    let (samples, outputs) = (
        listed("sample", "x", 1..bank.frame_samples() * frames + 1),
        listed("output", "y", 0..bank.ratio * frames),
    );
    let taken = match frames {
        1 => "a frame".to_owned(),
        _ => format!("{frames} frames, one after the other"),
    };
    let load = match circuit.load_words {
        0 => String::new(),
        words => format!(
            "\n\n   load_write puts load_data at load_address of the words that do not run, 0 to {}.\n   \
             A clock with commit and in_ready exchanges them with those that run; a frame of this clock has the new\n   \
             ones. Before the next commit all words must be written again. rst keeps them, and begins with the\n   \
             samples at rest of those that run.\n   {layout}",
            words - 1
        ),
    };
    format!(
        "/* {}\n   Written by hybank. Verilog-2001, no primitives.\n\n   \
         A clock with in_valid takes {taken}: {samples} of {} bits, {}. {latency_clocks} clocks\n   \
         later out_valid is there with {outputs} of {} bits. Frames may come at every\n   \
         {}. rst clears all at a clock. The latency of the filters is {} (output samples).\n   {}.\n   \
         {}.{load}\n\n   \
         Before optimisation: multipliers {multipliers}, adders {adders}, bits of registers {registers}, of ROM {rom_bits} */\n",
        c99::title(bank),
        words.input,
        c99::samples_of(bank),
        words.output,
        match clocks_per_frame {
            1 => "clock".to_owned(),
            clocks => format!("{clocks} clocks, when in_ready is there"),
        },
        bank.latency,
        c99::gammas(bank),
        arithmetic(bank, model, words, circuit.needed_accumulator_bits),
    )
}

/// What two banks must have in common to be loaded into one module.
fn layout(bank: &Bank, taps: &FixedPoint, words: WordSizes, options: &VerilogOptions) -> String {
    let bits = match &taps.bits {
        WordLengths::Same(bits) => bits.to_string(),
        WordLengths::PerTap(bits) => bits.iter().map(u32::to_string).collect::<Vec<_>>().join(" "),
    };
    format!(
        "Layout: {} samples and {} outputs a frame, {} taps of {bits} bits times 2^{}, samples of {} bits, \
         accumulator of {}, {} clocks per frame, {} frames per clock",
        bank.frame_samples(),
        bank.ratio,
        taps.integers.first().map_or(0, Vec::len),
        -taps.fraction_bits,
        words.input,
        words.accumulator,
        options.clocks_per_frame,
        options.frames_per_clock,
    )
}

/// "the samples x1, x2", or "the sample x1".
fn listed(noun: &str, letter: &str, numbers: std::ops::Range<usize>) -> String {
    let ending = if numbers.len() == 1 { "" } else { "s" };
    let names: Vec<String> = numbers.map(|i| format!("{letter}{i}")).collect();
    format!("the {noun}{ending} {}", names.join(", "))
}

/// What becomes of the samples, and where bits are lost.
fn arithmetic(bank: &Bank, model: &BitTrue, words: WordSizes, needed: u32) -> String {
    let offsets = if bank.offsets.iter().any(|offset| *offset != 0.0) {
        " The offsets of the channels are subtracted as constants."
    } else {
        ""
    };
    let (straight, guard_bits) = match &model.straightening {
        Some(_) => {
            (format!("Nonlinearities are taken out by tables, to 2^-{GUARD_BITS} of a step. "), GUARD_BITS)
        }
        None => (String::new(), 0),
    };
    let guard_bits = guard_bits as i32;
    let sums = match needed <= words.accumulator {
        true => format!(
            "No sum overflows: a width of {needed} holds all, and each word is as wide as its values need"
        ),
        false => format!(
            "The accumulator of {} bits wraps around; {needed} would hold all sums",
            words.accumulator
        ),
    };
    format!(
        "A tap is its integer times 2^{}, and a step of an output is one of a sample.{offsets}\n   \
         {straight}{sums}.\n   Each sum is rounded to the nearest step, halves upwards, and saturates",
        guard_bits - model.fraction_bits,
    )
}

/// The list of ports, and the end of the head of the module.
fn ports(filters: &IntegerFilters, words: WordSizes, has_ready: bool, load: Option<&LoadPort>) -> String {
    let mut ports = vec!["input wire clk".to_owned(), "input wire rst".into(), "input wire in_valid".into()];
    ports.extend(has_ready.then(|| "output wire in_ready".into()));
    ports.extend(load.map(LoadPort::ports).unwrap_or_default());
    let word = |kind: &str, bits: u32, name: String| format!("{kind} signed [{}:0] {name}", bits - 1);
    ports.extend((1..=filters.taps.channels).map(|i| word("input wire", words.input, format!("x{i}"))));
    ports.push("output wire out_valid".into());
    ports.extend((0..filters.taps.ratio).map(|p| word("output reg", words.output, format!("y{p}"))));
    format!("    {}\n);\n", ports.join(",\n    "))
}
