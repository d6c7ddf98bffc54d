//! The commands of README.md, and those of views in the gallery, run as they stand.

use super::{good, rig};
use std::fs;
use std::path::Path;

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
    let between = "[[view]]\nname = \"middle\"\nimage = \"middle.png\"\nposition = 0.5\n\
                   disparity = \"middle.pfm\"\n[virtual]\nposition = 0.25\n";
    fs::write(path("views.toml"), scene.replace("[virtual]\nposition = 0.5\n", between)).unwrap();
    fs::create_dir(path("pictures")).unwrap();
    fs::create_dir(path("folder")).unwrap();
    for (from, to) in
        [("middle.png", "photo.png"), ("left.png", "folder/left.png"), ("right.png", "folder/right.png")]
    {
        fs::copy(path(from), path(to)).unwrap();
    }
    dir
}

#[test]
fn commands_of_the_pages_run() {
    for name in ["README.md", "../docs/gallery.md"] {
        let page = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(name)).unwrap();
        let unseen = blocks(&page, "text").into_iter().flat_map(str::lines);
        let unseen: Vec<_> =
            unseen.filter(|line| line.trim_start_matches("$ ").starts_with("hybank")).collect();
        assert!(
            unseen.is_empty(),
            "{name}: {unseen:?} run nowhere; make the block `sh`, or `text illustration`"
        );
        let mut count = 0;
        for block in blocks(&page, "sh") {
            let dir = folder();
            for line in block.lines().filter_map(|line| line.strip_prefix("hybank-ibr ")) {
                let words = line.split('#').next().unwrap_or_default().split_whitespace();
                good(dir.path(), &words.collect::<Vec<_>>());
                count += 1;
            }
        }
        assert!(count > 0, "{name} has no command");
    }
}
