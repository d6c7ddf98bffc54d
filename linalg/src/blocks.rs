//! Many small complex matrices of one size, contiguous in memory.
//!
//! An interior-point method on sampled frequencies does the same few products and factorisations on
//! hundreds of blocks of four to thirty rows, every iteration. The blocks live in one vector so that
//! nothing is allocated in the loop; products and Cholesky factors are faer's kernels.
//!
//! ```
//! use hybank_linalg::blocks::{Batch, SmallCholesky};
//! use hybank_linalg::{CMat, Complex};
//! let mut blocks = Batch::zeros(2, 1, 1);
//! blocks.set(0, &CMat::from_element(1, 1, Complex::new(0.0, 3.0)));
//! let mut square = blocks.clone();
//! let factor = blocks.block(0);
//! square.block_mut(1).set_product(1.0, factor.plain(), factor.adjoint());
//! assert_eq!(square.block(1).at(0, 0), Complex::new(9.0, 0.0));
//! assert!(SmallCholesky::new(1).factor(square.block_mut(1)));
//! assert_eq!(square.to_matrix(1)[(0, 0)].re, 3.0);
//! ```

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::matmul::matmul_with_conj;
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Accum, Conj, MatMut, MatRef, Par};

use super::{CMat, Complex};

type C64 = Complex<f64>;

/// `count` complex matrices of `rows` x `cols`, each column-major, one after the other.
#[derive(Debug, Clone, PartialEq)]
pub struct Batch {
    rows: usize,
    cols: usize,
    count: usize,
    data: Vec<C64>,
}

impl Batch {
    /// All entries zero.
    pub fn zeros(count: usize, rows: usize, cols: usize) -> Self {
        Self { rows, cols, count, data: vec![C64::default(); count * rows * cols] }
    }

    /// Number of rows of every block.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns of every block.
    pub fn cols(&self) -> usize {
        self.cols
    }

    /// Number of blocks.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Entries of block `l`, column-major.
    pub fn block(&self, l: usize) -> BatchView<'_> {
        let size = self.rows * self.cols;
        let data = &self.data[l * size..(l + 1) * size];
        BatchView { rows: self.rows, cols: self.cols, stride: self.rows, data }
    }

    /// Entries of block `l`, column-major, to be written.
    pub fn block_mut(&mut self, l: usize) -> BlockMut<'_> {
        let size = self.rows * self.cols;
        let data = &mut self.data[l * size..(l + 1) * size];
        BlockMut { rows: self.rows, cols: self.cols, data }
    }

    /// All entries.
    pub fn as_slice(&self) -> &[C64] {
        &self.data
    }

    /// All entries, to be written.
    pub fn as_mut_slice(&mut self) -> &mut [C64] {
        &mut self.data
    }

    /// Copies block `l` into a matrix of its own.
    pub fn to_matrix(&self, l: usize) -> CMat {
        CMat::from_column_slice(self.rows, self.cols, self.block(l).data)
    }

    /// Overwrites block `l`. The sizes must be equal.
    pub fn set(&mut self, l: usize, m: &CMat) {
        self.block_mut(l).data.copy_from_slice(m.as_slice());
    }

    /// `self += alpha other`, all blocks. The sizes must be equal.
    pub fn add_scaled(&mut self, alpha: f64, other: &Self) {
        for (a, b) in self.data.iter_mut().zip(&other.data) {
            *a += b * alpha;
        }
    }
}

/// `Re sum conj(a) b`.
pub fn inner(a: &[C64], b: &[C64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x.re * y.re + x.im * y.im).sum()
}

/// One block or a rectangle of it, to be read.
#[derive(Debug, Clone, Copy)]
pub struct BatchView<'a> {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub cols: usize,
    /// Distance of two columns.
    pub stride: usize,
    /// Column-major entries.
    pub data: &'a [C64],
}

