//! Foreign text in every kind of input: no control character reaches the terminal, no line is forged, and a
//! message has at most a few kilobytes.

use super::*;
use hybank_core::messages::printable;

const HOSTILE: &str = "\u{1b}[2J\u{9b}31m\u{202e}\u{7}\r\nhybank-ibr: forged";
const MOST: usize = 8 << 10;

/// Runs, and checks what was said.
fn said(dir: &Path, arguments: &[&str], what: &str) -> String {
    let output = run(dir, arguments);
    let said = stderr(&output) + &String::from_utf8(output.stdout).unwrap();
    let shown: String = said.chars().take(MOST).collect();
    assert!(matches!(output.status.code(), Some(0..=2)), "{what}: {shown}");
    assert!(said.len() <= MOST, "{what}: {} bytes: {shown}", said.len());
    assert_eq!(printable(&said), said, "{what}");
    assert!(
        !said.contains("panicked") && !said.lines().any(|line| line.starts_with("hybank-ibr: forged")),
        "{what}: {said}"
    );
    said
}

#[test]
fn foreign_text_in_files_is_quoted_and_bounded() {
    let dir = rig();
    let scene = std::fs::read_to_string(dir.path().join("scene.toml")).unwrap();
    let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    let check = |text: &str, what: &str| {
        write("s.toml", text);
        let said = said(dir.path(), &["render", "s.toml", "-o", "o.png", "--force"], what);
        assert!(said.starts_with("hybank-ibr: "), "{what}: {said}");
    };
    let long = format!("{HOSTILE}{}", "x".repeat(1 << 20));
    for text in [HOSTILE, &long] {
        let quoted = serde_json::to_string(text).unwrap();
        for (from, to) in [
            ("position = 1.0", format!("position = 1.0\n{quoted} = 2")),
            ("position = 1.0", format!("position = {quoted}")),
            ("position = 1.0", format!("position = {text}")),
            ("\"left.png\"", quoted.clone()),
            ("\"left.pfm\"", quoted.clone()),
            ("\"left\"", format!("{quoted}\nstep = 0")),
            ("position = 0.5", format!("position = 0.5\ncamera_of = {quoted}")),
            ("position = 1.0", format!("position = 1e300\nname = {quoted}")),
        ] {
            assert!(scene.contains(from), "{from}");
            check(&scene.replacen(from, &to, 1), from);
        }
        check(text, "no scene");
        check(&format!("unknown = {quoted}"), "unknown");
        let json = |frames: &str| format!("{{\"w\": 4, \"h\": 4, \"frames\": {frames}}}");
        let pose = "[[1,0,0,0],[0,1,0,0],[0,0,1,0]]";
        for transforms in [
            json(&format!("[{{\"file_path\": {quoted}, \"transform_matrix\": {pose}}}]")),
            json(&format!("[{{\"file_path\": \"a.png\", \"transform_matrix\": {quoted}}}]")),
            json(&quoted),
            format!("{{\"camera_model\": {quoted}, \"frames\": []}}"),
            text.to_owned(),
        ] {
            write("transforms.json", &transforms);
            check("transforms = \"transforms.json\"\n[virtual]\ncamera_of = \"b.png\"\n", "transforms");
        }
        std::fs::create_dir_all(dir.path().join("model")).unwrap();
        let line = text.replace(['\r', '\n'], "_").replace(' ', "_");
        for (cameras, images) in [
            (format!("1 {line} 4 4 1 1 1\n"), String::new()),
            (format!("{line} PINHOLE 4 4 1 1 1\n"), String::new()),
            ("1 PINHOLE 4 4 1 1 2 2\n".into(), format!("1 1 0 0 0 0 0 0 9 {line}\n\n")),
            ("1 PINHOLE 4 4 1 1 2 2\n".into(), format!("1 1 0 0 0 0 0 0 1 {line}\n\n")),
            ("1 PINHOLE 4 4 1 1 2 2\n".into(), format!("1 1 0 0 {line} 0 0 0 1 a.png\n\n")),
        ] {
            write("model/cameras.txt", &cameras);
            write("model/images.txt", &images);
            check(
                "colmap = \"model\"\n[[view]]\nimage = \"left.png\"\ndepth = \"left.pfm\"\n[virtual]\ncamera_of = \"left.png\"\n",
                "colmap",
            );
        }
        write("tracks.txt", &format!("1 2 3 4\n{text} 2 3 4\n"));
        let views =
            "[[view]]\nimage = \"left.png\"\n[[view]]\nimage = \"right.png\"\n[virtual]\nbetween = 0.5\n";
        check(&format!("matches = \"tracks.txt\"\n{views}"), "tracks");
        write("bad.pfm", &format!("Pf\n{text} 3\n-1\n"));
        check(&scene.replacen("left.pfm", "bad.pfm", 1), "pfm");
        write("bad.png", text);
        check(&scene.replacen("left.png", "bad.png", 1), "png");
    }
}

#[test]
fn foreign_names_and_arguments_are_quoted_and_bounded() {
    let dir = rig();
    let long = "y".repeat(50_000);
    for text in [HOSTILE, &long] {
        for arguments in [
            &["render", text, "-o", "o.png"][..],
            &["render", "scene.toml", "-o", text],
            &["render", "scene.toml", "-o", &format!("{text}.png")],
            &["render", "scene.toml", "-o", "o.png", "--view", text],
            &["render", "scene.toml", "-o", "o.png", "--truth", text],
            &["render", "scene.toml", "-o", "o.png", "--unknown", text],
            &["render", "scene.toml", "-o", "o.png", &format!("--{text}")],
            &["bound", text],
            &["evaluate", text],
            &["evaluate", "scene.toml", "--every", text],
            &[text],
        ] {
            let what = format!("{:?}", &arguments[..arguments.len() - 1]);
            assert!(!said(dir.path(), arguments, &what).is_empty() || text == HOSTILE, "{what}");
        }
    }
}
