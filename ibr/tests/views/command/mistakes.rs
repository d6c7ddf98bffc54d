//! What users get wrong: each mistake is mended or named, none passes in silence.

use super::*;
use hybank_ibr::image::{Image, MOST_PIXELS, read_image};
use image::DynamicImage;

fn scene(dir: &Path) -> String {
    std::fs::read_to_string(dir.join("scene.toml")).unwrap()
}

fn write(dir: &Path, name: &str, text: &str) {
    std::fs::write(dir.join(name), text).unwrap();
}

/// Half of a Middlebury pair: the report says what is missing.
#[test]
fn half_of_a_pair_is_named() {
    let dir = rig();
    let at = |name: &str| dir.path().join(name);
    let copies = [("left.png", "im0.png"), ("right.png", "im1.png"), ("left.pfm", "disp0.pfm")];
    for (from, to) in copies {
        std::fs::copy(at(from), at(to)).unwrap();
    }
    write(dir.path(), "m.toml", "calib = \"calib.txt\"\n[virtual]\nposition = 0.5\n");
    let inner = "[108 0 59.5; 0 108 44.5; 0 0 1]";
    let calib = format!("cam0={inner}\ncam1={inner}\ndoffs=0\nbaseline=100\nwidth=120\nheight=90\n");
    write(dir.path(), "calib.txt", &calib);
    let left = good(dir.path(), &["render", "m.toml", "-o", "left.out.png"]);
    assert!(stderr(&left).contains("no disp1.pfm") && stderr(&left).contains("im0.png alone"));
    let predicted = good(dir.path(), &["bound", "m.toml"]);
    assert!(stderr(&predicted).contains("note: there is no disp1.pfm"), "{}", stderr(&predicted));
    std::fs::remove_file(at("disp0.pfm")).unwrap();
    refused(dir.path(), &["render", "m.toml", "-o", "x.png"], 1, &["disp0.pfm"]);
    std::fs::copy(at("right.pfm"), at("disp1.pfm")).unwrap();
    let right = good(dir.path(), &["render", "m.toml", "-o", "right.out.png"]);
    assert!(stderr(&right).contains("no disp0.pfm") && stderr(&right).contains("im1.png alone"));
}

/// The depth of a calibrated rig is in millimetres, that of others is said to be a disparity.
#[test]
fn depths_have_a_unit_and_the_report_names_it() {
    let dir = rig();
    let at = |name: &str| dir.path().join(name);
    let (focal, baseline, offset) = (108.0, 93.5, 12.5);
    let inner = |cx: f64| format!("[{focal} 0 {cx}; 0 {focal} 44.5; 0 0 1]");
    let calib = format!(
        "cam0={}\ncam1={}\ndoffs={offset}\nbaseline={baseline}\nwidth=120\nheight=90\n",
        inner(59.5),
        inner(59.5 + offset)
    );
    write(dir.path(), "calib.txt", &calib);
    write(dir.path(), "c.toml", &("calib = \"calib.txt\"\n".to_string() + &scene(dir.path())));
    let keyed = scene(dir.path()).replace("disparity =", "disparity_offset = 12.5\ndisparity =");
    write(dir.path(), "k.toml", &keyed);
    let read = |name: &str| pfm::decode(&std::fs::read(at(name)).unwrap()).unwrap().data().to_vec();
    for method in ["rows", "plane"] {
        let render = |scene: &str, depth: &str| {
            let arguments = ["render", scene, "-o", "o.png", "--force", "--method", method, "--depth", depth];
            String::from_utf8(good(dir.path(), &arguments).stdout).unwrap()
        };
        let said = render("c.toml", "mm.pfm");
        assert!(said.contains("depths    written in millimetres") && said.contains("93.5 mm"), "{said}");
        let said = render("k.toml", "px.pfm");
        assert!(said.contains("depths    written as disparities in pixels for a baseline of one"), "{said}");
        let (depths, disparities) = (read("mm.pfm"), read("px.pfm"));
        assert!(depths.iter().filter(|d| !d.is_nan()).count() > 9 * depths.len() / 10);
        for (depth, disparity) in depths.iter().zip(disparities) {
            let want = focal * baseline / (f64::from(disparity) + offset);
            let close = (f64::from(*depth) / want - 1.0).abs() < 1e-5;
            assert!(close || (depth.is_nan() && disparity.is_nan()), "{method}: {depth} {disparity}");
        }
    }
    let piped = json(&run(dir.path(), &["render", "scene.toml", "-o", "p.png", "--json"]));
    assert!(piped["depths"].is_null(), "{piped}");
}

