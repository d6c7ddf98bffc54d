//! A C99 header with the coefficients of a bank and a streaming function.

use super::ExportError;
use super::bit_true::IntegerFilters;
use super::layout::{PolyphaseTaps, sparse_rows};
use crate::bank::{Bank, FixedPoint, StateMatrices, SynthesisFilters};

/// Numbers per line of a table.
const PER_LINE: usize = 4;

/// The header. `name` is the prefix of its identifiers.
pub(super) fn header(bank: &Bank, name: &str, input_bits: Option<u32>) -> Result<String, ExportError> {
    if !is_identifier(name) {
        return Err(ExportError::Name { name: name.to_owned(), language: "C" });
    }
    let body = match (&bank.filters, &bank.fixed_point) {
        (SynthesisFilters::Fir(_), Some(words)) => integer_fir(bank, words, name, input_bits)?,
        (SynthesisFilters::Fir(taps), None) => real_fir(bank, &PolyphaseTaps::new(taps, bank.ratio), name),
        (SynthesisFilters::StateSpace(block), _) => recursive(bank, block, name),
    };
    let guard = format!("{}_H", name.to_ascii_uppercase());
    Ok(format!("{}#ifndef {guard}\n#define {guard}\n\n{body}\n#endif\n", about(bank, name)))
}

/// Whether C and Verilog take this name, unless it is one of their words.
pub(super) fn is_identifier(name: &str) -> bool {
    let is_legal = |c: char| c.is_ascii_alphanumeric() || c == '_';
    name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.chars().all(is_legal)
}

