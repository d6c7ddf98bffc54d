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
    refused(dir.path(), &target, 1, &["./0.png", "120 x 90", "60 x 90"]);
    assert_eq!(read_image(&dir.path().join("o.png"), MOST_PIXELS).unwrap().size(), SIZE);
}
