//! COLMAP models on the command line: binary ones with their own depth maps, and what users get wrong.

use super::*;
use hybank_ibr::camera::colmap::parse_model;
use hybank_ibr::image::Image;

/// Columns of the three cameras, along x.
const PLACES: [f64; 3] = [-0.2, 0.2, 0.0];
/// The camera of all images as COLMAP writes it: focal lengths and principal point.
const INNER: [f64; 4] = [108.0, 108.0, 60.0, 45.0];

/// The text of cameras.txt, for images of this size.
fn cameras(size: (usize, usize), [fx, fy, cx, cy]: [f64; 4]) -> String {
    format!("1 PINHOLE {} {} {fx} {fy} {cx} {cy}\n", size.0, size.1)
}

/// The text of images.txt.
fn images(names: [&str; 3]) -> String {
    let line = |(k, name): (usize, &str)| format!("{k} 1 0 0 0 {} 0 0 1 {name}\n\n", -PLACES[k]);
    names.into_iter().enumerate().map(line).collect()
}

/// The three photographs and depth maps of the synthetic scene, of this size.
fn photographs(size: (usize, usize), inner: [f64; 4]) -> Vec<(Image, DepthMap)> {
    let names = ["0", "1", "2"];
    let model = parse_model(&cameras(size, inner), &images(names), Path::new("m")).unwrap();
    let camera = |frame| model.camera(frame, size).unwrap().camera;
    model.frames.iter().map(|frame| SyntheticScene::default().view(&camera(frame), size)).collect()
}

/// A text model in `model`, photographs in `photos` and depth maps `0.pfm` to `2.pfm`; the scene has a view
/// of each.
fn folder(names: [&str; 3]) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    std::fs::create_dir(at("model")).unwrap();
    std::fs::write(at("model/cameras.txt"), cameras(SIZE, INNER)).unwrap();
    std::fs::write(at("model/images.txt"), images(names)).unwrap();
    let mut scene = "colmap = \"model\"\n".to_string();
    for (k, (photograph, depth)) in photographs(SIZE, INNER).iter().enumerate() {
        let path = at("photos").join(names[k]);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        save(photograph, &path).unwrap();
        write_map(depth, &at(&format!("{k}.pfm")));
        scene += &format!("[[view]]\nimage = \"photos/{}\"\ndepth = \"{k}.pfm\"\n", names[k]);
    }
    std::fs::write(at("s.toml"), scene).unwrap();
    dir
}

fn psnr(dir: &Path, arguments: &[&str]) -> f64 {
    let common = ["render", "s.toml", "-o", "o.png", "--force", "--json"];
    json(&run(dir, &[&common[..], arguments].concat()))["psnr"].as_f64().unwrap()
}

fn replace(dir: &Path, from: &str, to: &str) {
    let scene = std::fs::read_to_string(dir.join("s.toml")).unwrap();
    assert!(scene.contains(from), "{scene}");
    std::fs::write(dir.join("s.toml"), scene.replace(from, to)).unwrap();
}

const FLAT: [&str; 3] = ["a.png", "b.png", "c.png"];

