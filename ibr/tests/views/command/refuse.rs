//! Invalid scenes, arguments and usage: one clear message each.

use super::*;
use hybank_ibr::image::Image;

/// Contradictions, numbers out of range and files that are no files: exit code 1 and one message with the
/// words.
#[test]
fn hostile_scenes_are_refused_by_name() {
    let dir = rig();
    let scene = std::fs::read_to_string(dir.path().join("scene.toml")).unwrap();
    let map = |name: &str, value: f32| {
        let data = vec![value; 120 * 90];
        let bytes = pfm::encode(&Image::new(120, 90, 1, data).unwrap());
        std::fs::write(dir.path().join(name), bytes).unwrap();
    };
    map("tiny.pfm", 1e-42);
    map("negative.pfm", -3.0);
    std::fs::write(dir.path().join("huge.pfm"), "Pf\n100000 100000\n-1\n").unwrap();
    std::fs::write(dir.path().join("huge.pgm"), "P5 100000 100000 255\n").unwrap();
    std::fs::write(dir.path().join("empty.png"), "").unwrap();
    let whole = std::fs::read(dir.path().join("left.png")).unwrap();
    std::fs::write(dir.path().join("cut.png"), &whole[..whole.len() / 2]).unwrap();
    for (from, to, words) in [
        ("left.pfm\"", "tiny.pfm\"", &["tiny.pfm", "none of the 10800"][..]),
        ("left.pfm\"", "negative.pfm\"", &["negative.pfm", "none of the 10800"]),
        ("left.pfm\"", "huge.pfm\"", &["huge.pfm", "100000 x 100000"]),
        ("left.pfm\"", "left.png\"", &["left.png", "different red, green and blue"]),
        ("left.png\"", "huge.pgm\"", &["huge.pgm"]),
        ("left.png\"", "empty.png\"", &["empty.png"]),
        ("left.png\"", "cut.png\"", &["cut.png"]),
        ("left.png\"", ".\"", &["it is a folder"]),
        ("left.pfm\"", "left.pfm\"\ndisparity_scale = 0.0", &["\"left\"", "the scale is 0"]),
        ("left.pfm\"", "left.pfm\"\ndisparity_scale = -2.0", &["\"left\"", "the scale is -2"]),
        ("left.pfm\"", "left.pfm\"\ndisparity_scale = nan", &["\"left\"", "the scale is NaN"]),
        ("left.pfm\"", "left.pfm\"\ndisparity_scale = inf", &["\"left\"", "the scale is inf"]),
        ("left.pfm\"", "left.pfm\"\nstep = 1000", &["\"left\"", "1 x 1"]),
        ("left.pfm\"", "left.pfm\"\nstep = 0", &["\"left\"", "at least 1"]),
        ("left.pfm\"", "left.pfm\"\nstep = -1", &["-1", "broken.toml:"]),
        ("left.pfm\"", "left.pfm\"\ndepth = \"left.pfm\"", &["\"left\"", "`depth`"]),
        ("position = 1.0", "position = nan", &["\"right\"", "position = NaN"]),
        ("position = 0.5", "position = inf", &["virtual view", "position = inf"]),
        ("position = 0.5", "position = 1e300", &["broken.toml", "of 21600 pixels"]),
        ("\"right\"", "\"left\"", &["two views are named \"left\""]),
        ("disparity =", "disparty =", &["did you mean `disparity`?"]),
    ] {
        std::fs::write(dir.path().join("broken.toml"), scene.replacen(from, to, 1)).unwrap();
        let refused = run(dir.path(), &["render", "broken.toml", "-o", "o.png"]);
        let message = stderr(&refused);
        assert_eq!(code(&refused), 1, "{to}: {message}");
        assert!(words.iter().all(|w| message.contains(w)), "{to}: {message}");
        assert!(
            !message.contains("panicked") && refused.stdout.is_empty() && !dir.path().join("o.png").exists()
        );
    }
}

/// Settings that make no sense, and outputs that cannot be: one message each, with the right exit code.
#[test]
fn hostile_arguments_are_refused_by_name() {
    let dir = rig();
    std::fs::create_dir(dir.path().join("folder.png")).unwrap();
    let render = |more: &[&str]| run(dir.path(), &[&["render", "scene.toml"], more].concat());
    for (arguments, exit, words) in [
        (&["-o", "o.png", "--fps", "25"][..], 2, "--fps: only a film"),
        (&["-o", "o.png", "--seed", "3"], 2, "--seed: it is for a scene without cameras"),
        (&["-o", "o.png", "--offset", "nan"], 1, "offset is NaN"),
        (&["-o", "o.png", "--offset", "1e9"], 1, "no sample lies"),
        (&["-o", "o.png", "--threads", "100000"], 2, "1 to 1024"),
        (&["-o", "o.png", "--mask", "o.png"], 2, "both name o.png"),
        (&["-o", "o.png", "--depth-step", "x"], 2, "depth-step"),
        (&["-o", "folder.png"], 1, "it is a folder"),
        (&["-o", "folder.png", "--force"], 1, "it is a folder"),
        (&["-o", "nowhere/o.png"], 1, "nowhere/o.png"),
        (&["-o", "o.png", "--view", "middle"], 1, "the views are left, right"),
        (&["-o", "o.png", "--truth", "nowhere.png"], 1, "nowhere.png"),
        (&["-o", "o"], 2, "use .png"),
    ] {
        let refused = render(arguments);
        let message = stderr(&refused);
        assert_eq!(code(&refused), exit, "{arguments:?}: {message}");
        assert!(message.contains(words) && !message.contains("panicked"), "{arguments:?}: {message}");
        assert!(!dir.path().join("o.png").exists(), "{arguments:?}");
    }
    // A step beyond the map leaves one value: a flat scene, but a right answer.
    json(&render(&["-o", "flat.png", "--depth-step", "100000", "--json"]));
}

#[test]
fn wrong_usage_is_two() {
    let dir = tempfile::tempdir().unwrap();
    for arguments in [
        &["render"][..],
        &["render", "s.toml"],
        &["paint"],
        &["render", "s.toml", "-o", "o.png", "--depth-step", "0"],
        &["render", "s.toml", "-o", "-", "--json"],
        &["render", "s.toml", "-o", "o.png", "--threads", "0"],
        &["evaluate", "s.toml", "--every", "0"],
    ] {
        assert_eq!(code(&run(dir.path(), arguments)), 2, "{arguments:?}");
    }
    let help = run(dir.path(), &["render", "--help"]);
    assert_eq!(code(&help), 0);
    assert!(String::from_utf8(help.stdout).unwrap().contains("Examples:"));
    assert_eq!(code(&run(dir.path(), &["--version"])), 0);
    let missing = run(dir.path(), &["render", "s.toml", "-o", "o.png"]);
    assert_eq!(code(&missing), 1);
    assert!(stderr(&missing).contains("s.toml"));
    let format = run(dir.path(), &["render", "s.toml", "-o", "o.gif"]);
    assert_eq!(code(&format), 2);
    assert!(stderr(&format).contains(".png"));
}
