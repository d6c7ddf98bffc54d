//! Exported Verilog in the hands of Icarus Verilog, Verilator and Yosys, as far as they are there.

use crate::support::{Desk, number, text};
use hybank::bank::{Bank, FixedPoint, SynthesisFilters};
use hybank::runtime::Nonlinearity;
use hybank::spec::WordLengths;
use serde_json::Value;
use std::process::Command;

/// Runs a tool on the desk: whether it succeeded, with all that it said. `None` if it is not there, which
/// goes to the list of skipped tests.
fn tool(desk: &Desk, line: &[&str]) -> Option<(bool, String)> {
    match Command::new(line[0]).args(&line[1..]).current_dir(desk.path("")).output() {
        Ok(output) => Some((output.status.success(), text(&output.stdout) + &text(&output.stderr))),
        Err(_) => {
            trials::skipped(&format_args!("exported Verilog: no {}", line[0]));
            None
        }
    }
}

/// What the testbench prints in Icarus Verilog.
fn simulated(desk: &Desk) -> Option<String> {
    let (is_good, said) = tool(desk, &["iverilog", "-g2001", "-Wall", "-o", "test", "core.v", "core_tb.v"])?;
    assert!(is_good && !said.contains("warning"), "{said}");
    tool(desk, &["vvp", "test"]).map(|(_, said)| said)
}

fn bank_of_integers(integers: Vec<Vec<i64>>, bits: u32, fraction_bits: i32, ratio: usize) -> Bank {
    let words = FixedPoint { bits: WordLengths::Same(bits), fraction_bits, integers };
    let mut bank = Bank::bare(SynthesisFilters::Fir(words.taps()), ratio);
    bank.fixed_point = Some(words);
    bank
}

/// Writes a bank with offsets.
fn write_bank(desk: &Desk, integers: Vec<Vec<i64>>, bits: u32, fraction_bits: i32, ratio: usize) {
    let mut bank = bank_of_integers(integers, bits, fraction_bits, ratio);
    bank.offsets.iter_mut().enumerate().for_each(|(i, offset)| *offset = 0.03 * i as f64 - 0.05);
    desk.write("b.json", bank.to_json().unwrap());
}

/// The report of an export with a testbench beside it.
fn exported(desk: &Desk, more: &[&str]) -> Value {
    let plain = ["export", "b.json", "-o", "core.v", "--testbench", "."];
    desk.report(&[&plain[..], more].concat())
}

/// A bank of integers, and the options of a circuit.
struct Shape {
    integers: Vec<Vec<i64>>,
    fraction_bits: i32,
    ratio: usize,
    flags: &'static str,
}

impl Shape {
    /// A desk with the bank, its module and the testbench, and the report of the export.
    fn exported(&self) -> (Desk, Value) {
        let desk = Desk::empty();
        write_bank(&desk, self.integers.clone(), 8, self.fraction_bits, self.ratio);
        let flags: Vec<&str> = self.flags.split_whitespace().collect();
        let report = exported(&desk, &[&["--input-bits", "8"], &flags[..]].concat());
        (desk, report)
    }
}

/// Those before are one of each kind.
const KINDS: usize = 5;

