//! Runs that are disturbed: killed, without threads, without memory, beside what a killed run left.

use super::*;
use crate::support::jobs::Job;
use crate::support::kills::campaign;
use crate::support::random::Random;
use trials::rounds;

const PROGRAM: &str = env!("CARGO_BIN_EXE_hybank-ibr");

#[test]
fn a_killed_run_leaves_old_or_whole_files_and_the_next_one_names_the_rest() {
    let dir = rig();
    let render = ["render", "scene.toml", "-o", "out.png", "--mask", "mask.png", "--force"];
    let demo = ["demo", "--size", "64x64", "-o", "demo.png", "--force"];
    let mut dice = Random(1200);
    for (args, outputs) in [(&render[..], &["out.png", "mask.png"][..]), (&demo, &["demo.png"])] {
        let job = Job::new(PROGRAM, dir.path(), args, outputs);
        let seen = campaign(&job, rounds(8), &mut dice);
        println!("{}: {seen}", args.join(" "));
    }
}

#[cfg(target_os = "linux")]
#[test]
fn what_a_killed_run_left_is_named() {
    let dir = rig();
    // Above the largest number that Linux gives to a process.
    let host = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap();
    let letter = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let host: String = host.trim().chars().take(16).map(letter).collect();
    let name = format!(".out.png.{host}-4194305-0.part");
    let stale = dir.path().join(&name);
    std::fs::write(&stale, "half").unwrap();
    let done = run(dir.path(), &["render", "scene.toml", "-o", "out.png"]);
    let message = stderr(&done);
    assert!(code(&done) == 0 && message.contains(&name), "{message}");
    assert!(message.contains("4194305, which no longer runs") && stale.exists(), "{message}");
}

/// As of single outputs, of the numbered files of several virtual views.
#[cfg(target_os = "linux")]
#[test]
fn what_a_killed_run_left_of_numbered_views_is_named() {
    let dir = rig();
    let scene = std::fs::read_to_string(dir.path().join("scene.toml")).unwrap();
    let more = scene.replace("[virtual]", "[[virtual]]") + "[[virtual]]\nposition = 0.25\n";
    std::fs::write(dir.path().join("two.toml"), more).unwrap();
    let host = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap();
    let letter = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let host: String = host.trim().chars().take(16).map(letter).collect();
    for (command, option, file) in [("render", "-o", "out"), ("bound", "--map", "map")] {
        // Above the largest number that Linux gives to a process.
        let name = format!(".{file}-0002.png.{host}-4194305-0.part");
        std::fs::write(dir.path().join(&name), "half").unwrap();
        let done = run(dir.path(), &[command, "two.toml", option, &format!("{file}.png")]);
        let message = stderr(&done);
        assert!(code(&done) == 0 && message.matches(&name).count() == 1, "{message}");
    }
}

