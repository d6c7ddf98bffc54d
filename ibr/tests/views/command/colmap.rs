//! COLMAP models on the command line: photographs of another size than that of their cameras.

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

const FLAT: [&str; 3] = ["a.png", "b.png", "c.png"];

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