/// The name of the spec as a part of a comment.
pub(super) fn title(bank: &Bank) -> String {
    let named = bank.spec.as_ref().map(|spec| spec.name.replace("*/", "* /")).filter(|name| !name.is_empty());
    let title = named.unwrap_or_else(|| "A filter bank.".to_owned());
    title.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// The gammas of the coefficients as words of a comment.
pub(super) fn gammas(bank: &Bank) -> String {
    let bound = |value: Option<f64>| value.map_or_else(|| "unknown".to_owned(), |value| format!("{value:e}"));
    format!(
        "gamma of these coefficients in exact arithmetic: {}, upper bound {}, lower bound {}",
        bound(bank.gamma.norm),
        bound(bank.gamma.upper),
        bound(bank.gamma.lower)
    )
}

/// What the header is, as a comment.
fn about(bank: &Bank, name: &str) -> String {
    format!(
        "/* {}\n   Written by hybank. C99, no allocation, no library.\n\n   \
         {name}_reset clears a state. {name}_process takes the samples of one slow period, {},\n   \
         and writes the {} output samples of that period. Its latency is {} (output samples).\n   \
         {}.\n   \
         Sums are taken in the order written; -ffp-contract=off gives the same bits with every compiler. */\n",
        title(bank),
        samples_of(bank),
        bank.ratio,
        bank.latency,
        gammas(bank),
    )
}

/// The input of one call in words.
pub(super) fn samples_of(bank: &Bank) -> String {
    let counts: Vec<String> = bank.samples.iter().map(usize::to_string).collect();
    match (bank.layout().is_plain(), bank.channel_count()) {
        (true, 1) => "one of the channel".to_owned(),
        (true, channels) => format!("one of each of the {channels} channels"),
        (false, 1) => format!("{} in a row of the channel", counts.join("")),
        (false, channels) => format!("{} in a row of the {channels} channels", counts.join(" and ")),
    }
}

fn table<T>(values: &[T], write: impl Fn(&T) -> String) -> String {
    let lines: Vec<String> =
        values.chunks(PER_LINE).map(|line| line.iter().map(&write).collect::<Vec<_>>().join(", ")).collect();
    format!("{{\n    {}\n}}", lines.join(",\n    "))
}

fn double(value: &f64) -> String {
    format!("{value:e}")
}

fn real_fir(bank: &Bank, taps: &PolyphaseTaps<f64>, name: &str) -> String {
    fir(&FirHeader {
        name,
        sizes: [taps.channels, taps.ratio, taps.lags],
        comment: format!("{} taps, {} not zero", taps.values.len(), taps.nonzero()),
        include: "#include <string.h>",
        number: "double",
        sample: "double",
        tap: "double",
        taps: table(&taps.values, double),
        constants: format!(
            "static const double {name}_offsets[{}] = {};\n\n",
            taps.channels,
            table(&bank.layout().each(&bank.offsets), double)
        ),
        reset: String::new(),
        sample_of: format!("input[i] - {name}_offsets[i]"),
        start: "0".to_owned(),
        helper: String::new(),
        finish: "sum".to_owned(),
    })
}

fn integer_fir(
    bank: &Bank,
    words: &FixedPoint,
    name: &str,
    input_bits: Option<u32>,
) -> Result<String, ExportError> {
    let filters = IntegerFilters::new(bank, words, input_bits)?;
    // Whatever it is given, no sum of the code overflows.
    filters.check_sums(32)?;
    let taps = &filters.taps;
    let of_offsets = |text: String| if filters.has_offsets() { text } else { String::new() };
    let reset = format!(
        "    for (int j = 0; j < {}; j++)\n        \
         for (int i = 0; i < {}; i++) state->history[j][i] = {name}_resting[i];\n",
        taps.lags, taps.channels
    );
    let sums = match input_bits {
        Some(bits) => format!("Sums of {bits}-bit samples need {} bits", filters.needed_bits(bits)),
        None => format!("Sums of B-bit samples need B + {} bits", filters.needed_bits(32).saturating_sub(32)),
    };
    let constants = format!(
        "/* What the offsets add to the sums of the phases, and samples without a signal. */\n\
         static const int64_t {name}_constants[{}] = {};\n\
         static const int32_t {name}_resting[{}] = {};\n\n",
        taps.ratio,
        table(&filters.constants, constant),
        taps.channels,
        table(&filters.resting, ToString::to_string)
    );
    Ok(fir(&FirHeader {
        name,
        sizes: [taps.channels, taps.ratio, taps.lags],
        comment: format!(
            "{} integer taps times 2^{}, {} not zero. {sums}; 64 are used.\n   \
             Each sum is rounded to the nearest integer, halves upwards, and saturates at 32 bits",
            taps.values.len(),
            -words.fraction_bits,
            taps.nonzero()
        ),
        include: "#include <stdint.h>\n#include <string.h>",
        number: "int64_t",
        sample: "int32_t",
        tap: "int32_t",
        taps: table(&taps.values, ToString::to_string),
        constants: of_offsets(constants),
        reset: of_offsets(reset),
        sample_of: "input[i]".to_owned(),
        start: if filters.has_offsets() { format!("-{name}_constants[p]") } else { "0".to_owned() },
        helper: rounding(name, words.fraction_bits),
        finish: format!("{name}_rounded(sum)"),
    }))
}

/// A number of 64 bits.
fn constant(value: &i64) -> String {
    format!("INT64_C({value})")
}

/// The function that turns a sum into an output sample.
fn rounding(name: &str, fraction_bits: i32) -> String {
    let scaled = match fraction_bits {
        bits if bits > 62 => "0".to_owned(),
        bits if bits > 0 => {
            let half = 1_i64 << (bits - 1);
            // A shift of a negative number is not portable; the complement of one is never negative there.
            format!("sum >= -INT64_C({half}) ? (sum + {half}) >> {bits} : ~(~(sum + {half}) >> {bits})")
        }
        bits if bits >= -31 => {
            let factor = 1_i64 << -bits;
            let limit = i64::from(i32::MAX) / factor + 1;
            format!("sum > {limit} ? INT32_MAX : sum < -{limit} ? INT32_MIN : sum * {factor}")
        }
        _ => "sum > 0 ? INT32_MAX : sum < 0 ? INT32_MIN : 0".to_owned(),
    };
    format!(
        "static int32_t {name}_rounded(int64_t sum) {{\n    int64_t y = {scaled};\n    \
         return (int32_t)(y > INT32_MAX ? INT32_MAX : y < INT32_MIN ? INT32_MIN : y);\n}}\n\n"
    )
}

/// The parts of a header for FIR filters.
struct FirHeader<'a> {
    name: &'a str,
    /// N, M and the lags.
    sizes: [usize; 3],
    comment: String,
    include: &'a str,
    /// Type of the sums.
    number: &'a str,
    /// Type of the samples.
    sample: &'a str,
    tap: &'a str,
    taps: String,
    /// Tables for the offsets.
    constants: String,
    /// What the history is before the first frame, if not zero.
    reset: String,
    /// What the history keeps of a sample.
    sample_of: String,
    /// The value from which a sum starts.
    start: String,
    helper: String,
    /// The output sample of a sum.
    finish: String,
}

