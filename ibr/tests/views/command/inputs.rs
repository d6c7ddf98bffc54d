//! Inputs as other programs write them: lists of virtual cameras, masks, meshes, views without a map.

use super::*;
use hybank_ibr::image::{MOST_PIXELS, read_image};
use nalgebra::Matrix3x4;

const FOCAL: f64 = 108.0;

/// Places of the cameras along x; the last one has no photograph in the list.
const PLACES: [(&str, f64); 4] = [("a.png", -0.15), ("b.png", 0.15), ("c.png", 0.45), ("truth.png", 0.0)];

fn camera(x: f64) -> Camera {
    let (cx, cy) = (SIZE.0 as f64 / 2.0 - 0.5, SIZE.1 as f64 / 2.0 - 0.5);
    let matrix = Matrix3x4::new(FOCAL, 0.0, cx, -FOCAL * x, 0.0, FOCAL, cy, 0.0, 0.0, 0.0, 1.0, 0.0);
    Camera::metric(matrix, false).unwrap()
}

/// Rows of the matrix to the world of a camera that looks along z, as OpenGL has it.
fn pose(x: f64) -> String {
    format!("[1, 0, 0, {x}], [0, -1, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]")
}

fn list(places: &[(&str, f64)], extra: impl Fn(&str) -> String) -> String {
    let frame = |(name, x): &(&str, f64)| {
        format!("{{\"file_path\": \"{name}\", {}\"transform_matrix\": [{}]}}", extra(name), pose(*x))
    };
    let frames: Vec<String> = places.iter().map(frame).collect();
    let (w, h) = SIZE;
    format!("{{\"w\": {w}, \"h\": {h}, \"fl_x\": {FOCAL}, \"frames\": [{}]}}", frames.join(", "))
}

/// A camera path of nerfstudio with cameras at these places.
pub(super) fn camera_path(places: &[f64]) -> String {
    let fov = 2.0 * (SIZE.1 as f64 / 2.0 / FOCAL).atan().to_degrees();
    let one =
        |x: &f64| format!("{{\"camera_to_world\": [{}], \"fov\": {fov}}}", pose(*x).replace(['[', ']'], ""));
    let all: Vec<String> = places.iter().map(one).collect();
    let (w, h) = SIZE;
    format!("{{\"render_width\": {w}, \"render_height\": {h}, \"camera_path\": [{}]}}", all.join(", "))
}

/// A folder `set` of three photographs with depth and transforms.json; truth.png is a view between them.
pub(super) fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let set = dir.path().join("set");
    std::fs::create_dir(&set).unwrap();
    for (name, x) in PLACES {
        let (image, depth) = SyntheticScene::default().view(&camera(x), SIZE);
        if name == "truth.png" {
            save(&image, &dir.path().join(name)).unwrap();
            continue;
        }
        save(&image, &set.join(name)).unwrap();
        write_map(&depth, &set.join(name).with_extension("pfm"));
    }
    let depth = |name: &str| format!("\"depth_file_path\": \"{}\", ", name.replace("png", "pfm"));
    std::fs::write(set.join("transforms.json"), list(&PLACES[..3], depth)).unwrap();
    dir
}

/// The first line of a scene: its views, and the virtual view at the place of the truth.
fn scene(views: &str) -> String {
    let matrix = *camera(0.0).matrix();
    let row = |i: usize| format!("{:?}", [0, 1, 2, 3].map(|k| matrix[(i, k)]));
    let rows = [row(0), row(1), row(2)].join(", ");
    format!(
        "transforms = \"set/transforms.json\"\n{views}[virtual]\ncamera = [{rows}]\nsize = [{}, {}]\n",
        SIZE.0, SIZE.1
    )
}

fn psnr(dir: &Path, scene: &str) -> f64 {
    std::fs::write(dir.join("s.toml"), scene).unwrap();
    let output = good(dir, &["render", "s.toml", "-o", "o.png", "--force", "--json", "--truth", "truth.png"]);
    json(&output)["psnr"].as_f64().unwrap()
}

fn picture(dir: &Path, name: &str) -> Vec<u8> {
    std::fs::read(dir.join(name)).unwrap()
}

