//! Photographs with noise.

use hybank_ibr::image::Image;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64;

/// The image with white noise of this standard deviation.
pub(crate) fn noisy(image: &Image, deviation: f64, seed: u64) -> Image {
    let (mut normal, mut image) = (normal(seed), image.clone());
    image.data_mut().iter_mut().for_each(|v| *v += (deviation * normal()) as f32);
    image.quantised()
}

/// Normal numbers of variance one: sums of twelve uniform ones.
pub(crate) fn normal(seed: u64) -> impl FnMut() -> f64 {
    let mut random = Pcg64::seed_from_u64(seed);
    let mut part = move || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    move || (0..12).map(|_| part()).sum::<f64>() - 6.0
}
