//! Invalid arguments and usage: one clear message each.

use super::*;

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
