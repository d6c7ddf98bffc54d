//! Scenes whose views are listed in files of other programs.

use super::Loaded;
use crate::camera::Frame;
use crate::camera::transforms::read_transforms;
use crate::scene::{SceneSpec, ViewSpec};
use std::path::Path;

/// The scene with what its `transforms` file adds: views if it lists none.
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
