//! The formats against the bank's own coefficients.

use super::*;
use crate::bank::{FixedPoint, SynthesisFilters};
use crate::spec::WordLengths;

/// Two channels, M = 2, three taps each: the phases have two lags and one.
fn fir() -> Bank {
    Bank::bare(SynthesisFilters::Fir(vec![vec![0.5, -0.25, 1.0], vec![0.0, 2.0, -1.5]]), 2)
}

pub(super) fn integers(bits: u32, list: Vec<Vec<i64>>) -> Bank {
    let words = FixedPoint { bits: WordLengths::Same(bits), fraction_bits: 2, integers: list };
    let mut bank = Bank::bare(SynthesisFilters::Fir(words.taps()), 2);
    bank.fixed_point = Some(words);
    bank
}

fn text(bank: &Bank, format: Format) -> String {
    String::from_utf8(export(bank, format, "bank", None).unwrap()).unwrap()
}

#[test]
fn taps_are_ordered_by_channel_phase_and_lag() {
    let csv = text(&fir(), Format::Csv);
    let want = "channel,phase,lag,value\n1,0,0,5e-1\n1,0,1,1e0\n1,1,0,-2.5e-1\n1,1,1,0e0\n\
                2,0,0,0e0\n2,0,1,-1.5e0\n2,1,0,2e0\n2,1,1,0e0\n";
    assert_eq!(csv, want);
}

#[test]
fn integers_are_written_as_words_of_their_bits() {
    let bank = integers(6, vec![vec![2, -1, 31], vec![0, -32, 5]]);
    assert!(text(&bank, Format::Coe).ends_with("radix=10;\ncoefdata=\n2,\n31,\n-1,\n0,\n0,\n5,\n-32,\n0;\n"));
    let mem = text(&bank, Format::Mem);
    let words: Vec<&str> = mem.lines().filter(|line| !line.starts_with("//")).collect();
    assert_eq!(words, ["02", "1f", "3f", "00", "00", "05", "20", "00"]);
    assert!(text(&bank, Format::Csv).contains("2,1,0,-8e0,-32\n"));
    assert!(mem.contains("integers of 6 bits times 2^-2, 5 not zero"), "{mem}");
}

#[test]
fn a_matlab_file_holds_the_same_numbers() {
    let bank = fir();
    let mat = export(&bank, Format::Mat, "bank", None).unwrap();
    // Type, rows, columns, no imaginary part, length of the name; then the first column.
    let header: Vec<u32> = mat[..20].chunks(4).map(|b| u32::from_le_bytes(b.try_into().unwrap())).collect();
    assert_eq!(header, [0, 2, 4, 0, 5]);
    assert_eq!(&mat[20..25], b"taps\0");
    assert_eq!(&mat[25..41], [0.5_f64.to_le_bytes(), 0.0_f64.to_le_bytes()].concat());
}

#[test]
fn what_a_format_cannot_hold_is_refused() {
    for format in [Format::Coe, Format::Mem] {
        assert!(matches!(export(&fir(), format, "b", None), Err(ExportError::NoIntegers { .. })));
    }
    for name in ["", "1a", "a-b", "a b", "_", "é"] {
        assert!(matches!(export(&fir(), Format::C99, name, None), Err(ExportError::Name { .. })), "{name}");
    }
    let mut bank = integers(6, vec![vec![1], vec![1]]);
    bank.offsets[1] = 0.5;
    for format in [Format::C99, Format::Coe, Format::Mem] {
        let refused = export(&bank, format, "b", None);
        assert!(matches!(refused, Err(ExportError::Offset { channel: 2, .. })), "{format:?}");
        assert!(export(&bank, format, "b", Some(12)).is_ok(), "{format:?}");
        let wide = export(&bank, format, "b", Some(33));
        assert!(matches!(wide, Err(ExportError::Words { bits: 33, .. })), "{format:?}");
    }
    for format in [Format::Csv, Format::Mat] {
        let refused = export(&bank, format, "b", Some(12));
        assert!(matches!(refused, Err(ExportError::NoWords)), "{format:?}");
    }
    let large = integers(32, vec![vec![1 << 30], vec![-(1 << 30)]]);
    let refused = export(&large, Format::C99, "b", None);
    assert!(matches!(refused, Err(ExportError::Accumulator { sum, sample_bits: 32 }) if sum == 1 << 31));
    // The constants of offsets are part of the sums.
    let mut large = integers(31, vec![vec![1 << 29], vec![1 << 29]]);
    assert!(export(&large, Format::C99, "b", Some(32)).is_ok());
    large.offsets = vec![1.0, 1.0];
    assert!(matches!(export(&large, Format::C99, "b", Some(32)), Err(ExportError::Accumulator { .. })));
}

