//! Each example is a whole small program that ends well. `cargo test` builds them beside the tests.

use crate::support::text;
use std::fs;
use std::path::Path;
use std::process::Command;

#[test]
fn every_example_runs() {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples");
    let folder = Path::new(env!("CARGO_BIN_EXE_hybank")).with_file_name("examples");
    let names: Vec<String> = fs::read_dir(sources)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "rs"))
        .map(|path| path.file_stem().unwrap().to_string_lossy().into_owned())
        .collect();
    assert!(names.len() >= 2, "{names:?}");
    for name in names {
        let program = folder.join(&name);
        assert!(program.is_file(), "{name} is not built; `cargo build --examples` builds it");
        let output = Command::new(program).output().unwrap();
        assert!(output.status.success() && output.stderr.is_empty(), "{name}: {output:?}");
        assert!(text(&output.stdout).lines().count() > 1, "{name}: {output:?}");
    }
}

/// All ten figures and the table, with the numbers that are known of the thesis's FIR example.
#[test]
fn the_thesis_is_drawn_again() {
    let folder = tempfile::tempdir().unwrap();
    let program = Path::new(env!("CARGO_BIN_EXE_hybank")).with_file_name("examples").join("thesis");
    let output = Command::new(program).arg(folder.path()).output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
    let page = fs::read_to_string(folder.path().join("index.html")).unwrap();
    for number in 8..=17 {
        assert!(page.contains(&format!("<h2>Figure 5.{number}: ")), "{number}");
    }
    let pictures = fs::read_dir(folder.path()).unwrap().count() - 1;
    assert_eq!((pictures, page.matches("<svg").count()), (12, 12));
    assert!(page.contains("4.68 %") && page.contains("gamma 3.9932 % with 22 taps"), "{page}");
    // RMSE on the step and on the cosines: an independent design has 0.000822 and 0.00177, and the optimum
    // is not unique.
    let shown = text(&output.stdout);
    let row = shown.lines().find(|line| line.starts_with("hybank, FIR")).unwrap();
    let errors: Vec<f64> = row.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    assert!(errors[1] < 0.9e-3 && errors[3] < 1.9e-3, "{row}");
}

/// Runs the script of a folder of examples in a folder of its own; gives what it printed.
#[cfg(unix)]
fn run_script(example: &str, folder: &Path) -> String {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples").join(example).join("run.sh");
    let binary = Path::new(env!("CARGO_BIN_EXE_hybank")).parent().unwrap();
    let path = std::env::join_paths([binary, Path::new("/usr/bin"), Path::new("/bin")]).unwrap();
    let output = Command::new("sh").arg(script).arg(folder).env("PATH", path).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    text(&output.stdout)
}

/// The loop of capture, calibration, bank and fused recording, as a user starts it.
#[test]
#[cfg(unix)]
fn the_calibration_loop_runs() {
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
    let snr = shown.lines().find_map(|line| line.strip_prefix("SNR")).map(decibels);
    assert!(snr.is_some_and(|snr| snr > 50.0), "{shown}");
}

/// Two recordings with clocks of their own become one; the last line is that of the log.
#[test]
#[cfg(unix)]
fn two_recorders_become_one() {
    let folder = tempfile::tempdir().unwrap();
    let shown = run_script("recorders", folder.path());
    let last: serde_json::Value = serde_json::from_str(shown.lines().last().unwrap()).unwrap();
    assert_eq!(last["lock"][1], "locked", "{shown}");
    assert!((last["rate_ppm"][1].as_f64().unwrap() - 1.5).abs() < 0.3, "{last}");
}
