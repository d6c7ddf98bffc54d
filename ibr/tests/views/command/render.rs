//! Renderings of each kind of scene.

use super::*;
use hybank_ibr::image::{Image, MOST_PIXELS, read_image};
use nalgebra::Matrix3x4;

#[test]
fn a_rig_is_rendered_and_compared() {
    let dir = rig();
    let done = run(dir.path(), &["render", "scene.toml", "-o", "out.png", "--truth", "middle.png", "--json"]);
    let figures = json(&done);
    assert!(done.stderr.is_empty(), "{}", stderr(&done));
    let number = |key: &str| figures[key].as_f64().unwrap();
    assert!(number("psnr") > 33.0 && number("ssim") > 0.93 && number("mae") < 3.0, "{figures}");
    assert!(number("coverage") > 0.95 && number("seconds") > 0.0, "{figures}");
    assert_adds_up(&figures, 2 * 120 * 90);
    assert_eq!(read_image(&dir.path().join("out.png"), MOST_PIXELS).unwrap().size(), SIZE);
}

/// Swapped positions and a missing scale render without an error; the warning names what to check.
#[test]
fn inputs_that_do_not_fit_are_warned_about() {
    let dir = rig();
    let scene = std::fs::read_to_string(dir.path().join("scene.toml")).unwrap();
    let run_with = |text: String| {
        std::fs::write(dir.path().join("wrong.toml"), text).unwrap();
        run(dir.path(), &["render", "wrong.toml", "-o", "out.png", "--force", "--json"])
    };
    let right = run_with(scene.clone());
    assert!(json(&right)["agreement"]["pairs"][0]["share"].as_f64().unwrap() > 0.8, "{}", json(&right));
    assert!(right.stderr.is_empty(), "{}", stderr(&right));
    let swapped =
        scene.replace("position = 0.0", "position = 9.0").replace("position = 1.0", "position = 0.0");
    let swapped = run_with(swapped.replace("position = 9.0", "position = 1.0"));
    assert!(
        stderr(&swapped).contains("views 1 and 2 agree in depth and colour at only"),
        "{}",
        stderr(&swapped)
    );
    assert!(stderr(&swapped).contains("positions (swapped?)"), "{}", stderr(&swapped));
    let scaled = run_with(scene.replace("disparity =", "disparity_scale = 0.25\ndisparity ="));
    assert!(stderr(&scaled).contains("disparity_scale"), "{}", stderr(&scaled));
}

/// Cameras that converge by shifted principal points: the right image lies `SHIFT` columns further right,
/// all disparities are lower by as much, and some are negative. The virtual image moves by half of that.
#[test]
fn converged_rigs_have_negative_disparities() {
    const SHIFT: usize = 6;
    let dir = rig();
    let lower = |name: &str, columns: usize| {
        let path = dir.path().join(format!("{name}.pfm"));
        let mut map = pfm::decode(&std::fs::read(&path).unwrap()).unwrap();
        let before = map.data().to_vec();
        for (i, v) in map.data_mut().iter_mut().enumerate() {
            let from = (i % SIZE.0).saturating_sub(columns);
            *v = before[i - i % SIZE.0 + from] - SHIFT as f32;
        }
        assert!(map.data().iter().any(|v| *v < 0.0) && map.data().iter().any(|v| *v > 0.0));
        std::fs::write(path, pfm::encode(&map)).unwrap();
    };
    let shift_image = |name: &str, columns: usize| {
        let path = dir.path().join(format!("{name}.png"));
        let image = read_image(&path, MOST_PIXELS).unwrap();
        let pixel = |i: usize| {
            let from = i - i % SIZE.0 + (i % SIZE.0).saturating_sub(columns);
            image.data()[3 * from..3 * from + 3].to_vec()
        };
        let data = (0..SIZE.0 * SIZE.1).flat_map(pixel).collect();
        save(&Image::new(SIZE.0, SIZE.1, 3, data).unwrap(), &path).unwrap();
    };
    let render = |scene: &str| {
        json(&run(
            dir.path(),
            &["render", scene, "-o", "o.png", "--force", "--json", "--truth", "middle.png"],
        ))
    };
    let plain = render("scene.toml");
    lower("left", 0);
    lower("right", SHIFT);
    shift_image("right", SHIFT);
    shift_image("middle", SHIFT / 2);
    let scene = std::fs::read_to_string(dir.path().join("scene.toml")).unwrap();
    let placed = scene.replace("disparity =", &format!("disparity_offset = {SHIFT}.0\ndisparity ="));
    std::fs::write(dir.path().join("placed.toml"), placed).unwrap();
    let psnr = |figures: &serde_json::Value| figures["psnr"].as_f64().unwrap();
    let (with, without) = (render("placed.toml"), render("scene.toml"));
    // The columns that the shift pushed out of the right image are missing at the border.
    assert!(psnr(&with) > psnr(&plain) - 5.0, "{plain} {with}");
    assert!(psnr(&without) > psnr(&with) - 1.0, "{with} {without}");
    assert_eq!(without["samples"]["dropped"]["unknown"], 0, "{without}");
}

