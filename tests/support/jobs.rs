//! Runs of a program with known outputs, and what may be found in their place after a trial.
// Each program uses a part of it.
#![allow(dead_code)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The hangup of a terminal.
pub(crate) const HUP: u32 = 1;

/// Signals that end a run in order: those of terminals, of shells, of timers, of limits and of users.
pub(crate) const ENDING: [u32; 10] = {
    let [int, quit, term, xcpu, alrm, vtalrm, prof, usr1, usr2] = [2, 3, 15, 24, 14, 26, 27, 10, 12];
    [int, term, HUP, xcpu, alrm, usr1, usr2, quit, vtalrm, prof]
};

/// What lies under the names of a run's outputs; `None` for a file that is not there.
pub(crate) type State = Vec<Option<Vec<u8>>>;

/// A run that writes files.
pub(crate) struct Job {
    pub(crate) program: &'static str,
    pub(crate) folder: PathBuf,
    pub(crate) args: Vec<String>,
    outputs: Vec<PathBuf>,
    /// The outputs of an undisturbed run.
    pub(crate) whole: State,
    /// A signal completes the output of what came before it.
    pub(crate) is_live: bool,
}

impl Job {
    /// Makes one undisturbed run of `args` in `folder`, which must succeed.
    pub(crate) fn new(program: &'static str, folder: &Path, args: &[&str], outputs: &[&str]) -> Self {
        let mut job = Self {
            program,
            folder: folder.to_owned(),
            args: args.iter().map(|&arg| arg.to_owned()).collect(),
            outputs: outputs.iter().map(|name| folder.join(name)).collect(),
            whole: Vec::new(),
            is_live: false,
        };
        job.prepare(false);
        let output = job.command().output().unwrap();
        assert!(output.status.success(), "{args:?}: {output:?}");
        job.whole = job.state();
        assert!(job.whole.iter().all(Option::is_some), "{args:?}");
        job
    }

    pub(crate) fn command(&self) -> Command {
        let mut command = Command::new(self.program);
        command.current_dir(&self.folder).args(&self.args);
        command
    }

    /// Puts old files, or nothing, in the place of the outputs; gives their state.
    pub(crate) fn prepare(&self, old: bool) -> State {
        for output in &self.outputs {
            let _ = fs::remove_file(output);
            if old {
                fs::create_dir_all(output.parent().unwrap()).unwrap();
                fs::write(output, "old").unwrap();
            }
        }
        self.state()
    }

    pub(crate) fn state(&self) -> State {
        self.outputs.iter().map(|output| fs::read(output).ok()).collect()
    }

    /// Checks that each output is as before or whole; true if all are whole, `None` if only some are.
    pub(crate) fn judge(&self, before: &State, what: &str) -> Option<bool> {
        let state = self.state();
        let mut new = 0;
        for (i, found) in state.iter().enumerate() {
            let is_new = *found == self.whole[i];
            let name = self.outputs[i].display();
            let length = found.as_ref().map(Vec::len);
            assert!(
                is_new || *found == before[i],
                "{what}: {name} has {length:?} bytes, neither old nor whole"
            );
            new += usize::from(is_new);
        }
        match new {
            0 => Some(false),
            _ if new == state.len() => Some(true),
            _ => None,
        }
    }

    /// Checks that the only output has so many bytes, the first of the whole one.
    pub(crate) fn judge_live(&self, bytes: usize, what: &str) {
        let (state, whole) = (self.state(), self.whole[0].as_ref().unwrap());
        assert_eq!(state[0].as_deref(), whole.get(..bytes), "{what}");
    }

    /// Unfinished files beside the outputs.
    pub(crate) fn unfinished(&self) -> Vec<PathBuf> {
        let mut folders: Vec<_> = self.outputs.iter().map(|output| output.parent().unwrap()).collect();
        folders.dedup();
        let entries = folders.iter().filter_map(|folder| fs::read_dir(folder).ok()).flatten();
        entries
            .map(|entry| entry.unwrap().path())
            .filter(|path| path.extension().is_some_and(|extension| extension == "part"))
            .collect()
    }
}
