//! State-space filters tick by tick, states in lanes, in f64.
//!
//! x+ = A x + B u, y = C x + D u as sums of columns: one broadcast of a state or an input serves all
//! states, or all phases, at once. A block-diagonal A (modal form: real poles alone, conjugate pairs
//! as 2 x 2 blocks) needs two multiply-adds a vector of states instead of one for each state.

use super::Isa;
#[cfg(target_arch = "x86_64")]
use super::vector::{Avx2F64, Avx512F64};
use super::vector::{Pairs, Portable};
use crate::runtime::aligned::Aligned;

/// States and phases are padded to whole vectors of every instruction set.
pub(crate) const LANES: usize = 8;
/// Partial sums of an output, so that a sum need not wait for the one before.
const PARTS: usize = 4;

/// The coefficients, by columns of padded length.
#[derive(Debug)]
pub(crate) struct Columns {
    /// S, states after padding; neighbours 2l and 2l + 1 may be a pair.
    pub(crate) states: usize,
    /// N.
    pub(crate) inputs: usize,
    /// M.
    pub(crate) phases: usize,
    /// M after padding.
    pub(crate) outputs: usize,
    /// Modal form: factor of a state itself and of its neighbour.
    pub(crate) modal: Option<[Aligned<f64>; 2]>,
    /// S values for each input (modal), or for each state and then each input (dense).
    pub(crate) next: Aligned<f64>,
    /// M values (padded) for each state, then for each input.
    pub(crate) output: Aligned<f64>,
}

/// The state of a stream: z = (x, u) and room for x+ and y.
#[derive(Debug, Clone)]
pub(crate) struct Registers {
    pub(crate) z: Aligned<f64>,
    next: Aligned<f64>,
    output: Aligned<f64>,
}

impl Registers {
    pub(crate) fn new(columns: &Columns) -> Self {
        Self {
            z: Aligned::new(columns.states + columns.inputs),
            next: Aligned::new(columns.states),
            output: Aligned::new(columns.outputs),
        }
    }
}