fn fir(parts: &FirHeader<'_>) -> String {
    let FirHeader { name, sizes: [n, m, lags], comment, include, number, sample, tap, taps, .. } = parts;
    let FirHeader { constants, reset, sample_of, start, helper, finish, .. } = parts;
    format!(
        "{include}\n\n\
         /* {comment}.\n   taps[channel][phase][lag]: tap phase + lag * {m} of the channel's filter. */\n\
         static const {tap} {name}_taps[{count}] = {taps};\n\n{constants}\
         typedef struct {{\n    {sample} history[{lags}][{n}]; /* a ring of slow periods */\n    int newest;\n}} {name}_state;\n\n\
         static inline void {name}_reset({name}_state *state) {{\n    memset(state, 0, sizeof *state);\n{reset}}}\n\n{helper}\
         static inline void {name}_process({name}_state *state, const {sample} input[{n}], {sample} output[{m}]) {{\n    \
         state->newest = state->newest == 0 ? {last} : state->newest - 1;\n    \
         for (int i = 0; i < {n}; i++) state->history[state->newest][i] = {sample_of};\n    \
         for (int p = 0; p < {m}; p++) {{\n        {number} sum = {start};\n        \
         for (int j = 0; j < {lags}; j++) {{\n            \
         int k = state->newest + j;\n            if (k >= {lags}) k -= {lags};\n            \
         for (int i = 0; i < {n}; i++)\n                \
         sum += ({number}){name}_taps[(i * {m} + p) * {lags} + j] * state->history[k][i];\n        }}\n        \
         output[p] = {finish};\n    }}\n}}\n",
        count = n * m * lags,
        last = lags - 1,
    )
}

fn recursive(bank: &Bank, block: &StateMatrices, name: &str) -> String {
    let (rows, states) = (sparse_rows(block), block.a.len());
    let (inputs, outputs) = (bank.frame_samples(), bank.ratio);
    let starts: Vec<usize> = std::iter::once(0)
        .chain(rows.iter().scan(0, |end, row| {
            *end += row.len();
            Some(*end)
        }))
        .collect();
    let (columns, values): (Vec<usize>, Vec<f64>) = rows.iter().flatten().copied().unzip();
    // C has no arrays of length zero.
    let (columns, values) = if values.is_empty() { (vec![0], vec![0.0]) } else { (columns, values) };
    format!(
        "#include <string.h>\n\n\
         /* x+ = a x + b u, y = c x + d u with {states} states; the {count} coefficients of the rows of [a b; c d] that are\n   \
         not zero, with their columns of [x; u]. */\n\
         static const double {name}_values[{length}] = {values};\n\
         static const int {name}_columns[{length}] = {columns};\n\
         static const int {name}_starts[{boundaries}] = {starts};\n\
         static const double {name}_offsets[{inputs}] = {offsets};\n\n\
         typedef struct {{\n    double x[{width}];\n}} {name}_state;\n\n\
         static inline void {name}_reset({name}_state *state) {{\n    memset(state, 0, sizeof *state);\n}}\n\n\
         static double {name}_row(const double *z, int row) {{\n    double sum = 0;\n    \
         for (int k = {name}_starts[row]; k < {name}_starts[row + 1]; k++) sum += {name}_values[k] * z[{name}_columns[k]];\n    \
         return sum;\n}}\n\n\
         static inline void {name}_process({name}_state *state, const double input[{inputs}], double output[{outputs}]) {{\n    \
         double z[{all}];\n    \
         for (int i = 0; i < {states}; i++) z[i] = state->x[i];\n    \
         for (int i = 0; i < {inputs}; i++) z[{states} + i] = input[i] - {name}_offsets[i];\n    \
         for (int p = 0; p < {outputs}; p++) output[p] = {name}_row(z, {states} + p);\n    \
         for (int i = 0; i < {states}; i++) state->x[i] = {name}_row(z, i);\n}}\n",
        count = rows.iter().map(Vec::len).sum::<usize>(),
        length = columns.len(),
        values = table(&values, double),
        columns = table(&columns, ToString::to_string),
        boundaries = starts.len(),
        starts = table(&starts, ToString::to_string),
        offsets = table(&bank.layout().each(&bank.offsets), double),
        width = states.max(1),
        all = states + inputs,
    )
}
