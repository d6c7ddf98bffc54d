//! What other programs write and read: lists and films of virtual views, maps beside them, camera files.

use super::*;
use hybank_ibr::image::{MOST_PIXELS, read_image};
use image::DynamicImage;
use nalgebra::{Matrix3x4, Rotation3, Vector3};

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

/// Alpha agrees with the mask.
#[test]
fn alpha_is_written() {
    let dir = rig();
    let at = |name: &str| dir.path().join(name);
    let scene = "scene.toml";
    good(dir.path(), &["render", scene, "-o", "a.png", "--alpha"]);
    // Beyond the right view there are regions that no view shows.
    let beyond = std::fs::read_to_string(at(scene)).unwrap().replace("position = 0.5", "position = 2.0");
    std::fs::write(at("beyond.toml"), beyond).unwrap();
    good(
        dir.path(),
        &["render", "beyond.toml", "-o", "c.png", "--mask", "cm.png", "--alpha", "--bits", "16"],
    );
    let picture = image::open(at("c.png")).unwrap();
    let DynamicImage::ImageRgba16(pixels) = &picture else { panic!("{:?}", picture.color()) };
    let holes = read_image(&at("cm.png"), MOST_PIXELS).unwrap();
    assert!(holes.data().contains(&0.0) && holes.data().contains(&255.0));
    // Black: no view shows what is there; 64: only a guess says how deep it lies.
    assert!(pixels.pixels().zip(holes.data()).all(|(p, m)| p.0[3] == if *m < 65.0 { 0 } else { 65535 }));
    assert!(matches!(image::open(at("a.png")).unwrap(), DynamicImage::ImageRgba8(_)));
    for (arguments, exit, words) in [
        (&["-o", "x.jpg", "--alpha"][..], 2, "no alpha channel"),
        (&["-o", "x.png", "--depth", "n.jpg"], 2, "depth is written as .pfm"),
        (&["-o", "x.png", "--mask", "x.png"], 2, "both name x.png"),
        (&["-o", "x.png", "--nearest", "0"], 2, "at least one view"),
    ] {
        refused(dir.path(), &[&["render", scene], arguments].concat(), exit, &[words]);
    }
}

/// The pose of a turned camera as OpenGL writes it: x right, y up, z backwards, to the world.
fn open_gl(turn: [f64; 3], centre: [f64; 3]) -> serde_json::Value {
    let r = Rotation3::from_euler_angles(turn[0], turn[1], turn[2]).inverse();
    let row = |i: usize| vec![r[(i, 0)], -r[(i, 1)], -r[(i, 2)], centre[i]];
    serde_json::json!([row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]])
}

/// Three turned views with depths in a transforms file: the scene needs no other line about them.
#[test]
fn transforms_files_give_the_views() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    std::fs::create_dir(at("set")).unwrap();
    let poses = [
        ([0.01, 0.03, 0.02], [-0.25, 0.05, 0.0]),
        ([-0.015, -0.03, -0.01], [0.2, -0.04, 0.1]),
        ([0.0, 0.005, 0.0], [0.02, 0.03, 0.05]),
    ];
    let k = rig_camera(0.5, SIZE).fixed_columns::<3>(0).into_owned();
    let mut frames = Vec::new();
    for (number, (turn, centre)) in poses.into_iter().enumerate() {
        let r = Rotation3::from_euler_angles(turn[0], turn[1], turn[2]);
        let mut pose = Matrix3x4::zeros();
        pose.fixed_columns_mut::<3>(0).copy_from(r.matrix());
        pose.set_column(3, &-(r * Vector3::from(centre)));
        let (picture, depth) =
            SyntheticScene::default().view(&Camera::metric(k * pose, false).unwrap(), SIZE);
        save(&picture, &at(&format!("set/{number}.png"))).unwrap();
        // Thousandths of a unit in 16 bits.
        let stored: Vec<u16> = depth.data().iter().map(|d| (d * 1000.0).round() as u16).collect();
        let stored = image::ImageBuffer::from_raw(120, 90, stored).map(DynamicImage::ImageLuma16).unwrap();
        stored.save(at(&format!("set/depth{number}.png"))).unwrap();
        let mut frame = serde_json::json!({
            "file_path": format!("./{number}"), "transform_matrix": open_gl(turn, centre),
        });
        if number < 2 {
            frame["depth_file_path"] = format!("depth{number}.png").into();
        }
        frames.push(frame);
    }
    let (fx, fy, cx, cy) = (k[(0, 0)], k[(1, 1)], k[(0, 2)] + 0.5, k[(1, 2)] + 0.5);
    let file = serde_json::json!({
        "fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy, "w": 120, "h": 90, "camera_model": "OPENCV", "frames": frames
    });
    let write =
        |file: &serde_json::Value| std::fs::write(at("set/transforms.json"), file.to_string()).unwrap();
    write(&file);
    let scene = "transforms = \"set/transforms.json\"\n[virtual]\ncamera_of = \"2.png\"\n";
    std::fs::write(at("s.toml"), scene).unwrap();
    let arguments = ["render", "s.toml", "-o", "o.png", "--truth", "set/2.png", "--json", "--force"];
    let figures = json(&run(dir.path(), &arguments));
    assert!(figures["psnr"].as_f64().unwrap() > 31.0, "{figures}");
    assert_adds_up(&figures, 2 * 120 * 90);
    // Frame 2 of the path is half-way to the second view.
    let path = scene.replace("camera_of = \"2.png\"", "camera_of = \"0\"\nto_camera_of = \"1\"\nframes = 3");
    std::fs::write(at("path.toml"), path).unwrap();
    let done = json(&run(dir.path(), &["render", "path.toml", "-o", "p.y4m", "--json"]));
    assert_eq!(done["frames"].as_array().unwrap().len(), 3);
    refused(dir.path(), &["render", "s.toml", "-o", "set/0.png", "--force"], 1, &["set/0.png"]);
    std::fs::write(at("no.toml"), scene.replace("2.png", "9.png")).unwrap();
    refused(dir.path(), &["render", "no.toml", "-o", "x.png"], 1, &["transforms.json", "no image \"9.png\""]);
    let mut without = file.clone();
    for frame in without["frames"].as_array_mut().unwrap() {
        frame.as_object_mut().unwrap().remove("depth_file_path");
    }
    write(&without);
    refused(dir.path(), &["render", "s.toml", "-o", "x.png"], 1, &["frame 1", "depth_file_path", "[[view]]"]);
}
