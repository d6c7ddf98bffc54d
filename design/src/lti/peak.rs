//! Peak gains over the unit circle: the H-infinity norm, and the peak of the part of the references that
//! measurements cannot explain.
//!
//! Both are the maximum over w of sigma_max(L_z(w)). The LQ factorisation of the response [G_y; G_z] = [L_y
//! 0; L_zy L_z] Q separates the part L_zy of the references z that the measurements y explain. Without
//! measurements L_z is G_z, and the peak is the H-infinity norm.
//!
//! Method: level sets (Boyd & Balakrishnan 1990, Bruinsma & Steinbuch 1990). gamma is the gain at some
//! frequency exactly where G G* - gamma^2 J, J = diag(0, I), is singular; after a Cayley transform these
//! are the imaginary eigenvalues of one Hamiltonian matrix. Eigenvalues only *suggest* frequencies. Each
//! reported value is evaluated from the response itself and refined between its neighbours.

pub(crate) use super::refine::{Peak, local_maxima, refine};
use super::refine::{SETTINGS, higher, upper_estimate};
use super::{FrequencyResponse, LtiError, StateSpace};
use hybank_linalg::{CMat, Complex, Scalar};
use nalgebra::DMatrix;
use std::f64::consts::PI;

/// Distances from the angle of a pole, relative to the distance of the pole from the unit circle.
const WIDTHS: [f64; 5] = [-1.5, -0.5, 0.0, 0.5, 1.5];

/// Limit on the rounds. The level rises at least by [`Settings::accuracy`] in each; in practice two or three
/// rounds suffice.
const ROUND_LIMIT: usize = 60;
/// Uniform initial frequencies.
const FIRST_GRID: usize = 32;
/// At least so many uniform frequencies per state: |G|^2 has at most a peak for each state between 0 and pi.
const FREQUENCIES_PER_STATE: usize = 2;
/// Number of frequencies tried for a better centre.
const CENTRES: usize = 16;

/// The H-infinity norm of a stable system with its peak frequency.
pub(crate) fn hinf_norm(system: &StateSpace) -> Result<Peak, LtiError> {
    unexplained_peak(system, 0)
}

/// max over w of sigma_max of the part of the references (rows from `measurements` on) that no
/// combination of the measurements (the first rows) explains, causal or not:
/// G_z (I - G_y* (G_y G_y*)^+ G_y).
pub(crate) fn unexplained_peak(system: &StateSpace, measurements: usize) -> Result<Peak, LtiError> {
    let poles = stable_poles(system)?;
    let system = system.compress_inputs();
    let response = FrequencyResponse::new(&system);
    PeakSearch::new(&system, measurements, &|w| response.at_frequency(w), resonances(&poles)).run()
}

/// The H-infinity norm of a system that is known to be stable, with a response that is cheaper than its
/// own: `response(w)` has the singular values of G(e^{jw}), and `initial` are frequencies where it may be
/// large (see [`resonances`]).
pub(crate) fn hinf_norm_with_response(
    system: &StateSpace,
    response: &dyn Fn(f64) -> CMat,
    initial: Vec<f64>,
) -> Result<Peak, LtiError> {
    PeakSearch::new(&system.compress_inputs(), 0, response, initial).run()
}

/// The local maxima of the gain of a stable system that a grid shows, refined.
pub(crate) fn local_peaks(system: &StateSpace) -> Result<Vec<Peak>, LtiError> {
    let poles = stable_poles(system)?;
    let system = system.compress_inputs();
    let response = FrequencyResponse::new(&system);
    let at = |w| response.at_frequency(w);
    let search = PeakSearch::new(&system, 0, &at, resonances(&poles));
    let refined = |around| refine(|w| search.at(w), around, SETTINGS.flat_gain);
    local_maxima(&search.grid()?).into_iter().map(refined).collect()
}

/// The poles of a stable system.
///
/// # Errors
/// [`LtiError::Unstable`] if one of them is not inside the unit circle.
pub(crate) fn stable_poles(system: &StateSpace) -> Result<Vec<Complex<f64>>, LtiError> {
    let poles = hybank_linalg::eigenvalues(system.a())?;
    let radius = poles.iter().map(|pole| pole.norm()).fold(0.0, f64::max);
    if radius >= 1.0 { Err(LtiError::Unstable { radius }) } else { Ok(poles) }
}

/// Angles of the poles that may cause a peak, and angles near them at multiples of the pole's distance from
/// the unit circle, which is the width of its resonance.
pub(crate) fn resonances(poles: &[Complex<f64>]) -> Vec<f64> {
    let near = poles.iter().filter(|p| p.im >= 0.0 && p.norm() > SETTINGS.resonant_radius);
    let about = |p: &Complex<f64>| WIDTHS.map(|width| p.arg() + width * (1.0 - p.norm()));
    near.flat_map(about).filter(|w| (0.0..=PI).contains(w)).collect()
}

