//! State recursions x+ = A x + B u, states in lanes, a few ticks at a time.
//!
//! Inputs come from planar rows, and the states before each tick go to planar rows, as though they were channels: so
//! the FIR kernels can read both. Sections (two states that depend on one another at most) are 2 + 2 multiply-adds and
//! one for each input; any other A is a sum of its columns, one broadcast of a state serving all states.
//!
//! Bits: each state is one chain of fused multiply-adds, over the inputs first, in one lane.

use super::Isa;
#[cfg(target_arch = "x86_64")]
use super::vector::{Avx2F32, Avx2F64};
use super::vector::{Portable, Transpose, Vector};
use crate::runtime::aligned::Aligned;

/// Ticks of a section that are computed together.
const STEP: usize = 4;

/// A in the form in which it runs, with B.
#[derive(Debug)]
pub(crate) struct Recursion<T: Copy + Default> {
    /// S, states after padding to whole vectors.
    pub(crate) states: usize,
    /// Where the row of the first state begins in the window, and samples from row to row.
    pub(crate) first_row: usize,
    pub(crate) stride: usize,
    pub(crate) form: Form<T>,
}

/// How the states depend on one another.
#[derive(Debug)]
pub(crate) enum Form<T: Copy + Default> {
    /// By twos: states 2 v L + l and 2 v L + L + l, L lanes a vector, belong to section v L + l.
    Sections(Vec<SectionVector<T>>),
    /// In any way.
    Dense(Vec<ColumnTile<T>>),
}

/// L sections side by side: p+ = a11 p + a12 q + b1 u, q+ = a22 q + a21 p + b2 u.
#[derive(Debug)]
pub(crate) struct SectionVector<T: Copy + Default> {
    /// Place in the window of each input that any of them has.
    pub(crate) inputs: Vec<u32>,
    /// Vectors a11, a12, a21, a22, then b1 and b2 for each input.
    pub(crate) coefficients: Aligned<T>,
}

/// Up to [`ColumnTile::WIDEST`] vectors of states that are computed together.
#[derive(Debug)]
pub(crate) struct ColumnTile<T: Copy + Default> {
    /// The first state, and how many vectors follow: 1, 2, 4 or 8.
    pub(crate) first: usize,
    pub(crate) vectors: usize,
    /// Place in the window of each input, and index of each state, with a column that is not zero.
    pub(crate) inputs: Vec<u32>,
    pub(crate) columns: Vec<u32>,
    /// The columns of all inputs, then of all states.
    pub(crate) coefficients: Aligned<T>,
}

impl<T: Copy + Default> ColumnTile<T> {
    /// Sums that keep two multiply-adds a cycle busy.
    pub(crate) const WIDEST: usize = 8;
}

/// The state of a stream, and those of the next few ticks while they are computed.
#[derive(Debug, Clone)]
pub(crate) struct Registers<T: Copy + Default> {
    /// L + 1 rows of S states.
    rows: Aligned<T>,
    states: usize,
}

impl<T: Copy + Default> Registers<T> {
    pub(crate) fn new(states: usize, lanes: usize) -> Self {
        Self { rows: Aligned::new((lanes + 1) * states), states }
    }

    /// x.
    pub(crate) fn state(&mut self) -> &mut [T] {
        &mut self.rows[..self.states]
    }
}

/// One call of a kernel, checked.
struct Job<'a, T: Copy + Default> {
    recursion: &'a Recursion<T>,
    rows: *mut T,
    window: *mut T,
    ticks: usize,
}

/// The recursion of one sample type on one instruction set.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RecursionKernel<T: Copy + Default> {
    /// L.
    pub(crate) lanes: usize,
    run: unsafe fn(&Job<'_, T>),
}

