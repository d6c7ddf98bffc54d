//! Photographs with noise.

use super::normal::normal;
use hybank_ibr::image::Image;

/// The image with white noise of this standard deviation.
pub(crate) fn noisy(image: &Image, deviation: f64, seed: u64) -> Image {
    let (mut normal, mut image) = (normal(seed), image.clone());
    image.data_mut().iter_mut().for_each(|v| *v += (deviation * normal()) as f32);
    image.quantised()
}
