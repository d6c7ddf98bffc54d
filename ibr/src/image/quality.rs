//! Figures of merit of a rendering against a photograph: PSNR, SSIM and mean absolute error.

use super::Image;
use crate::files::InputError;

/// Figures of merit on the scale 0..255.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Quality {
    /// 10 log10(255^2 / MSE) in dB over all samples; infinite for equal images.
    pub psnr: f64,
    /// Structural similarity, mean over windows and channels.
    pub ssim: f64,
    /// Mean absolute error over all samples, in grey levels.
    pub mae: f64,
    /// Pixels that were compared.
    #[serde(skip)]
    pub pixels: usize,
}

/// Compares two images after rounding both to 8 bits, on the pixels where `mask` is true (all if `None`).
///
/// A grey image is compared with an RGB one as grey. `None` when the mask is empty.
///
/// # Errors
/// [`InputError::Sizes`] when the sizes differ, [`InputError::Buffer`] for a mask of another size.
pub fn compare(image: &Image, truth: &Image, mask: Option<&[bool]>) -> Result<Option<Quality>, InputError> {
    image.same_size("the rendered view", truth.size(), "the truth")?;
    let (width, height) = image.size();
    if let Some(mask) = mask.filter(|m| m.len() != width * height) {
        let expected = width * height;
        return Err(InputError::Buffer { width, height, channels: 1, expected, given: mask.len() });
    }
    let grey = image.channels() != truth.channels();
    let rounded = |image: &Image| if grey { image.to_grey().quantised() } else { image.quantised() };
    let (a, b) = (rounded(image), rounded(truth));
    let inside = |i: usize| mask.is_none_or(|m| m[i]);
    let pixels = (0..width * height).filter(|i| inside(*i)).count();
    if pixels == 0 {
        return Ok(None);
    }
    let (mut squares, mut sum) = (0.0, 0.0);
    for (i, (p, q)) in a.data.chunks_exact(a.channels).zip(b.data.chunks_exact(a.channels)).enumerate() {
        if inside(i) {
            let differences = p.iter().zip(q).map(|(p, q)| f64::from(p - q));
            differences.for_each(|d| (squares, sum) = (squares + d * d, sum + d.abs()));
        }
    }
    let samples = (pixels * a.channels) as f64;
    let ssim = (0..a.channels).map(|c| structural(&a, &b, c, &inside)).sum::<f64>() / a.channels as f64;
    let psnr = 10.0 * (255.0 * 255.0 * samples / squares).log10();
    Ok(Some(Quality { psnr, ssim, mae: sum / samples, pixels }))
}

/// Distance in pixels up to which the SSIM window reaches, and its standard deviation.
const SSIM_REACH: usize = 5;
const SSIM_SIGMA: f64 = 1.5;

/// Structural similarity of one channel (Wang, Bovik, Sheikh, Simoncelli 2004): Gaussian window of 11 x 11
/// pixels with a standard deviation of 1.5 pixels, K1 = 0.01, K2 = 0.03, mean over the windows that lie in
/// the image and whose centre is inside; the window shrinks in an image that is smaller.
fn structural(a: &Image, b: &Image, channel: usize, inside: &dyn Fn(usize) -> bool) -> f64 {
    let (width, height) = a.size();
    let (across, down) = (window(width), window(height));
    let (mut sum, mut count) = (0.0, 0.0);
    let mut columns = vec![[0.0; 5]; width];
    for top in 0..=height - down.len() {
        for (x, column) in columns.iter_mut().enumerate() {
            let at = |image: &Image, y: usize| f64::from(image.row(y)[x * image.channels + channel]);
            *column = weighted(&down, |k| {
                let (p, q) = (at(a, top + k), at(b, top + k));
                [p, q, p * p, q * q, p * q]
            });
        }
        for left in 0..=width - across.len() {
            if inside((top + down.len() / 2) * width + left + across.len() / 2) {
                sum += similarity(weighted(&across, |k| columns[left + k]));
                count += 1.0;
            }
        }
    }
    // A mask confined to the border contains no window; SSIM is then 1 by convention.
    if count > 0.0 { sum / count } else { 1.0 }
}