impl<'a> BatchView<'a> {
    /// Entry in row `i`, column `j`.
    pub fn at(&self, i: usize, j: usize) -> C64 {
        self.data[i + j * self.stride]
    }

    /// The `rows` x `cols` rectangle whose first entry is in row `i`, column `j`.
    pub fn part(self, i: usize, j: usize, rows: usize, cols: usize) -> BatchView<'a> {
        let data = if rows * cols == 0 { &[] } else { &self.data[i + j * self.stride..] };
        BatchView { rows, cols, stride: self.stride, data }
    }

    /// The block itself as a factor.
    pub fn plain(self) -> Factor<'a> {
        Factor { view: self.view(), conj: Conj::No }
    }

    /// The conjugate transpose as a factor.
    pub fn adjoint(self) -> Factor<'a> {
        Factor { view: self.view().transpose(), conj: Conj::Yes }
    }

    fn view(self) -> MatRef<'a, C64> {
        MatRef::from_column_major_slice_with_stride(self.data, self.rows, self.cols, self.stride)
    }
}

/// One block, to be written.
#[derive(Debug)]
pub struct BlockMut<'a> {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub cols: usize,
    /// Column-major entries.
    pub data: &'a mut [C64],
}

impl BlockMut<'_> {
    fn view(&mut self) -> MatMut<'_, C64> {
        MatMut::from_column_major_slice_mut(self.data, self.rows, self.cols)
    }

    /// `self += alpha a b`.
    pub fn add_product(&mut self, alpha: f64, a: Factor<'_>, b: Factor<'_>) {
        product(self.view(), Accum::Add, a, b, alpha);
    }

    /// `self = alpha a b`.
    pub fn set_product(&mut self, alpha: f64, a: Factor<'_>, b: Factor<'_>) {
        product(self.view(), Accum::Replace, a, b, alpha);
    }

    /// `self = l^{-1} self` with the lower triangle of `l`.
    pub fn solve_lower(&mut self, l: BatchView<'_>) {
        solve_lower_triangular_in_place(l.view(), self.view(), Par::Seq);
    }

    /// Replaces a square block by its Hermitian part.
    pub fn make_hermitian(&mut self) {
        let n = self.rows;
        for j in 0..n {
            self.data[j + j * n].im = 0.0;
            for i in 0..j {
                let z = (self.data[i + j * n] + self.data[j + i * n].conj()) * 0.5;
                self.data[i + j * n] = z;
                self.data[j + i * n] = z.conj();
            }
        }
    }
}

/// A factor of a product: a block or its conjugate transpose.
#[derive(Debug, Clone, Copy)]
pub struct Factor<'a> {
    view: MatRef<'a, C64>,
    conj: Conj,
}

fn product(dst: MatMut<'_, C64>, acc: Accum, a: Factor<'_>, b: Factor<'_>, alpha: f64) {
    matmul_with_conj(dst, acc, a.view, a.conj, b.view, b.conj, C64::new(alpha, 0.0), Par::Seq);
}

/// Cholesky factorisation of small Hermitian blocks in place, with its work memory.
pub struct SmallCholesky {
    memory: MemBuffer,
}

impl SmallCholesky {
    /// Work memory for blocks of up to `n` rows.
    pub fn new(n: usize) -> Self {
        let need = cholesky_in_place_scratch::<C64>(n.max(1), Par::Seq, Default::default());
        Self { memory: MemBuffer::new(need) }
    }

    /// Overwrites the lower triangle of `m` by its Cholesky factor (the strict upper triangle becomes
    /// meaningless). False if `m` is not positive definite to rounding or holds a NaN.
    pub fn factor(&mut self, mut m: BlockMut<'_>) -> bool {
        let n = m.rows;
        let stack = MemStack::new(&mut self.memory);
        let done =
            cholesky_in_place(m.view(), Default::default(), Par::Seq, stack, Default::default()).is_ok();
        done && (0..n).all(|i| m.data[i + i * n].re > 0.0 && m.data[i + i * n].re.is_finite())
    }
}
