//! The error of a view of a rectified rig, rendered by rows: what its samples say, pixel by pixel. How much
//! each sample counts in the fit that is really used, and how well the samples agree.

use super::estimate::{Examined, Predicted, Study};
use super::jitter::depth_jitter;
use super::regressors::{regressors, slopes};
use crate::depth::Measure;
use crate::image::Image;
use crate::interpolate::rows::{self, ORDER, RowWork};
use crate::interpolate::{Cover, Settings};
use crate::occlusion::DepthTest;
use crate::pipeline::rectified::{self, Job, Strip};
use crate::pipeline::{RenderError, RenderSettings, Rendering, ViewWeights};
use crate::propagate::{Frame, RectifiedView, RigCamera};
use hybank_sampling::SamplingError;
use hybank_sampling::fit::Response;
use rayon::prelude::*;

/// Distance in pixels over which a colour of doubtful depth is wrong, for the variogram.
const DOUBT: usize = 4;

impl Predicted for f64 {
    fn render(
        &self,
        views: &[RectifiedView<'_>],
        _: (usize, usize),
        settings: &RenderSettings,
    ) -> Result<Rendering, RenderError> {
        rectified::render(views, *self, settings)
    }

    fn examine(
        &self,
        views: &[RectifiedView<'_>],
        size: (usize, usize),
        study: &Study,
        spacing: f64,
    ) -> Result<Examined, RenderError> {
        let settings = &study.settings;
        let rendering = self.render(views, size, settings)?;
        let evidence = collect(views, *self, settings, &rendering)?;
        let jitter = depth_jitter(views, self, settings, &rendering.image, study.noise)?;
        let slopes = slopes(&rendering.image);
        let of_seen = |p: usize| {
            let e = &evidence[p];
            // The noise of the photograph that a view is compared with adds to that of the views.
            let noise = (1.0 + f64::from(e.views)).sqrt();
            // Displacements of the samples: one part grows with the distance to the views, and one does not.
            let disparity_gain = f64::from(e.disparity_gain) / (spacing * spacing);
            let displacement = ((f64::from(e.views) + disparity_gain) / 2.0).sqrt();
            [
                f64::from(e.bias),
                noise,
                f64::from(slopes[p]) * displacement,
                f64::from(jitter[p]),
                f64::from(e.edge),
                f64::from(e.doubtful) * study.variogram.at(DOUBT),
                0.0,
            ]
        };
        let regressors = regressors(&rendering, &study.variogram, of_seen);
        Ok(Examined { rendering, regressors })
    }

    fn spacing(&self, views: &[RectifiedView<'_>]) -> f64 {
        let positions = || views.iter().map(|v| v.camera);
        let (low, high) = positions().fold((f64::MAX, f64::MIN), |(a, b), p| (a.min(p), b.max(p)));
        let away = positions().map(|p| (p - self).abs()).fold(f64::MAX, f64::min);
        let candidates = [(high - low) / (views.len() as f64 - 1.0).max(1.0), away];
        candidates.into_iter().find(|s| *s > 0.0).unwrap_or(1.0)
    }
}

/// One pixel of a virtual view. h_s is the influence of sample s on the pixel at x.
#[derive(Debug, Clone, Copy, Default)]
struct Evidence {
    /// sum over the views of (sum of the h_s of the view)^2: 1 for one view, 1/2 for two equal ones.
    views: f32,
    /// sum over the views of (sum of the h_s of the view)^2 (distance to the view)^2.
    disparity_gain: f32,
    /// Change of the pixel when the fit is fitted once more: its bias.
    bias: f32,
    /// Influence of samples whose depth or colour is doubtful.
    doubtful: f32,
    /// The height of a depth edge beside the pixel, weighted by its distance; 0 elsewhere.
    edge: f32,
}

/// Collects the evidence for a view of a rectified rig.
///
/// # Errors
/// Those of [`rectified::render`].
fn collect(
    views: &[RectifiedView<'_>],
    position: f64,
    settings: &RenderSettings,
    rendering: &Rendering,
) -> Result<Vec<Evidence>, RenderError> {
    let view_weights = ViewWeights::of(views, &position).with_noise(&rendering.agreement);
    let settings = &settings.suited_to(&rendering.agreement, &view_weights, Measure::Disparity);
    let view_weights = view_weights.with_gains(&rendering.agreement.gains);
    let (camera, (width, height)) = (RigCamera::new(views, position), rendering.image.size());
    let frame = Frame::whole(width, height, rows::MARGIN, settings.offset);
    let rows = Job { views, camera, view_weights, frame, settings, watch: &|_| () };
    match rendering.image.channels() {
        3 => collect_with::<3>(&rows, &rendering.image),
        _ => collect_with::<1>(&rows, &rendering.image),
    }
}

fn collect_with<const C: usize>(job: &Job<'_>, image: &Image) -> Result<Vec<Evidence>, RenderError> {
    let (width, height) = image.size();
    let mut evidence = vec![Evidence::default(); width * height];
    evidence.par_chunks_mut(width).enumerate().try_for_each_init(
        || RowEvidence::<C>::new(job),
        |work, (y, evidence)| {
            if work.row(job, y, evidence)? {
                work.edges(job.settings.depth_test(), image.row(y), evidence);
            }
            Ok::<(), RenderError>(())
        },
    )?;
    Ok(evidence)
}

/// Pixels to each side beyond which no sample has an influence that counts: it falls by four per pixel.
const INFLUENCE: f64 = 8.0;

/// Work memory of one row.
struct RowEvidence<const C: usize> {
    strip: Strip<C>,
    fit: RowWork<C>,
    again: RowWork<C>,
    response: Response,
    /// The influence of each view on a pixel.
    of_views: Vec<f64>,
    values: Vec<f32>,
    mask: Vec<Cover>,
}

impl<const C: usize> RowEvidence<C> {
    fn new(job: &Job<'_>) -> Self {
        let width = job.frame.width;
        Self {
            strip: Strip::new(job),
            fit: RowWork::new(width),
            again: RowWork::new(width),
            response: Response::default(),
            of_views: Vec::new(),
            values: vec![0.0; width * C],
            mask: vec![Cover::default(); width],
        }
    }

    /// The evidence of one row; false if it has no samples.
    fn row(&mut self, job: &Job<'_>, y: usize, evidence: &mut [Evidence]) -> Result<bool, RenderError> {
        let failed = |source| RenderError::Fit { row: y, source };
        let settings = &job.settings.interpolation;
        self.strip.survivors_of_row(job, y);
        let fitted = self.fit.interpolate(&self.strip.samples, settings, &mut self.values, &mut self.mask);
        if !fitted.map_err(failed)? {
            return Ok(false);
        }
        for (x, pixel) in evidence.iter_mut().enumerate() {
            *pixel = self.pixel(job, x as f64);
        }
        self.bias(settings, evidence).map_err(failed)?;
        Ok(true)
    }

    /// Fits the fit again, at the samples.
    fn bias(&mut self, settings: &Settings, evidence: &mut [Evidence]) -> Result<(), SamplingError> {
        let once = std::mem::take(&mut self.values);
        let mut smooth = self.strip.samples.clone();
        smooth.iter_mut().for_each(|s| s.value = self.fit.value(s.x).map(|v| v as f32));
        self.values = vec![0.0; once.len()];
        self.again.interpolate(&smooth, settings, &mut self.values, &mut self.mask)?;
        let pairs = once.chunks_exact(C).zip(self.values.chunks_exact(C));
        for (pixel, (a, b)) in evidence.iter_mut().zip(pairs) {
            pixel.bias = a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f32>() / C as f32;
        }
        Ok(())
    }

    fn pixel(&mut self, job: &Job<'_>, x: f64) -> Evidence {
        self.fit.respond(x, &mut self.response);
        self.of_views.clear();
        self.of_views.resize(job.views.len(), 0.0);
        let mut e = Evidence::default();
        let from = self.strip.samples.partition_point(|s| s.x < x - INFLUENCE);
        for s in self.strip.samples[from..].iter().take_while(|s| s.x <= x + INFLUENCE) {
            let h = f64::from(s.weight) * self.response.at::<ORDER>(s.x);
            e.doubtful += if s.doubtful { h.abs() as f32 } else { 0.0 };
            self.of_views[usize::from(s.view)] += h;
        }
        for (view, influence) in self.of_views.iter().enumerate() {
            let (g2, distance) = (influence.powi(2), job.views[view].camera - job.camera.position);
            e.views += g2 as f32;
            e.disparity_gain += (g2 * distance * distance) as f32;
        }
        e
    }

    /// The height of every jump of depth between neighbouring samples, on the pixels within 1.5 of it.
    fn edges(&self, test: &DepthTest, row: &[f32], evidence: &mut [Evidence]) {
        let row = row.chunks_exact(C).collect::<Vec<_>>();
        let value = |x: f64| row[(x.round().max(0.0) as usize).min(row.len() - 1)];
        for pair in self.strip.samples.windows(2) {
            let (near, far) = (pair[0].depth.min(pair[1].depth), pair[0].depth.max(pair[1].depth));
            if !test.hides(f64::from(near), f64::from(far)) {
                continue;
            }
            let (left, right) = (value(pair[0].x - 1.5), value(pair[1].x + 1.5));
            let height = left.iter().zip(right).map(|(a, b)| (a - b).abs()).sum::<f32>() / left.len() as f32;
            let (low, high) = (pair[0].x, pair[1].x);
            let first = (low - 1.5).ceil().max(0.0) as usize;
            let near = evidence.iter_mut().enumerate().skip(first);
            for (x, pixel) in near.take_while(|(x, _)| *x as f64 <= high + 1.5) {
                let away = (low - x as f64).max(x as f64 - high).max(0.0) as f32;
                pixel.edge = pixel.edge.max(height * (1.0 - away / 1.5));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth::{DepthMap, Measure};
    use crate::image::Image;

    fn examined(positions: &[f64], at: f64, paint: impl Fn(usize) -> f32) -> Vec<Evidence> {
        let image = Image::new(60, 8, 1, (0..480).map(|i| paint(i % 60)).collect()).unwrap();
        let disparity = DepthMap::new((60, 8), vec![4.0; 480], 1.0, Measure::Disparity).unwrap();
        let view = |position: &f64| RectifiedView { image: &image, map: &disparity, camera: *position };
        let views: Vec<RectifiedView<'_>> = positions.iter().map(view).collect();
        let settings = RenderSettings::default();
        let rendering = rectified::render(&views, at, &settings).unwrap();
        collect(&views, at, &settings, &rendering).unwrap()
    }

    fn near(value: f32, want: f32) -> bool {
        (value - want).abs() < 0.02
    }

    /// Inside a flat scene the influences add up to one, evenly over the views half-way between them.
    #[test]
    fn influences_are_shares() {
        let two = examined(&[0.0, 1.0], 0.5, |_| 90.0);
        let one = examined(&[0.0], 0.5, |_| 90.0);
        for (s, views, disparity_gain) in [(&two, 0.5, 0.125), (&one, 1.0, 0.25)] {
            let e = s[4 * 60 + 30];
            assert!(near(e.views, views) && near(e.disparity_gain, disparity_gain), "{e:?}");
            assert!(near(e.bias, 0.0), "{e:?}");
        }
        assert!(two.iter().all(|e| e.edge == 0.0));
    }

    /// The bias of a smoothing fit is large where the texture is fine.
    #[test]
    fn fine_texture_has_a_bias() {
        let wave = |rate: f32| move |x: usize| 120.0 + 50.0 * (rate * x as f32).sin();
        let mean = |s: &[Evidence]| s[250..290].iter().map(|e| e.bias).sum::<f32>() / 40.0;
        let (fine, coarse) = (examined(&[0.0, 1.0], 0.5, wave(1.8)), examined(&[0.0, 1.0], 0.5, wave(0.3)));
        assert!(mean(&fine) > 10.0 * mean(&coarse), "{} {}", mean(&fine), mean(&coarse));
    }
}
