//! The binary as a user runs it, with exit code, standard output and standard error checked separately.

use crate::synthetic::{SyntheticScene, rig_camera, rig_disparity};
use hybank_ibr::camera::Camera;
use hybank_ibr::depth::DepthMap;
use hybank_ibr::image::{Image, pfm, save};
use std::path::Path;
use std::process::{Command, Output};

mod bound;
mod colmap;
#[cfg(unix)]
mod disturbed;
mod doors;
mod evaluate;
mod folders;
mod foreign;
mod inputs;
mod mistakes;
mod path;
mod readme;
mod refuse;
mod render;

const SIZE: (usize, usize) = (120, 90);

fn run(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_hybank-ibr")).args(arguments).current_dir(folder).output().unwrap()
}

fn code(output: &Output) -> i32 {
    output.status.code().unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// A run that ends with this exit code and one message with all the words.
fn refused(dir: &Path, arguments: &[&str], exit: i32, words: &[&str]) {
    let output = run(dir, arguments);
    let message = stderr(&output);
    assert_eq!(code(&output), exit, "{arguments:?}: {message}");
    assert!(words.iter().all(|word| message.contains(word)), "{arguments:?}: {message}");
    assert!(!message.contains("panicked") && output.stdout.is_empty(), "{arguments:?}: {message}");
}

fn good(dir: &Path, arguments: &[&str]) -> Output {
    let output = run(dir, arguments);
    assert_eq!(code(&output), 0, "{arguments:?}: {}", stderr(&output));
    output
}

fn json(output: &Output) -> serde_json::Value {
    assert_eq!(code(output), 0, "{}", stderr(output));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn write_map(map: &DepthMap, path: &Path) {
    let (width, height) = map.size();
    let data = map.data().to_vec();
    std::fs::write(path, pfm::encode(&Image::new(width, height, 1, data).unwrap())).unwrap();
}

/// A rectified rig of the synthetic scene: left.png, right.png, middle.png and their disparities.
fn rig() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    for (name, position) in [("left", 0.0), ("right", 1.0), ("middle", 0.5)] {
        let camera = Camera::metric(rig_camera(position, SIZE), false).unwrap();
        let (image, depth) = SyntheticScene::default().view(&camera, SIZE);
        save(&image, &dir.path().join(format!("{name}.png"))).unwrap();
        write_map(&rig_disparity(&depth, SIZE.0), &dir.path().join(format!("{name}.pfm")));
    }
    let view = |name: &str, position: f64| {
        format!(
            "[[view]]\nname = \"{name}\"\nimage = \"{name}.png\"\nposition = {position:?}\ndisparity = \"{name}.pfm\"\n"
        )
    };
    let scene = view("left", 0.0) + &view("right", 1.0) + "[virtual]\nposition = 0.5\n";
    std::fs::write(dir.path().join("scene.toml"), scene).unwrap();
    dir
}

/// Every pixel of the views is accounted for, and so is every pixel of the result.
fn assert_adds_up(figures: &serde_json::Value, pixels: u64) {
    let count = |v: &serde_json::Value| v.as_u64().unwrap();
    let (samples, holes) = (&figures["samples"], &figures["holes"]);
    let dropped: u64 = ["unknown", "behind", "outside"].iter().map(|k| count(&samples["dropped"][k])).sum();
    assert_eq!(samples["dropped"].as_object().unwrap().len(), 3, "{figures}");
    assert_eq!(count(&samples["propagated"]) + dropped, pixels, "{figures}");
    assert_eq!(
        count(&samples["propagated"]),
        count(&samples["occluded"]) + count(&samples["used"]),
        "{figures}"
    );
    let size = count(&figures["size"][0]) * count(&figures["size"][1]);
    let covered = 1.0 - (count(&holes["crack"]) + count(&holes["disocclusion"])) as f64 / size as f64;
    assert!((figures["coverage"].as_f64().unwrap() - covered).abs() < 1e-9, "{figures}");
}
