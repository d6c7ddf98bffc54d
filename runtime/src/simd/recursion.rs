//! State recursions x+ = A x + B u, states in lanes.
//!
//! Inputs are frames as they lie; the states become frames of their own, so that the FIR kernels can read
//! both. Sections (two states that depend on one another at most) take 2 + 2 multiply-adds and two for each
//! input; any other A is a sum of its columns, one broadcast of a state serving all states.
//!
//! Bits: each state is one chain of fused multiply-adds, over the inputs first, in one lane.
//!
//! Unsafe functions here run in code compiled for the instruction set of V. They read rows, inputs and
//! coefficients at places that `RecursionKernel::run` checks, and write the next row.

use super::dispatch::{Compiled, Kernel, compiled_narrow};
use super::isa::Isa;
use super::vector::{Vector, group_lanes};
use crate::aligned::Aligned;

/// Frames of a section that are computed together.
const STEP: usize = 4;

/// A in the form in which it runs, with B.
#[derive(Debug)]
pub(crate) struct Recursion {
    /// S, states after padding to whole vectors.
    pub(crate) states: usize,
    pub(crate) form: RecursionForm,
}

/// How the states depend on one another.
#[derive(Debug)]
pub(crate) enum RecursionForm {
    /// By twos: states 2 v L + l and 2 v L + L + l, L lanes per vector, belong to section v L + l.
    Sections(Vec<SectionVector>),
    /// In any way.
    Dense(Vec<ColumnTile>),
}

/// L sections side by side: p+ = a11 p + a12 q + b1 u, q+ = a22 q + a21 p + b2 u.
#[derive(Debug)]
pub(crate) struct SectionVector {
    /// Place in the window of each input that any of them has.
    pub(crate) inputs: Vec<u32>,
    /// Vectors a11, a12, a21, a22, then b1 and b2 for each input.
    pub(crate) coefficients: Aligned<f64>,
}

/// Up to [`ColumnTile::WIDEST`] vectors of states that are computed together.
#[derive(Debug)]
pub(crate) struct ColumnTile {
    /// The first state, and how many vectors follow: 1, 2, 4 or 8.
    pub(crate) first: usize,
    pub(crate) vectors: usize,
    /// Place in the window of each input, and index of each state, with a column that is not zero.
    pub(crate) inputs: Vec<u32>,
    pub(crate) columns: Vec<u32>,
    /// The columns of all inputs, then of all states.
    pub(crate) coefficients: Aligned<f64>,
}

impl ColumnTile {
    /// Sums that keep two multiply-adds per cycle busy.
    pub(crate) const WIDEST: usize = 8;
}

/// One call of the kernel, checked.
pub(crate) struct RecursionJob<'a> {
    recursion: &'a Recursion,
    rows: *mut f64,
    window: *const f64,
    hop: usize,
    frames: usize,
}

/// The recursion of one sample type on one instruction set.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RecursionKernel {
    /// L, lanes of a vector.
    pub(crate) lanes: usize,
    run: Compiled<Body>,
}

impl RecursionKernel {
    /// The kernel for an instruction set, in vectors of one group: the few sections of a usual bank would
    /// leave wider ones empty.
    pub(crate) fn new(isa: Isa) -> Self {
        Self { lanes: group_lanes::<f64>(), run: compiled_narrow::<Body>(isa) }
    }

    /// Goes on by `frames` frames: row 0 of `rows` (rows of S states) is the state before them, row t + 1
    /// becomes that after frame t. An input of frame t is `window[place + t * hop]` for the input's place.
    ///
    /// # Panics
    /// If anything is too short for that.
    pub(crate) fn run(
        &self,
        recursion: &Recursion,
        rows: &mut [f64],
        window: &[f64],
        hop: usize,
        frames: usize,
    ) {
        if recursion.states == 0 || frames == 0 {
            return;
        }
        assert!((frames + 1) * recursion.states <= rows.len());
        assert!((frames - 1) * hop < window.len());
        recursion.form.check(recursion.states, self.lanes, window.len() - (frames - 1) * hop);
        #[cfg(test)]
        super::work::add(frames * recursion.form.coefficients());
        let (rows, window) = (rows.as_mut_ptr(), window.as_ptr());
        // SAFETY: rows 0 to `frames` and the inputs of all frames are in the slices, and the places, columns
        // and coefficients of the form fit them, as asserted.
        unsafe { (self.run)(&RecursionJob { recursion, rows, window, hop, frames }) }
    }
}

impl RecursionForm {
    /// Coefficients, one multiply-add per frame each.
    #[cfg(test)]
    fn coefficients(&self) -> usize {
        match self {
            Self::Sections(vectors) => vectors.iter().map(|vector| vector.coefficients.len()).sum(),
            Self::Dense(tiles) => tiles.iter().map(|tile| tile.coefficients.len()).sum(),
        }
    }

