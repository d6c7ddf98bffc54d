//! The place that `--view` names: a view that is left out, or an image that only has a camera.

use super::{Loaded, Loader};
use crate::camera::names::{self, NameError};
use crate::files::InputError;
use crate::scene::ViewSpec;
use hybank_core::messages::Quoted;

/// What `--view` names.
pub(super) enum LeftOut {
    /// A view, by its number.
    View(usize),
    /// An image of the file of cameras that is no view.
    Listed(String),
}

impl Loader<'_> {
    /// The view that is left out: the one of this name, or the one whose name or image ends like it; else an
    /// image that the file of cameras lists.
    pub(super) fn left_out(&self, name: &str) -> Loaded<LeftOut> {
        let views = &self.spec.view;
        if let Some(index) = views.iter().position(|view| view.label() == name) {
            return Ok(LeftOut::View(index));
        }
        let labels: Vec<String> = views.iter().map(ViewSpec::label).collect();
        let images: Vec<String> = views.iter().map(|view| view.image.display().to_string()).collect();
        for list in [labels, images] {
            match names::find(&list, name) {
                Ok(found) if found.whole => return Ok(LeftOut::View(found.index)),
                Err(e @ NameError::Ambiguous { .. }) => return Err(self.incomplete(format!("--view: {e}"))),
                _ => (),
            }
        }
        let source = self.common_source().filter(|_| views.iter().all(|view| view.position.is_none()));
        let listed = source.map(|source| self.listed_name(&source, name)).transpose()?.flatten();
        match listed.is_some_and(|(_, whole)| whole) {
            true => Ok(LeftOut::Listed(name.into())),
            false => Err(self.no_such_view(name)),
        }
    }

    pub(super) fn no_such_view(&self, name: &str) -> InputError {
        let labels: Vec<String> = self.spec.view.iter().map(ViewSpec::label).collect();
        let known = names::list(&labels, ", ");
        self.incomplete(format!("there is no view \"{}\"; the views are {known}", Quoted(name)))
    }
}