/// The Gaussian of sum 1, of the largest odd length up to 11 that fits `side` pixels.
fn window(side: usize) -> Vec<f64> {
    let reach = SSIM_REACH.min(side.saturating_sub(1) / 2) as i32;
    let bell = |k: i32| (-f64::from(k * k) / (2.0 * SSIM_SIGMA * SSIM_SIGMA)).exp();
    let sum: f64 = (-reach..=reach).map(bell).sum();
    (-reach..=reach).map(|k| bell(k) / sum).collect()
}

/// Weighted means over a window of two signals, their squares and their product.
type Moments = [f64; 5];

fn weighted(window: &[f64], moments: impl Fn(usize) -> Moments) -> Moments {
    let add = |sum: Moments, (k, w): (usize, &f64)| {
        let more = moments(k);
        std::array::from_fn(|i| sum[i] + w * more[i])
    };
    window.iter().enumerate().fold([0.0; 5], add)
}

fn similarity([a, b, aa, bb, ab]: Moments) -> f64 {
    let (c1, c2) = ((0.01_f64 * 255.0).powi(2), (0.03_f64 * 255.0).powi(2));
    let (va, vb, covariance) = (aa - a * a, bb - b * b, ab - a * b);
    (2.0 * a * b + c1) * (2.0 * covariance + c2) / ((a * a + b * b + c1) * (va + vb + c2))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wavy(width: usize, height: usize, channels: usize) -> Image {
        let value = |i: usize| 128.0 + 90.0 * ((i % 17) as f32 * 0.7).sin() + ((i * i) % 23) as f32;
        Image::new(width, height, channels, (0..width * height * channels).map(value).collect()).unwrap()
    }

    #[test]
    fn equal_images_are_perfect() {
        let q = compare(&wavy(20, 9, 3), &wavy(20, 9, 3), None).unwrap().unwrap();
        assert!(q.psnr.is_infinite() && q.mae == 0.0 && (q.ssim - 1.0).abs() < 1e-12, "{q:?}");
    }

    #[test]
    fn a_constant_offset_has_a_closed_form() {
        let a = Image::filled(16, 16, 3, 100.0);
        let b = Image::filled(16, 16, 3, 110.0);
        let q = compare(&a, &b, None).unwrap().unwrap();
        assert!((q.psnr - 20.0 * 25.5_f64.log10()).abs() < 1e-12 && q.mae == 10.0, "{q:?}");
        let c1 = 2.55_f64.powi(2);
        let flat = (2.0 * 100.0 * 110.0 + c1) / (100.0_f64.powi(2) + 110.0_f64.powi(2) + c1);
        assert!((q.ssim - flat).abs() < 1e-9, "{q:?}");
    }

    /// Digits: the sums of the SSIM paper written out in Python, 11 x 11 products of Gaussian weights per
    /// window, over the 112 windows inside the image; a = (7 x + 13 y) mod 256, b = (7 x + 13 y + 9 (x mod
    /// 3)) mod 256, 24 x 18.
    const SSIM_DIGITS: f64 = 0.694981168065701;
    #[test]
    fn ssim_is_that_of_the_paper() {
        let image = |extra: usize| {
            let at = |i: usize| (7 * (i % 24) + 13 * (i / 24) + extra * ((i % 24) % 3)) % 256;
            Image::new(24, 18, 1, (0..24 * 18).map(|i| at(i) as f32).collect()).unwrap()
        };
        let q = compare(&image(0), &image(9), None).unwrap().unwrap();
        assert!((q.ssim - SSIM_DIGITS).abs() < 1e-9, "{q:?}");
    }
    #[test]
    fn masks_select_and_sizes_are_checked() {
        let a = Image::filled(4, 4, 1, 10.0);
        let mut b = a.clone();
        b.data_mut()[5] = 40.0;
        let mask: Vec<bool> = (0..16).map(|i| i == 5 || i == 6).collect();
        let q = compare(&a, &b, Some(&mask)).unwrap().unwrap();
        assert_eq!((q.pixels, q.mae), (2, 15.0));
        assert_eq!(compare(&a, &b, Some(&[false; 16])).unwrap(), None);
        assert!(matches!(compare(&a, &b, Some(&[true; 15])), Err(InputError::Buffer { .. })));
        assert!(matches!(compare(&a, &Image::filled(4, 5, 1, 0.0), None), Err(InputError::Sizes { .. })));
    }
}