    /// Everything that the kernels rely on; places lie before `end`.
    fn check(&self, states: usize, lanes: usize, end: usize) {
        let inside = |places: &[u32]| places.iter().all(|&place| (place as usize) < end);
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

/// The recursion of either form.
pub(crate) struct Body;

impl Kernel for Body {
    type Sample = f64;
    type Job<'a> = &'a RecursionJob<'a>;
    type Output = ();

    #[inline(always)]
    unsafe fn run<V: Vector<Sample = f64>>(job: &RecursionJob<'_>) {
        match &job.recursion.form {
            RecursionForm::Sections(vectors) => {
                let whole = job.frames / STEP * STEP;
                for t in (0..whole).step_by(STEP) {
                    sections::<V, STEP>(job, vectors, t);
                }
                for t in whole..job.frames {
                    sections::<V, 1>(job, vectors, t);
                }
            }
            RecursionForm::Dense(tiles) => {
                for t in 0..job.frames {
                    dense::<V>(job, tiles, t);
                }
            }
        }
    }
}

/// T frames from frame t on. One vector of sections after the other: while one waits for its own states, the
/// next can begin.
#[inline(always)]
unsafe fn sections<V: Vector<Sample = f64>, const T: usize>(
    job: &RecursionJob<'_>,
    vectors: &[SectionVector],
    t: usize,
) {
    let states = job.recursion.states;
    for (v, vector) in vectors.iter().enumerate() {
        let row = job.rows.add(t * states + 2 * v * V::LANES);
        section_vector::<V, T>(vector, row, states, job.window.add(t * job.hop), job.hop);
    }
}

/// T frames: the inputs of all of them first, which do not wait for the states.
#[inline(always)]
unsafe fn section_vector<V: Vector<Sample = f64>, const T: usize>(
    vector: &SectionVector,
    mut row: *mut f64,
    states: usize,
    window: *const f64,
    hop: usize,
) {
    let mut coefficients = vector.coefficients.as_ptr();
    let [a11, a12] = [V::load(coefficients), V::load(coefficients.add(V::LANES))];
    coefficients = coefficients.add(2 * V::LANES);
    let [a21, a22] = [V::load(coefficients), V::load(coefficients.add(V::LANES))];
    let zero = V::splat(0.0);
    let mut sums = [[zero; 2]; T];
    for &place in &vector.inputs {
        let mut input = window.add(place as usize);
        coefficients = coefficients.add(2 * V::LANES);
        let [b1, b2] = [V::load(coefficients), V::load(coefficients.add(V::LANES))];
        for [p, q] in &mut sums {
            let u = V::splat(*input);
            *p = u.mul_add(b1, *p);
            *q = u.mul_add(b2, *q);
            // May leave the window after the last frame, where nothing is read.
            input = input.wrapping_add(hop);
        }
    }
    let (mut p, mut q) = (V::load(row), V::load(row.add(V::LANES)));
    for [b1u, b2u] in sums {
        (p, q) = (p.mul_add(a11, q.mul_add(a12, b1u)), q.mul_add(a22, p.mul_add(a21, b2u)));
        row = row.add(states);
        p.store(row);
        q.store(row.add(V::LANES));
    }
}

/// Frame t, for any A.
#[inline(always)]
unsafe fn dense<V: Vector<Sample = f64>>(job: &RecursionJob<'_>, tiles: &[ColumnTile], t: usize) {
    for tile in tiles {
        match tile.vectors {
            1 => column_tile::<V, 1>(job, tile, t),
            2 => column_tile::<V, 2>(job, tile, t),
            4 => column_tile::<V, 4>(job, tile, t),
            _ => column_tile::<V, 8>(job, tile, t),
        }
    }
}

#[inline(always)]
unsafe fn column_tile<V: Vector<Sample = f64>, const R: usize>(
    job: &RecursionJob<'_>,
    tile: &ColumnTile,
    t: usize,
) {
    let states = job.recursion.states;
    let mut sums = [V::splat(0.0); R];
    let (x, window) = (job.rows.add(t * states), job.window.add(t * job.hop));
    let mut column = tile.coefficients.as_ptr();
    for &place in &tile.inputs {
        add_column(&mut sums, V::splat(*window.add(place as usize)), column);
        column = column.add(R * V::LANES);
    }
    for &j in &tile.columns {
        add_column(&mut sums, V::splat(*x.add(j as usize)), column);
        column = column.add(R * V::LANES);
    }
    for (r, sum) in sums.into_iter().enumerate() {
        sum.store(x.add(states + tile.first + r * V::LANES));
    }
}

/// sums <- sums + value times R vectors of a column.
#[inline(always)]
unsafe fn add_column<V: Vector<Sample = f64>, const R: usize>(
    sums: &mut [V; R],
    value: V,
    column: *const f64,
) {
    for (r, sum) in sums.iter_mut().enumerate() {
        *sum = value.mul_add(V::load(column.add(r * V::LANES)), *sum);
    }
}