/// The gain at one frequency: see [`unexplained_peak`].
pub(crate) fn unexplained_gain(response: &CMat, measurements: usize) -> Result<f64, LtiError> {
    let references = response.nrows() - measurements;
    if references == 0 || response.ncols() == 0 {
        return Ok(0.0);
    }
    if measurements == 0 {
        return Ok(hybank_linalg::largest_singular_value(response)?);
    }
    let l = hybank_linalg::lq_factor(response);
    if l.ncols() <= measurements {
        return Ok(0.0);
    }
    let rest = l.view((measurements, measurements), (references, l.ncols() - measurements)).into_owned();
    Ok(hybank_linalg::largest_singular_value(&rest)?)
}

/// The search on one system.
struct PeakSearch<'a> {
    system: StateSpace,
    measurements: usize,
    response: &'a dyn Fn(f64) -> CMat,
    /// Initial frequencies beside the uniform ones.
    initial: Vec<f64>,
    /// The level set squares the gain. Below sqrt(eps) of the terms that cancel it consists of rounding
    /// errors only, and the refined grid gives the result.
    floor: f64,
}

impl<'a> PeakSearch<'a> {
    fn new(
        system: &StateSpace,
        measurements: usize,
        response: &'a dyn Fn(f64) -> CMat,
        initial: Vec<f64>,
    ) -> Self {
        let system = system.rescaled();
        let scale = system.d().norm() + system.c().norm() * system.b().norm();
        Self { system, measurements, response, initial, floor: f64::EPSILON.sqrt() * scale }
    }

    fn gain(&self, w: f64) -> Result<f64, LtiError> {
        unexplained_gain(&(self.response)(w), self.measurements)
    }

    fn run(&self) -> Result<Peak, LtiError> {
        let mut best = self.first_peak()?;
        for _ in 0..ROUND_LIMIT {
            if best.gain <= self.floor {
                return Ok(best);
            }
            match self.above(best.gain * (1.0 + SETTINGS.accuracy))? {
                None => return Ok(best),
                Some(higher) => best = higher,
            }
        }
        Err(LtiError::IterationLimit { what: "the level set", limit: ROUND_LIMIT, change: SETTINGS.accuracy })
    }

    /// The highest local maximum. Each local maximum of the grid that may be the highest is refined.
    /// Minimax designs have many nearly equal peaks that no level set can distinguish, so none of them is
    /// left to the level sets.
    fn first_peak(&self) -> Result<Peak, LtiError> {
        let grid = self.grid()?;
        let mut maxima = local_maxima(&grid);
        maxima.sort_by(|a, b| b[1].gain.total_cmp(&a[1].gain));
        let mut best =
            maxima.first().map_or(Peak { gain: 0.0, frequency: 0.0 }, |maximum| maximum[1].folded());
        for [low, middle, high] in maxima {
            if upper_estimate(low, middle, high) > best.gain {
                best = higher(best, refine(|w| self.at(w), [low, middle, high], SETTINGS.flat_gain)?);
            }
        }
        Ok(best)
    }

    /// The gains at the initial frequencies, ascending from 0 to pi.
    fn grid(&self) -> Result<Vec<Peak>, LtiError> {
        let intervals = FIRST_GRID.max(FREQUENCIES_PER_STATE * self.system.order());
        let mut grid: Vec<f64> = (0..=intervals).map(|k| PI * k as f64 / intervals as f64).collect();
        grid.extend(&self.initial);
        grid.sort_by(f64::total_cmp);
        grid.dedup_by(|b, a| *b - *a < SETTINGS.same_frequency);
        grid.into_iter().map(|w| self.at(w)).collect()
    }

    fn at(&self, frequency: f64) -> Result<Peak, LtiError> {
        Ok(Peak { gain: self.gain(frequency)?, frequency })
    }

