//! FIR design by the bounded-real LMI of thesis 5.4.
//!
//! The error system of FIR filters has the states of the plant and of a delay line of its measurements. Its
//! A and B are fixed, C and D are affine in the taps:
//!
//! ```text
//! [u; z] = [y[k-J]; ..; y[k]; z[k]]    delay line after the plant
//! e      = z - sum_j F_j y[k-j]        F_j[p, i] = f_i[p + j M]
//! ```
//!
//! [`kyp::minimise`] finds the taps of least norm with a Lyapunov matrix instead of frequencies. It shares
//! no numerics with the exchange of frequencies, so it is an independent check of it.

use super::{Settings, Synthesis};
use crate::design::DesignError;
use crate::design::plant::LiftedPlant;
use crate::design::unfinished::{EndOfSearch, Unfinished};
use crate::linalg::Mat;
use crate::lmi;
use crate::lmi::kyp::{self, Problem};
use crate::lti::StateSpace;

/// Maximum number of states of the error system; the time grows with its sixth power.
pub(crate) const MAX_STATES: usize = 160;

/// The `settings.taps` taps per channel of least gamma, without a secondary objective.
///
/// `lower` is the dual objective at the covariance found: a lower bound up to rounding errors. There are no
/// dual points.
///
/// # Errors
/// [`DesignError::KypTooLarge`] for more than 160 states, [`DesignError::Lmi`] if a decomposition fails.
pub(crate) fn synthesise(plant: &LiftedPlant, settings: &Settings) -> Result<Synthesis, DesignError> {
    let stored = settings.taps.div_ceil(plant.ratio()).saturating_sub(1);
    let states = plant.system().order() + plant.channels() * stored;
    if states > MAX_STATES {
        return Err(DesignError::KypTooLarge { states, limit: MAX_STATES });
    }
    let solution = kyp::minimise(&problem(plant, settings.taps, stored)?, &lmi::Settings::KYP)?;
    let taps: Vec<Vec<f64>> = solution.x.chunks(settings.taps).map(<[f64]>::to_vec).collect();
    let peak = plant.fir_norm(&taps)?;
    let reason = EndOfSearch::of(solution.outcome);
    let unfinished = Unfinished::of(solution.lower, peak.gain, lmi::Settings::KYP.tol_gap_rel, reason);
    let found = Synthesis::of_least_gamma(plant, taps, peak, solution.lower)?;
    Ok(Synthesis { iterations: solution.iterations, unfinished, ..found })
}

/// The error as an affine function of the taps, those of the first channel first.
fn problem(plant: &LiftedPlant, taps: usize, stored: usize) -> Result<Problem, DesignError> {
    let (n, m) = (plant.channels(), plant.ratio());
    let all = plant.driving(&StateSpace::delay_line(n, stored))?;
    let history = n * (stored + 1);
    let reference = all.select_outputs(history..history + m)?;
    let unknowns = (0..n).flat_map(|channel| (0..taps).map(move |tap| (channel, tap)));
    let term = |(channel, tap): (usize, usize)| {
        // The delay line outputs the oldest measurements first.
        let delayed = (stored - tap / m) * n + channel;
        let placed = |of: &Mat| {
            let entry = |p: usize, j: usize| if p == tap % m { -of[(delayed, j)] } else { 0.0 };
            Mat::from_fn(m, of.ncols(), entry)
        };
        (placed(all.c()), placed(all.d()))
    };
    let terms = unknowns.map(term).collect();
    let [a, b, c, d] = [all.a(), all.b(), reference.c(), reference.d()].map(Mat::clone);
    Ok(Problem::new(a, b, c, d, terms)?)
}
