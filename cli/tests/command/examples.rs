//! The scripts of `examples/` run as a user starts them.

use crate::support::{repository, text};
use std::path::Path;
use std::process::Command;

/// Runs the script of a folder of examples in a folder of its own; gives what it printed.
#[cfg(unix)]
fn run_script(example: &str, folder: &Path) -> String {
    let script = repository(&format!("examples/{example}/run.sh"));
    let binary = Path::new(env!("CARGO_BIN_EXE_hybank")).parent().unwrap();
    let path = std::env::join_paths([binary, Path::new("/usr/bin"), Path::new("/bin")]).unwrap();
    let output = Command::new("sh").arg(script).arg(folder).env("PATH", path).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    text(&output.stdout)
}

/// The loop of capture, calibration, bank and fused recording, as a user starts it; a small one is in
/// `band.rs`.
#[test]
#[cfg(unix)]
fn the_calibration_loop_runs() {
    if !trials::is_slow("examples/calibrate: its captures and banks") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let shown = run_script("calibrate", folder.path());
    assert!(shown.contains("held out   the captures agree"), "{shown}");
    for name in ["measured.toml", "measured.json", "measured.wav"] {
        assert!(folder.path().join(name).is_file(), "{name}");
    }
    // Measured again: interleaving spurs of the bank for the drawing, and of the bank for the converters.
    let spurs: Vec<f64> =
        shown.lines().filter_map(|line| line.strip_prefix("interleaving")).map(decibels).collect();
    assert!(spurs.len() == 2 && spurs[0] > -45.0 && spurs[1] < -75.0, "{spurs:?}");
}

/// The first number of a line of figures.
#[cfg(unix)]
fn decibels(line: &str) -> f64 {
    line.split_whitespace().next().unwrap().parse().unwrap()
}

/// Two sensors of 100 Hz and 60 Hz become one of 300 Hz.
#[test]
#[cfg(unix)]
fn two_inertial_sensors_become_one() {
    let folder = tempfile::tempdir().unwrap();
    let shown = run_script("inertial", folder.path());
    // The line of `design` comes first, that of `measure` last: 66.1 dB, where 64.5 were promised for white
    // noise, and a cubic spline has 19.1.
    let snr = shown.lines().filter_map(|line| line.strip_prefix("SNR  ")).map(decibels).next_back();
    assert!(snr.is_some_and(|snr| snr > 60.0), "{shown}");
}

/// Two recordings that began apart, with clocks of their own, become one: better than one of them alone at
/// best (15.8 dB) and than one resampled (25 to 27 dB).
#[test]
#[cfg(unix)]
fn two_recorders_become_one() {
    let folder = tempfile::tempdir().unwrap();
    let shown = run_script("recorders", folder.path());
    let drift: f64 = {
        let row = shown.lines().find(|line| line.starts_with("  2 ")).unwrap();
        row.split('±').nth(1).unwrap().split_whitespace().nth(1).unwrap().parse().unwrap()
    };
    assert!((drift - 1.5).abs() < 0.1, "{shown}");
    let ratios: Vec<f64> =
        shown.lines().filter_map(|line| line.strip_prefix("SNR  ")).map(decibels).collect();
    // The line of `design`, and a signal with as much in the upper band as the model has.
    assert!(matches!(ratios[..], [promised, fused] if fused > promised), "{shown}");
}

/// The circuit of the example gives the integers of the model, and its spurs are theirs.
#[test]
#[cfg(unix)]
fn the_circuit_of_the_fpga_example_has_the_bits_of_the_model() {
    // The tests of the export simulate smaller banks in any case.
    if !trials::is_slow("examples/fpga") {
        return;
    }
    if Command::new("iverilog").arg("-V").output().is_err() {
        trials::skipped(&"examples/fpga: no iverilog");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let shown = run_script("fpga", folder.path());
    assert!(shown.matches("PASS").count() == 4 && !shown.contains("FAIL"), "{shown}");
    let levels: Vec<f64> = shown
        .lines()
        .filter(|line| line.ends_with("tone over the largest spur"))
        .filter_map(|line| line.strip_prefix("SFDR  ")?.split_whitespace().next()?.parse().ok())
        .collect();
    assert!(levels.len() == 5 && levels[0] > 95.0 && levels[1] > 80.0, "{shown}");
    // The file of numbers begins with the same samples.
    assert!((levels[1] - levels[2]).abs() < 0.01, "{shown}");
    // What was loaded follows the drift.
    assert!(levels[4] > levels[3] + 15.0, "{shown}");
}