/// Runs ticks `0..ticks`: input i of tick k is `u[k N + i]`, phase p becomes `y[k M + p]`.
///
/// # Panics
/// If a slice is too short.
pub(crate) fn run(
    isa: Isa,
    columns: &Columns,
    registers: &mut Registers,
    u: &[f64],
    y: &mut [f64],
    ticks: usize,
) {
    columns.check(registers);
    assert!(columns.phases <= columns.outputs);
    match isa {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the processor was asked; the sizes are checked above.
        Isa::Avx2 if isa.is_available() => unsafe { avx2(columns, registers, u, y, ticks) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        Isa::Avx512 if isa.is_available() => unsafe { avx512(columns, registers, u, y, ticks) },
        // SAFETY: the sizes are checked above.
        _ => unsafe { block::<Portable<f64>>(columns, registers, u, y, ticks) },
    }
}

impl Columns {
    fn check(&self, registers: &Registers) {
        let (s, n) = (self.states, self.inputs);
        assert!(s.is_multiple_of(LANES) && self.outputs.is_multiple_of(LANES));
        let feeding = if self.modal.is_some() { n } else { s + n };
        assert!(self.next.len() == s * feeding && self.output.len() == self.outputs * (s + n));
        assert!(self.modal.iter().flatten().all(|factors| factors.len() == s));
        assert!(registers.z.len() == s + n && registers.next.len() == s);
        assert!(registers.output.len() == self.outputs);
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
unsafe fn avx2(c: &Columns, r: &mut Registers, u: &[f64], y: &mut [f64], ticks: usize) {
    // SAFETY: the caller's.
    unsafe { block::<Avx2F64>(c, r, u, y, ticks) }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx2,fma")]
unsafe fn avx512(c: &Columns, r: &mut Registers, u: &[f64], y: &mut [f64], ticks: usize) {
    // SAFETY: the caller's.
    unsafe { block::<Avx512F64>(c, r, u, y, ticks) }
}

#[inline(always)]
unsafe fn block<V: Pairs>(
    columns: &Columns,
    registers: &mut Registers,
    u: &[f64],
    y: &mut [f64],
    ticks: usize,
) {
    for k in 0..ticks {
        for (i, slot) in registers.z[columns.states..].iter_mut().enumerate() {
            *slot = u[k * columns.inputs + i];
        }
        // SAFETY: the sizes are checked by `run`.
        unsafe {
            outputs::<V>(columns, registers);
            match &columns.modal {
                Some([own, neighbour]) => modal::<V>(columns, own, neighbour, registers),
                None => dense::<V>(columns, registers),
            }
        }
        for p in 0..columns.phases {
            y[k * columns.phases + p] = registers.output[p];
        }
    }
}

/// y = C x + D u, in four partial sums.
#[inline(always)]
unsafe fn outputs<V: Pairs>(columns: &Columns, registers: &mut Registers) {
    let count = columns.states + columns.inputs;
    for first in (0..columns.phases).step_by(V::LANES) {
        // SAFETY: column j has `outputs` values, see `Columns::check`.
        unsafe {
            let zero = V::splat(0.0);
            let mut parts = [zero; PARTS];
            let z = registers.z.as_ptr();
            let output = columns.output.as_ptr().add(first);
            let column = |j: usize| V::load(output.add(j * columns.outputs));
            let mut j = 0;
            while j + PARTS <= count {
                for (part, sum) in parts.iter_mut().enumerate() {
                    *sum = column(j + part).mul_add(V::splat(*z.add(j + part)), *sum);
                }
                j += PARTS;
            }
            while j < count {
                parts[0] = column(j).mul_add(V::splat(*z.add(j)), parts[0]);
                j += 1;
            }
            let one = V::splat(1.0);
            let [a, b, c, d] = parts;
            let sum = a.mul_add(one, b).mul_add(one, c.mul_add(one, d));
            sum.store(registers.output.as_mut_ptr().add(first));
        }
    }
}

/// x+ for a block-diagonal A: inputs first, which do not wait for the states.
#[inline(always)]
unsafe fn modal<V: Pairs>(columns: &Columns, own: &[f64], neighbour: &[f64], registers: &mut Registers) {
    let s = columns.states;
    // In place: a vector of states depends on itself and on the inputs alone.
    let z = registers.z.as_mut_ptr();
    let (next, own, neighbour) = (columns.next.as_ptr(), own.as_ptr(), neighbour.as_ptr());
    for first in (0..s).step_by(V::LANES) {
        // SAFETY: all columns have S values, see `Columns::check`.
        unsafe {
            let mut sum = V::splat(0.0);
            for i in 0..columns.inputs {
                sum = V::load(next.add(i * s + first)).mul_add(V::splat(*z.add(s + i)), sum);
            }
            let x = V::load(z.add(first));
            sum = x.swap_pairs().mul_add(V::load(neighbour.add(first)), sum);
            sum = x.mul_add(V::load(own.add(first)), sum);
            sum.store(z.add(first));
        }
    }
}

/// x+ for any A.
#[inline(always)]
unsafe fn dense<V: Pairs>(columns: &Columns, registers: &mut Registers) {
    let s = columns.states;
    let (z, to, next) = (registers.z.as_ptr(), registers.next.as_mut_ptr(), columns.next.as_ptr());
    for first in (0..s).step_by(V::LANES) {
        // SAFETY: all columns have S values, see `Columns::check`.
        unsafe {
            let mut sum = V::splat(0.0);
            for j in 0..s + columns.inputs {
                sum = V::load(next.add(j * s + first)).mul_add(V::splat(*z.add(j)), sum);
            }
            sum.store(to.add(first));
        }
    }
    registers.z[..s].copy_from_slice(&registers.next);
}
