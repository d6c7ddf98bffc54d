//! The error of a view of general cameras, from its rendering by the plane fit: the same causes as for
//! rectified rigs, their sizes taken from the rendered view, its depths and its sample counts.

use super::estimate::{Calibration, Examined, Known, ViewError, calibrate, equalised, judge};
use super::jitter::{difference, local_mean};
use super::lookup::local_limits;
use super::random::{bounded_normal, seeded};
use super::regressors::{Regressors, hole_distances, slopes};
use super::variogram::Variogram;
use crate::camera::Camera;
use crate::depth::DepthMap;
use crate::image::Image;
use crate::pipeline::depth_errors::Lookups;
use crate::pipeline::{Agreement, Balance, RenderError, RenderSettings, Rendering, calibrated as pipeline};
use crate::propagate::CalibratedView;

/// Errors of depth below this share change nothing that can be seen.
const LEAST: f64 = 1e-4;

/// Largest share of its depth by which a noisy depth is wrong, in standard deviations.
const TAIL: f64 = 3.0;

/// The error of the view of `camera` with `size` pixels. [`CameraPredictor`] predicts several views.
///
/// # Errors
/// Those of [`crate::pipeline::calibrated::render`].
pub fn calibrated(
    views: &[CalibratedView<'_>],
    camera: &Camera,
    size: (usize, usize),
    settings: &RenderSettings,
) -> Result<ViewError, RenderError> {
    CameraPredictor::new(views, settings)?.at(camera, size)
}

/// Views of general cameras with the weights that are calibrated on them, for any number of predictions.
pub struct CameraPredictor<'a> {
    /// Photographs with one exposure.
    images: Vec<Image>,
    maps: Vec<(&'a DepthMap, Camera)>,
    settings: RenderSettings,
    known: Known,
    calibration: Calibration,
    agreement: Agreement,
}

impl<'a> CameraPredictor<'a> {
    /// Leaves each view out in turn and calibrates.
    ///
    /// # Errors
    /// Those of [`crate::pipeline::calibrated::render`].
    pub fn new(views: &[CalibratedView<'a>], settings: &RenderSettings) -> Result<Self, RenderError> {
        let agreement = Agreement::calibrated(views);
        let gains = if settings.keep_exposure { &[][..] } else { &agreement.gains };
        let images = equalised(views.iter().map(|v| v.image), gains);
        let maps: Vec<_> = views.iter().map(|v| (v.depth, v.camera)).collect();
        let views = joined(&images, &maps);
        let settings = RenderSettings { keep_exposure: true, ..*settings };
        let known = Known { variogram: Variogram::of(images.iter()), noise: depth_noise(&views) };
        let calibration: Calibration = calibrate(&views, &known, |others, truth| {
            // A registration offset belongs to the virtual view only.
            let settings = RenderSettings { offset: 0.0, ..settings };
            let goal = Goal { camera: &truth.camera, size: truth.image.size() };
            let (rendering, x) = examine(others, &goal, &settings, &known, spacing(&views, &truth.camera))?;
            Ok((x, difference(&rendering.image.quantised(), truth.image)))
        })?;
        Ok(Self { images, maps, settings, known, calibration, agreement })
    }

    /// How well the views agree, as they were given.
    pub fn agreement(&self) -> &Agreement {
        &self.agreement
    }

    /// The views, with one exposure.
    pub fn views(&self) -> Vec<CalibratedView<'_>> {
        joined(&self.images, &self.maps)
    }

    /// The error of the view of `camera`.
    ///
    /// # Errors
    /// Those of [`crate::pipeline::calibrated::render`].
    pub fn at(&self, camera: &Camera, size: (usize, usize)) -> Result<ViewError, RenderError> {
        let (views, goal) = (self.views(), Goal { camera, size });
        let spacing = spacing(&views, camera);
        let (rendering, regressors) = examine(&views, &goal, &self.settings, &self.known, spacing)?;
        let local_limit = local_limits(&views, camera, &rendering, TAIL * self.known.noise);
        Ok(judge(Examined { rendering, regressors, sure_bound: Vec::new(), local_limit }, self.calibration))
    }

    /// The view of `camera`, as it is rendered from the views.
    ///
    /// # Errors
    /// Those of [`crate::pipeline::calibrated::render`].
    pub fn render(&self, camera: &Camera, size: (usize, usize)) -> Result<Rendering, RenderError> {
        pipeline::render(&self.views(), camera, size, &RenderSettings { offset: 0.0, ..self.settings })
    }

    /// The local mean of the change of a rendered view if its depths were `changed`, in grey levels.
    ///
    /// # Errors
    /// Those of [`crate::pipeline::calibrated::render`].
    pub fn change(
        &self,
        camera: &Camera,
        rendered: &Image,
        changed: impl Fn(&DepthMap) -> DepthMap,
    ) -> Result<Vec<f32>, RenderError> {
        let maps: Vec<DepthMap> = self.maps.iter().map(|(map, _)| changed(map)).collect();
        let with = |(v, depth)| CalibratedView { depth, ..v };
        let views: Vec<CalibratedView<'_>> = self.views().into_iter().zip(&maps).map(with).collect();
        let image = pipeline::render(&views, camera, rendered.size(), &self.settings)?.image;
        Ok(local_mean(&difference(&image, rendered), image.size()))
    }

    /// The mean estimate of the view of `camera` if `another` view were there too, with the weights as they
    /// are.
    ///
    /// # Errors
    /// Those of [`crate::pipeline::calibrated::render`].
    pub fn with_view(
        &self,
        camera: &Camera,
        size: (usize, usize),
        another: &CalibratedView<'_>,
    ) -> Result<f64, RenderError> {
        let views = [self.views(), vec![*another]].concat();
        let (goal, spacing) = (Goal { camera, size }, spacing(&self.views(), camera));
        let (_, regressors) = examine(&views, &goal, &self.settings, &self.known, spacing)?;
        Ok(self.calibration.mean(&regressors))
    }
}

fn joined<'a>(images: &'a [Image], maps: &[(&'a DepthMap, Camera)]) -> Vec<CalibratedView<'a>> {
    let view = |(image, (depth, camera)): (&'a Image, &(&'a DepthMap, Camera))| CalibratedView {
        image,
        depth,
        camera: *camera,
    };
    images.iter().zip(maps).map(view).collect()
}

/// A virtual camera and its size in pixels.
struct Goal<'a> {
    camera: &'a Camera,
    size: (usize, usize),
}

/// Mean distance between a view and the one nearest to it; for views at one place that of the virtual
/// camera, or one.
fn spacing(views: &[CalibratedView<'_>], camera: &Camera) -> f64 {
    let between = |a: &Camera, b: &Camera| (a.centre() - b.centre()).norm();
    let nearest = |i: usize| {
        let others = views.iter().enumerate().filter(|(j, _)| *j != i);
        others.map(|(_, v)| between(&v.camera, &views[i].camera)).fold(f64::INFINITY, f64::min)
    };
    let mean = (0..views.len()).map(nearest).sum::<f64>() / views.len() as f64;
    let away = views.iter().map(|v| between(&v.camera, camera)).fold(f64::INFINITY, f64::min);
    [mean, away].into_iter().find(|s| *s > 0.0 && s.is_finite()).unwrap_or(1.0)
}

/// Standard deviation of independent errors of the depths as a share of the depth, from the maps alone:
/// points of one map are looked up in that of the nearest other view. 0 for a single view.
///
/// The second depth is interpolated between four, which leaves 4/9 of its variance, so the difference has
/// s^2 (1 + 4/9). The median makes hidden points harmless.
pub fn depth_noise(views: &[CalibratedView<'_>]) -> f64 {
    let distance = |i: usize, j: usize| (views[i].camera.centre() - views[j].camera.centre()).norm();
    let nearest = |j| (0..j).min_by(|a: &usize, b: &usize| distance(*a, j).total_cmp(&distance(*b, j)));
    let lookups = |j: usize| {
        let (a, b) = (&views[nearest(j)?], &views[j]);
        let map = a.camera.relative_to(&b.camera);
        Some(Lookups::of(a.depth, b.depth, |x, y, d| map.map(x, y, d)))
    };
    (1..views.len()).filter_map(lookups).fold(Lookups::default(), Lookups::and).common()
}

/// A rendering and the regressors of its pixels.
fn examine(
    views: &[CalibratedView<'_>],
    goal: &Goal<'_>,
    settings: &RenderSettings,
    known: &Known,
    spacing: f64,
) -> Result<(Rendering, Vec<Regressors>), RenderError> {
    let Goal { camera, size } = *goal;
    let rendering = pipeline::render(views, camera, size, settings)?;
    let jitter = jitter(views, camera, settings, &rendering.image, known.noise)?;
    let balance = Balance::calibrated(views, camera).with_noise(&rendering.agreement);
    let (shares, lever) = shares(views, camera, &balance);
    let lever = lever / (spacing * spacing);
    let image = &rendering.image;
    let (slopes, bends) = (slopes(image), bends(image));
    let edges = edges(image, &rendering.depth, settings);
    let distances = hole_distances(&rendering.mask, size.0);
    let of_pixel = |p: usize| {
        if distances[p] > 0 {
            return [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, known.variogram.at(distances[p])];
        }
        // At most as many views share in a pixel as samples lie on it.
        let shares = f64::max(shares, 1.0 / f64::from(rendering.counts[p].max(1)));
        let displacement = ((shares + lever) / 2.0).sqrt();
        let slope = f64::from(slopes[p]) * displacement;
        [
            f64::from(bends[p]),
            (1.0 + shares).sqrt(),
            slope,
            f64::from(jitter[p]),
            f64::from(edges[p]),
            0.0,
            0.0,
        ]
    };
    let regressors = (0..size.0 * size.1).map(of_pixel).collect();
    Ok((rendering, regressors))
}

/// Sum of the squared shares of the views in a pixel that all of them see, and the same times their squared
/// distances.
fn shares(views: &[CalibratedView<'_>], camera: &Camera, balance: &Balance) -> (f64, f64) {
    let weight = |i: usize| f64::from(balance.weight(i as u16));
    let total: f64 = (0..views.len()).map(weight).sum();
    let square = |i: usize| (weight(i) / total).powi(2);
    let away = |i: usize| (views[i].camera.centre() - camera.centre()).norm_squared();
    ((0..views.len()).map(square).sum(), (0..views.len()).map(|i| square(i) * away(i)).sum())
}

/// Local mean of the change of a view under errors of the depths of this relative standard deviation.
fn jitter(
    views: &[CalibratedView<'_>],
    camera: &Camera,
    settings: &RenderSettings,
    view: &Image,
    deviation: f64,
) -> Result<Vec<f32>, RenderError> {
    let size = view.size();
    if deviation < LEAST {
        return Ok(vec![0.0; size.0 * size.1]);
    }
    let random = &mut seeded(1);
    let mut error = || bounded_normal(random) * deviation;
    let maps: Vec<DepthMap> = views.iter().map(|v| v.depth.changed(|d| d * (1.0 + error()) as f32)).collect();
    let noisy: Vec<CalibratedView<'_>> =
        views.iter().zip(&maps).map(|(v, depth)| CalibratedView { depth, ..*v }).collect();
    let changed = pipeline::render(&noisy, camera, size, settings)?.image;
    Ok(local_mean(&difference(&changed, view), size))
}

/// (|f_xx| + |f_yy|) / 8, mean over the channels: the error of linear interpolation between samples a pixel
/// apart.
fn bends(image: &Image) -> Vec<f32> {
    let ((width, height), channels) = (image.size(), image.channels());
    let at = |x: usize, y: usize, c: usize| image.data()[(y * width + x) * channels + c];
    let bend = |p: usize| {
        let (x, y) = ((p % width).clamp(1, width.max(3) - 2), (p / width).clamp(1, height.max(3) - 2));
        let of_channel = |c: usize| {
            let middle = 2.0 * at(x, y, c);
            let across = (at(x - 1, y, c) - middle + at(x + 1, y, c)).abs();
            across + (at(x, y - 1, c) - middle + at(x, y + 1, c)).abs()
        };
        (0..channels).map(of_channel).sum::<f32>() / (8.0 * channels as f32)
    };
    if width < 3 || height < 3 {
        return vec![0.0; width * height];
    }
    (0..width * height).map(bend).collect()
}

/// Share of the height of a jump in its two pixels, which lie half a pixel away: 1 - 0.5 / 1.5.
const BESIDE: f32 = 2.0 / 3.0;

/// For pixels beside a jump of the rendered depth, the difference of the colours on both sides of it.
fn edges(image: &Image, depth: &DepthMap, settings: &RenderSettings) -> Vec<f32> {
    let ((width, height), channels) = (image.size(), image.channels());
    let test = settings.depth_test();
    let known = |p: usize| Some(f64::from(depth.data()[p])).filter(|d| !d.is_nan());
    let mut edges = vec![0.0_f32; width * height];
    for p in 0..width * height {
        let across = (p % width + 1 < width).then_some((p + 1, 1));
        let down = (p / width + 1 < height).then_some((p + width, width));
        for (q, stride) in across.into_iter().chain(down) {
            let Some((a, b)) = known(p).zip(known(q)) else { continue };
            if !test.hides(a.min(b), a.max(b)) {
                continue;
            }
            // The pixels of the jump itself are mixed: compare those behind them.
            let (before, after) = (p.saturating_sub(stride), (q + stride).min(width * height - 1));
            let value = |p: usize, c: usize| image.data()[p * channels + c];
            let height = (0..channels).map(|c| (value(before, c) - value(after, c)).abs()).sum::<f32>();
            let beside = BESIDE * height / channels as f32;
            (edges[p], edges[q]) = (edges[p].max(beside), edges[q].max(beside));
        }
    }
    edges
}