/// With zeros, powers of two, equal taps and phases without taps.
fn shapes() -> Vec<Shape> {
    let wild = |n: usize, taps: usize| -> Vec<Vec<i64>> {
        let tap = |i: usize, k: usize| ((k * 37 + 101 * i) % 255) as i64 - 127;
        (0..n).map(|i| (0..taps).map(|k| tap(i, k)).collect()).collect()
    };
    let small = vec![vec![5, -3, 0, 8, -16, 5], vec![-128, 0, 0, 127, 1, -1]];
    let equal: Vec<Vec<i64>> = [[5, 7], [5, 7], [-10, 14]].map(|pair| pair.repeat(3)).to_vec();
    let shape = |integers: Vec<Vec<i64>>, fraction_bits, ratio, flags| Shape {
        integers,
        fraction_bits,
        ratio,
        flags,
    };
    vec![
        shape(small.clone(), 6, 2, ""),
        shape(small.clone(), 0, 2, "--pipeline 3 --output-bits 12"),
        shape(small.clone(), 6, 3, "--clocks-per-frame 2"),
        shape(small.clone(), 5, 2, "--accumulator 12 --clocks-per-frame 3 --output-bits 5"),
        // Equal channels, and taps that are the same at each clock.
        shape(equal.clone(), 4, 2, "--clocks-per-frame 3"),
        shape(equal, 4, 2, ""),
        shape(small.clone(), -3, 3, "--output-bits 17"),
        shape(small.clone(), 6, 2, "--accumulator 12"),
        shape(small.clone(), 30, 2, ""),
        shape(small.clone(), 6, 2, "--frames-per-clock 2"),
        shape(small.clone(), 6, 3, "--frames-per-clock 4 --pipeline 2 --accumulator 12"),
        shape(small.clone(), 6, 2, "--loadable"),
        shape(small.clone(), 6, 3, "--loadable --frames-per-clock 2"),
        shape(small.clone(), -1, 2, "--loadable --clocks-per-frame 3 --output-bits 12"),
        shape(small.clone(), 5, 2, "--loadable --clocks-per-frame 4 --accumulator 12 --pipeline 2"),
        shape(small, 6, 2, "--pipeline 2"),
        shape(wild(3, 7), 7, 2, ""),
        shape(wild(5, 4), 7, 4, "--clocks-per-frame 8"),
        shape(wild(1, 9), 4, 1, ""),
        shape(wild(1, 9), 4, 1, "--frames-per-clock 3"),
        shape(wild(1, 9), 4, 1, "--loadable --clocks-per-frame 100"),
        shape(wild(2, 6), 4, 2, "--clocks-per-frame 100"),
        shape(vec![vec![0, 0], vec![0, 0]], 4, 2, ""),
        shape(vec![vec![1, 0], vec![0, 0]], 0, 2, "--clocks-per-frame 2"),
        shape(vec![vec![-1, 0], vec![0, 0]], 0, 2, "--clocks-per-frame 2"),
        shape(vec![vec![1], vec![0]], 0, 2, "--output-bits 5"),
        shape(vec![vec![-1], vec![-1]], 0, 1, ""),
        shape(wild(2, 6), 1, 2, "--output-bits 2 --accumulator 2"),
        shape(wild(2, 6), 4, 2, "--output-bits 2 --accumulator 9 --clocks-per-frame 2"),
    ]
}

#[test]
fn verilog_has_the_bits_of_the_model() {
    for shape in shapes() {
        let flags = shape.flags;
        let (desk, report) = shape.exported();
        let Some(said) = simulated(&desk) else { return };
        assert!(said.contains("PASS") && !said.contains("FAIL"), "{flags} {report}: {said}");
    }
}

#[test]
fn verilog_is_clean_for_linters() {
    for shape in shapes() {
        let flags = shape.flags;
        let (desk, _) = shape.exported();
        let Some((is_good, said)) = tool(&desk, &["verilator", "--lint-only", "-Wall", "core.v"]) else {
            return;
        };
        assert!(is_good && said.is_empty(), "{flags}: {said}");
        let of_bench = "verilator --lint-only --timing -Wno-lint --top-module core_tb core.v core_tb.v";
        let line: Vec<&str> = of_bench.split_whitespace().collect();
        let Some((is_good, said)) = tool(&desk, &line) else { return };
        assert!(is_good, "{flags}: {said}");
    }
}

/// Cells of Yosys whose kind begins with one of these words: their number and their bits.
fn cells(statistics: &str, kinds: &[&str]) -> (f64, f64) {
    let cell = |line: &str| {
        let (name, count) = line.trim().split_once(' ')?;
        let (kind, bits) = name.strip_prefix('$')?.rsplit_once('_')?;
        let is_wanted = kinds.iter().any(|wanted| kind.contains(wanted));
        let (bits, count): (f64, f64) = (bits.parse().ok()?, count.trim().parse().ok()?);
        is_wanted.then_some((count, bits * count))
    };
    statistics.lines().filter_map(cell).fold((0.0, 0.0), |sum, cell| (sum.0 + cell.0, sum.1 + cell.1))
}

/// Flip-flops that are left after synthesis.
fn flip_flops(statistics: &str) -> f64 {
    let cell = |line: &str| {
        let (name, count) = line.trim().split_once(' ')?;
        (name.starts_with("$_") && name.contains("DFF")).then(|| count.trim().parse::<f64>().ok())?
    };
    statistics.lines().filter_map(cell).sum()
}