#[test]
fn circuits_that_cannot_be_are_refused() {
    let bank = integers(4, vec![vec![3, -2], vec![-5, 7]]);
    let circuit = |bank: &Bank, name: &str, input_bits, accumulator_bits| {
        let options = VerilogOptions { input_bits, accumulator_bits, ..VerilogOptions::default() };
        Verilog::new(bank, name, &options)
    };
    assert!(matches!(circuit(&fir(), "b", Some(8), None), Err(ExportError::NoIntegers { .. })));
    assert!(matches!(circuit(&bank, "b", None, None), Err(ExportError::NoInputBits)));
    let named = |name: &str| circuit(&bank, name, Some(8), None);
    for name in ["wire", "1a", "a b"] {
        assert!(matches!(named(name), Err(ExportError::Name { .. })), "{name}");
    }
    for name in ["x1", "clk", "sum1"] {
        assert!(matches!(named(name), Err(ExportError::NameOfSignal { .. })), "{name}");
    }
    let narrow = circuit(&bank, "b", Some(8), Some(2));
    assert!(matches!(narrow, Err(ExportError::NothingLeft { accumulator: 2, fraction_bits: 2, .. })));
    let many = circuit(&bank, "b", Some(8), None).unwrap().testbench(MOST_RANDOM_FRAMES + 1);
    assert!(matches!(many, Err(ExportError::Frames { .. })));
}

/// 2 * 0.5 + 31 * 0.5 .. at full scale 2^4, and 0.5 of full scale is 8 steps.
#[test]
fn offsets_are_constants_of_the_sums_or_comments() {
    let mut bank = integers(6, vec![vec![2, -1, 31], vec![0, -32, 5]]);
    bank.offsets = vec![0.5, -0.28125];
    let of_phases = [33.0 * 8.0 - 5.0 * 4.5, -8.0 + 32.0 * 4.5].map(f64::round);
    assert_eq!(of_phases, [242.0, 136.0]);
    let lines = "offsets, for samples of 5 bits: subtract from the sums of the phases 242 136\n";
    for (format, comment) in [(Format::Coe, "; "), (Format::Mem, "// ")] {
        let text = String::from_utf8(export(&bank, format, "b", Some(5)).unwrap()).unwrap();
        let rest = format!("{comment}and begin with samples of the channels that are 8 -5\n");
        assert!(text.contains(&format!("{comment}{lines}{rest}")), "{text}");
    }
    let c = String::from_utf8(export(&bank, Format::C99, "b", Some(5)).unwrap()).unwrap();
    assert!(c.contains("b_constants[2] = {\n    INT64_C(242), INT64_C(136)\n}"), "{c}");
    assert!(c.contains("b_resting[2] = {\n    8, -5\n}"), "{c}");
    let comments = "# subtract 5e-1 of full scale from the samples of channel 1\n\
                    # subtract -2.8125e-1 of full scale from the samples of channel 2\nchannel,phase";
    let csv = text(&bank, Format::Csv);
    assert!(csv.starts_with(comments), "{csv}");
    assert_eq!(taps_of_csv(csv.as_bytes()).unwrap().len(), 2);
}

fn csv(text: &str) -> Result<Vec<Vec<f64>>, TapsError> {
    taps_of_csv(text.as_bytes())
}

#[test]
fn taps_are_read_by_column_or_as_they_were_exported() {
    let want = vec![vec![0.5, -0.25, 1.0], vec![0.0, 2.0, -1.5]];
    assert_eq!(csv("0.5,0\n-0.25,2\n1,-1.5\n"), Ok(want.clone()));
    assert_eq!(csv("left, right\n0.5 ,0e0\n-.25,+2\n1,-1.5"), Ok(want.clone()));
    // The export has whole slow periods.
    let padded: Vec<Vec<f64>> = want.iter().map(|list| [&list[..], &[0.0]].concat()).collect();
    assert_eq!(csv(&text(&fir(), Format::Csv)), Ok(padded));
}

