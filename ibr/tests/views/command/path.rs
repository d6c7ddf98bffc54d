//! Frames of a camera path, one after the other: what changes from frame to frame is the scene, not the
//! rendering.

use super::*;
use hybank_ibr::image::Image;

/// Unequal distances between the views, and photographs that are brighter or darker by so many grey levels:
/// whichever view enters or leaves too suddenly changes the brightness of the frames.
const VIEWS: [(f64, f32); 4] = [(0.0, -10.0), (0.3, 0.0), (1.1, 10.0), (1.5, -10.0)];
/// Ends of the path, and its frames.
const ENDS: [f64; 2] = [-0.2, 1.7];
const FRAMES: usize = 77;

fn position(frame: usize) -> f64 {
    ENDS[0] + (ENDS[1] - ENDS[0]) * frame as f64 / (FRAMES - 1) as f64
}

fn shot(position: f64) -> (Image, DepthMap) {
    let camera = Camera::metric(rig_camera(position, SIZE), false).unwrap();
    SyntheticScene::default().view(&camera, SIZE)
}

fn matrix(position: f64) -> String {
    let m = rig_camera(position, SIZE);
    let row = |i: usize| format!("[{:?}, {:?}, {:?}, {:?}]", m[(i, 0)], m[(i, 1)], m[(i, 2)], m[(i, 3)]);
    format!("[{}, {}, {}]", row(0), row(1), row(2))
}

/// The views as a rectified rig and as general cameras, with the path from end to end.
fn scenes() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let (mut rig, mut general) = (String::new(), String::new());
    for (k, (place, brighter)) in VIEWS.into_iter().enumerate() {
        let (mut photograph, depth) = shot(place);
        photograph.data_mut().iter_mut().for_each(|v| *v += brighter);
        save(&photograph, &dir.path().join(format!("{k}.png"))).unwrap();
        write_map(&depth, &dir.path().join(format!("z{k}.pfm")));
        write_map(&rig_disparity(&depth, SIZE.0), &dir.path().join(format!("d{k}.pfm")));
        let image = format!("[[view]]\nname = \"{k}\"\nimage = \"{k}.png\"\n");
        rig += &format!("{image}position = {place:?}\ndisparity = \"d{k}.pfm\"\n");
        general += &format!("{image}camera = {}\ndepth = \"z{k}.pfm\"\n", matrix(place));
    }
    let [from, to] = ENDS;
    rig += &format!("[virtual]\nposition = {from:?}\nto_position = {to:?}\nframes = {FRAMES}\n");
    let ends = format!("camera = {}\nto_camera = {}\n", matrix(from), matrix(to));
    general += &format!("[virtual]\n{ends}frames = {FRAMES}\n");
    std::fs::write(dir.path().join("rig.toml"), rig).unwrap();
    std::fs::write(dir.path().join("general.toml"), general).unwrap();
    dir
}

fn pixels(path: &Path) -> Vec<f32> {
    pfm::decode(&std::fs::read(path).unwrap()).unwrap().data().iter().map(|v| 255.0 * v).collect()
}

/// By how many grey levels the frames are brighter than the scene, and the root mean square difference of
/// the changes from frame to frame of both.
fn errors(frames: &[Vec<f32>], truth: &[Vec<f32>]) -> (Vec<f64>, Vec<f64>) {
    let error = |k: usize| frames[k].iter().zip(&truth[k]).map(|(a, b)| f64::from(a - b));
    let count = truth[0].len() as f64;
    let brighter = (0..frames.len()).map(|k| error(k).sum::<f64>() / count).collect();
    let change = |k: usize| error(k + 1).zip(error(k)).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
    let changes = (0..frames.len() - 1).map(|k| (change(k) / count).sqrt()).collect();
    (brighter, changes)
}

/// The largest step of the brightness and of the content from a frame to the next.
fn largest_steps(frames: &[Vec<f32>], truth: &[Vec<f32>], what: &str) -> (f64, f64) {
    let (brighter, changes) = errors(frames, truth);
    let most = |all: &mut dyn Iterator<Item = f64>| all.fold(0.0, f64::max);
    let step = most(&mut brighter.windows(2).map(|pair| (pair[1] - pair[0]).abs()));
    let change = most(&mut changes.iter().copied());
    println!("{what}: steps of brightness up to {step:.2}, changes up to {change:.2} grey levels");
    println!("  {brighter:.2?}");
    (step, change)
}

/// All frames of a path that passes through every view and beyond both ends.
#[test]
fn a_path_does_not_pulse_from_frame_to_frame() {
    let dir = scenes();
    let truth: Vec<Vec<f32>> = (0..FRAMES).map(|k| shot(position(k)).0.data().to_vec()).collect();
    let all = [("rig", "4"), ("general", "2"), ("rig", "2"), ("general", "4")];
    let count = if trials::is_slow("paths through few and many views of both scenes") { 4 } else { 2 };
    for (scene, nearest) in all.into_iter().take(count) {
        let (file, output) = (format!("{scene}.toml"), format!("{scene}-{nearest}.pfm"));
        let arguments = ["render", &file, "-o", &output, "--nearest", nearest, "--keep-exposure"];
        good(dir.path(), &arguments);
        let frame = |k: usize| pixels(&dir.path().join(format!("{scene}-{nearest}-{:04}.pfm", k + 1)));
        let frames: Vec<Vec<f32>> = (0..FRAMES).map(frame).collect();
        let what = format!("{scene}, nearest {nearest}");
        let (step, change) = largest_steps(&frames, &truth, &what);
        assert!(step < 3.0 && change < 5.0, "{what}: {step} {change}");
    }
}