#[test]
fn synthesis_has_no_latch_and_the_cells_of_the_report() {
    let is_all = trials::is_slow("the synthesis of all shapes of circuits");
    for shape in shapes().into_iter().take(if is_all { usize::MAX } else { KINDS }) {
        let flags = shape.flags;
        if shape.fraction_bits == 30 || shape.integers.concat().iter().all(|tap| tap.abs() < 2) {
            continue;
        }
        let (desk, report) = shape.exported();
        let script = "read_verilog core.v; proc; opt_clean; tee -q -o cells.txt stat -width; synth -noabc; tee -q -o gates.txt stat; \
                      check -assert; select -assert-none t:$_DLATCH* t:$dlatch t:$_SR*";
        let Some((is_good, said)) = tool(&desk, &["yosys", "-q", "-p", script]) else { return };
        assert!(is_good, "{flags}: {said}");
        let cells = |kinds: &[&str]| cells(&text(&desk.read("cells.txt")), kinds);
        let close = |found: f64, key: &str| {
            let stated = number(&report, key);
            assert!((found - stated).abs() <= 0.2 * stated, "{flags}: {found} {key}, {report}");
        };
        close(cells(&["mul"]).0, "/multipliers");
        close(cells(&["add", "sub", "neg"]).0, "/adders");
        close(cells(&["dff"]).1, "/registers");
        // A narrow accumulator leaves the upper bits of the samples without use.
        if !flags.contains("accumulator") {
            // Yosys makes small memories of flip-flops.
            let loaded = if flags.contains("loadable") { number(&report, "/rom_bits") } else { 0.0 };
            close(flip_flops(&text(&desk.read("gates.txt"))) - loaded, "/registers");
        }
    }
}

/// Each wrong circuit is found by the testbench of the right one.
#[test]
fn mutations_are_caught() {
    let desk = Desk::empty();
    write_bank(&desk, vec![vec![5, -3, 0, 8, -16, 5], vec![-127, 0, 0, 127, 3, -1]], 8, 6, 2);
    for flags in [&["--input-bits", "8"][..], &["--input-bits", "8", "--clocks-per-frame", "3"]] {
        exported(&desk, flags);
        let core = text(&desk.read("core.v"));
        let (parallel, folded) = (flags.len() == 2, flags.len() > 2);
        let narrower = |register: &str| {
            let line = core.lines().find(|line| line.ends_with(&format!(" {register};"))).unwrap();
            let (begin, rest) = line.split_once('[').unwrap();
            let (top, end) = rest.split_once(':').unwrap();
            core.replace(line, &format!("{begin}[{}:{end}", top.parse::<u32>().unwrap() - 1))
        };
        let mut wrong = vec![narrower(if parallel { "z0_0" } else { "z0" })];
        if parallel {
            wrong.push(core.replacen(" - ", " + ", 1));
            let (before, after) = core.split_once("x1_times_5 <= ").unwrap();
            wrong.push(format!("{before}x1_times_5 <= -{after}"));
            // A word that skips its register, and a frame that is too early.
            let delayed = core.find("_d <= ").map(|end| core[..end].rsplit(' ').next().unwrap()).unwrap();
            wrong.push(
                core.replace(&format!("{delayed}_d[7]"), &format!("{delayed}[7]"))
                    .replace(&format!("{delayed}_d}}"), &format!("{delayed}}}")),
            );
            wrong.push(core.replacen("if (valid[1])", "if (valid[0])", 1));
        }
        if folded {
            wrong.push(core.replacen("8'sd5;", "-8'sd5;", 1));
            wrong.push(core.replacen(" ? -", " ? ", 1));
            wrong.push(core.replacen("(first[2]", "(first[1]", 1));
        }
        for (number, text) in wrong.iter().enumerate() {
            desk.write("core.v", text);
            let Some(said) = simulated(&desk) else { return };
            assert!(*text != core && said.contains("FAIL"), "{flags:?}, mutation {number}: {said}");
        }
    }
}

