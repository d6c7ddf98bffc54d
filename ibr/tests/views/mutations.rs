//! Damaged input: every parser of ours gives a value or a message for thousands of seeded mutations, and
//! never panics. `fuzz/` looks deeper with the same checks.

use hybank_ibr::camera::CameraList;
use hybank_ibr::camera::colmap::parse_model;
use hybank_ibr::camera::transforms::parse_transforms;
use hybank_ibr::image::{Image, Levels, MOST_PIXELS, encode, pfm, read_image, read_map};
use hybank_ibr::scene::parse;
use hybank_ibr::uncalibrated::tracks::Tracks;
use std::path::Path;
use trials::random::Random;

const ROUNDS: usize = 3000;

/// What breaks number and structure readers.
const NASTY: [&[u8]; 12] = [
    b"",
    b"-",
    b"nan",
    b"inf",
    b"1e400",
    b"-0",
    b"99999999999999999999",
    b"0",
    b"\n",
    b"\xff\xfe",
    b"\0",
    b"#",
];

/// A few bytes cut, doubled, flipped or replaced.
fn mutated(seed: &[u8], round: u64) -> Vec<u8> {
    let mut random = Random(round);
    let mut bytes = seed.to_vec();
    for _ in 0..1 + random.below(4) {
        let at = random.below(bytes.len() + 1);
        let end = (at + random.below(9)).min(bytes.len());
        match random.below(5) {
            0 => drop(bytes.drain(at..end)),
            1 => bytes.truncate(at),
            2 => bytes.splice(at..at, bytes[at..end].to_vec()).for_each(drop),
            3 => bytes.splice(at..end, NASTY[random.below(NASTY.len())].iter().copied()).for_each(drop),
            _ => bytes[at..end].iter_mut().for_each(|b| *b ^= 1 << (round % 8)),
        }
    }
    bytes
}

/// Runs `check` on every mutation of the seeds; it says whether the input was accepted. Both must occur, or
/// the mutations would test nothing.
fn survive(seeds: &[&[u8]], check: impl Fn(&[u8]) -> bool) {
    survive_rounds(trials::rounds(ROUNDS), seeds, check);
}

fn survive_rounds(rounds: usize, seeds: &[&[u8]], check: impl Fn(&[u8]) -> bool) {
    let accepted = (0..rounds).filter(|&r| check(&mutated(seeds[r % seeds.len()], r as u64))).count();
    println!("{rounds} damaged inputs, {accepted} accepted");
    assert!(accepted > 0 && accepted < rounds, "{accepted} of {rounds} were accepted");
}

/// Whether a result is a value; a message must say something.
fn accepted<T>(result: Result<T, impl std::fmt::Display>) -> bool {
    result.inspect_err(|e| assert!(!e.to_string().is_empty())).is_ok()
}

#[test]
fn float_maps() {
    let grey = Image::filled(3, 2, 1, 1.5);
    let colour = Image::filled(1, 2, 3, -0.5);
    let big = b"Pf 2 1 1.0\n\x3f\x80\x00\x00\x3f\x80\x00\x00";
    survive(&[&pfm::encode(&grey), &pfm::encode(&colour), big], |bytes| {
        accepted(pfm::decode(bytes).inspect(|map| {
            assert_eq!(map.data().len(), map.width() * map.height() * map.channels());
        }))
    });
}

#[test]
fn tracks() {
    let seeds: [&[u8]; 2] = [b"# a\n1 2 - 3.5 4\n- 1e2 7 5 6\n", b"1 2 - - 3 4\n- - 5 6 7 8 # far\n"];
    survive(&seeds, |bytes| {
        let read = Tracks::parse(&String::from_utf8_lossy(bytes), Path::new("t.txt"));
        accepted(read.inspect(|t| {
            assert!(t.columns() > 0 && t.rows().iter().all(|row| row.len() == t.columns()));
            assert!(t.rows().iter().flatten().flatten().all(|p| p.x.is_finite() && p.y.is_finite()));
        }))
    });
}

