//! The runs that are disturbed.

use crate::support::jobs::Job;
use crate::support::random::Random;
use crate::support::{Desk, THESIS, names, wav};

const HYBANK: &str = env!("CARGO_BIN_EXE_hybank");

/// Two recordings of so many samples, a spec and its bank.
pub(crate) fn desk(samples: usize) -> Desk {
    let desk = Desk::new();
    desk.write("spec.toml", THESIS);
    let mut dice = Random(18);
    let mut noise = || (0..samples).map(|_| dice.sample() as f32).collect::<Vec<_>>();
    wav::write_pair(&desk, &noise(), &noise());
    desk
}

/// One job per command that writes files, with one file and with sets of files.
pub(crate) fn jobs(desk: &Desk) -> Vec<Job> {
    let folder = desk.path("");
    let fuse = "fuse bank.json a.wav b.wav --force";
    [
        (format!("{fuse} -o out.wav"), &["out.wav"][..]),
        (format!("{fuse} --gaps zero --mask mask -o masked.wav"), &["masked.wav", "mask"]),
        (format!("{fuse} -o out.sigmf-meta"), &["out.sigmf-meta", "out.sigmf-data"]),
        ("design spec.toml -o designed.json --force".to_owned(), &["designed.json"]),
        (
            "simulate spec.toml --source a.wav -o captures --force".to_owned(),
            &["captures/ch1.wav", "captures/ch2.wav", "captures/target.wav"],
        ),
    ]
    .iter()
    .map(|(line, outputs)| Job::new(HYBANK, &folder, &line.split(' ').collect::<Vec<_>>(), outputs))
    .collect()
}

/// A run that records: a signal completes its output.
pub(crate) fn recorder(desk: &Desk) -> Job {
    let line = "stream bank.json --input a.wav --input b.wav -o out.raw --force";
    let args: Vec<&str> = line.split(' ').collect();
    let mut job = Job::new(HYBANK, &desk.path(""), &args, &["out.raw"]);
    job.is_live = true;
    job
}

/// A run with a set of many files.
pub(crate) fn manual(desk: &Desk) -> Job {
    let folder = desk.path("");
    let run = std::process::Command::new(HYBANK).current_dir(&folder).args(["man", "pages"]).status();
    assert!(run.unwrap().success());
    let pages = names(&folder.join("pages")).into_iter().map(|name| format!("pages/{name}"));
    let pages: Vec<String> = pages.collect();
    let outputs: Vec<&str> = pages.iter().map(String::as_str).collect();
    Job::new(HYBANK, &folder, &["man", "pages", "--force"], &outputs)
}
