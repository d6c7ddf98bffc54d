//! Scenes of folders: what `init` writes, and that `render` of the folder gives the same picture.

use super::*;
use hybank_ibr::camera::colmap::parse_model;

/// The photographs of the synthetic rig under some names in a folder of their own.
fn photographs(names: &[(&str, &str)]) -> tempfile::TempDir {
    let (rig, dir) = (rig(), tempfile::tempdir().unwrap());
    for (from, to) in names {
        let to = dir.path().join("set").join(to);
        std::fs::create_dir_all(to.parent().unwrap()).unwrap();
        std::fs::copy(rig.path().join(from), to).unwrap();
    }
    std::fs::copy(rig.path().join("middle.png"), dir.path().join("truth.png")).unwrap();
    dir
}

/// The PSNR of a scene against truth.png.
fn psnr(dir: &Path, scene: &str) -> f64 {
    let output = good(dir, &["render", scene, "-o", "o.png", "--force", "--json", "--truth", "truth.png"]);
    json(&output)["psnr"].as_f64().unwrap()
}

/// The scene of a folder, written and not written, gives one picture of so many dB.
fn is_rendered(dir: &Path, inputs: &[&str], least: f64) -> String {
    good(dir, &[&["init"], inputs, &["-o", "s.toml", "--force"]].concat());
    let written = psnr(dir, "s.toml");
    assert!(written >= least, "{inputs:?}: {written}");
    let picture = std::fs::read(dir.join("o.png")).unwrap();
    if let [folder] = inputs {
        assert_eq!(psnr(dir, folder), written);
        assert_eq!(std::fs::read(dir.join("o.png")).unwrap(), picture);
    }
    std::fs::read_to_string(dir.join("s.toml")).unwrap()
}

#[test]
fn two_photographs_are_a_rig() {
    let dir = photographs(&[("left.png", "a.png"), ("right.png", "b.png")]);
    let scene = is_rendered(dir.path(), &["set"], 27.0);
    assert_eq!(scene.matches("disparity = \"matched\"").count(), 2, "{scene}");
    assert_eq!(is_rendered(dir.path(), &["set/a.png", "set/b.png"], 27.0), scene);
}

/// A COLMAP workspace of three cameras side by side, without depth maps; truth.png is the view half-way
/// between the first two.
fn workspace() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    for folder in ["set/images", "set/sparse/0"] {
        std::fs::create_dir_all(at(folder)).unwrap();
    }
    let cameras = format!("1 PINHOLE {} {} 108 108 60 45\n", SIZE.0, SIZE.1);
    let places = [("a.png", -0.15), ("b.png", 0.15), ("c.png", 0.45), ("truth.png", 0.0)];
    let line = |(k, (name, x)): (usize, &(&str, f64))| format!("{} 1 0 0 0 {} 0 0 1 {name}\n\n", k + 1, -x);
    let all: String = places.iter().enumerate().map(line).collect();
    let views: String = places[..3].iter().enumerate().map(line).collect();
    let model = parse_model(&cameras, &all, Path::new("m")).unwrap();
    let mut points = String::new();
    for frame in &model.frames {
        let camera = model.camera(frame, SIZE).unwrap().camera;
        let (photograph, depth) = SyntheticScene::default().view(&camera, SIZE);
        let name = frame.image.to_str().unwrap();
        let id = places.iter().position(|place| place.0 == name).unwrap() + 1;
        if id == 4 {
            save(&photograph, &at("truth.png")).unwrap();
            continue;
        }
        save(&photograph, &at("set/images").join(name)).unwrap();
        for p in (7 * id..SIZE.0 * SIZE.1).step_by(31) {
            let (x, y) = (p % SIZE.0, p / SIZE.0);
            let point = camera.unproject(x as f64, y as f64, f64::from(depth.data()[p]));
            points += &format!("{p} {} {} {} 9 9 9 0.1 {id} 0\n", point.x, point.y, point.z);
        }
    }
    std::fs::write(at("set/sparse/0/cameras.txt"), cameras).unwrap();
    std::fs::write(at("set/sparse/0/images.txt"), views).unwrap();
    std::fs::write(at("set/sparse/0/points3D.txt"), points).unwrap();
    dir
}

#[test]
fn a_workspace_of_colmap_is_matched_or_takes_its_points() {
    let dir = workspace();
    let scene = is_rendered(dir.path(), &["set"], 27.0);
    assert!(scene.contains("colmap = \"set/sparse/0\"") && scene.contains("set/images/c.png"), "{scene}");
    std::fs::write(dir.path().join("s.toml"), scene.replace("\"matched\"", "\"points\"")).unwrap();
    let of_points = psnr(dir.path(), "s.toml");
    assert!(of_points > 25.0, "{of_points}");
    std::fs::remove_file(dir.path().join("set/sparse/0/points3D.txt")).unwrap();
    refused(dir.path(), &["render", "s.toml", "-o", "p.png"], 1, &["points3D.txt", "points3D.bin"]);
}

/// All files of a model are inputs, also those that are not read.
#[test]
fn no_file_of_a_model_is_replaced() {
    let dir = workspace();
    let of_model = |name: &str| format!("set/sparse/0/{name}");
    for name in ["cameras.txt", "images.txt", "points3D.txt", "points3D.bin", "frames.bin", "rigs.bin"] {
        let path = of_model(name);
        if !dir.path().join(&path).exists() {
            std::fs::write(dir.path().join(&path), "kept").unwrap();
        }
        let before = std::fs::read(dir.path().join(&path)).unwrap();
        let words = [name, "it is also the input"];
        refused(dir.path(), &["init", "set", "-o", &path, "--force"], 1, &words);
        let depth = ["render", "set", "-o", "o.png", "--depth", "d.pfm", "--force"];
        std::fs::hard_link(dir.path().join(&path), dir.path().join("d.pfm")).unwrap();
        refused(dir.path(), &depth, 1, &["d.pfm", "it is also the input"]);
        std::fs::remove_file(dir.path().join("d.pfm")).unwrap();
        assert_eq!(std::fs::read(dir.path().join(&path)).unwrap(), before, "{name}");
    }
}

#[test]
fn transforms_are_a_scene() {
    let dir = workspace();
    let at = |name: &str| dir.path().join(name);
    let frame = |name: &str, x: f64| {
        format!(
            "{{\"file_path\": \"images/{name}\", \"transform_matrix\": [[1, 0, 0, {x}], [0, -1, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]]}}"
        )
    };
    let frames = [frame("a.png", -0.15), frame("b.png", 0.15), frame("c.png", 0.45)].join(", ");
    let list = format!("{{\"fl_x\": 108, \"cx\": 60, \"cy\": 45, \"frames\": [{frames}]}}");
    std::fs::write(at("set/transforms.json"), list).unwrap();
    let scene = is_rendered(dir.path(), &["set"], 27.0);
    assert!(scene.contains("transforms = \"set/transforms.json\""), "{scene}");
    assert_eq!(is_rendered(dir.path(), &["set/transforms.json"], 27.0), scene);
}

#[test]
fn a_scene_file_in_the_folder_is_taken() {
    let dir = rig();
    let output = good(dir.path(), &["render", ".", "-o", "o.png"]);
    assert!(stderr(&output).contains("scene.toml"), "{}", stderr(&output));
}
