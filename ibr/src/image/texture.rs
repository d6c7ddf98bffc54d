//! Noise and slopes of a photograph, from the photograph alone.

use super::Image;

/// Side of the blocks in which the noise is measured, in pixels.
const BLOCK: usize = 16;
/// The same with the border that second differences need.
const WHOLE: usize = BLOCK + 2;
/// Blocks that are measured, about.
const BLOCKS: usize = 256;
/// Share of the blocks that are taken to have no texture.
const QUIET: f64 = 0.1;
/// Blocks with darker or brighter pixels are left out: their noise is cut off.
const DARK: f32 = 0.5;
const BRIGHT: f32 = 254.5;
/// Energy of the mixed second difference (1 -2 1)' (1 -2 1): the gain of the variance of white noise.
const ENERGY: f64 = 36.0;

/// Noise and slopes of a photograph.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Texture {
    /// Standard deviation of the noise, grey levels. What is left of the texture in the quietest blocks
    /// counts as noise.
    pub noise: f64,
    /// Root mean square slope along the rows without the noise, grey levels per pixel.
    pub slope: f64,
}

impl Texture {
    /// Of an image; of a coloured one, of its green. `None` if it is too small or has no slopes above its
    /// noise.
    ///
    /// The mixed second difference is zero on planes and along straight edges in rows and columns, and has
    /// 36 times the variance of white noise (J. Immerkaer, *Fast noise variance estimation*, Computer Vision
    /// and Image Understanding 64, 1996). Its mean square is taken in blocks, of which the tenth part with
    /// the least shows the noise. Overexposed and black blocks are left out.
    pub fn of(image: &Image) -> Option<Self> {
        let mut blocks = blocks(image);
        if blocks.is_empty() {
            return None;
        }
        let quiet = (QUIET * blocks.len() as f64) as usize;
        let slope = blocks.iter().map(|block| block.slope).sum::<f64>() / blocks.len() as f64;
        let (_, block, _) = blocks.select_nth_unstable_by(quiet, |a, b| a.second.total_cmp(&b.second));
        let noise = block.second / ENERGY;
        let slope = slope - 2.0 * noise;
        (slope > 0.0).then(|| Self { noise: noise.sqrt(), slope: slope.sqrt() })
    }
}

/// Mean squares over a block.
struct Block {
    /// Of the mixed second difference.
    second: f64,
    /// Of the difference of neighbours in a row.
    slope: f64,
}

/// A block with its border.
type Pixels = [[f32; WHOLE]; WHOLE];

fn blocks(image: &Image) -> Vec<Block> {
    let (width, height) = image.size();
    if width < WHOLE || height < WHOLE {
        return Vec::new();
    }
    let step = ((width * height / BLOCKS) as f64).sqrt().max(BLOCK as f64) as usize;
    let corners = (0..=height - WHOLE).step_by(step);
    corners
        .flat_map(|y| (0..=width - WHOLE).step_by(step).map(move |x| (x, y)))
        .map(|corner| pixels(image, corner))
        .filter(|pixels| pixels.as_flattened().iter().all(|v| (DARK..BRIGHT).contains(v)))
        .map(|pixels| Block::of(&pixels))
        .collect()
}

/// The block whose upper left corner is this pixel.
fn pixels(image: &Image, (x, y): (usize, usize)) -> Pixels {
    let channels = image.channels();
    let value =
        |i: usize, j: usize| image.data()[((y + i) * image.width() + x + j) * channels + channels / 2];
    std::array::from_fn(|i| std::array::from_fn(|j| value(i, j)))
}

impl Block {
    fn of(pixels: &Pixels) -> Self {
        let (mut second, mut slope) = (0.0, 0.0);
        for rows in pixels.windows(3) {
            let (above, row, below) = (&rows[0], &rows[1], &rows[2]);
            let bent = |i: usize| above[i] - 2.0 * row[i] + below[i];
            for i in 1..=BLOCK {
                second += f64::from(bent(i - 1) - 2.0 * bent(i) + bent(i + 1)).powi(2);
                slope += f64::from(row[i] - row[i - 1]).powi(2);
            }
        }
        let count = (BLOCK * BLOCK) as f64;
        Self { second: second / count, slope: slope / count }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::uncalibrated::random::dice::Dice;

    /// A surface of this root mean square slope with noise.
    fn photograph(slope: f64, noise: f64, channels: usize) -> Image {
        let dice = &mut Dice::new(5);
        let (width, height) = (320, 240);
        // slope^2 = A^2 w^2 / 2.
        let w = 0.05;
        let amplitude = slope * 2.0_f64.sqrt() / w;
        let values = (0..width * height)
            .flat_map(|p| {
                let x = (p % width) as f64 + 0.3 * (p / width) as f64;
                vec![128.0 + amplitude * (w * x).sin(); channels]
            })
            .map(|v| (v + noise * dice.normal()) as f32)
            .collect();
        Image::new(width, height, channels, values).unwrap()
    }

    #[test]
    fn noise_and_slope_of_a_known_photograph() {
        for channels in [1, 3] {
            for (slope, noise) in [(2.0, 0.5), (3.0, 2.0), (3.0, 8.0), (1.0, 4.0)] {
                let found = Texture::of(&photograph(slope, noise, channels)).unwrap();
                // The quietest tenth lies a little below the mean.
                assert!((0.8..1.02).contains(&(found.noise / noise)), "{found:?} {noise}");
                assert!(
                    (found.slope.powi(2) - slope.powi(2)).abs() < 0.1 * slope.powi(2) + 0.5 * noise.powi(2)
                );
            }
        }
    }

    #[test]
    fn flat_small_and_overexposed_photographs_say_nothing() {
        assert_eq!(Texture::of(&Image::filled(64, 64, 1, 100.0)), None);
        assert_eq!(Texture::of(&Image::filled(17, 64, 3, 100.0)), None);
        let bright = photograph(3.0, 1.0, 1);
        let values = bright.data().iter().map(|v| v + 255.0).collect();
        assert_eq!(Texture::of(&Image::new(320, 240, 1, values).unwrap()), None);
    }
}
