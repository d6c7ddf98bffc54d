//! Images of one size in memory: rows of all images in turn, with zeros beside them.

use rayon::prelude::*;

/// Numbers that loops treat at once: a few vector registers.
pub(super) const LANES: usize = 16;

/// Zeros to the right of each row, so that neighbours across the border are there and count nothing.
const BORDER: usize = 2;

/// Rows that are treated without asking for another thread.
pub(super) const ROWS_AT_ONCE: usize = 8;

/// Numbers of some pages of memory.
const PAGES: usize = 1 << 14;

/// Width and height of a grid of coefficients.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Grid {
    pub(super) width: usize,
    pub(super) height: usize,
}

impl Grid {
    /// That of the splines of an image.
    pub(super) fn of_image<const ORDER: usize>(width: usize, height: usize) -> Self {
        Self { width: width + ORDER - 2, height: height + ORDER - 2 }
    }

    /// That of blocks of 2 x 2.
    pub(super) fn halved(self) -> Self {
        Self { width: self.width.div_ceil(2), height: self.height.div_ceil(2) }
    }

    /// Numbers of a row in memory, with its zeros: whole blocks of [`LANES`].
    pub(super) fn stride(self) -> usize {
        (self.width + BORDER).next_multiple_of(LANES)
    }

    pub(super) fn len(self) -> usize {
        self.width * self.height
    }
}

/// Some images, row by row: row 0 of each, then row 1 of each.
#[derive(Debug, Clone)]
pub(super) struct Planes {
    grid: Grid,
    count: usize,
    data: Vec<f32>,
}

impl Planes {
    /// `count` images of zeros.
    pub(super) fn zeros(grid: Grid, count: usize) -> Self {
        // A block before and after, for neighbours of the first and of the last numbers.
        let mut data = vec![0.0; grid.height * count * grid.stride() + 2 * LANES];
        // The system gives memory page by page, at the first access. A page that is read first and written
        // later costs it two turns and interrupts the other threads, so all are written now, in parallel.
        data.par_chunks_mut(PAGES).for_each(|part| part.fill(0.0));
        Self { grid, count, data }
    }

    pub(super) fn grid(&self) -> Grid {
        self.grid
    }

    /// Where row y of image k begins. Its neighbours left and right are there too.
    #[inline]
    pub(super) fn start(&self, y: usize, k: usize) -> usize {
        LANES + (y * self.count + k) * self.grid.stride()
    }

    /// Where the neighbours of a row begin that lie so many columns to the left and rows above it; none
    /// above the image.
    #[inline]
    pub(super) fn before(&self, y: usize, k: usize, (columns, rows): (isize, usize)) -> Option<usize> {
        Some(self.start(y.checked_sub(rows)?, k).wrapping_add_signed(-columns))
    }

    /// The same to the right and below it; none below the image.
    #[inline]
    pub(super) fn after(&self, y: usize, k: usize, (columns, rows): (isize, usize)) -> Option<usize> {
        let row = Some(y + rows).filter(|row| *row < self.grid.height)?;
        Some(self.start(row, k).wrapping_add_signed(columns))
    }

    /// All numbers.
    #[inline]
    pub(super) fn data(&self) -> &[f32] {
        &self.data
    }

    /// A row of an image, without zeros.
    pub(super) fn row(&self, y: usize, k: usize) -> &[f32] {
        let start = self.start(y, k);
        &self.data[start..start + self.grid.width]
    }

    pub(super) fn row_mut(&mut self, y: usize, k: usize) -> &mut [f32] {
        let start = self.start(y, k);
        &mut self.data[start..start + self.grid.width]
    }

    /// The rows of all images, each with its zeros to the right: `count` times the stride.
    pub(super) fn rows(&self) -> &[f32] {
        &self.data[self.start(0, 0)..self.start(self.grid.height, 0)]
    }

    fn rows_mut(&mut self) -> &mut [f32] {
        let range = self.start(0, 0)..self.start(self.grid.height, 0);
        &mut self.data[range]
    }

    /// All rows of all images, to be split.
    pub(super) fn all_rows(&mut self) -> RowsMut<'_> {
        RowsMut { stride: self.grid.stride(), count: self.count, data: self.rows_mut() }
    }

    /// Takes another size, no larger than the one that was made. What the images hold is not defined then.
    pub(super) fn reshape(&mut self, grid: Grid) {
        self.grid = grid;
    }

    /// Numbers of one row of all images in memory.
    pub(super) fn row_len(&self) -> usize {
        self.count * self.grid.stride()
    }

    /// The rows, for several threads.
    pub(super) fn par_rows(&self) -> rayon::slice::Chunks<'_, f32> {
        self.rows().par_chunks(self.row_len())
    }

    /// Bands of so many rows, each row as in [`Planes::par_rows_mut`].
    pub(super) fn par_bands_mut(
        &mut self,
        rows: usize,
    ) -> impl IndexedParallelIterator<Item = std::slice::ChunksMut<'_, f32>> {
        let len = self.row_len();
        self.rows_mut().par_chunks_mut(rows * len).map(move |band| band.chunks_mut(len))
    }

    pub(super) fn par_rows_mut(&mut self) -> rayon::slice::ChunksMut<'_, f32> {
        let len = self.row_len();
        self.rows_mut().par_chunks_mut(len)
    }
}

/// Some rows of all images.
#[derive(Debug)]
pub(super) struct RowsMut<'a> {
    stride: usize,
    count: usize,
    data: &'a mut [f32],
}

impl<'a> RowsMut<'a> {
    /// The first `rows` rows, and the rest.
    pub(super) fn split_at(self, rows: usize) -> (Self, Self) {
        let (stride, count) = (self.stride, self.count);
        let middle = rows.saturating_mul(count * stride).min(self.data.len());
        let (before, after) = self.data.split_at_mut(middle);
        (Self { stride, count, data: before }, Self { stride, count, data: after })
    }

    /// N numbers of a row of image k from column x on.
    #[inline(always)]
    pub(super) fn at<const N: usize>(&mut self, k: usize, x: usize, row: usize) -> &mut [f32] {
        let start = (row * self.count + k) * self.stride + x;
        &mut self.data[start..start + N]
    }
}

/// A row in blocks of [`LANES`].
pub(super) type LaneBlocks<'a> = &'a [[f32; LANES]];
pub(super) type BlocksMut<'a> = &'a mut [[f32; LANES]];

/// The whole blocks of a row.
#[inline(always)]
pub(super) fn blocks(row: &[f32]) -> LaneBlocks<'_> {
    row.as_chunks().0
}

#[inline(always)]
pub(super) fn blocks_mut(row: &mut [f32]) -> BlocksMut<'_> {
    row.as_chunks_mut().0
}