#[test]
fn init_writes_the_place_of_a_view() {
    let dir = folder();
    good(dir.path(), &["init", "set", "--view", "b.png", "-o", "s.toml"]);
    good(dir.path(), &["render", "s.toml", "-o", "written.png"]);
    good(dir.path(), &["render", "set", "--view", "b.png", "-o", "left_out.png"]);
    assert!(picture(dir.path(), "written.png") == picture(dir.path(), "left_out.png"));
    refused(dir.path(), &["init", "set", "--view", "z.png", "-o", "t.toml"], 1, &["no image \"z.png\""]);
    let pair = ["init", "set/a.png", "set/b.png", "--view", "b.png", "-o", "t.toml"];
    refused(dir.path(), &pair, 1, &["b.png", "shows no depth"]);
}

/// A thing that is in one photograph only, and that a mask or the alpha channel takes out.
#[test]
fn masked_pixels_are_unknown() {
    let dir = folder();
    let views = |mask: &str| {
        let view = |name: &str| {
            let mask = if name == "a" { mask } else { "" };
            format!("[[view]]\nimage = \"set/{name}.png\"\ndepth = \"set/{name}.pfm\"\n{mask}")
        };
        ["a", "b", "c"].map(view).concat()
    };
    let clean = psnr(dir.path(), &scene(&views("")));
    let photograph = read_image(&dir.path().join("set/a.png"), MOST_PIXELS).unwrap();
    let is_thing = |p: usize| (30..60).contains(&(p % SIZE.0)) && (20..60).contains(&(p / SIZE.0));
    let rgb = |p: usize| if is_thing(p) { [255, 0, 0] } else { photograph.pixel::<3>(p).map(|v| v as u8) };
    let pixels = SIZE.0 * SIZE.1;
    let encode = |name: &str, kind: image::ExtendedColorType, bytes: Vec<u8>| {
        let path = dir.path().join(name);
        image::save_buffer(path, &bytes, SIZE.0 as u32, SIZE.1 as u32, kind).unwrap();
    };
    let mask = (0..pixels).map(|p| if is_thing(p) { 0 } else { 255 }).collect();
    encode("mask.png", image::ExtendedColorType::L8, mask);
    encode("set/a.png", image::ExtendedColorType::Rgb8, (0..pixels).flat_map(rgb).collect());
    let with_thing = psnr(dir.path(), &scene(&views("")));
    let masked = psnr(dir.path(), &scene(&views("mask = \"mask.png\"\n")));
    assert!(with_thing < clean - 6.0 && masked > clean - 2.5, "{clean} {with_thing} {masked}");
    let masked = picture(dir.path(), "o.png");
    // The same by transparency, and by the list of a folder.
    let json = std::fs::read_to_string(dir.path().join("set/transforms.json")).unwrap();
    let evaluated = || {
        let figures = super::json(&run(dir.path(), &["evaluate", "set", "--every", "3", "--json"]));
        figures["psnr"].as_f64().unwrap()
    };
    let with_thing = evaluated();
    let listed =
        json.replacen("\"depth_file_path\"", "\"mask_path\": \"../mask.png\", \"depth_file_path\"", 1);
    std::fs::write(dir.path().join("set/transforms.json"), listed).unwrap();
    psnr(dir.path(), &scene(""));
    assert!(picture(dir.path(), "o.png") == masked);
    // What is no part of the scene is not compared either.
    assert!(evaluated() > with_thing + 6.0, "{} {with_thing}", evaluated());
    std::fs::write(dir.path().join("set/transforms.json"), json).unwrap();
    let rgba = |p: usize| rgb(p).into_iter().chain([if is_thing(p) { 0 } else { 255 }]);
    encode("set/a.png", image::ExtendedColorType::Rgba8, (0..pixels).flat_map(rgba).collect());
    psnr(dir.path(), &scene(&views("")));
    assert!(picture(dir.path(), "o.png") == masked);
}

#[test]
fn a_view_without_a_map_takes_the_depths_of_the_others() {
    let dir = folder();
    let view = |name: &str, has_map: bool| {
        let depth = if has_map { format!("depth = \"set/{name}.pfm\"\n") } else { String::new() };
        format!("[[view]]\nimage = \"set/{name}.png\"\n{depth}")
    };
    let all = psnr(dir.path(), &scene(&(view("a", true) + &view("b", true) + &view("c", true))));
    let two = psnr(dir.path(), &scene(&(view("b", true) + &view("c", true))));
    let lacking = psnr(dir.path(), &scene(&(view("a", false) + &view("b", true) + &view("c", true))));
    assert!(lacking > all - 3.5 && lacking > two + 3.0, "{all} {lacking} {two}");
    std::fs::write(dir.path().join("none.toml"), scene(&(view("a", false) + &view("b", false)))).unwrap();
    refused(dir.path(), &["render", "none.toml", "-o", "x.png"], 1, &["no `depth`", "\"matched\""]);
}
