//! `hybank-ibr init`: a scene file for what lies in a folder.

use super::arguments::InitArguments;
use super::failure::{Failure, PROGRAM, failed};
use super::output::{self, Encoded};
use crate::scene;
use hybank_core::messages::Quoted;
use hybank_program::is_dash;
use std::path::{Path, PathBuf};

pub(super) fn run(arguments: &InitArguments) -> Result<(), Failure> {
    let path = &arguments.output;
    output::refuse_existing(path, arguments.force)?;
    let beside = if is_dash(path) { Path::new("") } else { path.parent().unwrap_or(Path::new("")) };
    let scene = scene::describe(&arguments.inputs, arguments.view.as_deref(), beside).map_err(failed)?;
    let (files, text) = (scene.spec.files(beside), scene.text().map_err(failed)?);
    output::refuse_overlaps(&[path], &files.iter().map(PathBuf::as_path).collect::<Vec<_>>())?;
    output::write(&[Encoded { bytes: text.into_bytes(), path }], arguments.force)?;
    if !is_dash(path) {
        let (shown, views) = (Quoted(path), scene.spec.view.len());
        PROGRAM.say_line(&format!("{shown}: {views} views; now: hybank-ibr render {shown} -o view.png"));
    }
    Ok(())
}