/// A binary model and the `.geometric.bin` maps of its dense reconstruction, where unknown depths are 0: the
/// view is that of the text model with the same depths.
#[test]
fn binary_models_and_their_depth_maps_are_rendered() {
    let dir = folder(FLAT);
    let at = |name: &str| dir.path().join(name);
    let truth = ["--view", "photos/c.png", "--truth", "photos/c.png"];
    let want = psnr(dir.path(), &truth);
    let picture = std::fs::read(at("o.png")).unwrap();
    let workspace = at("dense/stereo/depth_maps");
    std::fs::create_dir_all(&workspace).unwrap();
    std::fs::create_dir(at("dense/sparse")).unwrap();
    let put = |bytes: &mut Vec<u8>, values: &[f64]| values.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
    let mut inner = 1_u64.to_le_bytes().to_vec();
    inner.extend(1_u32.to_le_bytes());
    inner.extend(1_i32.to_le_bytes());
    [SIZE.0 as u64, SIZE.1 as u64].iter().for_each(|side| inner.extend(side.to_le_bytes()));
    put(&mut inner, &INNER);
    let mut poses = 3_u64.to_le_bytes().to_vec();
    for (k, name) in FLAT.iter().enumerate() {
        poses.extend((k as u32).to_le_bytes());
        put(&mut poses, &[1.0, 0.0, 0.0, 0.0, -PLACES[k], 0.0, 0.0]);
        poses.extend(1_u32.to_le_bytes());
        poses.extend(format!("{name}\0").as_bytes());
        poses.extend(1_u64.to_le_bytes());
        put(&mut poses, &[7.0, 8.0]);
        poses.extend((-1_i64).to_le_bytes());
        let map = pfm::decode(&std::fs::read(at(&format!("{k}.pfm"))).unwrap()).unwrap();
        let mut bytes = format!("{}&{}&1&", map.width(), map.height()).into_bytes();
        map.data().iter().for_each(|depth| bytes.extend(depth.to_le_bytes()));
        std::fs::write(workspace.join(format!("{name}.geometric.bin")), bytes).unwrap();
        replace(dir.path(), &format!("{k}.pfm"), &format!("dense/stereo/depth_maps/{name}.geometric.bin"));
    }
    std::fs::write(at("dense/sparse/cameras.bin"), inner).unwrap();
    std::fs::write(at("dense/sparse/images.bin"), poses).unwrap();
    replace(dir.path(), "\"model\"", "\"dense/sparse\"");
    assert!(want > 31.0 && (psnr(dir.path(), &truth) - want).abs() < 1e-9, "{want}");
    assert!(std::fs::read(at("o.png")).unwrap() == picture);
    // Depths that the reconstruction does not know are 0: here 1000 in the upper rows. They take the
    // farthest depths around them, and the other view decides.
    let hole = 500..1500;
    let path = workspace.join("a.png.geometric.bin");
    let mut bytes = std::fs::read(&path).unwrap();
    let header = bytes.len() - 4 * SIZE.0 * SIZE.1;
    bytes[header + 4 * hole.start..header + 4 * hole.end].fill(0);
    std::fs::write(&path, bytes).unwrap();
    let done = run(dir.path(), &["render", "s.toml", "--view", "c.png", "-o", "p.png", "--json"]);
    assert_eq!(json(&done)["filled_depths"], hole.len());
    let filled = psnr(dir.path(), &truth);
    assert!(filled > want - 0.5, "{filled} {want}");
    std::fs::write(at("dense/sparse/images.bin"), [1; 9]).unwrap();
    refused(
        dir.path(),
        &["render", "s.toml", "--view", "c.png", "-o", "q.png"],
        1,
        &["images.bin", "record"],
    );
}

/// Photographs of half the size that the model is for: the cameras are scaled with them.
#[test]
fn cameras_are_scaled_to_their_photographs() {
    let dir = folder(FLAT);
    let at = |name: &str| dir.path().join(name);
    let (small, inner) = ((60, 45), INNER.map(|v| v / 2.0));
    for (k, (photograph, depth)) in photographs(small, inner).iter().enumerate() {
        save(photograph, &at("photos").join(FLAT[k])).unwrap();
        write_map(depth, &at(&format!("{k}.pfm")));
    }
    let truth = ["--view", "c.png", "--truth", "photos/c.png"];
    let done =
        run(dir.path(), &[&["render", "s.toml", "-o", "o.png", "--force", "--json"][..], &truth].concat());
    let message = stderr(&done);
    assert!(
        message.contains("cameras of 2 views are scaled from images of 120 x 90 to 60 x 45"),
        "{message}"
    );
    let scaled = std::fs::read(at("o.png")).unwrap();
    // The same with the camera of an image that is no view, whose size follows that of the views.
    let whole = std::fs::read_to_string(at("s.toml")).unwrap();
    let two = whole.split("[[view]]").take(3).collect::<Vec<_>>().join("[[view]]");
    std::fs::write(at("two.toml"), two.clone() + "[virtual]\ncamera_of = \"c.png\"\n").unwrap();
    good(dir.path(), &["render", "two.toml", "-o", "two.png"]);
    assert!(std::fs::read(at("two.png")).unwrap() == scaled);
    std::fs::write(at("place.toml"), two).unwrap();
    good(dir.path(), &["render", "place.toml", "--view", "c.png", "-o", "place.png"]);
    assert!(std::fs::read(at("place.png")).unwrap() == scaled);
    // A model of the small photographs says the same, without a note.
    std::fs::write(at("model/cameras.txt"), cameras(small, inner)).unwrap();
    let plain = psnr(dir.path(), &truth);
    assert!(std::fs::read(at("o.png")).unwrap() == scaled && plain > 28.0, "{plain}");
    assert!(stderr(&run(dir.path(), &["render", "s.toml", "--view", "c.png", "-o", "p.png"])).is_empty());
    std::fs::write(at("model/cameras.txt"), cameras((45, 60), inner)).unwrap();
    let render = ["render", "s.toml", "--view", "c.png", "-o", "x.png"];
    refused(dir.path(), &render, 1, &["view \"photos/a.png\"", "60 x 45", "45 x 60", "same factor"]);
}
