//! The grid of depth samples, in the quantity that is affine on planes.

use crate::depth::{DepthMap, Measure};

/// Depth samples every `step` pixels as disparity or reciprocal depth, none unknown.
pub(super) struct Grid {
    pub(super) columns: usize,
    pub(super) rows: usize,
    pub(super) step: usize,
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) measure: Measure,
    pub(super) values: Vec<f32>,
}

/// The unit square of samples around a pixel.
pub(super) struct Square {
    /// Indices of the upper left, upper right, lower left and lower right sample.
    pub(super) corners: [usize; 4],
    /// Position of the pixel in the square, 0..1.
    pub(super) s: f32,
    /// The same for the rows.
    pub(super) t: f32,
}

impl Square {
    /// Bilinear weights of the corners.
    pub(super) fn weights(&self) -> [f32; 4] {
        let (s, t) = (self.s, self.t);
        [(1.0 - s) * (1.0 - t), s * (1.0 - t), (1.0 - s) * t, s * t]
    }

    /// Squared distances of the pixel from the corners, in steps.
    pub(super) fn distances(&self) -> [f32; 4] {
        let (s, t) = (self.s, self.t);
        let (a, b, c, d) = (s * s, (1.0 - s) * (1.0 - s), t * t, (1.0 - t) * (1.0 - t));
        [a + c, b + c, a + d, b + d]
    }
}

impl Grid {
    pub(super) fn new(sparse: &DepthMap, step: usize, (width, height): (usize, usize)) -> Self {
        let (columns, rows) = sparse.size();
        let measure = sparse.measure();
        let mut values: Vec<f32> = sparse.data().iter().map(|v| turn(*v, measure)).collect();
        fill_nearest(&mut values, columns);
        Self { columns, rows, step, width, height, measure, values }
    }

    /// The square that holds a pixel; squares at the border repeat the last samples.
    pub(super) fn square(&self, x: usize, y: usize) -> Square {
        let (i, j) = ((x / self.step).min(self.columns - 1), (y / self.step).min(self.rows - 1));
        let (right, down) = ((i + 1).min(self.columns - 1), (j + 1).min(self.rows - 1));
        let at = |i: usize, j: usize| j * self.columns + i;
        let position = |v: usize, k: usize| (v - k * self.step) as f32 / self.step as f32;
        Square {
            corners: [at(i, j), at(right, j), at(i, down), at(right, down)],
            s: position(x, i),
            t: position(y, j),
        }
    }

    /// The pixel of a sample.
    pub(super) fn pixel(&self, sample: usize) -> usize {
        sample / self.columns * self.step * self.width + sample % self.columns * self.step
    }

    pub(super) fn blend(&self, square: &Square) -> f32 {
        square.corners.iter().zip(square.weights()).map(|(c, w)| self.values[*c] * w).sum()
    }

    pub(super) fn bilinear(&self) -> Vec<f32> {
        self.for_pixels(|square| self.blend(&square))
    }

    pub(super) fn nearest(&self) -> Vec<f32> {
        self.for_pixels(|square| {
            let right = usize::from(square.s >= 0.5);
            let down = usize::from(square.t >= 0.5);
            self.values[square.corners[right + 2 * down]]
        })
    }

    fn for_pixels(&self, value: impl Fn(Square) -> f32) -> Vec<f32> {
        let pixels = 0..self.width * self.height;
        pixels.map(|p| value(self.square(p % self.width, p / self.width))).collect()
    }

    pub(super) fn into_map(self, values: Vec<f32>, coarse: &DepthMap) -> DepthMap {
        let data = values.into_iter().map(|v| turn(v, self.measure)).collect();
        coarse.with_values((self.width, self.height), data)
    }
}

/// Converts between the stored quantity and the one that is affine on planes; its own inverse.
fn turn(value: f32, measure: Measure) -> f32 {
    match measure {
        Measure::Disparity => value,
        Measure::Depth => 1.0 / value,
    }
}

/// Gives unknown samples the value of the nearest known one: rings of 4-neighbours, each ring at once.
fn fill_nearest(values: &mut [f32], columns: usize) {
    let mut ring: Vec<usize> = (0..values.len()).filter(|i| !values[*i].is_nan()).collect();
    while !ring.is_empty() {
        let mut next = Vec::new();
        for &from in &ring {
            for to in around(from, columns, values.len()) {
                if values[to].is_nan() {
                    values[to] = values[from];
                    next.push(to);
                }
            }
        }
        ring = next;
    }
}

/// The 4-neighbours of an element of a grid.
pub(super) fn around(i: usize, columns: usize, length: usize) -> impl Iterator<Item = usize> {
    let left = (!i.is_multiple_of(columns)).then(|| i - 1);
    let right = (i % columns + 1 < columns).then_some(i + 1);
    let up = i.checked_sub(columns);
    let down = (i + columns < length).then_some(i + columns);
    [up, left, right, down].into_iter().flatten()
}