/// All views of a path are looked at, not the first alone.
#[test]
fn warnings_are_about_all_views_of_a_path() {
    let dir = rig();
    let path = scene(dir.path()) + "to_position = 20.0\nframes = 3\n";
    write(dir.path(), "path.toml", &path);
    let done = good(dir.path(), &["render", "path.toml", "-o", "p.png"]);
    let message = stderr(&done);
    assert!(message.contains("1 of 3 virtual views, worst number 3: only "), "{message}");
    let text = String::from_utf8(done.stdout).unwrap();
    assert!(text.contains("inputs    views agree"), "{text}");
    write(dir.path(), "away.toml", &path.replace("to_position = 20.0", "to_position = 4000.0"));
    let away = ["render", "away.toml", "-o", "away.png"];
    refused(dir.path(), &away, 1, &["away.toml: virtual view 2 of 3: no sample lies"]);
    let swapped = path.replace("position = 1.0\n", "position = -1.0\n");
    write(dir.path(), "swapped.toml", &swapped.replace("to_position = 20.0", "to_position = 0.6"));
    let message = stderr(&good(dir.path(), &["render", "swapped.toml", "-o", "s.png"]));
    assert_eq!(message.matches("agree in depth and colour at only").count(), 1, "{message}");
}

/// Two frames of a transforms file with depth in hundredths of a unit, a third one without.
fn transforms() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let k = rig_camera(0.5, SIZE);
    let mut frames = Vec::new();
    for (number, x) in [-0.2, 0.2, 0.0].into_iter().enumerate() {
        let mut matrix = k;
        matrix.set_column(3, &(-(k.fixed_columns::<3>(0) * nalgebra::Vector3::new(x, 0.0, 0.0))));
        let (picture, depth) = SyntheticScene::default().view(&Camera::metric(matrix, false).unwrap(), SIZE);
        save(&picture, &dir.path().join(format!("{number}.png"))).unwrap();
        let stored: Vec<u16> = depth.data().iter().map(|d| (d * 100.0).round() as u16).collect();
        let stored = image::ImageBuffer::from_raw(120, 90, stored).map(DynamicImage::ImageLuma16).unwrap();
        stored.save(dir.path().join(format!("d{number}.png"))).unwrap();
        let pose = [[1.0, 0.0, 0.0, x], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
        let mut frame = serde_json::json!({"file_path": format!("./{number}.png"), "transform_matrix": pose});
        if number < 2 {
            frame["depth_file_path"] = format!("d{number}.png").into();
        }
        frames.push(frame);
    }
    let file = serde_json::json!({
        "fl_x": k[(0, 0)], "fl_y": k[(1, 1)], "cx": k[(0, 2)] + 0.5, "cy": k[(1, 2)] + 0.5, "w": 120, "h": 90,
        "frames": frames
    });
    write(dir.path(), "transforms.json", &file.to_string());
    dir
}

/// One line says the scale of all depth maps, and keys in a wrong table are sent to theirs.
#[test]
fn the_scale_of_all_maps_is_one_line() {
    let dir = transforms();
    let top = "transforms = \"transforms.json\"\n";
    let psnr = |scene: &str| {
        write(dir.path(), "s.toml", scene);
        let arguments = ["render", "s.toml", "-o", "o.png", "--force", "--truth", "2.png", "--json"];
        json(&run(dir.path(), &arguments))["psnr"].as_f64().unwrap()
    };
    let target = "[virtual]\ncamera_of = \"2.png\"\n";
    let scaled = psnr(&format!("{top}depth_scale = 100.0\n{target}"));
    let view = |k: usize| format!("[[view]]\nimage = \"{k}.png\"\ndepth = \"d{k}.png\"\n");
    let tables = view(0) + &view(1);
    let listed = psnr(&format!("{top}depth_scale = 100.0\n{tables}{target}"));
    let own = psnr(&format!("{top}{}{target}", tables.replace("depth =", "depth_scale = 100.0\ndepth =")));
    assert!(scaled > 30.0 && scaled == listed && scaled == own, "{scaled} {listed} {own}");
    write(dir.path(), "s.toml", &format!("{top}step = 2\n{target}"));
    refused(
        dir.path(),
        &["render", "s.toml", "-o", "x.png"],
        1,
        &["s.toml:2:1: ", "`step` belongs in [[view]]"],
    );
}

/// Without `[virtual]` the message names the key to write; a frame without depth is a place too.
#[test]
fn transforms_without_a_virtual_view_say_which_key_is_missing() {
    let dir = transforms();
    write(dir.path(), "s.toml", "transforms = \"transforms.json\"\ndepth_scale = 100.0\n");
    let words = ["[virtual] needs `camera_of`", "./0.png, ./1.png, ./2.png"];
    refused(dir.path(), &["render", "s.toml", "-o", "x.png"], 1, &words);
    let arguments = ["render", "s.toml", "--view", "2.png", "--truth", "2.png", "-o", "o.png", "--json"];
    let figures = json(&run(dir.path(), &arguments));
    assert!(figures["psnr"].as_f64().unwrap() > 30.0, "{figures}");
    refused(dir.path(), &["render", "s.toml", "--view", "9.png", "-o", "x.png"], 1, &["no view", "./0.png"]);
    // Photographs of another shape than the file says.
    save(&Image::filled(60, 90, 3, 9.0), &dir.path().join("0.png")).unwrap();
    let target = ["render", "s.toml", "--view", "2.png", "-o", "x.png"];
    refused(dir.path(), &target, 1, &["d0.png", "120 x 90", "60 x 90"]);
    assert_eq!(read_image(&dir.path().join("o.png"), MOST_PIXELS).unwrap().size(), SIZE);
}
