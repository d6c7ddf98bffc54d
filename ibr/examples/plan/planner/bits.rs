//! Bits for intensities and depths: R_T and R_D per value, R_T + R_D / k^2 = R per pixel where depth is
//! given for one pixel in k x k.
//!
//! With errors e_T = A 2^{-R_T} and e_D = D 2^{-R_D} in the view that are independent, the mean square is
//! the sum of their squares. It is least where its derivatives by the bits of one pixel agree, at
//! e_T = k e_D:
//!
//! ```text
//! R_T = (R - log2(k D / A) / k^2) / (1 + 1 / k^2),   R_D = R_T + log2(k D / A)
//! ```
//!
//! For k = 1 this is R_D = R / 2 + (1/2) log2(D / A): more bits of depth for textured scenes, wide baselines
//! and near objects.
//!
//! Rounded disparities err alike at all pixels of a point: half-way between two views they displace its
//! samples in opposite directions, and to first order the error cancels. The closed form, which takes errors
//! as independent, then gives too many bits to depth. [`RoundingCosts`] renders the view from rounded
//! inputs.

use super::random::{seeded, within};
use hybank_ibr::analysis::with_noise;
use hybank_ibr::depth::{DepthMap, Measure};
use hybank_ibr::image::Image;
use hybank_ibr::pipeline::{Agreement, RenderError, RenderSettings, ViewWeights, rectified};
use hybank_ibr::propagate::RectifiedView;

/// Errors of intensity that are tried, in grey levels.
const GREY_LEVELS: f64 = 4.0;

/// Errors of disparity that are tried, in pixels for a baseline of one.
const DISPARITY: f64 = 0.25;

/// What errors of the inputs cost in a view: root mean square grey levels per unit of their own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensitivity {
    /// Per grey level.
    pub texture: f64,
    /// Per pixel of disparity for a baseline of one.
    pub depth: f64,
}

