//! Scenes as users write them, and what is wrong with others.

use super::*;
use crate::pipeline::uncalibrated::Target;
use crate::scene::Kind;
use crate::uncalibrated::Point;

fn scene(text: &str) -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(dir.path().join(name), bytes).unwrap();
    write("a.pgm", b"P5 4 2 255\n\x01\x02\x03\x04\x05\x06\x07\x08");
    write("small.pgm", b"P5 2 1 255\n\x01\x02");
    write("d.pgm", b"P5 4 2 255\n\x04\x04\x04\x00\x04\x04\x04\x04");
    write("tall.pgm", b"P5 2 4 255\n\x04\x04\x04\x04\x04\x04\x04\x04");
    write("zero.pgm", b"P5 4 2 255\n\0\0\0\0\0\0\0\0");
    write("t.txt", b"1 2 3 4 5 6\n1 2 - 5 6\n");
    let path = dir.path().join("scene.toml");
    std::fs::write(&path, text).unwrap();
    (dir, path)
}

fn read(text: &str, options: &LoadOptions) -> Result<Scene, String> {
    let (_dir, path) = scene(text);
    let spec = parse(text, &path).map_err(|e| e.to_string())?;
    load(&spec, &path, options).map_err(|e| e.to_string())
}

const RIG: &str = r#"
    [[view]]
    name = "left"
    image = "a.pgm"
    position = 0.0
    disparity = "d.pgm"
    disparity_scale = 4.0
    [[view]]
    name = "right"
    image = "a.pgm"
    position = 1.0
    disparity = "d.pgm"
    [virtual]
    position = 0.5
"#;

#[test]
fn a_rectified_rig_is_read() {
    let read_rig = read(RIG, &LoadOptions::default()).unwrap();
    let Kind::Rectified { views, positions } = read_rig.kind else { panic!("{read_rig:?}") };
    assert_eq!((views.len(), &positions[..], read_rig.filled), (2, &[0.5][..], 2));
    assert_eq!((views[0].map.data()[3], views[1].map.data()[3]), (1.0, 4.0));
    let without = LoadOptions {
        view: Some("right".into()),
        unknown: Some(crate::scene::Unknown::Drop),
        ..LoadOptions::default()
    };
    let Kind::Rectified { views, positions } = read(RIG, &without).unwrap().kind else { panic!() };
    assert_eq!((views.len(), &positions[..]), (1, &[1.0][..]));
    assert!(views[0].map.data()[3].is_nan());
}

#[test]
fn paths_have_both_ends() {
    let defaults = LoadOptions::default();
    let path = RIG.to_string() + "to_position = 1.0\nframes = 3\n";
    let Kind::Rectified { positions, .. } = read(&path, &defaults).unwrap().kind else { panic!() };
    assert_eq!(positions, [0.5, 0.75, 1.0]);
    for (keys, words) in [
        ("frames = 3", "no end of the path"),
        ("to_position = 1.0", "how many views"),
        ("to_position = 1.0\nframes = 1", "2 to 9999"),
        ("to_position = nan\nframes = 3", "finite"),
        ("to_camera_of = \"a\"\nframes = 3", "`to_camera_of`, which has no meaning in a rectified scene"),
    ] {
        let message = read(&(RIG.to_string() + keys), &defaults).unwrap_err();
        assert!(message.contains(words), "{message}");
    }
    let row = |x: f64| format!("[[5.0, 0.0, 1.5, {x:?}], [0.0, 5.0, 0.5, 0.0], [0.0, 0.0, 1.0, 0.0]]");
    let text = format!(
        "[[view]]\nimage = \"a.pgm\"\ncamera = {}\ndepth = \"d.pgm\"\n[virtual]\ncamera = {}\nto_camera = {}\nframes = 5\n",
        row(0.0),
        row(-5.0),
        row(-10.0)
    );
    let Kind::Calibrated { cameras, .. } = read(&text, &defaults).unwrap().kind else { panic!() };
    let columns: Vec<f64> = cameras.iter().map(|c| c.centre().x).collect();
    assert!(
        columns.iter().zip([1.0, 1.25, 1.5, 1.75, 2.0]).all(|(a, b)| (a - b).abs() < 1e-9),
        "{columns:?}"
    );
}

