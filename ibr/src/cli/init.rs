//! `hybank-ibr init`: a scene file for what lies in a folder.

use super::arguments::InitArguments;
use super::failure::{self, Failure};
use super::output::{self, Encoded};
use crate::scene;
use hybank::messages::Quoted;
use std::path::{Path, PathBuf};

pub(super) fn run(arguments: &InitArguments) -> Result<(), Failure> {
    let path = &arguments.output;
    output::refuse_existing(path, arguments.force)?;
    let beside =
        if output::is_standard(path) { Path::new("") } else { path.parent().unwrap_or(Path::new("")) };
    let scene = scene::describe(&arguments.inputs, beside).map_err(Failure::input)?;
    let (files, text) = (scene.spec.files(beside), scene.text().map_err(Failure::input)?);
    output::refuse_overlaps(&[path], &files.iter().map(PathBuf::as_path).collect::<Vec<_>>())?;
    output::name_leftovers(&[path]);
    output::write(&[Encoded { bytes: text.into_bytes(), path }], arguments.force)?;
    if !output::is_standard(path) {
        let (shown, views) = (Quoted(path), scene.spec.view.len());
        failure::say_line(&format!("{shown}: {views} views; now: hybank-ibr render {shown} -o view.png"));
    }
    Ok(())
}