/// All outputs of a rendering, or none.
#[cfg(target_os = "linux")]
#[test]
fn a_refused_name_of_the_third_output_leaves_none() {
    let dir = rig();
    let strace = |options: &[&str]| Command::new("strace").current_dir(dir.path()).args(options).output();
    if !strace(&["-o", "/dev/null", "true"]).is_ok_and(|output| output.status.success()) {
        return trials::skipped(&"refused names of outputs: strace is not there or may not trace");
    }
    for old in [false, true] {
        let names = ["out.png", "mask.png", "error.png"];
        for name in names {
            let _ = std::fs::remove_file(dir.path().join(name));
            if old {
                std::fs::write(dir.path().join(name), "old").unwrap();
            }
        }
        let call = if old { "renameat2:error=EIO:when=5+" } else { "renameat2:error=EIO:when=3+" };
        let inject = format!("inject={call}");
        let options = ["-f", "-qq", "-o", "/dev/null", "-e", "trace=renameat2", "-e", &inject, PROGRAM];
        let render = ["render", "scene.toml", "-o", names[0], "--mask", names[1], "--error", names[2]];
        let truth = ["--truth", "middle.png", "--force"];
        let output = strace(&[&options[..], &render, &truth].concat()).unwrap();
        let message = stderr(&output);
        assert_eq!((output.status.code(), message.lines().count()), (Some(1), 1), "{message}");
        let is_as_before =
            |name: &&str| std::fs::read(dir.path().join(name)).ok() == old.then(|| b"old".to_vec());
        let changed = names.iter().filter(|name| !is_as_before(name));
        for name in changed {
            assert!(message.contains("not taken back: ") && message.contains(name), "{name}: {message}");
        }
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

#[cfg(unix)]
fn shell(dir: &Path, script: &str) -> Output {
    Command::new("sh").current_dir(dir).env("H", PROGRAM).args(["-c", script]).output().unwrap()
}

#[cfg(target_os = "linux")]
#[test]
fn without_threads_the_work_is_done_or_refused_in_one_line() {
    let dir = rig();
    // More than any address space: no thread with such a stack can be started.
    let without = |line: &str| shell(dir.path(), &format!("RUST_MIN_STACK=1000000000000000 $H {line}"));
    let done = without("render scene.toml -o out.png");
    assert_eq!(code(&done), 0, "{}", stderr(&done));
    let refused = without("render scene.toml -o more.png --threads 3");
    assert_eq!((code(&refused), stderr(&refused).lines().count()), (1, 1), "{}", stderr(&refused));
    assert!(stderr(&refused).contains("--threads 3"), "{}", stderr(&refused));
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
    // With the limit lifted, but not that of the memory.
    let refused = shell(dir.path(), "ulimit -v 320000; $H render wide.toml -o out.png --max-pixels 50000000");
    let message = stderr(&refused);
    assert_eq!((code(&refused), message.lines().count()), (1, 1), "{message}");
    assert!(
        message.contains("wide.pgm") && message.contains("of memory, and this process may use"),
        "{message}"
    );
    // What reading takes, 30 bytes per pixel, is within this limit: the run goes on to what is wrong.
    let refused =
        shell(dir.path(), "ulimit -v 2000000; $H render wide.toml -o out.png --max-pixels 50000000");
    let message = stderr(&refused);
    assert_eq!((code(&refused), message.lines().count()), (1, 1), "{message}");
    assert!(message.contains("20000 x 2000") && !message.contains("memory"), "{message}");
}

/// Images that are read, and then too little memory for the work on them.
#[cfg(target_os = "linux")]
#[test]
fn renderings_that_no_memory_holds_are_refused() {
    let dir = rig();
    let (width, height) = (2000, 2000);
    let pixels = [format!("P5 {width} {height} 255\n").into_bytes(), vec![7; width * height]].concat();
    let data = vec![4.0; width * height];
    let map = pfm::encode(&Image::new(width, height, 1, data).unwrap());
    let view = |k: usize| {
        format!("[[view]]\nname = \"{k}\"\nimage = \"a.pgm\"\nposition = {k}.0\ndisparity = \"a.pfm\"\n")
    };
    let scene = view(0) + &view(1) + "[virtual]\nposition = 0.5\n";
    for (name, bytes) in [("a.pgm", pixels), ("a.pfm", map), ("large.toml", scene.into_bytes())] {
        std::fs::write(dir.path().join(name), bytes).unwrap();
    }
    let tracks = (0..9).map(|i| format!("{i} 1 {i} 2 {i} 3\n")).collect::<String>();
    std::fs::write(dir.path().join("tracks.txt"), tracks).unwrap();
    let views = "[[view]]\nimage = \"a.pgm\"\n".repeat(2);
    let scene = format!("matches = \"tracks.txt\"\n{views}[virtual]\nfrom_tracks = 3\n");
    std::fs::write(dir.path().join("tracked.toml"), scene).unwrap();
    for (line, limit) in [
        ("bound large.toml --map map.png", 500_000),
        ("render large.toml -o out.png --method plane", 420_000),
        ("render tracked.toml -o out.png", 234_000),
    ] {
        let refused = shell(dir.path(), &format!("ulimit -v {limit}; $H {line} --threads 1"));
        let message = stderr(&refused);
        assert_eq!((code(&refused), message.lines().count()), (1, 1), "{line}: {message}");
        assert!(
            message.contains("from 2 views") && message.contains("of memory, and this process may use"),
            "{line}: {message}"
        );
    }
    assert!(!dir.path().join("map.png").exists() && !dir.path().join("out.png").exists());
}

/// A text of so many numbered lines.
#[cfg(target_os = "linux")]
fn lines(count: usize, line: impl Fn(usize) -> String) -> String {
    (0..count).map(line).collect()
}

/// Scenes whose size their files decide: wide and narrow views, lists, tracks, large pictures.
#[cfg(target_os = "linux")]
fn sized_scenes(dir: &Path) {
    let write = |name: &str, text: &str| std::fs::write(dir.join(name), text).unwrap();
    let row = |x: f64| format!("[[100, 0, 12, {x}], [0, 100, 8, 0], [0, 0, 1, 0]]");
    let map = pfm::encode(&Image::filled(24, 16, 1, 5.0));
    std::fs::write(dir.join("small.pfm"), map).unwrap();
    save(&Image::filled(24, 16, 3, 90.0), &dir.join("small.png")).unwrap();
    let view = |k: usize, camera: &str| {
        format!("[[view]]\nname = \"{k}\"\nimage = \"small.png\"\ndepth = \"small.pfm\"\n{camera}\n")
    };
    let cameras = lines(2, |k| view(k, &format!("camera = {}", row(-10.0 * k as f64))));
    for (name, size) in [("narrow", "[1, 400000]"), ("flat", "[400000, 1]"), ("wide", "[900, 700]")] {
        let target = format!("[virtual]\ncamera = {}\nsize = {size}\n", row(-5.0));
        write(&format!("{name}.toml"), &format!("{cameras}{target}"));
    }
    let many = lines(3000, |k| view(k, &format!("camera = {}", row(-0.01 * k as f64))));
    write("many.toml", &format!("{many}[virtual]\ncamera = {}\n", row(-5.0)));
    std::fs::create_dir(dir.join("model")).unwrap();
    write("model/cameras.txt", "1 PINHOLE 24 16 100 100 12.5 8.5\n");
    write("model/images.txt", &lines(40_000, |k| format!("{k} 1 0 0 0 0.{k} 0 0 1 {k}.png\n\n")));
    let listed = view(0, "").replace("small.png", "./1.png") + &view(1, "").replace("small.png", "2.png");
    ["1.png", "2.png"].iter().for_each(|name| drop(std::fs::copy(dir.join("small.png"), dir.join(name))));
    write("listed.toml", &format!("colmap = \"model\"\n{listed}[virtual]\ncamera_of = \"3.png\"\n"));
    write("tracks.txt", &lines(60_000, |k| format!("{}.5 {}.25 - 7 3\n", k % 24, k % 16)));
    let views = "[[view]]\nimage = \"small.png\"\n".repeat(2);
    write("tracked.toml", &format!("matches = \"tracks.txt\"\n{views}[virtual]\nfrom_tracks = 3\n"));
    let frame = |k: usize| {
        format!(
            "{{\"file_path\": \"{k}.png\", \"transform_matrix\": [[1,0,0,{k}],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}},"
        )
    };
    let frames = lines(20_000, frame);
    write(
        "t.json",
        &format!("{{\"fl_x\": 100, \"w\": 24, \"h\": 16, \"frames\": [{}]}}", frames.trim_end_matches(',')),
    );
    write(
        "frames.toml",
        &format!(
            "transforms = \"t.json\"\n{}{}[virtual]\ncamera_of = \"3\"\n",
            view(1, "").replace("small.png", "1.png"),
            view(2, "").replace("small.png", "2.png")
        ),
    );
    let large = Image::filled(1500, 1200, 3, 90.0);
    save(&large, &dir.join("large.png")).unwrap();
    std::fs::write(dir.join("large.pfm"), pfm::encode(&Image::filled(1500, 1200, 1, 4.0))).unwrap();
    let rig = |k: usize| {
        format!(
            "[[view]]\nname = \"{k}\"\nimage = \"large.png\"\nposition = {k}.0\ndisparity = \"large.pfm\"\n"
        )
    };
    write("large.toml", &format!("{}{}[virtual]\nposition = 0.5\n", rig(0), rig(1)));
}

/// Whether the program ended because not even an object of a fixed size could be had, which no input
/// decides.
#[cfg(target_os = "linux")]
fn is_small_allocation(message: &str) -> bool {
    let bytes = message.split("memory allocation of ").nth(1).and_then(|rest| rest.split(' ').next());
    bytes.and_then(|bytes| bytes.parse::<usize>().ok()).is_some_and(|bytes| bytes < 1 << 14)
}

/// More memory never turns a result into a refusal: threads are started where there is room for them, and a
/// scene of thousands of views takes what is estimated.
#[cfg(target_os = "linux")]
#[test]
fn more_memory_is_never_worse() {
    let dir = rig();
    sized_scenes(dir.path());
    let line = "render scene.toml -o out.png --threads 2 --force";
    let limits = (60..300).step_by(10).chain([400, 550, 600]);
    let ends = |limit: usize| shell(dir.path(), &format!("ulimit -v {limit}000; exec $H {line}"));
    let codes: Vec<_> = limits.map(|limit| (limit, ends(limit).status.code())).collect();
    let first = codes.iter().position(|(_, code)| *code == Some(0)).unwrap();
    assert!(codes[first..].iter().all(|(_, code)| *code == Some(0)), "{codes:?}");
    for limit in (88..135).step_by(4) {
        let line = format!("ulimit -v {limit}000; exec $H render many.toml -o out.png --threads 2 --force");
        let output = shell(dir.path(), &line);
        assert!(matches!(output.status.code(), Some(0 | 1)), "{limit}: {}", stderr(&output));
    }
}

/// Where standard output is closed, the message says that the files are there.
#[cfg(target_os = "linux")]
#[test]
fn a_report_that_cannot_be_printed_names_what_is_written() {
    let dir = rig();
    for (line, words) in [
        ("render scene.toml -o x.png", "; x.png is written"),
        ("render scene.toml -o y.png --mask m.png", "; y.png and 1 other file are written"),
        ("bound scene.toml --map map.png", "; map.png is written"),
        ("bound scene.toml", "hybank-ibr: standard output: cannot write it: "),
    ] {
        let output = shell(dir.path(), &format!("exec $H {line} >&-"));
        assert!(code(&output) == 1 && stderr(&output).contains(words), "{line}: {}", stderr(&output));
    }
    assert!(["x.png", "y.png", "m.png", "map.png"].iter().all(|name| dir.path().join(name).exists()));
}

/// Whatever the limit of the address space, a run ends with a result or with one message. The system ends it
/// only where the last kilobytes are missing.
#[cfg(target_os = "linux")]
#[test]
fn every_limit_of_memory_ends_in_a_result_or_a_message() {
    let dir = rig();
    sized_scenes(dir.path());
    let runs = [
        "render scene.toml -o out.png --mask mask.png --depth depth.pfm --truth middle.png",
        "render scene.toml -o out.png --depth-step 6 --bits 16 --alpha",
        "render narrow.toml -o out.png",
        "render flat.toml -o out.png --degree cubic",
        "render wide.toml -o out.pfm --count count.png",
        "render many.toml -o out.ppm --threads 1",
        "render listed.toml -o out.png",
        "render tracked.toml -o out.png",
        "render frames.toml -o out.png",
        "render large.toml -o out.jpg --threads 2",
        "render large.toml -o out.png --method plane",
        "bound scene.toml --map map.png",
        "bound large.toml --map map.pfm --threads 1",
        "demo -o demo.png",
    ];
    let (mut done, mut refused, mut small) = (0, 0, 0);
    let steps = rounds(1);
    let mut dice = Random(4096);
    for line in runs {
        for step in 0..steps {
            // From 40 MB on, on a logarithmic scale.
            let share = (step as f64 + dice.below(1000) as f64 / 1000.0) / steps as f64;
            let limit = (40_000.0 * 30.0_f64.powf(share)) as usize;
            let output = shell(dir.path(), &format!("ulimit -v {limit}; exec $H {line} --force"));
            let message = stderr(&output);
            let ended = output.status.code();
            if is_small_allocation(&message) {
                small += 1;
                continue;
            }
            assert!(
                matches!(ended, Some(0 | 1)),
                "ulimit -v {limit}; {line}: {:?}: {message}",
                output.status
            );
            assert!(!message.contains("panicked"), "ulimit -v {limit}; {line}: {message}");
            if ended == Some(1) {
                let says = message.lines().filter(|line| !line.contains(": warning:")).count();
                assert!(says > 0, "ulimit -v {limit}; {line}: {message}");
                refused += 1;
            } else {
                done += 1;
            }
        }
    }
    println!("{done} results, {refused} refusals, {small} ends by a small allocation under limits of memory");
    assert!(done > 0 && refused > 0 && 10 * small <= done + refused, "{done}, {refused}, {small}");
}
