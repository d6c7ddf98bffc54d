//! Images of one size in memory: rows of all images in turn, with zeros around.

use rayon::prelude::*;

/// Numbers that loops treat at once: a few vector registers.
pub(super) const LANES: usize = 16;

/// Zeros above and below the images, and to the right of each row, so that neighbours across the border are
/// there and count nothing.
pub(super) const BORDER: usize = 3;

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
        let rows = grid.height + 2 * BORDER;
        // A block before and after, for neighbours of the first and of the last numbers.
        let mut data = vec![0.0; rows * count * grid.stride() + 2 * LANES];
        // The system gives memory page by page, at the first access. A page that is read first and written
        // later costs it two turns and interrupts the other threads, so all are written now, in parallel.
        data.par_chunks_mut(PAGES).for_each(|part| part.fill(0.0));
        Self { grid, count, data }
    }

    pub(super) fn grid(&self) -> Grid {
        self.grid
    }

    /// Where row y of image k begins. Row -[`BORDER`] is there too, as are the neighbours left and right.
    #[inline]
    pub(super) fn start(&self, y: usize, k: usize) -> usize {
        LANES + ((y + BORDER) * self.count + k) * self.grid.stride()
    }

    /// Distance in memory of a neighbour in the same image.
    #[inline]
    pub(super) fn distance(&self, (columns, rows): (isize, usize)) -> isize {
        (rows * self.count * self.grid.stride()) as isize + columns
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

    /// The first rows of all images, and below them rows of zeros, as many as [`BORDER`] at most.
    pub(super) fn first_rows(&mut self, rows: usize) -> RowsMut<'_> {
        let (stride, count) = (self.grid.stride(), self.count);
        let range = self.start(0, 0)..self.start(rows, 0);
        RowsMut { stride, count, data: &mut self.data[range] }
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
pub(super) type Blocks<'a> = &'a [[f32; LANES]];
pub(super) type BlocksMut<'a> = &'a mut [[f32; LANES]];

/// The whole blocks of a row.
#[inline(always)]
pub(super) fn blocks(row: &[f32]) -> Blocks<'_> {
    row.as_chunks().0
}

#[inline(always)]
pub(super) fn blocks_mut(row: &mut [f32]) -> BlocksMut<'_> {
    row.as_chunks_mut().0
}