/// The depth of the virtual view against that of the ray tracer, and an image of 16 bits.
#[test]
fn depth_and_sixteen_bits_are_written() {
    let dir = rig();
    let arguments = [
        "render",
        "scene.toml",
        "-o",
        "deep.png",
        "--bits",
        "16",
        "--depth",
        "d.pfm",
        "--json",
        "--truth",
        "middle.png",
    ];
    let figures = json(&run(dir.path(), &arguments));
    assert!(figures["psnr"].as_f64().unwrap() > 33.0);
    let read = |name: &str| pfm::decode(&std::fs::read(dir.path().join(name)).unwrap()).unwrap();
    let (depth, exact) = (read("d.pfm"), read("middle.pfm"));
    let near = depth.data().iter().zip(exact.data()).filter(|(a, b)| (*a - *b).abs() < 0.25).count();
    assert!(near as f64 > 0.95 * exact.data().len() as f64, "{near} of {}", exact.data().len());
    let unknown = depth.data().iter().filter(|d| d.is_nan()).count();
    assert_eq!(
        unknown as u64,
        figures["holes"]["crack"].as_u64().unwrap() + figures["holes"]["disocclusion"].as_u64().unwrap()
    );
    let deep = read_image(&dir.path().join("deep.png"), MOST_PIXELS).unwrap();
    assert!(deep.data().iter().any(|v| (v - v.round()).abs() > 0.1), "more than 256 levels");
    for (name, value, words) in [
        ("--depth", "d.png", "depth is written as .pfm"),
        ("--depth", "-", "cannot go to standard output"),
        ("--bits", "12", "possible values: 8, 16"),
    ] {
        let refused = run(dir.path(), &["render", "scene.toml", "-o", "x.png", name, value]);
        assert_eq!(code(&refused), 2);
        assert!(stderr(&refused).contains(words), "{}", stderr(&refused));
    }
    let refused = run(dir.path(), &["render", "scene.toml", "-o", "x.jpg", "--bits", "16"]);
    assert!(code(&refused) == 2 && stderr(&refused).contains(".png files only"), "{}", stderr(&refused));
}

#[test]
fn files_are_not_overwritten_and_appear_whole() {
    let dir = rig();
    let out = dir.path().join("out.png");
    std::fs::write(&out, "precious").unwrap();
    let refused = run(dir.path(), &["render", "scene.toml", "-o", "out.png"]);
    assert_eq!(code(&refused), 1);
    assert!(stderr(&refused).contains("out.png exists; use --force to overwrite it"), "{}", stderr(&refused));
    assert_eq!(std::fs::read_to_string(&out).unwrap(), "precious");
    let failed = run(dir.path(), &["render", "scene.toml", "-o", "new.png", "--view", "nobody"]);
    assert_eq!(code(&failed), 1);
    assert!(!dir.path().join("new.png").exists());
    let forced = run(dir.path(), &["render", "scene.toml", "-o", "out.png", "--force"]);
    assert_eq!(code(&forced), 0, "{}", stderr(&forced));
    assert!(String::from_utf8(forced.stdout).unwrap().contains("coverage"));
    assert!(
        std::fs::read_dir(dir.path()).unwrap().all(|e| !e
            .unwrap()
            .file_name()
            .to_string_lossy()
            .ends_with(".part"))
    );
}

