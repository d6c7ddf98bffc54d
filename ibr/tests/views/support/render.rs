//! One virtual view of some views.

use hybank_ibr::pipeline::{Geometry, RenderError, RenderSettings, Renderer, Rendering};
use hybank_ibr::propagate::{RectifiedView, View};

pub(crate) fn render<P: Geometry>(
    views: &[View<'_, P>],
    camera: &P,
    size: (usize, usize),
    settings: &RenderSettings,
) -> Result<Rendering, RenderError> {
    Renderer::new(views, settings)?.render(camera, size)
}

/// That of a position of a rig, whose size is that of the views.
pub(crate) fn of_rig(views: &[RectifiedView<'_>], position: f64, settings: &RenderSettings) -> Rendering {
    render(views, &position, views[0].image.size(), settings).unwrap()
}