/// The settings with exposures as they are and with the smoothing that suits the views, so that renderings
/// from changed views are comparable.
fn settled(views: &[RectifiedView<'_>], position: f64, settings: &RenderSettings) -> RenderSettings {
    let agreement = Agreement::of(views);
    let view_weights = ViewWeights::of(views, &position).with_noise(&agreement);
    RenderSettings {
        keep_exposure: true,
        ..settings.suited_to(&agreement, &view_weights, Measure::Disparity)
    }
}

/// The sensitivities of a view of a rectified rig: it is rendered from intensities and from disparities with
/// small independent errors.
///
/// # Errors
/// Those of [`rectified::render`].
pub fn sensitivity(
    views: &[RectifiedView<'_>],
    position: f64,
    settings: &RenderSettings,
) -> Result<Sensitivity, RenderError> {
    let settings = settled(views, position, settings);
    let plain = rectified::render(views, position, &settings)?.image;
    let change = |views: &[RectifiedView<'_>]| {
        let image = rectified::render(views, position, &settings)?.image;
        Ok::<f64, RenderError>(mean_square(&image, &plain).sqrt())
    };
    let maps = with_noise(views, DISPARITY, 3);
    let moved: Vec<_> =
        views.iter().zip(&maps).map(|(v, disparity)| RectifiedView { map: disparity, ..*v }).collect();
    let random = &mut seeded(4);
    // A uniform error of this limit has the standard deviation GREY_LEVELS.
    let limit = GREY_LEVELS * 3.0_f64.sqrt();
    let mut images: Vec<_> = views.iter().map(|v| v.image.clone()).collect();
    images.iter_mut().for_each(|i| i.data_mut().iter_mut().for_each(|v| *v += within(limit, random) as f32));
    let noisy: Vec<_> = views.iter().zip(&images).map(|(v, image)| RectifiedView { image, ..*v }).collect();
    Ok(Sensitivity { texture: change(&noisy)? / GREY_LEVELS, depth: change(&moved)? / DISPARITY })
}

/// Bits per value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BitSplit {
    /// R_T, per intensity.
    pub texture: f64,
    /// R_D, per depth.
    pub depth: f64,
}

impl BitSplit {
    /// The best split of `total` bits per pixel for values that span `ranges` (grey levels, pixels of
    /// disparity), depth being given for one pixel in `step` x `step`. A rounding error is uniform within a
    /// step of 2^{-R} of the range.
    pub fn best(total: f64, sensitivity: Sensitivity, ranges: (f64, f64), step: usize) -> Self {
        let k = step.max(1) as f64;
        let ratio = (k * sensitivity.depth * ranges.1 / (sensitivity.texture * ranges.0)).log2();
        let texture = ((total - ratio / (k * k)) / (1.0 + 1.0 / (k * k))).clamp(0.0, total);
        Self { texture, depth: (total - texture) * k * k }
    }
}

/// Mean square change of a view when only intensities, or only disparities, are rounded to so many bits.
#[derive(Debug, Clone, PartialEq)]
pub struct RoundingCosts {
    /// For 1, 2, .. bits per intensity, in grey levels squared.
    pub texture: Vec<f64>,
    /// For 1, 2, .. bits per disparity.
    pub depth: Vec<f64>,
}

impl RoundingCosts {
    /// Renders a view of a rectified rig from inputs rounded to 1 .. `most` bits. `ranges` are the largest
    /// intensity and disparity; the smallest are 0.
    ///
    /// # Errors
    /// Those of [`rectified::render`].
    pub fn new(
        views: &[RectifiedView<'_>],
        position: f64,
        settings: &RenderSettings,
        ranges: (f64, f64),
        most: u32,
    ) -> Result<Self, RenderError> {
        let depths = |step: Option<f64>| {
            let of_view = |v: &RectifiedView<'_>| match step {
                Some(step) => rounded_map(v.map, step),
                None => v.map.clone(),
            };
            views.iter().map(of_view).collect()
        };
        Self::with_depths(views, position, settings, ranges, most, depths)
    }

    /// The same with depth that is not given for every pixel: `depths` makes the dense maps of all views
    /// from disparities that are rounded to a step ([`rounded_map`]), or as they are.
    ///
    /// # Errors
    /// Those of [`rectified::render`].
    pub fn with_depths(
        views: &[RectifiedView<'_>],
        position: f64,
        settings: &RenderSettings,
        ranges: (f64, f64),
        most: u32,
        depths: impl Fn(Option<f64>) -> Vec<DepthMap>,
    ) -> Result<Self, RenderError> {
        let exact = depths(None);
        let views = with_maps(views, &exact);
        let settings = settled(&views, position, settings);
        let render = |views: &[RectifiedView<'_>]| {
            Ok::<Image, RenderError>(rectified::render(views, position, &settings)?.image)
        };
        let plain = render(&views)?;
        let (mut texture, mut depth) = (Vec::new(), Vec::new());
        for bits in 1..=most {
            let step = |range: f64| range * (-f64::from(bits)).exp2();
            let images: Vec<Image> = views.iter().map(|v| rounded_image(v.image, step(ranges.0))).collect();
            let coarse: Vec<_> =
                views.iter().zip(&images).map(|(v, image)| RectifiedView { image, ..*v }).collect();
            texture.push(mean_square(&render(&coarse)?, &plain));
            let maps = depths(Some(step(ranges.1)));
            depth.push(mean_square(&render(&with_maps(&views, &maps))?, &plain));
        }
        Ok(Self { texture, depth })
    }

    /// The split of `total` bits per pixel with the least sum, in steps of a hundredth of a bit; depth is
    /// given for one pixel in `step` x `step`.
    pub fn best(&self, total: f64, step: usize) -> BitSplit {
        let area = (step.max(1) as f64).powi(2);
        let split = |texture: f64| BitSplit { texture, depth: (total - texture) * area };
        let cost = |s: &BitSplit| between(&self.texture, s.texture) + between(&self.depth, s.depth);
        let tried = (0..=(100.0 * total.max(0.0)) as usize).map(|i| split(i as f64 / 100.0));
        tried.min_by(|a, b| cost(a).total_cmp(&cost(b))).unwrap_or(split(0.0))
    }
}

fn with_maps<'a>(views: &[RectifiedView<'a>], maps: &'a [DepthMap]) -> Vec<RectifiedView<'a>> {
    views.iter().zip(maps).map(|(v, disparity)| RectifiedView { map: disparity, ..*v }).collect()
}

/// The mean square for any number of bits; its logarithm is linear between whole numbers and beyond them.
fn between(costs: &[f64], bits: f64) -> f64 {
    let logarithm = |k: usize| costs.get(k).map_or(0.0, |c| c.max(1e-12).ln());
    let below = (bits.max(1.0) as usize - 1).min(costs.len().saturating_sub(2));
    let part = bits - 1.0 - below as f64;
    (logarithm(below) * (1.0 - part) + logarithm(below + 1) * part).exp()
}

fn mean_square(a: &Image, b: &Image) -> f64 {
    let pairs = a.data().iter().zip(b.data());
    pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>() / a.data().len() as f64
}

/// The middle of the step that a value lies in.
fn middle(value: f32, step: f64) -> f32 {
    (((f64::from(value) / step).floor() + 0.5) * step) as f32
}

fn rounded_image(image: &Image, step: f64) -> Image {
    let mut rounded = image.clone();
    rounded.data_mut().iter_mut().for_each(|v| *v = middle(*v, step));
    rounded
}

/// A map whose values are the middles of steps.
pub fn rounded_map(map: &DepthMap, step: f64) -> DepthMap {
    map.changed(|v| middle(v, step))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The split against a search: no other one has a smaller sum of squares.
    #[test]
    fn no_other_split_is_better() {
        for (texture, depth, step) in [(0.5, 6.0, 1), (1.0, 0.5, 1), (0.7, 3.0, 6)] {
            let (k2, total) = ((step * step) as f64, 9.0);
            let cost = |r: f64| {
                let (e, d) = (texture * 255.0 * (-r).exp2(), depth * 60.0 * (-(total - r) * k2).exp2());
                e * e + d * d
            };
            let best = BitSplit::best(total, Sensitivity { texture, depth }, (255.0, 60.0), step);
            assert!((best.texture + best.depth / k2 - total).abs() < 1e-9);
            let found = (0..9000).map(|i| f64::from(i) * 1e-3).min_by(|a, b| cost(*a).total_cmp(&cost(*b)));
            assert!((found.unwrap() - best.texture).abs() < 2e-3, "{step}: {found:?} {best:?}");
        }
        // The same from costs of exact powers of two.
        let (a, d) = (0.5 * 255.0, 6.0 * 60.0);
        let powers = |e: f64| (1..=10).map(|b| (e * (-f64::from(b)).exp2()).powi(2)).collect();
        let costs = RoundingCosts { texture: powers(a), depth: powers(d) };
        let closed = BitSplit::best(9.0, Sensitivity { texture: 0.5, depth: 6.0 }, (255.0, 60.0), 1);
        assert!((costs.best(9.0, 1).texture - closed.texture).abs() < 0.011);
        let extreme = BitSplit::best(4.0, Sensitivity { texture: 1e-9, depth: 1.0 }, (255.0, 60.0), 1);
        assert_eq!(extreme, BitSplit { texture: 0.0, depth: 4.0 });
    }
}