impl<T: Copy + Default> RecursionKernel<T> {
    /// Goes on by `ticks` ticks. Input k is `window[place + k]` for the input's place; the row of each state becomes its
    /// values before these ticks. Up to L - 1 values past `ticks` are written too and mean nothing.
    ///
    /// # Panics
    /// If anything is too short for that.
    pub(crate) fn run(
        &self,
        recursion: &Recursion<T>,
        registers: &mut Registers<T>,
        window: &mut [T],
        ticks: usize,
    ) {
        let padded = ticks.next_multiple_of(self.lanes);
        assert!(registers.rows.len() == (self.lanes + 1) * recursion.states);
        if recursion.states == 0 {
            return;
        }
        let last_row = recursion.first_row + (recursion.states - 1) * recursion.stride;
        assert!(last_row + padded <= window.len());
        recursion.form.check(recursion.states, self.lanes, window.len() - padded);
        let (rows, window) = (registers.rows.as_mut_ptr(), window.as_mut_ptr());
        // SAFETY: the kernel was chosen for an available instruction set (`Isa::is_available`), and all its loads and
        // stores lie within the bounds asserted above.
        unsafe { (self.run)(&Job { recursion, rows, window, ticks }) }
    }
}

impl<T: Copy + Default> Form<T> {
    /// Everything that the kernels rely on.
    fn check(&self, states: usize, lanes: usize, reach: usize) {
        let inside = |places: &[u32]| places.iter().all(|&place| place as usize <= reach);
        match self {
            Self::Sections(vectors) => {
                assert!(vectors.len() * 2 * lanes == states);
                assert!(vectors.iter().all(|v| {
                    inside(&v.inputs) && v.coefficients.len() == (4 + 2 * v.inputs.len()) * lanes
                }));
            }
            Self::Dense(tiles) => assert!(tiles.iter().all(|tile| {
                let terms = tile.inputs.len() + tile.columns.len();
                matches!(tile.vectors, 1 | 2 | 4 | 8)
                    && tile.first + tile.vectors * lanes <= states
                    && tile.columns.iter().all(|&j| (j as usize) < states)
                    && inside(&tile.inputs)
                    && tile.coefficients.len() == terms * tile.vectors * lanes
            })),
        }
    }
}

