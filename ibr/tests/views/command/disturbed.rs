//! Runs that are disturbed: interrupted, or with outputs that are inputs.

use super::*;

const PROGRAM: &str = env!("CARGO_BIN_EXE_hybank-ibr");

/// A film begins before its first frame and ends long after it.
#[cfg(target_os = "linux")]
#[test]
fn a_signal_ends_a_run_at_once_and_leaves_no_file() {
    let dir = rig();
    let scene = std::fs::read_to_string(dir.path().join("scene.toml")).unwrap();
    let path = scene.replace("position = 0.5\n", "position = 0.0\nto_position = 1.0\nframes = 9000\n");
    std::fs::write(dir.path().join("path.toml"), path).unwrap();
    let names = || {
        let names = std::fs::read_dir(dir.path()).unwrap().map(|file| file.unwrap().file_name());
        names.map(|name| name.into_string().unwrap()).collect::<std::collections::BTreeSet<_>>()
    };
    let before = names();
    for signal in [2, 15] {
        let mut command = Command::new(PROGRAM);
        command.current_dir(dir.path()).args(["render", "path.toml", "-o", "film.y4m", "--threads", "1"]);
        let mut child = command.spawn().unwrap();
        while !names().iter().any(|name| name.ends_with(".part")) {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        let kill = Command::new("kill").args(["-s", &signal.to_string(), &child.id().to_string()]).status();
        assert!(kill.unwrap().success());
        assert_eq!(child.wait().unwrap().code(), Some(128 + signal));
        assert_eq!(names(), before);
    }
}

#[test]
fn no_file_of_the_scene_is_replaced_even_by_force() {
    let dir = rig();
    let read = |name: &str| std::fs::read(dir.path().join(name)).unwrap();
    std::fs::hard_link(dir.path().join("left.png"), dir.path().join("same.png")).unwrap();
    let before = ["left.png", "right.png", "left.pfm", "middle.png"].map(read);
    for output in ["left.png", "./right.png", "left.pfm", "same.png", "middle.png"] {
        let truth = ["--truth", "middle.png", "--force"];
        for names in [["-o", output].to_vec(), ["-o", "new.png", "--mask", output].to_vec()] {
            let refused = run(dir.path(), &[&["render", "scene.toml"], &names[..], &truth].concat());
            let message = stderr(&refused);
            assert_eq!(code(&refused), 1, "{names:?}: {message}");
            assert!(
                message.contains("also the input") && message.lines().count() == 1,
                "{names:?}: {message}"
            );
        }
    }
    assert_eq!(["left.png", "right.png", "left.pfm", "middle.png"].map(read), before);
    assert!(!dir.path().join("new.png").exists());
}

#[cfg(target_os = "linux")]
#[test]
fn too_many_pixels_are_refused_before_any_work() {
    let dir = rig();
    let pixels = [b"P5 20000 2000 255\n".to_vec(), vec![7; 40_000_000]].concat();
    std::fs::write(dir.path().join("wide.pgm"), pixels).unwrap();
    let scene = std::fs::read_to_string(dir.path().join("scene.toml")).unwrap();
    std::fs::write(dir.path().join("wide.toml"), scene.replace("left.png", "wide.pgm")).unwrap();
    let refused = run(dir.path(), &["render", "wide.toml", "-o", "out.png"]);
    let message = stderr(&refused);
    assert!(message.contains("20000 x 2000") && message.contains("--max-pixels"), "{message}");
}
