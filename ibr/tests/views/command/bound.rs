//! The predicted error on the command line.

use super::*;

#[test]
fn an_error_is_predicted_mapped_and_compared() {
    let dir = rig();
    let arguments = ["bound", "scene.toml", "--map", "map.pfm", "--truth", "middle.png", "--json"];
    let figures = json(&run(dir.path(), &arguments));
    let number = |path: &str| figures.pointer(path).and_then(serde_json::Value::as_f64).unwrap();
    let (expected, estimate) = (number("/totals/expected"), number("/totals/estimate"));
    assert!(estimate > 0.0 && estimate <= expected, "{figures}");
    let parts: f64 = (0..5).map(|k| number(&format!("/causes/{k}/error"))).sum();
    assert!((parts / estimate - 1.0).abs() < 1e-4, "{figures}");
    assert!((number("/measured/ratio") - estimate / number("/measured/mae")).abs() < 1e-9);
    assert_eq!((number("/calibrated_on"), figures["rows"].as_array().unwrap().len()), (2.0, SIZE.1));
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

/// A map holds the estimates in grey levels, whose mean is the total.
#[test]
fn a_float_map_holds_the_numbers() {
    let dir = rig();
    let figures = json(&run(dir.path(), &["bound", "scene.toml", "--map", "map.pfm", "--json"]));
    let map = pfm::decode(&std::fs::read(dir.path().join("map.pfm")).unwrap()).unwrap();
    assert_eq!((map.width(), map.height(), map.channels()), (SIZE.0, SIZE.1, 1));
    let pixels = (SIZE.0 * SIZE.1) as f64;
    let mean = map.data().iter().map(|v| f64::from(*v)).sum::<f64>() / pixels;
    assert!((mean / figures["totals"]["estimate"].as_f64().unwrap() - 1.0).abs() < 1e-4, "{figures}");
}

/// Every view of a path is predicted, with numbered files; a photograph fits one view only.
#[test]
fn the_views_of_a_path_are_predicted() {
    let dir = rig();
    let scene = std::fs::read_to_string(dir.path().join("scene.toml")).unwrap();
    let path = scene
        .replace("[virtual]\nposition = 0.5\n", "[virtual]\nposition = 0.5\nto_position = 1.5\nframes = 3\n");
    std::fs::write(dir.path().join("path.toml"), path).unwrap();
    let figures = json(&run(dir.path(), &["bound", "path.toml", "--map", "map.pfm", "--json"]));
    let frames = figures["frames"].as_array().unwrap();
    let estimate = |k: usize| frames[k]["totals"]["estimate"].as_f64().unwrap();
    assert!(frames.len() == 3 && estimate(2) > estimate(0) && estimate(0) > 0.0, "{figures}");
    let alone = json(&run(dir.path(), &["bound", "scene.toml", "--json"]));
    assert!((alone["totals"]["estimate"].as_f64().unwrap() / estimate(0) - 1.0).abs() < 1e-9);
    assert_eq!(figures["worst"].as_u64(), Some(2));
    assert!((1..=3).all(|k| dir.path().join(format!("map-000{k}.pfm")).is_file()));
    let text = run(dir.path(), &["bound", "path.toml"]);
    let text = String::from_utf8(text.stdout).unwrap();
    assert!(text.contains("view    1") && text.contains("The largest, view 3:"), "{text}");
    let refused = run(dir.path(), &["bound", "path.toml", "--truth", "middle.png"]);
    assert!(code(&refused) == 2 && stderr(&refused).contains("--view"), "{}", stderr(&refused));
    let exists = run(dir.path(), &["bound", "path.toml", "--map", "map.pfm"]);
    assert!(code(&exists) == 1 && stderr(&exists).contains("map-0001.pfm"), "{}", stderr(&exists));
}

/// Swapped positions are warned of, and the advice is to check them, not to spend.
#[test]
fn contradicting_inputs_are_to_be_checked_first() {
    let dir = rig();
    let scene = std::fs::read_to_string(dir.path().join("scene.toml")).unwrap();
    let swapped =
        scene.replace("position = 1.0", "position = 9.0").replace("position = 0.0", "position = 1.0");
    std::fs::write(dir.path().join("swapped.toml"), swapped.replace("position = 9.0", "position = 0.0"))
        .unwrap();
    let done = run(dir.path(), &["bound", "swapped.toml"]);
    let text = String::from_utf8(done.stdout.clone()).unwrap();
    assert!(stderr(&done).contains("positions (swapped?)"), "{}", stderr(&done));
    assert!(text.contains("next      check the inputs first"), "{text}");
    let right = run(dir.path(), &["bound", "scene.toml"]);
    let text = String::from_utf8(right.stdout.clone()).unwrap();
    assert!(right.stderr.is_empty() && text.contains("inputs    views agree"), "{text}{}", stderr(&right));
}

/// Values anywhere between the least and the largest, in one map of two: their share is said, and depth is
/// what to mend first.
#[test]
fn outliers_of_depth_are_named() {
    let dir = rig();
    let figures = || json(&run(dir.path(), &["bound", "scene.toml", "--json"]));
    let text = || String::from_utf8(good(dir.path(), &["bound", "scene.toml"]).stdout).unwrap();
    let mend = "depth without outliers";
    let clean = figures();
    assert!(clean["outliers"].as_f64().unwrap() < 0.01 && !text().contains("outliers"), "{clean}");
    assert!(!clean["remedy"].as_str().unwrap().starts_with(mend), "{clean}");

    let path = dir.path().join("left.pfm");
    let mut map = pfm::decode(&std::fs::read(&path).unwrap()).unwrap();
    let values = || map.data().iter().copied();
    let (low, high) = (values().fold(f32::MAX, f32::min), values().fold(0.0, f32::max));
    for (k, value) in map.data_mut().iter_mut().enumerate().filter(|(k, _)| k * 7919 % 100 < 8) {
        *value = low + (high - low) * (k * 6361 % 1000) as f32 / 1000.0;
    }
    std::fs::write(&path, pfm::encode(&map)).unwrap();
    let (damaged, text) = (figures(), text());
    let share = damaged["outliers"].as_f64().unwrap();
    // A change that is as small as the noise of a map is none.
    assert!((0.02..=0.045).contains(&share), "{share}");
    assert!(damaged["remedy"].as_str().unwrap().starts_with(mend), "{damaged}");
    assert!(text.contains(&format!("outliers  {:.1} % of the depths\n", 100.0 * share)), "{text}");
    assert!(text.contains(&format!("next      {mend}")), "{text}");
}
