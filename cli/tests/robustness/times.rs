//! Large inputs end soon: twice as many parts take no more than about twice the time.

use crate::large::{LARGE, desk};
use std::process::{Command, Stdio};
use trials::rounds;

/// Parts of a file. What looks at each pair of them would take many times the limit.
const PARTS: usize = 40_000;
/// Seconds of processor time for so many parts, in a debug build.
const SECONDS: usize = 15;

#[test]
fn the_time_of_a_run_grows_with_its_input_and_not_with_its_square() {
    let desk = desk();
    for large in &LARGE {
        let parts = rounds(PARTS);
        let content = (large.make)(parts);
        let bytes = content.len();
        desk.write(large.file, content);
        let limited = format!("ulimit -t {}; exec $H {}", rounds(SECONDS), large.line);
        let mut command = Command::new("sh");
        command.current_dir(desk.path("")).env("H", env!("CARGO_BIN_EXE_hybank")).args(["-c", &limited]);
        let begin = std::time::Instant::now();
        let output = command.stdin(Stdio::null()).output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr);
        let shown: String = message.chars().take(300).collect();
        println!(
            "{parts} {}, {bytes} bytes: {:.1?}, {}: {shown}",
            large.parts,
            begin.elapsed(),
            output.status
        );
        assert!(matches!(output.status.code(), Some(0 | 1)), "{}: {}: {shown}", large.parts, output.status);
        assert!(!message.contains("panicked"), "{}: {shown}", large.parts);
        std::fs::remove_file(desk.path(large.file)).unwrap();
    }
}
