//! FIR design by the bounded-real LMI of thesis 5.4.
//!
//! The error system of FIR filters has the states of the plant and of the delay lines of the measurements. Its A and B are
//! fixed, C and D are affine in the taps:
//!
//! ```text
//! x+   = A x + B w                     plant, y = C_y x + D_y w measured, z = C_z x + D_z w reference
//! s_1+ = y,   s_{j+1}+ = s_j           delay lines, j < J
//! e    = z - F_0 y - sum_j F_j s_j     F_j[p, i] = f_i[p + j M]
//! ```
//!
//! [`kyp::minimise`] finds the taps of least norm with a Lyapunov matrix instead of frequencies. It shares no numerics with
//! the exchange of frequencies, so it is the second opinion on it.

use super::DesignError;
use super::equivalence::BlockedPlant;
use super::error_system::FirError;
use super::fir::FirDesign;
use super::iir::noncausal_bound;
use crate::linalg::Mat;
use crate::lmi::kyp::{self, Problem, Settings};

/// Most states of the error system; the time grows with the sixth power.
pub const MAX_STATES: usize = 160;

/// The taps per channel of least gamma, without a secondary objective.
///
/// `lower` is the value of the dual covariance, a lower bound up to rounding errors; there are no dual points.
///
/// # Errors
/// [`DesignError::KypTooLarge`] for more than [`MAX_STATES`] states, [`DesignError::Kyp`] if a decomposition fails.
pub fn design_fir_kyp(plant: &BlockedPlant, taps: usize) -> Result<FirDesign, DesignError> {
    let register = Register::new(plant, taps);
    if register.states() > MAX_STATES {
        return Err(DesignError::KypTooLarge { states: register.states(), limit: MAX_STATES });
    }
    let solution = kyp::minimise(&register.problem()?, &Settings::default())?;
    let filters = register.impulse_responses(&solution.x);
    let peak = FirError::new(plant)?.gamma(&filters)?;
    let noncausal = noncausal_bound(plant)?;
    let upper = peak.gain;
    Ok(FirDesign {
        taps: filters,
        peak,
        lower: solution.lower.max(noncausal).min(upper),
        noncausal: noncausal.min(upper),
        rounds: 1,
        iterations: solution.steps.len(),
        dual: Vec::new(),
    })
}

/// The plant with delay lines behind its measurements.
struct Register<'a> {
    plant: &'a BlockedPlant,
    taps: usize,
    lags: usize,
}

impl<'a> Register<'a> {
    fn new(plant: &'a BlockedPlant, taps: usize) -> Self {
        Self { plant, taps, lags: taps.div_ceil(plant.wanted) }
    }

    fn states(&self) -> usize {
        self.plant.system.order() + self.plant.measured * (self.lags - 1)
    }

    /// `(channel, tap)` of each unknown.
    fn unknowns(&self) -> impl Iterator<Item = (usize, usize)> {
        let taps = self.taps;
        (0..self.plant.measured).flat_map(move |i| (0..taps).map(move |n| (i, n)))
    }

    fn problem(&self) -> Result<Problem, DesignError> {
        let system = self.plant.system.compress_inputs();
        let (n, q, measured, wanted) =
            (system.order(), system.inputs(), self.plant.measured, self.plant.wanted);
        let states = self.states();
        let (mut a, mut b) = (Mat::zeros(states, states), Mat::zeros(states, q));
        a.view_mut((0, 0), (n, n)).copy_from(system.a());
        b.rows_mut(0, n).copy_from(system.b());
        if self.lags > 1 {
            a.view_mut((n, 0), (measured, n)).copy_from(&system.c().rows(0, measured));
            b.rows_mut(n, measured).copy_from(&system.d().rows(0, measured));
        }
        (n + measured..states).for_each(|i| a[(i, i - measured)] = 1.0);
        let mut c = Mat::zeros(wanted, states);
        c.columns_mut(0, n).copy_from(&system.c().rows(measured, wanted));
        let d = system.d().rows(measured, wanted).into_owned();
        let term = |(i, tap): (usize, usize)| {
            let (phase, lag) = (tap % wanted, tap / wanted);
            let (mut c, mut d) = (Mat::zeros(wanted, states), Mat::zeros(wanted, q));
            if lag == 0 {
                c.view_mut((phase, 0), (1, n)).copy_from(&-system.c().row(i));
                d.row_mut(phase).copy_from(&-system.d().row(i));
            } else {
                c[(phase, n + measured * (lag - 1) + i)] = -1.0;
            }
            (c, d)
        };
        let terms = self.unknowns().map(term).collect();
        Ok(Problem::new(a, b, c, d, terms)?)
    }

    fn impulse_responses(&self, x: &[f64]) -> Vec<Vec<f64>> {
        x.chunks(self.taps).map(<[f64]>::to_vec).collect()
    }
}