#[test]
fn damaged_tables_are_refused_with_their_line() {
    let no_number = |line, column, text: &str| TapsError::NoNumber { line, column, text: text.to_owned() };
    assert_eq!(csv("1,2\n3,x\n"), Err(no_number(2, 2, "x")));
    assert_eq!(csv("a,b\n1,2\n3,nan\n"), Err(no_number(3, 2, "nan")));
    assert_eq!(csv("1,1e999\n"), Err(no_number(1, 2, "1e999")));
    for empty in ["", "\n\n", "a,b\n"] {
        assert_eq!(csv(empty), Err(TapsError::Empty), "{empty:?}");
    }
    assert!(matches!(csv("1,2\n3\n"), Err(TapsError::Broken(_))));
    let export = text(&fir(), Format::Csv);
    for damaged in [export.replace("1,1,0,", "1,1,5,"), export.replace("2,1,1,0e0\n", "")] {
        assert!(matches!(csv(&damaged), Err(TapsError::Broken(_))), "{damaged}");
    }
}

/// An array of doubles as NumPy writes it.
fn npy(shape: &str, fortran_order: &str, values: &[f64]) -> Vec<u8> {
    let header = format!("{{'descr': '<f8', 'fortran_order': {fortran_order}, 'shape': {shape}, }}\n");
    let length = u16::try_from(header.len()).unwrap().to_le_bytes();
    let values: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    [&b"\x93NUMPY\x01\x00"[..], &length, header.as_bytes(), &values].concat()
}

#[test]
fn arrays_are_read_in_both_orders() {
    let want = vec![vec![1.0, 2.0, 3.0], vec![4.0, 5.0, 6.0]];
    assert_eq!(taps_of_npy(&npy("(2, 3)", "False", &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0])), Ok(want.clone()));
    assert_eq!(taps_of_npy(&npy("(2, 3)", "True", &[1.0, 4.0, 2.0, 5.0, 3.0, 6.0])), Ok(want));
    let phases = npy("(1, 2, 2)", "False", &[1.0, 3.0, 2.0, 4.0]);
    assert_eq!(taps_of_npy(&phases), Ok(vec![vec![1.0, 2.0, 3.0, 4.0]]));
    assert!(matches!(taps_of_npy(&npy("(3,)", "False", &[1.0; 3])), Err(TapsError::Shape { .. })));
    assert_eq!(taps_of_npy(&npy("(2, 0)", "False", &[])), Err(TapsError::Empty));
    assert!(matches!(taps_of_npy(b"RIFF"), Err(TapsError::Broken(_))));
    for sizes in ["4294967296, 4294967296, 4294967296", "99999999999999999999, 1", "9223372036854775807, 1"] {
        let huge = npy(&format!("({sizes})"), "False", &[0.0; 8]);
        assert!(matches!(taps_of_npy(&huge), Err(TapsError::Broken(_))), "{sizes}");
    }
    let cut = npy("(2, 3)", "False", &[1.0; 6]);
    assert!(matches!(taps_of_npy(&cut[..cut.len() - 3]), Err(TapsError::Broken(_))));
}

#[test]
fn words_out_of_range_are_refused_and_not_clamped() {
    let bank = integers(4, vec![vec![1, 2, 3], vec![-4, 5, -6]]);
    for (input, accumulator, output, part) in [
        (16, 65, 16, "65 bits for the accumulator; give 2 to 64"),
        (16, 1, 16, "1 bits for the accumulator"),
        (16, 32, 33, "33 bits for the outputs; give 2 to 32"),
        (16, 32, 0, "0 bits for the outputs"),
        (33, 32, 16, "33 bits for the samples; give 2 to 32"),
    ] {
        let error = BitTrue::new(&bank, WordSizes { input, accumulator, output }).unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
    }
    assert!(BitTrue::new(&bank, WordSizes { input: 2, accumulator: 64, output: 2 }).is_ok());
}
