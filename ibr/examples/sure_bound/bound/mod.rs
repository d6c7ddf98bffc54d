//! The sure bound of every pixel of a view that is rendered by rows.

mod row;

pub use row::Limits;

use hybank_ibr::depth::Measure;
use hybank_ibr::interpolate::Cover;
use hybank_ibr::interpolate::rows::{MARGIN, RowWork};
use hybank_ibr::occlusion::{RowScratch, remove_in_row};
use hybank_ibr::pipeline::{RenderError, RenderSettings, Rendering, ViewWeights, rectified};
use hybank_ibr::propagate::{Frame, RectifiedView, RigCamera, rectified_row};
use hybank_ibr::sample::Sample;
use hybank_sampling::fit::Response;
use row::{RANGE, REACH, Row};

/// Order of the splines of the row fit.
const ORDER: usize = 4;

/// The view at a position with the sure bound of each pixel, in grey levels; that of a pixel which no view
/// sees is the whole range.
pub fn bounded(
    views: &[RectifiedView<'_>],
    position: f64,
    settings: &RenderSettings,
    limits: &Limits,
) -> Result<(Rendering, Vec<f32>), RenderError> {
    let rendering = rectified::render(views, position, settings)?;
    let agreement = &rendering.agreement;
    let weights = ViewWeights::of(views, &position).nearest(settings.nearest).with_noise(agreement);
    let settings = settings.suited_to(agreement, &weights, Measure::Disparity);
    let weights = if settings.keep_exposure { weights } else { weights.with_gains(&agreement.gains) };
    let (width, height) = rendering.image.size();
    let frame = Frame::whole(width, height, MARGIN, settings.offset);
    let camera = RigCamera::new(views, position);
    let job = Job { views, camera, weights, frame, settings, mask: &rendering.mask, limits };
    let bounds = match rendering.image.channels() {
        3 => job.bounds::<3>(),
        _ => job.bounds::<1>(),
    }?;
    Ok((rendering, bounds))
}

/// What all rows share.
struct Job<'a> {
    views: &'a [RectifiedView<'a>],
    camera: RigCamera,
    weights: ViewWeights,
    frame: Frame,
    settings: RenderSettings,
    mask: &'a [Cover],
    limits: &'a Limits,
}

impl Job<'_> {
    fn bounds<const C: usize>(&self) -> Result<Vec<f32>, RenderError> {
        let width = self.frame.width;
        let mut bounds = vec![RANGE as f32; self.mask.len()];
        let (mut fit, mut values) = (RowWork::<C>::new(width), vec![0.0; width * C]);
        let mut mask = vec![Cover::default(); width];
        for (y, bounds) in bounds.chunks_mut(width).enumerate() {
            let samples = self.samples::<C>(y);
            let fitted = fit.interpolate(&samples, &self.settings.interpolation, &mut values, &mut mask);
            if fitted.map_err(|source| RenderError::Fit { row: y, source })? {
                self.of_row(&samples, &fit, &self.mask[y * width..], bounds);
            }
        }
        Ok(bounds)
    }

    /// The visible samples of a row, with the weights of their views.
    fn samples<const C: usize>(&self, y: usize) -> Vec<Sample<C>> {
        let mut samples = Vec::new();
        for view in self.weights.views() {
            rectified_row(&self.views[view], view as u16, y, &self.camera, &self.frame, &mut samples);
        }
        remove_in_row(&mut samples, self.settings.depth_test(), &mut RowScratch::default());
        self.weights.apply(&mut samples);
        samples
    }

    /// The bound of every pixel of a row that is seen.
    fn of_row<const C: usize>(
        &self,
        samples: &[Sample<C>],
        fit: &RowWork<C>,
        seen: &[Cover],
        bounds: &mut [f32],
    ) {
        let test = self.settings.depth_test();
        let parts = |a: &Sample<C>, b: &Sample<C>| {
            test.hides(f64::from(a.depth.min(b.depth)), f64::from(a.depth.max(b.depth)))
        };
        let distance = |view: u16| (self.views[usize::from(view)].camera - self.camera.position).abs();
        let row = Row::new(samples, self.limits, distance, parts);
        let mut response = Response::default();
        for (column, bound) in bounds.iter_mut().enumerate().filter(|(x, _)| seen[*x] == Cover::Seen) {
            let x = column as f64;
            fit.respond(x, &mut response);
            let influence = |k: usize| f64::from(samples[k].weight) * response.at::<ORDER>(samples[k].x);
            let near = fit.fillers().iter().filter(|f| (**f - x).abs() <= REACH);
            let filled =
                near.map(|f| response.at::<ORDER>(*f)).fold((0.0, 0.0), |(s, m), h| (s + h, m + h.abs()));
            *bound = row.bound(x, self.limits, influence, filled) as f32;
        }
    }
}