#[test]
fn keys_of_the_top_that_another_kind_has_are_refused() {
    for key in [
        "matches = \"t.txt\"",
        "transforms = \"t.json\"",
        "colmap = \"c\"",
        "mirrored = true",
        "depth_scale = 3.0",
    ] {
        let name = key.split(' ').next().unwrap();
        let message = read(&format!("{key}\n{RIG}"), &LoadOptions::default()).unwrap_err();
        let words = format!("the top of the file has `{name}`, which has no meaning in a rectified scene");
        assert!(message.contains(&words), "{message}");
    }
}

/// A rectified virtual view has no camera, and the size of its views.
#[test]
fn keys_of_a_virtual_camera_are_refused_in_a_rectified_scene() {
    let with = |key: &str| read(&(RIG.to_string() + key), &LoadOptions::default());
    assert!(with("size = [4, 2]").is_ok());
    for (key, words) in [
        (
            "size = [2, 1]",
            "has `size` = [2, 1], but that of a rectified scene has the size of its views, 4 x 2 pixels; remove `size`",
        ),
        ("camera_of = \"left\"", "has `camera_of`, which has no meaning in a rectified scene"),
    ] {
        let message = with(key).unwrap_err();
        assert!(message.contains(words), "{message}");
    }
}

#[test]
fn coarse_maps_are_made_dense() {
    let coarse = LoadOptions { depth_step: 2, ..LoadOptions::default() };
    let Kind::Rectified { views, .. } = read(RIG, &coarse).unwrap().kind else { panic!() };
    assert_eq!(views[0].map.size(), (4, 2));
    let text = RIG.replace("disparity = \"d.pgm\"", "disparity = \"small.pgm\"\nstep = 2");
    let Kind::Rectified { views, .. } = read(&text, &LoadOptions::default()).unwrap().kind else { panic!() };
    assert!((views[1].map.data()[0] - 1.0).abs() < 1e-3);
}

#[test]
fn tracks_and_columns() {
    let text = r#"
        matches = "t.txt"
        [[view]]
        image = "a.pgm"
        [[view]]
        image = "small.pgm"
        [virtual]
        from_tracks = 2
    "#;
    let Kind::Uncalibrated { tracks, targets, size, .. } = read(text, &LoadOptions::default()).unwrap().kind
    else {
        panic!()
    };
    assert_eq!(tracks[0], [Some(Point::new(1.0, 2.0)), Some(Point::new(5.0, 6.0))]);
    assert_eq!(targets, [Target::Tracks(vec![Some(Point::new(3.0, 4.0)), None])]);
    assert_eq!(size, (4, 2));
    let outside = text.replace("from_tracks = 2", "from_tracks = 7");
    let message = read(&outside, &LoadOptions::default()).unwrap_err();
    assert!(message.contains("3 columns, numbered from 1"), "{message}");
    // A view without a column takes none that another view names, and no column may be named twice.
    let named = text.replace("image = \"small.pgm\"", "image = \"small.pgm\"\ncolumn = 1");
    let Kind::Uncalibrated { tracks, .. } = read(&named, &LoadOptions::default()).unwrap().kind else {
        panic!()
    };
    assert_eq!(tracks[0], [Some(Point::new(5.0, 6.0)), Some(Point::new(1.0, 2.0))]);
    for twice in
        [named.replace("column = 1", "column = 2"), named.replace("from_tracks = 2", "from_tracks = 1")]
    {
        let message = read(&twice, &LoadOptions::default()).unwrap_err();
        assert!(message.contains("a column of its own"), "{message}");
    }
}

#[test]
fn cameras_and_sizes() {
    let camera = "camera = [[5.0, 0.0, 1.5, 0.0], [0.0, 5.0, 0.5, 0.0], [0.0, 0.0, 1.0, 0.0]]";
    let text = format!(
        "[[view]]\nimage = \"a.pgm\"\n{camera}\ndepth = \"d.pgm\"\n[virtual]\n{camera}\nsize = [6, 3]\n"
    );
    let Kind::Calibrated { views, size, .. } = read(&text, &LoadOptions::default()).unwrap().kind else {
        panic!()
    };
    assert_eq!((views[0].map.data()[0], size), (4.0, (6, 3)));
    let singular = text.replace("[0.0, 0.0, 1.0, 0.0]", "[0.0, 0.0, 0.0, 1.0]");
    let message = read(&singular, &LoadOptions::default()).unwrap_err();
    assert!(message.contains("view \"a.pgm\"") && message.contains("singular"), "{message}");
    let sized = |size: &str, options: &LoadOptions| read(&text.replace("[6, 3]", size), options);
    let defaults = LoadOptions::default();
    assert!(sized("[0, 3]", &defaults).unwrap_err().contains("at least one pixel"));
    let message = sized("[8192, 8192]", &defaults).unwrap_err();
    assert!(message.contains("8192 x 8192") && message.contains("--max-pixels"), "{message}");
    let message = sized("[6, 3]", &LoadOptions { max_pixels: 17, ..defaults }).unwrap_err();
    assert!(message.contains("limit of 17"), "{message}");
}

