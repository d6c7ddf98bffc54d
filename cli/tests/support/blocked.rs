//! Waits until another thread or process has come so far, by what Linux says of it. Elsewhere a while.
// Each program uses a part of it.
#![allow(dead_code)]

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// More than any thread needs to come so far.
const PATIENCE: Duration = Duration::from_secs(60);
/// Long enough on an idle machine, where nothing can be asked.
const A_WHILE: Duration = Duration::from_millis(500);

/// Numbers of the system call `write` on x86-64 and on 64-bit ARM.
const WRITE: [&str; 2] = ["1", "64"];

fn tasks(process: u32) -> Vec<PathBuf> {
    let tasks = fs::read_dir(format!("/proc/{process}/task")).into_iter().flatten();
    tasks.filter_map(|task| Some(task.ok()?.path())).collect()
}

fn until(is_so: impl Fn() -> bool, what: &str) {
    if !Path::new("/proc/self/syscall").exists() {
        return std::thread::sleep(A_WHILE);
    }
    let begin = Instant::now();
    while !is_so() {
        assert!(begin.elapsed() < PATIENCE, "{what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Waits until a thread of a process is held up by a write, to a file descriptor if one is given.
pub(crate) fn until_a_write_waits(process: u32, descriptor: Option<i32>) {
    let waits = |task: PathBuf| {
        let call = fs::read_to_string(task.join("syscall")).unwrap_or_default();
        let mut words = call.split_whitespace();
        let is_write = words.next().is_some_and(|number| WRITE.contains(&number));
        let given = words.next();
        is_write && descriptor.is_none_or(|wanted| given == Some(&format!("{wanted:#x}")))
    };
    until(|| tasks(process).into_iter().any(waits), "no write waits for its reader");
}

fn has_thread(process: u32, name: &str) -> bool {
    let is_it = |task: PathBuf| fs::read_to_string(task.join("comm")).is_ok_and(|comm| comm.trim() == name);
    tasks(process).into_iter().any(is_it)
}

/// Waits until a process has a thread of this name.
pub(crate) fn until_a_thread_begins(process: u32, name: &str) {
    until(|| has_thread(process, name), "the thread does not begin");
}