/// The frames of a clock have the outputs that they have one by one.
#[test]
fn frames_of_one_clock_have_the_outputs_of_frames_by_themselves() {
    let desk = Desk::empty();
    write_bank(&desk, vec![vec![5, -3, 0, 8, -16, 5], vec![-127, 0, 0, 127, 3, -1]], 8, 6, 2);
    let run = |frames: &str| {
        let report = exported(&desk, &["--input-bits", "8", "--frames-per-clock", frames]);
        let list = |name: &str| -> Vec<String> {
            text(&desk.read(name)).split_whitespace().map(str::to_owned).collect()
        };
        (report, list("input.txt"), list("expected.txt"))
    };
    let (one, input, expected) = run("1");
    let (three, inputs, outputs) = run("3");
    assert!(inputs.starts_with(&input) && inputs.len() - input.len() < 6);
    assert!(outputs.starts_with(&expected));
    assert_eq!(number(&three, "/frames_per_clock"), 3.0);
    assert_eq!(number(&three, "/multipliers"), 3.0 * number(&one, "/multipliers"));
    for (flags, words) in [
        (&["--frames-per-clock", "2", "--clocks-per-frame", "2"][..], "one of them must be 1"),
        (&["--frames-per-clock", "65"], "64 at most"),
    ] {
        let line = [&["export", "b.json", "-o", "no.v", "--input-bits", "8"], flags].concat();
        desk.refused(1, &line, &[words]);
    }
}

/// One module serves all banks of its size, and `mem` holds what its port takes.
#[test]
fn a_loadable_module_depends_on_no_tap() {
    let desk = Desk::empty();
    let flags = ["--input-bits", "8", "--loadable", "--clocks-per-frame", "3"];
    let mut modules = Vec::new();
    for taps in [vec![vec![0; 4], vec![1, 2, 3, 4]], vec![vec![5, -3, 0, 8], vec![-127, 0, 0, 127]]] {
        write_bank(&desk, taps, 8, 6, 2);
        exported(&desk, &flags);
        modules.push(text(&desk.read("core.v")).split_once("module core").unwrap().1.to_owned());
        desk.good(&[&["export", "b.json", "-o", "words.mem", "--force"], &flags[..]].concat());
        assert_eq!(desk.read("words.mem"), desk.read("load.mem"));
    }
    assert_eq!(modules[0], modules[1]);
    let core = text(&desk.read("core.v"));
    for (right, wrong) in [
        ("commit & in_ready", "commit"),
        ("c0_words[{~active", "c0_words[{active"),
        ("q1_0_words[{~active", "q0_0_words[{~active"),
        ("<= x2_words[", "<= x1_words["),
        ("active <= ~active", "active <= active"),
    ] {
        let text = core.replacen(right, wrong, 1);
        desk.write("core.v", &text);
        let Some(said) = simulated(&desk) else { return };
        assert!(text != core && said.contains("FAIL"), "{right}: {said}");
    }
}

/// A channel with a nonlinearity, one with none: the bits of the model for all codes, in a clean module,
/// with a wrong word of a table found.
#[test]
fn tables_take_out_nonlinearities() {
    let desk = Desk::empty();
    let mut bank = bank_of_integers(vec![vec![5, -3, 0, 8, -16, 5], vec![-127, 0, 0, 127, 3, -1]], 8, 6, 2);
    let codes = (0..256).map(|code| 0.004 * f64::from(code % 16) - 0.03).collect();
    let curves = [Nonlinearity::Polynomial(vec![0.01, -0.004]), Nonlinearity::Table { table: codes }];
    bank.offsets = vec![0.03, -0.02];
    for (flags, curve) in
        [&[][..], &["--clocks-per-frame", "3"], &["--frames-per-clock", "2"], &["--accumulator", "16"]]
            .into_iter()
            .zip(curves.iter().cycle())
    {
        bank.nonlinearity = vec![curve.clone(), Nonlinearity::default()];
        desk.write("b.json", bank.to_json().unwrap());
        let report = exported(&desk, &[&["--input-bits", "8"], flags].concat());
        let core = text(&desk.read("core.v"));
        if let Some((is_good, said)) = tool(&desk, &["verilator", "--lint-only", "-Wall", "core.v"]) {
            assert!(is_good && said.is_empty(), "{flags:?}: {said}");
        }
        let Some(said) = simulated(&desk) else { return };
        assert!(said.contains("PASS") && !said.contains("FAIL"), "{flags:?} {report}: {said}");
        assert!(number(&report, "/rom_bits") >= 256.0 * 11.0, "{report}");
        let word = core.lines().find(|line| line.contains("straight1[77] = ")).unwrap();
        desk.write("core.v", core.replace(word, "straight1[77] = 12'sd0;"));
        assert!(simulated(&desk).unwrap().contains("FAIL"), "{flags:?}");
    }
    let script = "read_verilog core.v; proc; opt; memory_collect; select -assert-count 1 t:$mem*; memory -nomap; check -assert";
    exported(&desk, &["--input-bits", "8"]);
    if let Some((is_good, said)) = tool(&desk, &["yosys", "-q", "-p", script]) {
        assert!(is_good, "{said}");
    }
    for (flags, words) in [
        (&["--input-bits", "8", "--loadable"][..], "Verilog with constant taps"),
        (&["--input-bits", "15"], "14 bits are the most"),
    ] {
        desk.refused(1, &[&["export", "b.json", "-o", "no.v"], flags].concat(), &[words]);
    }
}

