//! The costs of hypotheses: how much the surroundings of a pixel differ from those of the point that it
//! would be in other photographs.
//!
//! The census of a pixel has a bit for each pixel around it, set if that one is darker (R. Zabih, J.
//! Woodfill, ECCV 1994), so exposure and white balance do not matter. The cost is the number of bits that
//! differ.

use crate::image::Image;
use std::ops::Range;

/// Radius of the surroundings: 24 bits.
const RADIUS: usize = 2;

/// Cost where no other photograph shows the point: that of unlike surroundings, about.
const NOT_SHOWN: u8 = 8;

/// Some rows of a photograph with the costs of all hypotheses, pixel by pixel.
pub(super) struct Costs {
    pub(super) width: usize,
    pub(super) hypotheses: usize,
    pub(super) values: Vec<u8>,
    /// The rows of the surroundings, which may lie outside the photograph.
    around: Range<isize>,
    census: Vec<u32>,
}

impl Costs {
    /// Of some rows of a grey photograph, as if no other one showed anything.
    pub(super) fn new(image: &Image, rows: &Range<usize>, hypotheses: usize) -> Self {
        let (width, bottom) = (image.width(), image.height() as isize - 1);
        let around = rows.start as isize - RADIUS as isize..(rows.end + RADIUS) as isize;
        let rows = around.clone().flat_map(|y| image.row(y.clamp(0, bottom) as usize));
        let census = census(&rows.copied().collect::<Vec<_>>(), width);
        Self { width, hypotheses, values: vec![u8::MAX; census.len() * hypotheses], around, census }
    }

    /// Takes the costs of one hypothesis in another grey photograph, where they are less; `at` gives the
    /// position there of a column and a row.
    pub(super) fn offer(&mut self, hypothesis: usize, other: &Image, at: impl Fn([f64; 2]) -> [f64; 2]) {
        let mut shown = Vec::with_capacity(self.around.clone().count() * self.width);
        for y in self.around.clone() {
            let value = |x: usize| {
                let [u, v] = at([x as f64, y as f64]);
                other.value_at(u, v, 0)
            };
            shown.extend((0..self.width).map(value));
        }
        let there = census(&shown, self.width).into_iter().zip(&shown[RADIUS * self.width..]);
        let costs = self.values[hypothesis..].iter_mut().step_by(self.hypotheses);
        for ((cost, here), (there, centre)) in costs.zip(&self.census).zip(there) {
            let difference = (there ^ here).count_ones() as u8;
            *cost = (*cost).min(if centre.is_nan() { u8::MAX } else { difference });
        }
    }

    /// The costs, with that of points that no other photograph shows.
    pub(super) fn finished(mut self) -> Self {
        self.values.iter_mut().for_each(|cost| *cost = if *cost == u8::MAX { NOT_SHOWN } else { *cost });
        self
    }
}

/// The census of all rows but the outermost `RADIUS`.
fn census(values: &[f32], width: usize) -> Vec<u32> {
    let padded = |row: &[f32]| [&[row[0]; RADIUS], row, &[row[width - 1]; RADIUS]].concat();
    let rows: Vec<Vec<f32>> = values.chunks_exact(width).map(padded).collect();
    let mut bits = vec![0_u32; values.len() - 2 * RADIUS * width];
    for (rows, bits) in rows.windows(2 * RADIUS + 1).zip(bits.chunks_exact_mut(width)) {
        let centre = &rows[RADIUS][RADIUS..RADIUS + width];
        for other in rows.iter().flat_map(|row| row.windows(width)) {
            for ((bits, a), b) in bits.iter_mut().zip(other).zip(centre) {
                *bits = *bits << 1 | u32::from(a < b);
            }
        }
    }
    bits
}
