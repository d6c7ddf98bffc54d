//! Each example is a whole small program that ends well. `cargo test` builds them beside the tests.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The folder of the compiled examples, beside that of the tests.
fn built() -> PathBuf {
    let program = std::env::current_exe().unwrap();
    program.parent().and_then(Path::parent).unwrap().join("examples")
}

#[test]
fn every_example_runs() {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples");
    let folder = built();
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
        assert!(output.stdout.iter().filter(|&&byte| byte == b'\n').count() > 1, "{name}: {output:?}");
    }
}

/// One converter shows a tone at a wrong frequency, two in turn show three images, and fused there are none.
#[test]
fn the_picture_of_the_readme_has_false_lines_until_it_is_fused() {
    let output = Command::new(built().join("spectra")).output().unwrap();
    let picture = String::from_utf8(output.stdout).unwrap();
    let panels: Vec<&str> = picture.split("<g ").skip(1).collect();
    let seen: Vec<bool> = panels.iter().map(|panel| panel.contains("class=\"false\"")).collect();
    assert_eq!(seen, [true, true, false]);
}

/// All ten figures and the table, with the numbers that are known of the thesis's FIR example.
#[test]
fn the_thesis_is_drawn_again() {
    let folder = tempfile::tempdir().unwrap();
    let program = built().join("thesis");
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
    let shown = String::from_utf8(output.stdout).unwrap();
    let row = shown.lines().find(|line| line.starts_with("hybank, FIR")).unwrap();
    let errors: Vec<f64> = row.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    assert!(errors[1] < 0.9e-3 && errors[3] < 1.9e-3, "{row}");
}
