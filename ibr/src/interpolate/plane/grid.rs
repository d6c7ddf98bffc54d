//! The coefficients of the splines beside the pixels of the image.

use hybank_sampling::Fit2;

/// Pixels and coefficients: a bicubic spline has one coefficient more than there are pixels on each side.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid {
    pub(super) image: (usize, usize),
    pub(super) coefficients: (usize, usize),
}

impl Grid {
    pub(super) fn new<const ORDER: usize, const C: usize>(
        image: (usize, usize),
        fit: &Fit2<ORDER, C>,
    ) -> Self {
        Self { image, coefficients: fit.coefficients() }
    }

    fn margin(self) -> usize {
        (self.coefficients.0 - self.image.0) / 2
    }

    /// The coefficient at the place of a pixel.
    #[inline]
    pub(super) fn coefficient(self, pixel: usize) -> usize {
        let (x, y) = (pixel % self.image.0, pixel / self.image.0);
        (y + self.margin()) * self.coefficients.0 + x + self.margin()
    }

    #[inline]
    pub(super) fn pixel(self, coefficient: usize) -> usize {
        self.pixel_at(coefficient % self.coefficients.0, coefficient / self.coefficients.0)
    }

    /// The pixel nearest to a column and row of coefficients.
    #[inline]
    pub(super) fn pixel_at(self, column: usize, row: usize) -> usize {
        let nearest = |at: usize, length: usize| at.saturating_sub(self.margin()).min(length - 1);
        nearest(row, self.image.1) * self.image.0 + nearest(column, self.image.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_have_coefficients() {
        for margin in [0, 1] {
            let grid = Grid { image: (4, 3), coefficients: (4 + 2 * margin, 3 + 2 * margin) };
            (0..12).for_each(|p| assert_eq!(grid.pixel(grid.coefficient(p)), p));
            let corners = [0, (4 + 2 * margin) * (3 + 2 * margin) - 1].map(|c| grid.pixel(c));
            assert_eq!(corners, [0, 11]);
        }
    }
}
