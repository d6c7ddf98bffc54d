//! What other programs read: lists and films of virtual views.

use super::*;
use hybank_ibr::image::{MOST_PIXELS, read_image};

/// Frames of a film as their planes, read by the rules of the format.
fn frames(bytes: &[u8], header: &str, planes: usize) -> Vec<Vec<u8>> {
    let rest = bytes.strip_prefix(header.as_bytes()).unwrap();
    let size = planes * SIZE.0 * SIZE.1;
    rest.chunks(size + 6).map(|frame| frame.strip_prefix(b"FRAME\n").unwrap().to_vec()).collect()
}

/// A list of tables, one of them a path: the views are those that are rendered one by one, as files and as a
/// film on a pipe.
#[test]
fn lists_and_films_hold_the_views() {
    let dir = rig();
    let at = |name: &str| dir.path().join(name);
    let scene = std::fs::read_to_string(at("scene.toml")).unwrap();
    let list = scene.replace("[virtual]\nposition = 0.5\n", "")
        + "[[virtual]]\nposition = 0.25\n[[virtual]]\nposition = 0.5\nto_position = 0.75\nframes = 2\n";
    std::fs::write(at("list.toml"), &list).unwrap();
    good(dir.path(), &["render", "list.toml", "-o", "v.png", "--mask", "n.png"]);
    let film = good(dir.path(), &["render", "list.toml", "-o", "film.y4m", "--fps", "30"]);
    assert!(String::from_utf8(film.stdout).unwrap().contains("frame 3  coverage"));
    let piped = good(dir.path(), &["render", "list.toml", "-o", "-", "--fps", "30"]);
    let bytes = std::fs::read(at("film.y4m")).unwrap();
    assert!(piped.stdout == bytes);
    let header = "YUV4MPEG2 W120 H90 F30:1 Ip A1:1 C444 XCOLORRANGE=LIMITED\n";
    let shown = frames(&bytes, header, 3);
    assert_eq!(shown.len(), 3);
    for (k, position) in ["0.25", "0.5", "0.75"].iter().enumerate() {
        let one = scene.replace("position = 0.5", &format!("position = {position}"));
        std::fs::write(at("one.toml"), one).unwrap();
        good(dir.path(), &["render", "one.toml", "-o", "one.png", "--force"]);
        let number = format!("v-000{}.png", k + 1);
        assert!(std::fs::read(at(&number)).unwrap() == std::fs::read(at("one.png")).unwrap(), "{number}");
        assert!(at(&format!("n-000{}.png", k + 1)).exists());
        // Luma of the picture, rounded twice.
        let picture = read_image(&at("one.png"), MOST_PIXELS).unwrap();
        for (pixel, luma) in picture.data().chunks_exact(3).zip(&shown[k]) {
            let want = 16.0 + 219.0 / 255.0 * (0.299 * pixel[0] + 0.587 * pixel[1] + 0.114 * pixel[2]);
            assert!((want - f32::from(*luma)).abs() <= 1.5, "{want} {luma}");
        }
    }
    let broken = |from: &str, to: &str, words: &[&str]| {
        std::fs::write(at("broken.toml"), list.replacen(from, to, 1)).unwrap();
        refused(dir.path(), &["render", "broken.toml", "-o", "x.png"], 1, words);
    };
    broken("position = 0.25", "", &["[[virtual]] number 1 needs a `position`"]);
    broken("position = 0.25", "position = 0.25\nframes = 3", &["number 1 has `frames` but no end"]);
    broken(
        "frames = 2",
        "frames = 2\noffset = 1.0\n[[virtual]]\nposition = 0.0\noffset = 2.0",
        &["number 3 has another `offset`"],
    );
    broken("position = 0.25", "positon = 0.25", &["did you mean `position`?", "broken.toml:"]);
    broken("frames = 2", "frames = 9999", &["more than 9999 virtual views"]);
    for (arguments, words) in [
        (&["--truth", "middle.png"][..], "several virtual views"),
        (&["--bits", "16"], "8 bits per value"),
        (&["--fps", "0"], "--fps"),
    ] {
        refused(dir.path(), &[&["render", "list.toml", "-o", "x.y4m"], arguments].concat(), 2, &[words]);
    }
    refused(dir.path(), &["render", "list.toml", "-o", "film.y4m"], 1, &["film.y4m exists"]);
}
