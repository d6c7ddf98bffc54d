//! The cost of a hypothesis: how much the surroundings of a pixel differ from those of the point that it
//! would be in other photographs.
//!
//! The census of a pixel has a bit for each pixel around it, set if that one is darker (R. Zabih, J.
//! Woodfill, ECCV 1994). So neither exposure nor white balance matters. The cost is the number of bits that
//! differ.

use crate::image::Image;

/// Radius of the surroundings: 24 bits.
const RADIUS: usize = 2;

/// Cost where no other photograph shows the point: that of unlike surroundings, about.
const NOT_SHOWN: u8 = 8;

/// Rows of a grey image, NaN outside the photograph.
pub(super) struct Rows {
    pub(super) width: usize,
    pub(super) values: Vec<f32>,
}

impl Rows {
    /// Rows `first` to `last`, which may lie outside, with what `at` says of a column and a row.
    fn new(width: usize, rows: std::ops::Range<isize>, at: impl Fn(usize, isize) -> f32) -> Self {
        let values = rows.flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| at(x, y)).collect();
        Self { width, values }
    }

    /// The census of all rows but the outermost `RADIUS`.
    fn census(&self) -> Vec<u32> {
        let width = self.width;
        let padded: Vec<Vec<f32>> = self.values.chunks_exact(width).map(padded).collect();
        let mut bits = vec![0_u32; width * padded.len().saturating_sub(2 * RADIUS)];
        for (y, bits) in bits.chunks_exact_mut(width).enumerate() {
            let centre = &padded[y + RADIUS][RADIUS..RADIUS + width];
            for (dy, dx) in around() {
                let other = &padded[y + dy][dx..dx + width];
                for ((bits, a), b) in bits.iter_mut().zip(other).zip(centre) {
                    *bits = *bits << 1 | u32::from(a < b);
                }
            }
        }
        bits
    }
}

/// Offsets of the surroundings, from their corner.
fn around() -> impl Iterator<Item = (usize, usize)> {
    let side = 0..=2 * RADIUS;
    side.clone().flat_map(move |dy| side.clone().map(move |dx| (dy, dx))).filter(|at| *at != (RADIUS, RADIUS))
}

/// A row whose ends are repeated.
fn padded(row: &[f32]) -> Vec<f32> {
    let ends = [row[0], row[row.len() - 1]].map(|end| [end; RADIUS]);
    [&ends[0], row, &ends[1]].concat()
}

/// A part of the rows of a photograph with the costs of all hypotheses, hypothesis by hypothesis within a
/// pixel.
pub(super) struct Costs {
    pub(super) width: usize,
    pub(super) hypotheses: usize,
    pub(super) values: Vec<u8>,
    first: usize,
    reference: Vec<u32>,
}

impl Costs {
    /// Of some rows of a grey photograph, as if no other one showed anything.
    pub(super) fn new(image: &Image, rows: std::ops::Range<usize>, hypotheses: usize) -> Self {
        let (width, bottom) = (image.width(), image.height() as isize - 1);
        let at = |x: usize, y: isize| image.row(y.clamp(0, bottom) as usize)[x];
        let reference = Rows::new(width, with_surroundings(&rows), at).census();
        let values = vec![u8::MAX; reference.len() * hypotheses];
        Self { width, hypotheses, values, first: rows.start, reference }
    }

    /// Takes the costs of one hypothesis in another grey photograph where they are less; `at` gives the
    /// position there of a column and a row.
    pub(super) fn offer(&mut self, hypothesis: usize, other: &Image, at: impl Fn(f64, f64) -> [f64; 2]) {
        let rows = self.first..self.first + self.reference.len() / self.width;
        let shown = Rows::new(self.width, with_surroundings(&rows), |x, y| value(other, at(x as f64, y as f64)));
        let centres = &shown.values[RADIUS * self.width..];
        let pixels = shown.census().into_iter().zip(centres).zip(&self.reference);
        let costs = self.values[hypothesis..].iter_mut().step_by(self.hypotheses);
        for (cost, ((there, centre), here)) in costs.zip(pixels) {
            let difference = (there ^ here).count_ones() as u8;
            *cost = (*cost).min(if centre.is_nan() { u8::MAX } else { difference });
        }
    }

    /// The costs, with that of what no photograph shows.
    pub(super) fn finished(mut self) -> Self {
        self.values.iter_mut().filter(|cost| **cost == u8::MAX).for_each(|cost| *cost = NOT_SHOWN);
        self
    }
}

fn with_surroundings(rows: &std::ops::Range<usize>) -> std::ops::Range<isize> {
    rows.start as isize - RADIUS as isize..(rows.end + RADIUS) as isize
}

/// The value of a grey image at a position, linear between pixels; NaN outside.
fn value(image: &Image, [x, y]: [f64; 2]) -> f32 {
    let (width, height) = image.size();
    let inside = x >= 0.0 && y >= 0.0 && x <= (width - 1) as f64 && y <= (height - 1) as f64;
    if !inside {
        return f32::NAN;
    }
    let (column, row) = (x as usize, y as usize);
    let (right, below) = ((column + 1).min(width - 1), (row + 1).min(height - 1));
    let (a, b) = ((x - column as f64) as f32, (y - row as f64) as f32);
    let along = |row: &[f32]| row[column] + a * (row[right] - row[column]);
    let upper = along(image.row(row));
    upper + b * (along(image.row(below)) - upper)
}
