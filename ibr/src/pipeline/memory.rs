//! The memory that a rendering takes beside its views, before it begins: the arrays of the equations and of
//! the pixels, and the samples that are held at a time. Whether multigrid takes over is not known before;
//! the estimate lies between.

use super::{Method, RenderError, RenderSettings};
use crate::interpolate::Degree;
use crate::interpolate::rows::ORDER;
use crate::sample::Sample;
use hybank::memory::check_memory;
use hybank::sampling::Fit2;

/// Samples held in memory at a time; larger scenes are rendered in bands of rows.
const SAMPLES_AT_A_TIME: usize = 1 << 16;
/// Fewest rows of a band, however many samples they have: neighbouring bands share some rows, whose samples
/// are made twice.
const FEWEST_ROWS: usize = 40;

/// Bytes of a rendering of any kind: threads, points that are compared, and whatever is small.
const BASE: f64 = 5e5;
/// Bytes of a row of a rectified rig, its counts, and of each of its samples while it is sorted, tested and
/// fitted: keys, cells, the survivors' weights and sums.
const ROW: f64 = 41.0;
const ROW_SAMPLE: f64 = 67.0;
/// Bytes of a place in a band beside its sample: positions, depths, weights, cells.
const PLACE: f64 = 45.0;
/// Bytes per pixel of a prediction: of the evidence of a row fit, of the regressors with slopes, distances
/// and jitter, and of the search for local limits.
const ROW_EVIDENCE: f64 = 24.0;
const REGRESSORS: f64 = 76.0;
const LIMITS: f64 = 52.0;

/// The sizes on which the memory depends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    /// Width and height of the virtual view.
    pub size: (usize, usize),
    /// Views that are used.
    pub views: usize,
    /// Pixels of all of them.
    pub pixels: usize,
    /// Of these, as many as fall in the virtual view at most.
    pub samples: usize,
    /// Pixels of the largest.
    pub largest: usize,
    /// 1 for grey, 3 for RGB.
    pub channels: usize,
}

impl Extent {
    /// Of views of these sizes, all of which are used, or so many.
    pub fn new(size: (usize, usize), images: &[&crate::image::Image], nearest: Option<usize>) -> Self {
        let mut pixels: Vec<usize> = images.iter().map(|image| image.width() * image.height()).collect();
        pixels.sort_unstable_by(|a, b| b.cmp(a));
        pixels.truncate(nearest.unwrap_or(usize::MAX));
        let channels = images.iter().map(|image| image.channels()).max().unwrap_or(1);
        let largest = pixels.first().copied().unwrap_or(0);
        let (views, pixels) = (pixels.len(), pixels.iter().sum());
        Self { size, views, pixels, samples: pixels, largest, channels }
    }

    fn virtual_pixels(&self) -> f64 {
        self.size.0 as f64 * self.size.1 as f64
    }

    fn sample(&self) -> f64 {
        if self.channels == 3 { size_of::<Sample<3>>() as f64 } else { size_of::<Sample<1>>() as f64 }
    }

    /// A rendered view: values, depths, counts and the mask.
    pub(crate) fn rendering(&self) -> f64 {
        (4.0 * self.channels as f64 + 7.0) * self.virtual_pixels()
    }

    fn agreement(&self) -> f64 {
        16.0 / 7.0 * self.largest as f64
    }

    fn strip(&self) -> f64 {
        let knot = 8.0 * (ORDER + self.channels) as f64;
        self.size.0 as f64 * (knot + self.views as f64 * (2.0 * self.sample() + ROW_SAMPLE))
    }

    /// Bytes of a view of a rectified rig.
    pub fn of_rig(&self, settings: &RenderSettings) -> f64 {
        if settings.method == Method::Plane {
            return BASE + self.plane(settings.interpolation.plane.degree, self.strip());
        }
        let strips = rayon::current_num_threads().min(self.size.1) as f64 * self.strip();
        BASE + self.agreement().max(self.rendering() + ROW * self.size.1 as f64 + strips)
    }

    /// Bytes of a view of general cameras.
    pub fn of_cameras(&self, settings: &RenderSettings) -> f64 {
        let bands = bands_of(self.samples, self.size.1);
        let at_a_time = rayon::current_num_threads().min(bands.div_ceil(2)) as f64 / bands as f64;
        let samples = self.samples as f64 * at_a_time.min(1.0) * (self.sample() + PLACE);
        BASE + self
            .agreement()
            .max(self.plane(settings.interpolation.plane.degree, samples + self.samples as f64))
    }

    /// Bytes of a view of views without cameras.
    pub fn of_tracks(&self) -> f64 {
        // The brightness of all views, with what lies in front and behind on each pixel of one; then the
        // depths in front in all views, and counts of the virtual one.
        let decided = 4.0 * self.pixels as f64 + 36.0 * self.largest as f64;
        let rendered = 4.0 * self.pixels as f64 + self.rendering() + 4.0 * self.virtual_pixels();
        BASE + decided.max(rendered)
    }

    /// Bytes of the prediction of a view of a rectified rig, with what is known of views before it.
    pub fn of_rig_prediction(&self) -> f64 {
        let strips = 2.0 * rayon::current_num_threads().min(self.size.1) as f64 * self.strip();
        BASE + self.predicted(ROW_EVIDENCE * self.virtual_pixels() + strips)
    }

    /// Bytes of the prediction of a view of general cameras, with what is known of views before it.
    pub fn of_camera_prediction(&self, settings: &RenderSettings) -> f64 {
        self.predicted(self.of_cameras(settings))
    }

    /// Photographs with one exposure and the rendered view, and the larger of two: maps with errors and what
    /// `rendering` from these takes, or what the errors are computed from.
    fn predicted(&self, rendering: f64) -> f64 {
        let equalised = 4.0 * self.channels as f64 * self.pixels as f64;
        let judged = (REGRESSORS + LIMITS) * self.virtual_pixels();
        equalised + self.rendering() + judged.max(5.0 * self.pixels as f64 + rendering)
    }

    /// The plane fit, with other memory while samples are added.
    fn plane(&self, degree: Degree, gathering: f64) -> f64 {
        let Self { size, .. } = *self;
        let memory = match (degree, self.channels) {
            (Degree::Linear, 3) => Fit2::<2, 3>::memory(size.0, size.1),
            (Degree::Linear, _) => Fit2::<2, 1>::memory(size.0, size.1),
            (Degree::Cubic, 3) => Fit2::<4, 3>::memory(size.0, size.1),
            (Degree::Cubic, _) => Fit2::<4, 1>::memory(size.0, size.1),
        };
        let pixels = self.virtual_pixels();
        // Depths, their distances, and counts; then the mask instead of the distances.
        let gathered = memory.equations + 10.0 * pixels + gathering;
        let (alone, with_multigrid) = (memory.solving + 7.0 * pixels, memory.with_multigrid + 7.0 * pixels);
        // As far above the one as below the other.
        let solved = 2.0 / (1.0 / alone + 1.0 / with_multigrid);
        gathered.max(solved)
    }

    /// Refuses work for which this process has too little memory.
    ///
    /// # Errors
    /// [`RenderError::Memory`].
    pub fn check(&self, bytes: f64) -> Result<(), RenderError> {
        let Self { size, views, .. } = *self;
        check_memory(bytes).map_err(|shortage| RenderError::Memory { size, views, shortage })
    }
}

/// Bands of rows for views of so many pixels in all.
pub(super) fn bands_of(pixels: usize, height: usize) -> usize {
    pixels.div_ceil(SAMPLES_AT_A_TIME).min(height.div_ceil(FEWEST_ROWS)).max(1)
}
