//! The memory that a rendering takes, before it begins.

use super::failure::Failure;
use crate::image::Image;
use crate::pipeline::Method;
use crate::scene::{Kind, Scene};
use hybank::memory::available_memory;

/// What is computed from a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Work {
    /// A virtual view by this method.
    Render(Method),
    /// The prediction of its error.
    Bound,
}

/// Bytes beside those of the scene: of each pixel of each view, of each pixel of the virtual view, and of
/// its colours. Fitted to the largest resident memory of renderings of 1 to 4 million pixels from 2 and 4
/// views.
struct Rates {
    view: f64,
    pixel: f64,
    colour: f64,
}

const ROWS: Rates = Rates { view: 4.0, pixel: 12.0, colour: 10.0 };
const PLANE: Rates = Rates { view: 8.0, pixel: 100.0, colour: 12.0 };
/// All samples are in memory at once, 40 bytes each, or 48 with colours.
const UNCALIBRATED: Rates = Rates { view: 80.0, pixel: 100.0, colour: 12.0 };
const BOUND: Rates = Rates { view: 40.0, pixel: 150.0, colour: 20.0 };
/// Threads, and bands of samples whose size does not depend on the views.
const BASE: f64 = 5e7;

impl Work {
    fn rates(self, kind: &Kind) -> Rates {
        match (self, kind) {
            (Self::Bound, _) => BOUND,
            (_, Kind::Uncalibrated { .. }) => UNCALIBRATED,
            (Self::Render(Method::Auto | Method::Rows), Kind::Rectified { .. }) => ROWS,
            (Self::Render(_), _) => PLANE,
        }
    }
}

/// Refuses a rendering for which this process has no memory; the system would end it without a message.
pub(super) fn check(scene: &Scene, work: Work) -> Result<(), Failure> {
    let (images, (width, height)) = sizes(&scene.kind);
    let views: f64 = images.iter().map(|image| (image.width() * image.height()) as f64).sum();
    let colours = images.iter().map(|image| image.channels()).max().unwrap_or(1) as f64;
    let Rates { view, pixel, colour } = work.rates(&scene.kind);
    let bytes = BASE + view * views + (pixel + colour * colours) * (width * height) as f64;
    match available_memory() {
        Some(memory) if bytes > memory => Err(Failure::Input(format!(
            "the virtual view of {width} x {height} pixels from {} views takes about {:.2} GB of memory, and this \
             process may use {:.2} GB; shrink the images or the view, or use fewer views",
            images.len(),
            bytes / 1e9,
            memory / 1e9
        ))),
        _ => Ok(()),
    }
}

/// The images of a scene, and the size of its virtual views.
fn sizes(kind: &Kind) -> (Vec<&Image>, (usize, usize)) {
    match kind {
        Kind::Rectified { views, .. } => {
            let images: Vec<&Image> = views.iter().map(|view| &view.image).collect();
            let size = images.first().map_or((0, 0), |image| image.size());
            (images, size)
        }
        Kind::Calibrated { views, size, .. } => (views.iter().map(|view| &view.image).collect(), *size),
        Kind::Uncalibrated { images, size, .. } => (images.iter().collect(), *size),
    }
}
