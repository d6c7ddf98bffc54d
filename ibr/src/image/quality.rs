//! Figures of merit of a rendering against a photograph: PSNR, SSIM and mean absolute error.

use super::{Image, ImageError};

/// Figures of merit on the scale 0..255.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// 10 log10(255^2 / MSE) in dB over all samples; infinite for equal images.
    pub psnr: f64,
    /// Structural similarity, mean over windows and channels.
    pub ssim: f64,
    /// Mean absolute error over all samples, in grey levels.
    pub mae: f64,
    /// Pixels that were compared.
    pub pixels: usize,
}

/// Compares two images after rounding both to 8 bits, on the pixels where `mask` is true (all if `None`).
///
/// A grey image is compared with an RGB one as grey. `None` when the mask is empty.
///
/// # Errors
/// [`ImageError::Sizes`] when the sizes differ, [`ImageError::Buffer`] for a mask of another size.
pub fn compare(image: &Image, truth: &Image, mask: Option<&[bool]>) -> Result<Option<Quality>, ImageError> {
    image.same_size("the rendered view", truth.size(), "the truth")?;
    let (width, height) = image.size();
    if let Some(mask) = mask.filter(|m| m.len() != width * height) {
        let expected = width * height;
        return Err(ImageError::Buffer { width, height, channels: 1, expected, given: mask.len() });
    }
    let grey = image.channels() != truth.channels();
    let (a, b) = if grey { (image.to_grey(), truth.to_grey()) } else { (image.clone(), truth.clone()) };
    let (a, b) = (a.quantised(), b.quantised());
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

/// Side of the SSIM window in pixels.
const SSIM_WINDOW: usize = 7;

/// Structural similarity of one channel (Wang, Bovik, Sheikh, Simoncelli 2004): uniform window of 7 x 7
/// pixels with sample covariances, K1 = 0.01, K2 = 0.03, mean over the windows that lie in the image and
/// whose centre is inside; the window shrinks to the image if that is smaller.
fn structural(a: &Image, b: &Image, channel: usize, inside: &dyn Fn(usize) -> bool) -> f64 {
    let (width, height) = a.size();
    let (w, h) = (SSIM_WINDOW.min(width), SSIM_WINDOW.min(height));
    let (mut sum, mut count) = (0.0, 0.0);
    let mut columns = vec![Moments::default(); width];
    for top in 0..=height - h {
        columns.iter_mut().enumerate().for_each(|(x, m)| *m = column_moments(a, b, channel, x, top..top + h));
        for left in 0..=width - w {
            if inside((top + h / 2) * width + left + w / 2) {
                let total = columns[left..left + w].iter().fold(Moments::default(), |t, m| t.plus(m));
                sum += total.similarity((w * h) as f64);
                count += 1.0;
            }
        }
    }
    // A mask confined to the border contains no window; SSIM is then 1 by convention.
    if count > 0.0 { sum / count } else { 1.0 }
}

fn column_moments(a: &Image, b: &Image, channel: usize, x: usize, rows: std::ops::Range<usize>) -> Moments {
    rows.fold(Moments::default(), |total, y| {
        let at = |image: &Image| f64::from(image.row(y)[x * image.channels + channel]);
        let (p, q) = (at(a), at(b));
        total.plus(&Moments { a: p, b: q, aa: p * p, bb: q * q, ab: p * q })
    })
}

/// Sums of two signals, their squares and their product; whole numbers, hence exact.
#[derive(Debug, Clone, Copy, Default)]
struct Moments {
    a: f64,
    b: f64,
    aa: f64,
    bb: f64,
    ab: f64,
}

impl Moments {
    fn plus(&self, o: &Self) -> Self {
        Self { a: self.a + o.a, b: self.b + o.b, aa: self.aa + o.aa, bb: self.bb + o.bb, ab: self.ab + o.ab }
    }

    fn similarity(&self, n: f64) -> f64 {
        let (c1, c2) = ((0.01_f64 * 255.0).powi(2), (0.03_f64 * 255.0).powi(2));
        let unbiased = n / (n - 1.0).max(1.0);
        let (ma, mb) = (self.a / n, self.b / n);
        let va = unbiased * (self.aa / n - ma * ma);
        let vb = unbiased * (self.bb / n - mb * mb);
        let cov = unbiased * (self.ab / n - ma * mb);
        let likeness = (2.0 * ma * mb + c1) * (2.0 * cov + c2);
        likeness / ((ma * ma + mb * mb + c1) * (va + vb + c2))
    }
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

    /// Digits: scipy.ndimage.uniform_filter(size = 7) in the formula of the SSIM paper with covariances
    /// times 49/48 and three border pixels cut; a = (7 x + 13 y) mod 256,
    /// b = (7 x + 13 y + 9 (x mod 3)) mod 256, 24 x 18.
    const SSIM_DIGITS: f64 = 0.7509838676712346;
    #[test]
    fn ssim_agrees_with_scipy() {
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
        assert!(matches!(compare(&a, &b, Some(&[true; 15])), Err(ImageError::Buffer { .. })));
        assert!(matches!(compare(&a, &Image::filled(4, 5, 1, 0.0), None), Err(ImageError::Sizes { .. })));
    }
}