#[test]
fn a_view_is_left_out_and_depth_may_be_coarse() {
    let dir = rig();
    let with_middle = std::fs::read_to_string(dir.path().join("scene.toml")).unwrap().replace(
        "[virtual]\nposition = 0.5\n",
        "[[view]]\nname = \"middle\"\nimage = \"middle.png\"\nposition = 0.5\n",
    );
    std::fs::write(dir.path().join("three.toml"), with_middle).unwrap();
    let arguments = ["render", "three.toml", "--view", "middle", "--truth", "middle.png", "--json", "-o"];
    let full = json(&run(dir.path(), &[&arguments[..], &["a.png"]].concat()));
    let coarse = json(&run(dir.path(), &[&arguments[..], &["b.png", "--depth-step", "6"]].concat()));
    let direct = run(dir.path(), &["render", "scene.toml", "-o", "c.png"]);
    assert_eq!(code(&direct), 0);
    let bytes = |name: &str| std::fs::read(dir.path().join(name)).unwrap();
    assert_eq!(bytes("a.png"), bytes("c.png"), "the same view, asked for in two ways");
    let psnr = |v: &serde_json::Value| v["psnr"].as_f64().unwrap();
    assert!(psnr(&full) > 33.0 && psnr(&coarse) > 26.0 && psnr(&coarse) < psnr(&full), "{full} {coarse}");
}

#[test]
fn threads_change_no_byte_and_streams_work() {
    let dir = rig();
    for (threads, name) in [("1", "a.png"), ("2", "b.png"), ("5", "c.png")] {
        let done = run(dir.path(), &["render", "scene.toml", "-o", name, "--threads", threads]);
        assert_eq!(code(&done), 0, "{}", stderr(&done));
    }
    let bytes = |name: &str| std::fs::read(dir.path().join(name)).unwrap();
    assert!(bytes("a.png") == bytes("b.png") && bytes("a.png") == bytes("c.png"));
    let piped = run(dir.path(), &["render", "scene.toml", "-o", "-"]);
    assert_eq!(piped.stdout, bytes("a.png"));
    assert!(stderr(&piped).contains("coverage"));
}

fn toml_rows(m: &Matrix3x4<f64>) -> String {
    let row = |i: usize| format!("[{:?}, {:?}, {:?}, {:?}]", m[(i, 0)], m[(i, 1)], m[(i, 2)], m[(i, 3)]);
    format!("[{}, {}, {}]", row(0), row(1), row(2))
}

/// Three cameras that are turned and moved in all directions.
fn turned(k: usize) -> Matrix3x4<f64> {
    let centre = [[-0.25, 0.05, 0.0], [0.2, -0.04, 0.1], [0.02, 0.03, 0.05]][k];
    let turn = [[0.01, 0.03, 0.02], [-0.015, -0.03, -0.01], [0.0, 0.005, 0.0]][k];
    let r = nalgebra::Rotation3::from_euler_angles(turn[0], turn[1], turn[2]);
    let mut rt = Matrix3x4::zeros();
    rt.fixed_columns_mut::<3>(0).copy_from(r.matrix());
    rt.set_column(3, &-(r * nalgebra::Vector3::from(centre)));
    let rig = rig_camera(0.5, SIZE);
    rig.fixed_columns::<3>(0) * rt
}

#[test]
fn general_cameras_are_rendered() {
    let dir = tempfile::tempdir().unwrap();
    let mut scene = String::new();
    for k in 0..3 {
        // Scale and sign of a camera matrix must not matter.
        let matrix = turned(k) * [1.0, -2.5, 1.0][k];
        let camera = Camera::metric(turned(k), false).unwrap();
        let (image, depth) = SyntheticScene::default().view(&camera, SIZE);
        save(&image, &dir.path().join(format!("{k}.png"))).unwrap();
        write_map(&depth, &dir.path().join(format!("{k}.pfm")));
        if k < 2 {
            scene += &format!(
                "[[view]]\nimage = \"{k}.png\"\ndepth = \"{k}.pfm\"\ncamera = {}\n",
                toml_rows(&matrix)
            );
        } else {
            scene += &format!("[virtual]\nsize = [120, 90]\ncamera = {}\n", toml_rows(&matrix));
        }
    }
    std::fs::write(dir.path().join("scene.toml"), scene).unwrap();
    let done = run(
        dir.path(),
        &["render", "scene.toml", "-o", "o.png", "--truth", "2.png", "--json", "--mask", "m.png"],
    );
    let figures = json(&done);
    assert!(figures["psnr"].as_f64().unwrap() > 31.0, "{figures}");
    assert_adds_up(&figures, 2 * 120 * 90);
    assert_eq!(figures["convergence"]["reached"], true);
    assert_eq!(read_image(&dir.path().join("m.png"), MOST_PIXELS).unwrap().channels(), 1);
}