#[test]
fn what_is_wrong_is_named() {
    let fails = |text: &str, words: &[&str]| {
        let message = read(text, &LoadOptions::default()).unwrap_err();
        assert!(words.iter().all(|w| message.contains(w)), "{message}");
    };
    fails(&RIG.replace("disparity_scale", "disparity_scal"), &["scene.toml:7:5", "disparity_scal"]);
    fails(&RIG.replace("disparity = \"d.pgm\"", ""), &["\"left\"", "`disparity`"]);
    fails(&RIG.replacen("a.pgm", "missing.pgm", 1), &["missing.pgm"]);
    fails(&RIG.replacen("\"a.pgm\"", "\"small.pgm\"", 1), &["d.pgm", "4 x 2", "2 x 1"]);
    fails(&RIG.replacen("d.pgm", "tall.pgm", 1), &["tall.pgm", "2 x 4", "on its side"]);
    fails(&RIG.replace("d.pgm", "zero.pgm"), &["zero.pgm", "none of the 8 values"]);
    fails(&RIG.replace("4.0", "0.0"), &["the scale is 0"]);
    fails(&RIG.replace("[virtual]\n    position = 0.5", ""), &["[virtual] needs a `position`"]);
    fails("[[view]]\nimage = \"a.pgm\"\n[[view]]\nimage = \"a.pgm\"\n", &["`matches`"]);
    fails("", &["[[view]]"]);
    fails(&RIG.replace("disparity_scale", "disparty_scale"), &["did you mean `disparity_scale`?"]);
    fails(&RIG.replace("\"right\"", "\"left\""), &["two views are named \"left\""]);
    fails(&RIG.replace("position = 1.0", "position = 1.0\ndepth = \"d.pgm\""), &["\"right\"", "`depth`"]);
    fails(&RIG.replace("position = 1.0", "position = nan"), &["\"right\"", "position = NaN"]);
    fails(&RIG.replace("position = 0.5", "position = inf"), &["virtual view", "position = inf"]);
    fails(
        &RIG.replace("position = 0.5", "position = 0.5\ncamera_of = \"a\""),
        &["[virtual] has `camera_of`"],
    );
    fails(&RIG.replace("position = 0.5", "position = 0.5\nbetween = 0.5"), &["`between`", "rectified"]);
    fails(&RIG.replace("position = 0.5", "position = 0.5\nsize = [4, 3]"), &["[4, 3]", "4 x 2"]);
    let rows = "[[5.0, 0.0, 1.5, 0.0], [0.0, 5.0, 0.5, 0.0], [0.0, 0.0, 1.0, 0.0]]";
    let view = format!("[[view]]\nimage = \"a.pgm\"\ncamera = {rows}\ndepth = \"d.pgm\"\n");
    let general = format!("{view}[virtual]\ncamera = {rows}\n");
    fails(&format!("{general}position = 0.5\n"), &["[virtual] has `position`", "calibrated"]);
    fails(&format!("{general}camera_of = \"a\"\n"), &["both `camera` and `camera_of`"]);
    let options = LoadOptions { view: Some("middle".into()), ..LoadOptions::default() };
    assert!(read(RIG, &options).unwrap_err().contains("the views are left, right"));
}

/// 12 bits in files of 16 are at most 4095 / 257, and dark photographs of 8 bits are no such data.
#[test]
fn data_of_twelve_bits_are_noticed() {
    let noted = |values: [f32; 2]| {
        crate::scene::notes::of_dark(&[&Image::new(2, 1, 1, values.to_vec()).unwrap()]).is_some()
    };
    assert!(noted([15.9, 3.1]) && !noted([15.0, 3.0]) && !noted([16.1, 3.1]));
}