#[test]
fn colmap_models() {
    let cameras = "# c\n1 PINHOLE 640 480 500 510 320 240\n2 SIMPLE_RADIAL 64 48 50 32 24 0.01\n";
    let images = "1 0.9 0.1 0 0.2 1 2 3 1 a b.png\n1 2 -1\n2 1 0 0 0 0 0 0 2 c.png\n\n";
    let folder = Path::new("model");
    survive(&[cameras.as_bytes()], |bytes| {
        accepted(parse_model(&String::from_utf8_lossy(bytes), images, folder).inspect(finite_cameras))
    });
    survive(&[images.as_bytes()], |bytes| {
        accepted(parse_model(cameras, &String::from_utf8_lossy(bytes), folder).inspect(finite_cameras))
    });
}

/// Cameras of a list are finite, also for the size of an image that the file does not give.
fn finite_cameras(list: &CameraList) {
    for frame in &list.frames {
        accepted(list.camera(frame, (9, 7)).inspect(|found| {
            assert!(found.camera.matrix().iter().all(|v| v.is_finite()) && found.size.0 > 0);
        }));
    }
}

#[test]
fn transforms_files() {
    let seeds: [&[u8]; 2] = [
        br#"{"camera_angle_x": 0.69, "frames": [{"file_path": "./train/r_0", "transform_matrix": [[1, 0, 0, 2], [0, 1, 0, 3], [0, 0, 1, 4], [0, 0, 0, 1]]}]}"#,
        br#"{"w": 64, "h": 48, "fl_x": 50.5, "cx": 32, "cy": 24, "k1": -0.1, "p2": 1e-3, "frames": [{"file_path": "a.jpg", "depth_file_path": "a.png", "transform_matrix": [[0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0]]}]}"#,
    ];
    survive(&seeds, |bytes| {
        let read = parse_transforms(&String::from_utf8_lossy(bytes), Path::new("t.json"));
        accepted(read.inspect(finite_cameras))
    });
}

#[test]
fn scenes() {
    let seeds: [&[u8]; 3] = [
        b"unknown = \"far\"\n[[virtual]]\nposition = 0.5\n[[virtual]]\nposition = 0.5\nto_position = 1.0\nframes = 3\n",
        b"[[view]]\nname = \"l\"\nimage = \"a.png\"\nposition = 0.0\ndisparity = \"d.pfm\"\nstep = 2\n[virtual]\nposition = 0.5\n",
        b"matches = \"t\"\n[[view]]\nimage = \"a\"\ncamera = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]\n[virtual]\nsize = [4, 3]\n",
    ];
    survive(&seeds, |bytes| accepted(parse(&String::from_utf8_lossy(bytes), Path::new("s.toml"))));
}

/// Images of every format, as files.
#[test]
fn images() {
    let dir = tempfile::tempdir().unwrap();
    let colour = Image::new(9, 7, 3, (0..189).map(|i| (i * 31 % 256) as f32).collect()).unwrap();
    for name in ["a.png", "a.jpg", "a.ppm", "a.pgm", "a.pfm"] {
        let path = dir.path().join(name);
        let seed = encode(&colour, &path, Levels::Eight).unwrap();
        survive_rounds(trials::rounds(300), &[&seed], |bytes| {
            std::fs::write(&path, bytes).unwrap();
            let named = |error: hybank_ibr::files::InputError| {
                let message = error.to_string();
                assert!(message.contains(name), "{message}");
            };
            if let Ok((width, height, values)) = read_map(&path, MOST_PIXELS).map_err(named) {
                assert_eq!(values.len(), width * height);
            }
            read_image(&path, MOST_PIXELS).map_err(named).is_ok_and(|image| {
                let (width, height) = image.size();
                assert_eq!(image.data().len(), width * height * image.channels());
                true
            })
        });
    }
}
