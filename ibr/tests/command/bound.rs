//! The predicted error on the command line.

use super::*;
use hybank_ibr::image::read_image;

#[test]
fn an_error_is_predicted_mapped_and_compared() {
    let dir = rig();
    let arguments = ["bound", "scene.toml", "--map", "map.png", "--truth", "middle.png", "--json"];
    let figures = json(&run(dir.path(), &arguments));
    let number = |path: &str| figures.pointer(path).and_then(serde_json::Value::as_f64).unwrap();
    let (bound, expected, estimate) =
        (number("/totals/local_bound"), number("/totals/expected"), number("/totals/estimate"));
    assert!(estimate > 0.0 && estimate <= expected && number("/measured/mae") < bound, "{figures}");
    let parts: f64 = (0..5).map(|k| number(&format!("/causes/{k}/error"))).sum();
    assert!((parts / estimate - 1.0).abs() < 1e-4, "{figures}");
    assert!((number("/measured/ratio") - estimate / number("/measured/mae")).abs() < 1e-9);
    assert_eq!((number("/calibrated_on"), figures["rows"].as_array().unwrap().len()), (2.0, SIZE.1));
    assert_eq!(read_image(&dir.path().join("map.png")).unwrap().size(), SIZE);
    let again = run(dir.path(), &arguments);
    assert!(code(&again) == 1 && stderr(&again).contains("--force"), "{}", stderr(&again));
}

/// Coarse depth has larger errors, and the prediction knows; a view alone takes typical weights.
#[test]
fn worse_inputs_are_predicted_to_be_worse() {
    let dir = rig();
    let estimate = |more: &[&str]| {
        let arguments = [&["bound", "scene.toml", "--json"], more].concat();
        json(&run(dir.path(), &arguments))["totals"]["estimate"].as_f64().unwrap()
    };
    let (fine, coarse) = (estimate(&[]), estimate(&["--depth-step", "8"]));
    assert!(coarse > 1.1 * fine, "{fine} {coarse}");
    let text = run(dir.path(), &["bound", "scene.toml", "--view", "left"]);
    let text = String::from_utf8(text.stdout).unwrap();
    assert!(text.contains("typical photographs") && text.contains("causes    density"), "{text}");
}

#[test]
fn what_cannot_be_predicted_is_refused() {
    let dir = rig();
    let scene = "matches = \"t.txt\"\n[[view]]\nname = \"a\"\nimage = \"left.png\"\n[[view]]\nname = \"b\"\nimage = \"right.png\"\n[virtual]\nbetween = 0.5\n";
    std::fs::write(dir.path().join("free.toml"), scene).unwrap();
    let lines: String = (0..20).map(|i| format!("{} {} {} {}\n", 5 * i, 4 * i, 5 * i + 1, 4 * i)).collect();
    std::fs::write(dir.path().join("t.txt"), lines).unwrap();
    let refused = run(dir.path(), &["bound", "free.toml"]);
    assert!(
        code(&refused) == 1 && stderr(&refused).contains("the cameras of this scene are unknown"),
        "{}",
        stderr(&refused)
    );
    let usage = run(dir.path(), &["bound", "scene.toml", "--map", "-"]);
    assert_eq!(code(&usage), 2);
    let over = run(dir.path(), &["bound", "scene.toml", "--map", "left.png", "--force"]);
    assert!(code(&over) == 1 && dir.path().join("left.png").is_file(), "{}", stderr(&over));
}