#[inline(always)]
unsafe fn run<V: Transpose>(job: &Job<'_, V::Sample>)
where
    V::Sample: Default,
{
    let states = job.recursion.states;
    for first in (0..job.ticks).step_by(V::LANES) {
        let ticks = V::LANES.min(job.ticks - first);
        // SAFETY: the caller's, see `RecursionKernel::run`.
        unsafe {
            match &job.recursion.form {
                Form::Sections(vectors) => {
                    for (v, vector) in vectors.iter().enumerate() {
                        sections::<V>(job, vector, 2 * v * V::LANES, first, ticks);
                    }
                }
                Form::Dense(tiles) => (0..ticks).for_each(|t| dense::<V>(job, tiles, first, t)),
            }
            for state in (0..states).step_by(V::LANES) {
                let row = job.recursion.first_row + state * job.recursion.stride + first;
                V::transpose(job.rows.add(state), states, job.window.add(row), job.recursion.stride);
            }
            std::ptr::copy_nonoverlapping(job.rows.add(ticks * states), job.rows, states);
        }
    }
}

/// The sections of one vector, whose states begin at `at`: ticks 0..`ticks` of the group that begins at tick `first`.
#[inline(always)]
unsafe fn sections<V: Vector>(
    job: &Job<'_, V::Sample>,
    vector: &SectionVector<V::Sample>,
    at: usize,
    first: usize,
    ticks: usize,
) where
    V::Sample: Default,
{
    let mut t = 0;
    // SAFETY: the caller's, see `RecursionKernel::run`.
    unsafe {
        while t + STEP <= ticks {
            section_steps::<V, STEP>(job, vector, at, first, t);
            t += STEP;
        }
        while t < ticks {
            section_steps::<V, 1>(job, vector, at, first, t);
            t += 1;
        }
    }
}

/// T ticks: the inputs of all of them first, which do not wait for the states.
#[inline(always)]
unsafe fn section_steps<V: Vector, const T: usize>(
    job: &Job<'_, V::Sample>,
    vector: &SectionVector<V::Sample>,
    at: usize,
    first: usize,
    t: usize,
) where
    V::Sample: Default,
{
    // SAFETY: the caller's, see `RecursionKernel::run`.
    unsafe {
        let coefficients = vector.coefficients.as_ptr();
        let coefficient = |k: usize| V::load(coefficients.add(k * V::LANES));
        let mut sums = [[V::zero(); 2]; T];
        for (i, &place) in vector.inputs.iter().enumerate() {
            let input = job.window.add(place as usize + first + t);
            let b = [coefficient(4 + 2 * i), coefficient(5 + 2 * i)];
            for (k, [p, q]) in sums.iter_mut().enumerate() {
                let u = V::splat(*input.add(k));
                *p = u.mul_add(b[0], *p);
                *q = u.mul_add(b[1], *q);
            }
        }
        let states = job.recursion.states;
        let mut row = job.rows.add(t * states + at);
        let (mut p, mut q) = (V::load(row), V::load(row.add(V::LANES)));
        let [a11, a12, a21, a22] = [coefficient(0), coefficient(1), coefficient(2), coefficient(3)];
        for [b1u, b2u] in sums {
            (p, q) = (p.mul_add(a11, q.mul_add(a12, b1u)), q.mul_add(a22, p.mul_add(a21, b2u)));
            row = row.add(states);
            p.store(row);
            q.store(row.add(V::LANES));
        }
    }
}

/// Tick t of the group that begins at tick `first`, for any A.
#[inline(always)]
unsafe fn dense<V: Vector>(job: &Job<'_, V::Sample>, tiles: &[ColumnTile<V::Sample>], first: usize, t: usize)
where
    V::Sample: Default,
{
    for tile in tiles {
        // SAFETY: the caller's, see `RecursionKernel::run`.
        unsafe {
            match tile.vectors {
                1 => column_tile::<V, 1>(job, tile, first, t),
                2 => column_tile::<V, 2>(job, tile, first, t),
                4 => column_tile::<V, 4>(job, tile, first, t),
                _ => column_tile::<V, 8>(job, tile, first, t),
            }
        }
    }
}

#[inline(always)]
unsafe fn column_tile<V: Vector, const R: usize>(
    job: &Job<'_, V::Sample>,
    tile: &ColumnTile<V::Sample>,
    first: usize,
    t: usize,
) where
    V::Sample: Default,
{
    let states = job.recursion.states;
    // SAFETY: the caller's, see `RecursionKernel::run`.
    unsafe {
        let mut sums = [V::zero(); R];
        let mut column = tile.coefficients.as_ptr();
        let mut add = |value: V::Sample| {
            let value = V::splat(value);
            for (r, sum) in sums.iter_mut().enumerate() {
                *sum = value.mul_add(V::load(column.add(r * V::LANES)), *sum);
            }
            column = column.add(R * V::LANES);
        };
        tile.inputs.iter().for_each(|&place| add(*job.window.add(place as usize + first + t)));
        let x = job.rows.add(t * states);
        tile.columns.iter().for_each(|&j| add(*x.add(j as usize)));
        for (r, sum) in sums.into_iter().enumerate() {
            sum.store(x.add(states + tile.first + r * V::LANES));
        }
    }
}

macro_rules! kernel {
    ($name:ident, $vector:ty, $sample:ty $(, $features:literal)?) => {
        impl RecursionKernel<$sample> {
            fn $name() -> Self {
                $(#[target_feature(enable = $features)])?
                unsafe fn compiled(job: &Job<'_, $sample>) {
                    // SAFETY: the caller's, see `RecursionKernel::run`.
                    unsafe { run::<$vector>(job) }
                }
                Self { lanes: <$vector>::LANES, run: compiled }
            }
        }
    };
}

kernel!(portable, Portable<f32>, f32);
kernel!(portable, Portable<f64>, f64);
#[cfg(target_arch = "x86_64")]
kernel!(avx2, Avx2F32, f32, "avx2,fma");
#[cfg(target_arch = "x86_64")]
kernel!(avx2, Avx2F64, f64, "avx2,fma");

macro_rules! choose {
    ($sample:ty) => {
        impl RecursionKernel<$sample> {
            /// The kernel for an instruction set; the portable one where the processor does not have it. With AVX-512 it
            /// is that of AVX2: the few sections of a usual bank would leave wider vectors empty.
            pub(crate) fn new(isa: Isa) -> Self {
                match isa {
                    #[cfg(target_arch = "x86_64")]
                    Isa::Avx2 | Isa::Avx512 if isa.is_available() => Self::avx2(),
                    _ => Self::portable(),
                }
            }
        }
    };
}

choose!(f32);
choose!(f64);
