//! The commands of README.md run as they stand.

use super::{good, inputs, rig};
use std::fs;

/// The blocks that begin with this fence.
fn blocks<'a>(page: &'a str, fence: &str) -> Vec<&'a str> {
    let opened = page.split(&format!("\n```{fence}\n")).skip(1).collect::<Vec<_>>();
    opened.into_iter().filter_map(|rest| rest.split("\n```").next()).collect()
}

/// A folder with all files that the commands name.
fn folder() -> tempfile::TempDir {
    let dir = rig();
    let path = |name: &str| dir.path().join(name);
    let scene = fs::read_to_string(path("scene.toml")).unwrap();
    fs::write(path("path.toml"), format!("{scene}to_position = 1.0\nframes = 3\n")).unwrap();
    let between = "[[view]]\nname = \"middle\"\nimage = \"photo.png\"\nposition = 0.5\n\
                   disparity = \"middle.pfm\"\n[virtual]\nposition = 0.25\n";
    fs::write(path("views.toml"), scene.replace("[virtual]\nposition = 0.5\n", between)).unwrap();
    fs::create_dir(path("folder")).unwrap();
    fs::rename(path("middle.png"), path("photo.png")).unwrap();
    for name in ["left.png", "right.png"] {
        fs::copy(path(name), path("folder").join(name)).unwrap();
    }
    let capture = inputs::folder();
    fs::create_dir(path("capture")).unwrap();
    for file in fs::read_dir(capture.path().join("set")).unwrap().map(Result::unwrap) {
        fs::copy(file.path(), path("capture").join(file.file_name())).unwrap();
    }
    fs::write(path("camera_path.json"), inputs::camera_path(&[0.0, 0.3])).unwrap();
    dir
}

#[test]
fn commands_of_the_readme_run() {
    let page = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/README.md")).unwrap();
    let texts = blocks(&page, "text").into_iter().flat_map(str::lines);
    let unseen: Vec<_> =
        texts.filter(|line| line.trim_start_matches("$ ").starts_with("hybank-ibr ")).collect();
    assert!(unseen.is_empty(), "make these blocks `sh`, or `text illustration`: {unseen:?}");
    let mut count = 0;
    for block in blocks(&page, "sh") {
        let dir = folder();
        for line in block.lines().filter_map(|line| line.strip_prefix("hybank-ibr ")) {
            let words = line.split('#').next().unwrap_or_default().split_whitespace();
            good(dir.path(), &words.collect::<Vec<_>>());
            count += 1;
        }
    }
    assert!(count > 0, "README.md has no command");
}