#[test]
fn bits_that_hold_all_sums_are_the_least() {
    for (tap, bits) in [(1, 8), (-1, 9), (2, 9), (-2, 10), (3, 10)] {
        let desk = Desk::empty();
        let bank = bank_of_integers(vec![vec![tap]], 8, 0, 1);
        desk.write("b.json", bank.to_json().unwrap());
        let report = exported(&desk, &["--input-bits", "8"]);
        assert_eq!(number(&report, "/needed_accumulator_bits"), f64::from(bits), "tap {tap}");
        assert!(!text(&desk.read("core.v")).contains("wrap"), "tap {tap}");
    }
}

/// Yosys proves a small circuit equal to the definition, for every input, pause and state before the reset:
/// sums, rounding, saturation and the valid flag.
fn prove_a_small_circuit(flags: &str) {
    let beyond = if trials::is_slow("proofs of a circuit over six clocks") { 6 } else { 4 };
    let desk = Desk::empty();
    let bank = bank_of_integers(vec![vec![3, -2, 1], vec![-5, 7, 0]], 4, 1, 2);
    desk.write("b.json", bank.to_json().unwrap());
    let words: Vec<&str> = flags.split_whitespace().collect();
    let report = exported(&desk, &[&["--input-bits", "2"][..], &words].concat());
    let latency = number(&report, "/latency_clocks") as usize;
    let ready = if flags.contains("clocks") { "wire ready; " } else { "wire ready = 1'b1; " };
    let port = if flags.contains("clocks") { ", .in_ready(ready)" } else { "" };
    desk.write(
        "top.v",
        format!(
            "module top (input clk, input rst, input in_valid, input signed [1:0] x1, input signed [1:0] x2, output ok);\n\
             wire out_valid; wire signed [1:0] y0, y1; {ready}\n\
             core core (.clk(clk), .rst(rst), .in_valid(in_valid), .x1(x1), .x2(x2), .out_valid(out_valid), .y0(y0), .y1(y1){port});\n\
             wire take = in_valid & ready;\n\
             reg signed [1:0] a, a1, b;\n\
             reg [{top}:0] valid; reg signed [1:0] w0 [1:{before}], w1 [1:{before}];\n\
             wire signed [9:0] s0 = 3 * a + a1 - 5 * b; wire signed [9:0] s1 = 7 * b - 2 * a;\n\
             wire signed [9:0] r0 = (s0 + 1) >>> 1; wire signed [9:0] r1 = (s1 + 1) >>> 1;\n\
             integer k;\n\
             always @(posedge clk) begin\n\
             if (rst) begin a <= 0; a1 <= 0; b <= 0; valid <= 0; end\n\
             else begin valid <= {{valid, take}}; if (take) begin a <= x1; a1 <= a; b <= x2; end end\n\
             w0[1] <= r0 > 1 ? 1 : r0 < -2 ? -2 : r0; w1[1] <= r1 > 1 ? 1 : r1 < -2 ? -2 : r1;\n\
             for (k = 2; k <= {before}; k = k + 1) begin w0[k] <= w0[k - 1]; w1[k] <= w1[k - 1]; end\n\
             end\n\
             assign ok = out_valid == valid[{top}] & (~out_valid | y0 == w0[{before}] & y1 == w1[{before}]);\n\
             endmodule\n",
            top = latency - 1,
            before = latency - 1,
        ),
    );
    // Two whole frames, one after the other, at least.
    let steps = (latency + beyond).to_string();
    let script = format!(
        "read_verilog core.v top.v; hierarchy -top top; proc; flatten; memory; opt; \
         sat -verify -set-at 1 rst 1 -prove ok 1 -seq {steps} -prove-skip 1 top"
    );
    let Some((is_good, said)) = tool(&desk, &["yosys", "-q", "-p", &script]) else { return };
    assert!(is_good, "{flags}: {said}");
}

#[test]
fn a_small_parallel_circuit_is_proven() {
    prove_a_small_circuit("");
}

#[test]
fn a_small_folded_circuit_is_proven() {
    prove_a_small_circuit("--clocks-per-frame 2");
}