/// Tracks of points on the scene's surfaces over the three turned cameras, without any camera in the scene
/// file.
#[test]
fn images_and_tracks_alone_are_enough() {
    let dir = tempfile::tempdir().unwrap();
    let cameras = [0, 1, 2].map(|k| Camera::metric(turned(k), false).unwrap());
    let scene = SyntheticScene::default();
    let depths: Vec<DepthMap> = (0..3)
        .map(|k| {
            let (image, depth) = scene.view(&cameras[k], SIZE);
            save(&image, &dir.path().join(format!("{k}.png"))).unwrap();
            depth
        })
        .collect();
    let mut tracks = String::new();
    for (x, y) in (3..87).step_by(4).flat_map(|y| (3..117).step_by(4).map(move |x| (x, y))) {
        let point = cameras[0].unproject(x as f64, y as f64, f64::from(depths[0].row(y)[x]));
        let seen = |k: usize| {
            let (u, v, d) = cameras[k].project(&point);
            let inside = u >= 0.0 && v >= 0.0 && u <= 119.0 && v <= 89.0 && d > 0.0;
            let visible =
                inside && (f64::from(depths[k].row(v.round() as usize)[u.round() as usize]) - d).abs() < 0.1;
            if visible { format!("{u:.3} {v:.3}") } else { "-".into() }
        };
        if (x + y) % 8 == 6 {
            tracks += &format!("{} {} {}\n", seen(0), seen(1), seen(2));
        }
    }
    std::fs::write(dir.path().join("tracks.txt"), tracks).unwrap();
    let views = "matches = \"tracks.txt\"\n[[view]]\nname = \"a\"\nimage = \"0.png\"\n[[view]]\nname = \"b\"\nimage = \"1.png\"\n";
    std::fs::write(dir.path().join("s.toml"), format!("{views}[virtual]\nfrom_tracks = 3\n")).unwrap();
    let done = run(dir.path(), &["render", "s.toml", "-o", "o.png", "--truth", "2.png", "--json"]);
    let figures = json(&done);
    assert!(figures["psnr"].as_f64().unwrap() > 23.0, "{figures}");
    assert_adds_up(&figures, 2 * 120 * 90);
    assert_eq!(figures["compared_on"], "hull");
    assert!(figures["geometry"]["sampson_rms"].as_f64().unwrap() < 0.05, "{figures}");
    std::fs::write(dir.path().join("b.toml"), format!("{views}[virtual]\nbetween = 0.5\n")).unwrap();
    let between = json(&run(dir.path(), &["render", "b.toml", "-o", "p.png", "--json"]));
    assert!(between["coverage"].as_f64().unwrap() > 0.5, "{between}");
    let refused = run(dir.path(), &["render", "s.toml", "-o", "q.png", "--degree", "linear"]);
    assert_eq!(code(&refused), 2);
    assert!(
        stderr(&refused).contains("--degree: it is for a scene of general cameras"),
        "{}",
        stderr(&refused)
    );
    // Seven tracks are too few, and tracks of a plane do not determine the geometry.
    let few = "1 2 3 4 -\n".repeat(7);
    std::fs::write(dir.path().join("tracks.txt"), few).unwrap();
    let refused = run(dir.path(), &["render", "s.toml", "-o", "q.png"]);
    assert_eq!(code(&refused), 1);
    assert!(
        stderr(&refused).contains("7 matches are too few, at least 8 are needed"),
        "{}",
        stderr(&refused)
    );
    let plane: String = (0..40)
        .map(|i| {
            let (x, y) = ((i * 37 % 100) as f64, (i * 53 % 80) as f64);
            format!("{x} {y} {} {} -\n", 0.9 * x + 0.1 * y + 3.0, 1.05 * y - 0.02 * x + 1.0)
        })
        .collect();
    std::fs::write(dir.path().join("tracks.txt"), plane).unwrap();
    let refused = run(dir.path(), &["render", "s.toml", "-o", "q.png"]);
    assert_eq!(code(&refused), 1);
    assert!(stderr(&refused).contains("planar"), "{}", stderr(&refused));
    assert!(!dir.path().join("q.png").exists());
}