    /// A frequency with a gain above `level`, refined, if there is one.
    fn above(&self, level: f64) -> Result<Option<Peak>, LtiError> {
        let crossings = self.crossings(level)?;
        let mut candidates = crossings.clone();
        candidates.extend(crossings.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])));
        let mut best = Peak { gain: level, frequency: f64::NAN };
        for w in candidates {
            best = higher(best, self.at(w)?);
        }
        if best.frequency.is_nan() {
            return Ok(None);
        }
        let spread = 0.25 * PI / FIRST_GRID as f64;
        let (low, high) = (self.at(best.frequency - spread)?, self.at(best.frequency + spread)?);
        refine(|w| self.at(w), [low, best, high], SETTINGS.flat_gain).map(Some)
    }

    /// Frequencies in [0, pi], ascending and with both ends, at which the gain may equal `level`.
    ///
    /// If measurements are copies of one another, there is no Hamiltonian matrix. Then no frequency is
    /// suggested, and the result is that of the refined grid, which is still an attained value.
    fn crossings(&self, level: f64) -> Result<Vec<f64>, LtiError> {
        let mut crossings = vec![0.0, PI];
        let centre = self.centre(level)?;
        let real = centre == 0.0 || centre == PI;
        let eigenvalues = if real {
            let turn = if centre == PI { 1.0 } else { -1.0 };
            let matrix = hamiltonian_about(turn, &self.system, self.measurements, level);
            hybank_linalg::eigenvalues(&matrix)
        } else {
            let turn = -Complex::from_polar(1.0, -centre);
            let matrix = hamiltonian_about(turn, &self.system, self.measurements, level);
            hybank_linalg::eigenvalues(&matrix)
        };
        let eigenvalues = match eigenvalues {
            Err(hybank_linalg::LinalgError::NotFinite { .. }) if self.measurements > 0 => {
                return Ok(crossings);
            }
            other => other?,
        };
        // Of a conjugate pair one is enough.
        for lambda in eigenvalues.into_iter().filter(|lambda| !real || lambda.im >= 0.0) {
            if lambda.re.abs() <= SETTINGS.near_axis * (1.0 + lambda.norm()) {
                let w = centre + PI + 2.0 * lambda.im.atan();
                crossings.push(Peak { gain: level, frequency: w }.folded().frequency);
            }
        }
        crossings.sort_by(f64::total_cmp);
        Ok(crossings)
    }

    /// The Cayley transform sends e^{j centre} to infinity, where the gain must not equal the level: of pi
    /// and 0 the one whose gain is farther away or, where both are near (as in errors of many equal peaks),
    /// a frequency between them.
    fn centre(&self, level: f64) -> Result<f64, LtiError> {
        let distance = |w: f64| self.gain(w).map(|gain| (gain - level).abs());
        let (low, high) = (distance(0.0)?, distance(PI)?);
        let mut best = if high >= low { (high, PI) } else { (low, 0.0) };
        if best.0 > SETTINGS.near_level * level {
            return Ok(best.1);
        }
        for k in 1..CENTRES {
            let w = PI * k as f64 / CENTRES as f64;
            let away = distance(w)?;
            if away > best.0 {
                best = (away, w);
            }
        }
        Ok(best.1)
    }
}

type Parts<T> = (DMatrix<T>, DMatrix<T>, DMatrix<T>, DMatrix<T>);

/// The Hamiltonian matrix whose eigenvalue j tan(w / 2) marks gain(w) = level, w counted from the point
/// opposite to the centre of the Cayley transform, e^{j centre}. `turn` is -e^{-j centre}, which is real for
/// the centres 0 and pi. The gain is that of the outputs from `measurements` on, after subtraction of the
/// part that the outputs before explain.
fn hamiltonian_about<T: Scalar>(turn: T, system: &StateSpace, measurements: usize, level: f64) -> DMatrix<T> {
    let [a, b, c, d] = [system.a(), system.b(), system.c(), system.d()].map(|m| m.map(T::from_real));
    hamiltonian(&cayley((a * turn, b * turn, c, d)), measurements, level)
}

/// s = (z - 1) / (z + 1): the unit circle becomes the imaginary axis, z = -1 infinity.
fn cayley<T: Scalar>((a, b, c, d): Parts<T>) -> Parts<T> {
    let n = a.nrows();
    let identity = DMatrix::<T>::identity(n, n);
    let inverse = hybank_linalg::solve(&(&a + &identity), &identity);
    let b = &inverse * b;
    let d = d - &c * &b;
    let root2 = T::from_real(std::f64::consts::SQRT_2);
    (&inverse * (a - identity), b * root2, c * inverse * root2, d)
}

/// The Hamiltonian matrix of a continuous-time system whose eigenvalues on the imaginary axis mark
/// gain = `level`. The gain is that of the outputs from `measurements` on, after subtraction of the part
/// that the outputs before explain.
fn hamiltonian<T: Scalar>((a, b, c, d): &Parts<T>, measurements: usize, level: f64) -> DMatrix<T> {
    let mut r = d * d.adjoint();
    for i in measurements..r.nrows() {
        r[(i, i)] -= T::from_real(level * level);
    }
    let s = b * d.adjoint();
    let n = a.nrows();
    let solved = hybank_linalg::solve(&r, &hybank_linalg::hstack(&[c, &s.adjoint()]));
    let (rc, rs) = (solved.columns(0, n), solved.columns(n, n));
    let drift = a - &s * rc;
    let (b_part, c_part) = (b * b.adjoint() - s * rs, c.adjoint() * rc);
    hybank_linalg::from_blocks(&[&[&drift, &b_part], &[&c_part, &-drift.adjoint()]])
}

#[cfg(test)]
mod tests;
