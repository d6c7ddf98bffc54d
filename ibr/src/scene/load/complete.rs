//! Scenes whose views are listed in files of other programs.

use super::Loaded;
use crate::camera::Frame;
use crate::camera::middlebury::read_calibration;
use crate::camera::transforms::read_transforms;
use crate::files::InputError;
use crate::scene::{SceneSpec, ViewSpec};
use hybank_core::messages::{Number, Quoted};
use std::path::Path;

/// The scene with what its `transforms` or `calib` file adds: views if it lists none, and disparity offsets.
/// `path` is the scene file.
///
/// # Errors
/// `InputError` of the file.
pub fn complete(spec: &SceneSpec, path: &Path) -> Loaded<SceneSpec> {
    let mut whole = spec.clone();
    let folder = path.parent().unwrap_or(Path::new(""));
    if let (Some(file), true) = (&spec.transforms, spec.view.is_empty()) {
        whole.view = transforms_views(file, folder, spec.depth_scale)?;
    }
    if let Some(file) = &spec.calib {
        if spec.view.is_empty() {
            (whole.view, whole.notes) = pair_views(file, folder);
        }
        let calibration = read_calibration(&folder.join(file))?;
        for view in &mut whole.view {
            let offset = *view.disparity_offset.get_or_insert(calibration.offset);
            if offset != calibration.offset {
                let reason = format!(
                    "{} has disparity_offset = {}, but {} says {}; remove one of them",
                    view.named(),
                    Number(offset),
                    Quoted(file),
                    Number(calibration.offset)
                );
                return Err(InputError::file(path, reason));
            }
        }
    }
    for view in whole.view.iter_mut().filter(|view| view.is_stored()) {
        view.disparity_scale = view.disparity_scale.or(spec.disparity_scale);
        view.depth_scale = view.depth_scale.or(spec.depth_scale);
    }
    Ok(whole)
}

/// The frames with depth; paths in the file are relative to it.
fn transforms_views(file: &Path, folder: &Path, scale: Option<f64>) -> Loaded<Vec<ViewSpec>> {
    let all = read_transforms(&folder.join(file))?;
    let beside = file.parent().unwrap_or(Path::new(""));
    let view = |frame: &Frame| {
        let depth = frame.depth.as_ref()?;
        Some(ViewSpec {
            name: Some(frame.image.display().to_string()),
            image: beside.join(&frame.image),
            depth: Some(beside.join(depth)),
            depth_scale: scale.or(ViewSpec::usual_scale(depth)),
            ..ViewSpec::default()
        })
    };
    let views: Vec<ViewSpec> = all.frames.iter().filter_map(view).collect();
    match all.frames.first() {
        Some(frame) if views.is_empty() => Err(all.without_depth(frame)),
        _ => Ok(views),
    }
}

/// The views of a pair whose disparity maps are there, and what is to be said of a missing one.
fn pair_views(file: &Path, folder: &Path) -> (Vec<ViewSpec>, Vec<String>) {
    let beside = file.parent().unwrap_or(Path::new(""));
    let view = |k: usize| ViewSpec {
        image: beside.join(format!("im{k}.png")),
        position: Some(k as f64),
        disparity: Some(beside.join(format!("disp{k}.pfm"))),
        ..ViewSpec::default()
    };
    let has_map = |k: &usize| folder.join(beside).join(format!("disp{k}.pfm")).exists();
    let found: Vec<usize> = (0..2).filter(has_map).collect();
    match found[..] {
        // The message about the file that cannot be opened names the first map.
        [] => (vec![view(0)], Vec::new()),
        [only] => {
            let note = format!(
                "there is no disp{}.pfm beside {}: the view is rendered from im{only}.png alone",
                1 - only,
                Quoted(file)
            );
            (vec![view(only)], vec![note])
        }
        _ => ((0..2).map(view).collect(), Vec::new()),
    }
}
