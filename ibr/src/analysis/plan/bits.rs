//! Bits for intensities and depths: R_T and R_D per value, R_T + R_D / k^2 = R per pixel where depth is given
//! for one pixel in k x k.
//!
//! With errors e_T = A 2^{-R_T} and e_D = D 2^{-R_D} in the view that are independent, the mean square e_T^2 +
//! e_D^2 is least where its derivatives by the bits of one pixel agree, at e_T = k e_D:
//!
//! ```text
//! R_T = (R - log2(k D / A) / k^2) / (1 + 1 / k^2),   R_D = R_T + log2(k D / A)
//! ```
//!
//! For k = 1 this is R_D = R / 2 + (1/2) log2(D / A): more bits of depth for textured scenes, wide baselines
//! and near objects.

use crate::analysis::random::{seeded, within};
use crate::analysis::view::with_noise;
use crate::pipeline::{RenderError, RenderSettings, rectified};
use crate::propagate::RectifiedView;

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
    let settings = RenderSettings { keep_exposure: true, ..*settings };
    let plain = rectified::render(views, position, &settings)?.image;
    let change = |views: &[RectifiedView<'_>]| {
        let image = rectified::render(views, position, &settings)?.image;
        let pairs = image.data().iter().zip(plain.data());
        let square = pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>() / plain.data().len() as f64;
        Ok::<f64, RenderError>(square.sqrt())
    };
    let maps = with_noise(views, DISPARITY, 3);
    let moved: Vec<_> =
        views.iter().zip(&maps).map(|(v, disparity)| RectifiedView { disparity, ..*v }).collect();
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
        let extreme = BitSplit::best(4.0, Sensitivity { texture: 1e-9, depth: 1.0 }, (255.0, 60.0), 1);
        assert_eq!(extreme, BitSplit { texture: 0.0, depth: 4.0 });
    }
}
