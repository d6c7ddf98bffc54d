//! Peak gains over the unit circle: the H-infinity norm, and the peak of what measured outputs
//! cannot explain.
//!
//! Both are largest values over w of sigma_max(L_z(w)), where an LQ factorisation of the response
//! [G_y; G_z] = [L_y 0; L_zy L_z] Q splits off what the measured outputs y say about the wanted
//! outputs z. Without measured outputs this is sigma_max(G_z) and its peak the H-infinity norm.
//!
//! Method: level sets (Boyd & Balakrishnan 1990, Bruinsma & Steinbuch 1990). gamma is the gain at some
//! frequency exactly where G G* - gamma^2 J, J = diag(0, I), is singular; after a Cayley transform these
//! are the imaginary eigenvalues of one Hamiltonian matrix. Eigenvalues only ever *suggest* frequencies:
//! each value that is reported was evaluated from the response itself.

use super::{FrequencyResponse, LtiError, StateSpace};
use crate::linalg::{self, CMat, Complex, Mat};
use nalgebra::{ComplexField, DMatrix};
use std::f64::consts::PI;

/// Relative accuracy of the returned peak.
pub const PEAK_ACCURACY: f64 = 1e-9;
/// The level rises at least by [`PEAK_ACCURACY`] in each round; in practice two or three do.
const ROUND_LIMIT: usize = 60;
/// Uniform frequencies looked at first.
const FIRST_GRID: usize = 32;
/// Relative differences of gains below this are no reason to go on climbing.
const FLAT: f64 = 1e-11;
/// Relative differences of gains below this are no differences.
const ROUNDING: f64 = 1e-13;
/// Steps of a climb are at least this part of the width that is left.
const LEAST_STEP: f64 = 1e-3;
/// At least so many uniform frequencies a state: |G|^2 has at most a peak for each state between 0 and pi.
const LOOKS_PER_STATE: usize = 2;
/// Frequencies nearer than this are looked at once.
const SAME_FREQUENCY: f64 = 1e-9;
/// How far off the axis (relative) an eigenvalue may lie and still count as a crossing.
const ON_AXIS: f64 = 1e-5;
/// As [`ON_AXIS`] where a frequency is only suggested. Where the level all but touches a peak, two eigenvalues meet on the axis,
/// and what rounding does to the matrix moves them by its square root: errors of 1e-4 are common where the gain is small
/// against the parts that cancel. A false suggestion costs one evaluation, a missed one a peak.
const NEAR_AXIS: f64 = 1e-2;

/// Distances from the angle of a pole, in those of the pole from the unit circle.
const WIDTHS: [f64; 5] = [-1.5, -0.5, 0.0, 0.5, 1.5];

/// A gain this near to the level (relative) is no good centre of the Cayley transform.
const NEAR_LEVEL: f64 = 1e-2;
/// Frequencies looked at for a better one.
const CENTRES: usize = 16;

/// A peak gain and where it is attained.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak {
    /// The largest gain, to [`PEAK_ACCURACY`] relative, attained at `frequency` (so never too large).
    pub gain: f64,
    /// Radians per tick, in [0, pi].
    pub frequency: f64,
}

/// The H-infinity norm of a stable system with its peak frequency.
pub fn hinf_norm(system: &StateSpace) -> Result<Peak, LtiError> {
    unexplained_peak(system, 0)
}

/// max over w of sigma_max of the part of the wanted outputs (rows from `measured` on) that no
/// combination of the measured outputs (the first `measured` rows) explains, causal or not:
/// G_z (I - G_y* (G_y G_y*)^+ G_y).
pub fn unexplained_peak(system: &StateSpace, measured: usize) -> Result<Peak, LtiError> {
    let poles = stable_poles(system)?;
    let system = system.compress_inputs();
    let response = FrequencyResponse::new(&system);
    Search::new(&system, measured, &|w| response.at_frequency(w), resonances(&poles)).run()
}

/// The H-infinity norm of a system that is known to be stable and whose frequency response is cheaper to
/// have elsewhere: `response(w)` has the singular values of G(e^{jw}), and `hints` are frequencies where it may be
/// large (see [`resonances`]).
pub fn known_hinf_norm(
    system: &StateSpace,
    response: &dyn Fn(f64) -> CMat,
    hints: Vec<f64>,
) -> Result<Peak, LtiError> {
    Search::new(&system.compress_inputs(), 0, response, hints).run()
}

/// The peaks of a stable system that rise above `level`: at least one of each range of frequencies that does.
pub fn peaks_above(system: &StateSpace, level: f64) -> Result<Vec<Peak>, LtiError> {
    let poles = stable_poles(system)?;
    let system = system.compress_inputs();
    let response = FrequencyResponse::new(&system);
    Search::new(&system, 0, &|w| response.at_frequency(w), resonances(&poles)).all_above(level)
}

/// The poles of a stable system.
///
/// # Errors
/// [`LtiError::Unstable`] if one of them is not inside the unit circle.
pub fn stable_poles(system: &StateSpace) -> Result<Vec<Complex<f64>>, LtiError> {
    let poles = linalg::eigenvalues(system.a())?;
    let radius = poles.iter().map(|pole| pole.norm()).fold(0.0, f64::max);
    if radius >= 1.0 { Err(LtiError::Unstable { radius }) } else { Ok(poles) }
}

/// Angles of the poles that may make a peak, and angles about them at distances of what they miss of the unit circle: the
/// width of what they do to the gain.
pub fn resonances(poles: &[Complex<f64>]) -> Vec<f64> {
    let near = poles.iter().filter(|p| p.im >= 0.0 && p.norm() > 0.5);
    let about = |p: &Complex<f64>| WIDTHS.map(|width| p.arg() + width * (1.0 - p.norm()));
    near.flat_map(about).filter(|w| (0.0..=PI).contains(w)).collect()
}

/// The gain at one frequency: see [`unexplained_peak`].
pub fn unexplained_gain(response: &CMat, measured: usize) -> Result<f64, LtiError> {
    let wanted = response.nrows() - measured;
    if wanted == 0 || response.ncols() == 0 {
        return Ok(0.0);
    }
    if measured == 0 {
        return Ok(linalg::largest_singular_value_c(response)?);
    }
    let l = linalg::lq_factor_c(response);
    if l.ncols() <= measured {
        return Ok(0.0);
    }
    let rest = l.view((measured, measured), (wanted, l.ncols() - measured)).into_owned();
    Ok(linalg::largest_singular_value_c(&rest)?)
}

struct Search<'a> {
    system: StateSpace,
    measured: usize,
    response: &'a dyn Fn(f64) -> CMat,
    /// Frequencies looked at first, beside the uniform ones.
    hints: Vec<f64>,
    /// The level set squares the gain: below sqrt(eps) of what cancels it sees rounding only, and the
    /// refined grid has to do.
    floor: f64,
}

impl<'a> Search<'a> {
    fn new(system: &StateSpace, measured: usize, response: &'a dyn Fn(f64) -> CMat, hints: Vec<f64>) -> Self {
        let system = system.rescaled();
        let scale = system.d().norm() + system.c().norm() * system.b().norm();
        Self { system, measured, response, hints, floor: f64::EPSILON.sqrt() * scale }
    }

    fn gain(&self, w: f64) -> Result<f64, LtiError> {
        unexplained_gain(&(self.response)(w), self.measured)
    }

    fn run(&self) -> Result<Peak, LtiError> {
        let mut best = self.first_peak()?;
        for _ in 0..ROUND_LIMIT {
            if best.gain <= self.floor {
                return Ok(best);
            }
            match self.above(best.gain * (1.0 + PEAK_ACCURACY))? {
                None => return Ok(best),
                Some(higher) => best = higher,
            }
        }
        Err(LtiError::IterationLimit { what: "the level set", limit: ROUND_LIMIT, change: PEAK_ACCURACY })
    }

    /// The highest of the tops on the grid, each refined that may be it. Minimax designs have many peaks that differ by less
    /// than any level set tells apart, so that none can be left to it.
    fn first_peak(&self) -> Result<Peak, LtiError> {
        let looks = self.looks()?;
        let mut tops = tops(&looks);
        tops.sort_by(|a, b| b[1].gain.total_cmp(&a[1].gain));
        let mut best = tops.first().map_or(Peak { gain: 0.0, frequency: 0.0 }, |top| top[1].folded());
        for [low, top, high] in tops {
            if summit(low, top, high) > best.gain {
                best = higher(best, self.climb(low, top, high)?);
            }
        }
        Ok(best)
    }

    /// The gains at the first frequencies, ascending from 0 to pi.
    fn looks(&self) -> Result<Vec<Peak>, LtiError> {
        let intervals = FIRST_GRID.max(LOOKS_PER_STATE * self.system.order());
        let mut grid: Vec<f64> = (0..=intervals).map(|k| PI * k as f64 / intervals as f64).collect();
        grid.extend(&self.hints);
        grid.sort_by(f64::total_cmp);
        grid.dedup_by(|b, a| *b - *a < SAME_FREQUENCY);
        grid.into_iter().map(|w| self.look(w)).collect()
    }

    fn look(&self, frequency: f64) -> Result<Peak, LtiError> {
        Ok(Peak { gain: self.gain(frequency)?, frequency })
    }

    /// Climbs to the top between `low` and `high` by parabolas through the last three points, falling
    /// back on golden sections. The gain is flat at the top: its value converges twice as fast as the
    /// frequency.
    fn climb(&self, mut low: Peak, start: Peak, mut high: Peak) -> Result<Peak, LtiError> {
        let mut best = start;
        let (mut stalls, mut flats) = (0, 0);
        while high.frequency - low.frequency > 1e-9 && flats < 2 {
            let w = next_abscissa(low, best, high, stalls);
            let tried = self.look(w)?;
            let gained = tried.gain - best.gain;
            stalls = if gained < FLAT * best.gain { stalls + 1 } else { 0 };
            // A try far below the best one says that the step was poor, not that the top is reached.
            flats = if gained.abs() <= FLAT * best.gain { flats + 1 } else { 0 };
            // Of equal gains the first stays: tops at 0 and pi are there exactly.
            if gained > ROUNDING * best.gain {
                if w < best.frequency {
                    high = best
                } else {
                    low = best
                }
                best = tried;
            } else if w < best.frequency {
                low = tried;
            } else {
                high = tried;
            }
        }
        Ok(best.folded())
    }

    /// A frequency with a gain above `level`, refined, if there is one.
    fn above(&self, level: f64) -> Result<Option<Peak>, LtiError> {
        let crossings = self.crossings(level, NEAR_AXIS)?;
        let mut candidates = crossings.clone();
        candidates.extend(crossings.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])));
        let mut best = Peak { gain: level, frequency: f64::NAN };
        for w in candidates {
            best = higher(best, self.look(w)?);
        }
        if best.frequency.is_nan() {
            return Ok(None);
        }
        let spread = 0.25 * PI / FIRST_GRID as f64;
        let (low, high) = (self.look(best.frequency - spread)?, self.look(best.frequency + spread)?);
        self.climb(low, best, high).map(Some)
    }

    fn all_above(&self, level: f64) -> Result<Vec<Peak>, LtiError> {
        let mut edges = self.crossings(level, ON_AXIS)?;
        edges.dedup();
        let mut peaks = Vec::new();
        for range in edges.windows(2) {
            let start = self.look(0.5 * (range[0] + range[1]))?;
            if start.gain > level {
                let (low, high) = (self.look(range[0])?, self.look(range[1])?);
                peaks.push(higher(self.climb(low, start, high)?, higher(low, high)));
            }
        }
        Ok(peaks)
    }

    /// Frequencies in [0, pi], ascending and with both ends, at which the gain may equal `level`: those of eigenvalues that
    /// lie off the axis by at most `tolerance` (relative).
    ///
    /// The Hamiltonian matrix is asked balanced and, where its scales differ by many decades, as it stands too: large gains want
    /// the one, the smallest entries, which are rounding errors, the other.
    ///
    /// Measured outputs that are copies of one another leave no Hamiltonian matrix; then nothing is
    /// suggested and the refined grid stands, still a value that is attained.
    fn crossings(&self, level: f64, tolerance: f64) -> Result<Vec<f64>, LtiError> {
        let mut crossings = vec![0.0, PI];
        let centre = self.centre(level)?;
        let real = centre == 0.0 || centre == PI;
        let eigenvalues = if real {
            linalg::candidate_eigenvalues(&self.hamiltonian(level, centre)?)
        } else {
            linalg::candidate_eigenvalues_c(&self.rotated_hamiltonian(level, centre)?)
        };
        let eigenvalues = match eigenvalues {
            Err(linalg::LinalgError::NotFinite { .. }) if self.measured > 0 => return Ok(crossings),
            other => other?,
        };
        // Of a conjugate pair one is enough.
        for lambda in eigenvalues.into_iter().filter(|lambda| !real || lambda.im >= 0.0) {
            if lambda.re.abs() <= tolerance * (1.0 + lambda.norm()) {
                let w = centre + PI + 2.0 * lambda.im.atan();
                crossings.push(Peak { gain: level, frequency: w }.folded().frequency);
            }
        }
        crossings.sort_by(f64::total_cmp);
        Ok(crossings)
    }

    /// The Cayley transform sends e^{j centre} to infinity, where the gain must not equal the level: of pi and 0 the one
    /// whose gain is farther away or, where both are near (as in errors of many equal peaks), a frequency between them.
    fn centre(&self, level: f64) -> Result<f64, LtiError> {
        let distance = |w: f64| self.gain(w).map(|gain| (gain - level).abs());
        let (low, high) = (distance(0.0)?, distance(PI)?);
        let mut best = if high >= low { (high, PI) } else { (low, 0.0) };
        if best.0 > NEAR_LEVEL * level {
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

    /// The Hamiltonian matrix whose eigenvalue j tan(w / 2) marks gain(w) = level, w counted from the point
    /// opposite to the centre of the Cayley transform, which is 0 or pi.
    fn hamiltonian(&self, level: f64, centre: f64) -> Result<Mat, linalg::LinalgError> {
        let e = if centre == PI { 1.0 } else { -1.0 };
        let system = &self.system;
        let parts = (system.a() * e, system.b() * e, system.c().clone(), system.d().clone());
        hamiltonian(&cayley(parts, linalg::solve), self.measured, level, linalg::solve)
    }

    /// As [`Search::hamiltonian`] for any centre, which costs complex numbers.
    fn rotated_hamiltonian(&self, level: f64, centre: f64) -> Result<CMat, linalg::LinalgError> {
        let turn = -Complex::from_polar(1.0, -centre);
        let complex = |m: &Mat| linalg::to_complex(m);
        let system = &self.system;
        let parts = (
            complex(system.a()) * turn,
            complex(system.b()) * turn,
            complex(system.c()),
            complex(system.d()),
        );
        hamiltonian(&cayley(parts, linalg::solve_c), self.measured, level, linalg::solve_c)
    }
}

impl Peak {
    /// The same peak with its frequency brought into [0, pi].
    fn folded(self) -> Self {
        let w = self.frequency.rem_euclid(2.0 * PI);
        Self { gain: self.gain, frequency: w.min(2.0 * PI - w) }
    }
}

/// Vertex of the parabola through three points, at least [`LEAST_STEP`] of their width away from the best one (a shorter step
/// finds the same gain but for rounding, wherever the top is), or, where it is no use, a golden section of the longer side.
fn next_abscissa(low: Peak, best: Peak, high: Peak, stalls: usize) -> f64 {
    const GOLDEN: f64 = 0.381_966_011_250_105_1;
    let (a, m, b) = (low.frequency, best.frequency, high.frequency);
    let (left, right) = ((m - a) * (best.gain - high.gain), (b - m) * (best.gain - low.gain));
    let step = -0.5 * ((m - a) * left - (b - m) * right) / (left + right);
    let longer = if m - a > b - m { a - m } else { b - m };
    let least = LEAST_STEP * (b - a);
    let step = if step.abs() < least { least.copysign(longer) } else { step };
    let inside = m + step > a && m + step < b;
    if stalls % 3 < 2 && inside { m + step } else { m + GOLDEN * longer }
}

fn higher(a: Peak, b: Peak) -> Peak {
    if b.gain > a.gain { b } else { a }
}

/// The local maxima between their neighbours. The gain is even about 0 and about pi, so the neighbours there are mirror images.
fn tops(looks: &[Peak]) -> Vec<[Peak; 3]> {
    let last = looks.len() - 1;
    let neighbours = |k: usize| {
        let mirror = |about: f64, peak: Peak| Peak { frequency: 2.0 * about - peak.frequency, ..peak };
        let low = if k == 0 { mirror(0.0, looks[1]) } else { looks[k - 1] };
        let high = if k == last { mirror(PI, looks[last - 1]) } else { looks[k + 1] };
        [low, looks[k], high]
    };
    let is_top = |[low, top, high]: &[Peak; 3]| top.gain >= low.gain.max(high.gain);
    (0..=last).map(neighbours).filter(is_top).collect()
}

/// How high the gain may rise between `low` and `high`, of which `top` is the highest that was looked at: a gain that is
/// concave there lies below the chords on either side of `top`, extended to the other.
fn summit(low: Peak, top: Peak, high: Peak) -> f64 {
    let (left, right) = (top.frequency - low.frequency, high.frequency - top.frequency);
    let beyond_left = (top.gain - low.gain) * right / left;
    let beyond_right = (top.gain - high.gain) * left / right;
    top.gain + beyond_left.max(beyond_right)
}

type Parts<T> = (DMatrix<T>, DMatrix<T>, DMatrix<T>, DMatrix<T>);
type Solve<T> = fn(&DMatrix<T>, &DMatrix<T>) -> DMatrix<T>;

/// s = (z - 1) / (z + 1): the unit circle becomes the imaginary axis, z = -1 infinity.
fn cayley<T: ComplexField>((a, b, c, d): Parts<T>, solve: Solve<T>) -> Parts<T> {
    let n = a.nrows();
    let identity = DMatrix::<T>::identity(n, n);
    let inverse = solve(&(&a + &identity), &identity);
    let b = &inverse * b;
    let d = d - &c * &b;
    let root2 = nalgebra::convert::<f64, T>(std::f64::consts::SQRT_2);
    (&inverse * (a - identity), b * root2.clone(), c * inverse * root2, d)
}

/// The Hamiltonian matrix of a continuous-time system whose eigenvalues on the imaginary axis mark gain = `level` of the
/// outputs from `measured` on, as far as those before do not explain them.
fn hamiltonian<T: ComplexField>(
    (a, b, c, d): &Parts<T>,
    measured: usize,
    level: f64,
    solve: Solve<T>,
) -> Result<DMatrix<T>, linalg::LinalgError> {
    let mut r = d * d.adjoint();
    for i in measured..r.nrows() {
        r[(i, i)] -= nalgebra::convert(level * level);
    }
    let s = b * d.adjoint();
    let n = a.nrows();
    let solved = solve(&r, &linalg::hstack(&[c, &s.adjoint()])?);
    let (rc, rs) = (solved.columns(0, n), solved.columns(n, n));
    let drift = a - &s * &rc;
    let (b_part, c_part) = (b * b.adjoint() - s * rs, c.adjoint() * rc);
    linalg::from_blocks(&[&[&drift, &b_part], &[&c_part, &-drift.adjoint()]])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn siso(a: Mat, b: Vec<f64>, c: Vec<f64>, d: f64) -> StateSpace {
        let n = b.len();
        StateSpace::new(a, Mat::from_vec(n, 1, b), Mat::from_vec(1, n, c), Mat::from_element(1, 1, d))
            .unwrap()
    }

    #[test]
    fn one_pole_peaks_at_dc_or_nyquist() {
        for pole in [0.0_f64, 0.5, -0.5, 0.999, -0.999999] {
            let peak = hinf_norm(&siso(Mat::from_element(1, 1, pole), vec![1.0], vec![3.0], 0.0)).unwrap();
            let exact = 3.0 / (1.0 - pole.abs());
            assert!((peak.gain - exact).abs() < 1e-9 * exact, "{pole}: {peak:?}");
        }
    }

    /// Gains within 1e-6 of one another at 0, at pi and at a peak between them that is the highest by a little: what a
    /// minimax design looks like. Both real centres of the Cayley transform are all but singular then.
    #[test]
    fn the_highest_of_nearly_equal_peaks_is_found() {
        // y_n = Chebyshev polynomial of cos w as a delay line: T_4(cos w) = cos 4w has gain 1 at 0, pi/4, pi/2 ..; a small
        // cos 2w lifts pi/2 and lowers the rest: 1 - t at 0 and pi, 1 + t at pi/2 for cos 4w - t cos 2w.
        for t in [0.0, 1e-9, 1e-7, 3e-5, 1e-3] {
            let n = 8;
            let a = Mat::from_fn(n, n, |i, j| f64::from(u8::from(i == j + 1)));
            let mut b = vec![0.0; n];
            b[0] = 1.0;
            // e^{-4jw} (cos 4w - t cos 2w) = (1 - t e^{-2jw} - t e^{-6jw} + e^{-8jw}) / 2.
            let mut c = vec![0.0; n];
            (c[1], c[5], c[7]) = (-0.5 * t, -0.5 * t, 0.5);
            let peak = hinf_norm(&siso(a, b, c, 0.5)).unwrap();
            assert!((peak.gain - 1.0 - t).abs() < 2e-9, "{t}: {peak:?}");
        }
    }

    #[test]
    fn a_needle_between_grid_points_is_found() {
        // Poles r e^{+-j w0}, r = 1 - 1e-7: the peak is far narrower than any grid.
        let (r, w0) = (1.0 - 1e-7, 1.2345_f64);
        let a = Mat::from_row_slice(2, 2, &[2.0 * r * w0.cos(), -r * r, 1.0, 0.0]);
        let system = siso(a, vec![1.0, 0.0], vec![1.0, 0.0], 0.0);
        let peak = hinf_norm(&system).unwrap();
        // |1/((1 - p/z)(1 - p*/z))| at w0 is 1/((1-r) |1 - r e^{-2 j w0}|).
        let exact = 1.0 / ((1.0 - r) * (Complex::new(1.0, 0.0) - Complex::from_polar(r, -2.0 * w0)).norm());
        assert!((peak.gain - exact).abs() < 1e-6 * exact, "{peak:?} {exact}");
    }

    #[test]
    fn delay_lines_are_all_pass() {
        for n in 1..12 {
            let a = Mat::from_fn(n, n, |i, j| f64::from(u8::from(i == j + 1)));
            let mut b = vec![0.0; n];
            b[0] = 2.0;
            let mut c = vec![0.0; n];
            c[n - 1] = 1.5;
            let peak = hinf_norm(&siso(a, b, c, 0.0)).unwrap();
            assert!((peak.gain - 3.0).abs() < 1e-12, "{n}: {peak:?}");
        }
    }

    #[test]
    fn the_level_set_beats_a_fine_grid() {
        for seed in 0..8 {
            let n = 4 + seed;
            let raw = Mat::from_fn(n, n, |i, j| ((i * 37 + j * 11 + seed * 101 + 5) as f64).sin());
            let a = &raw * (0.97 / linalg::spectral_radius(&raw).unwrap());
            let b = Mat::from_fn(n, 3, |i, j| ((i * 3 + j + seed) as f64).cos());
            let c = Mat::from_fn(2, n, |i, j| ((i + j * 5 + seed) as f64).sin());
            let system = StateSpace::new(a, b, c, Mat::from_element(2, 3, 0.1)).unwrap();
            let peak = hinf_norm(&system).unwrap();
            let response = FrequencyResponse::new(&system);
            let grid = (0..=20_000)
                .map(|k| unexplained_gain(&response.at_frequency(PI * f64::from(k) / 20_000.0), 0).unwrap())
                .fold(0.0, f64::max);
            assert!(peak.gain >= grid * (1.0 - 1e-12), "{seed}: {peak:?} {grid}");
            assert!(peak.gain <= grid * (1.0 + 1e-4), "{seed}: {peak:?} {grid}");
        }
    }

    #[test]
    fn a_measured_copy_explains_everything() {
        let a = Mat::from_row_slice(2, 2, &[0.5, 0.3, -0.3, 0.5]);
        let c = Mat::from_row_slice(2, 2, &[1.0, 0.5, 2.0, 1.0]);
        let system = StateSpace::new(a, Mat::identity(2, 2), c, Mat::zeros(2, 2)).unwrap();
        assert!(unexplained_peak(&system, 1).unwrap().gain < 1e-14);
    }

    #[test]
    fn unstable_systems_are_refused() {
        let system = siso(Mat::from_element(1, 1, 1.0), vec![1.0], vec![1.0], 0.0);
        assert!(matches!(hinf_norm(&system), Err(LtiError::Unstable { .. })));
    }

    /// Rounding as large as evaluations of delicate error systems show, and three first points whose parabola has its vertex
    /// all but in the middle one, though the top is elsewhere.
    #[test]
    fn climbs_reach_the_top_whatever_the_first_points_look_like() {
        let no_states = (Mat::zeros(0, 0), Mat::zeros(0, 1), Mat::zeros(1, 0), Mat::zeros(1, 1));
        let empty = StateSpace::new(no_states.0, no_states.1, no_states.2, no_states.3).unwrap();
        for seed in 0..4000u32 {
            let die = |k: u32| (f64::from((seed * 16 + k) * (k + 1)) * 0.618_033_988_749_894_9).fract();
            let (width, middle) = (10f64.powf(-4.0 * die(0) - 0.5), 1.0 + die(1));
            let (skew, sharp) = (0.1 * (die(2) - 0.5), 10f64.powf(-6.0 * die(3)));
            let vertex = 0.1 * 10f64.powf(-10.0 * die(4)) * (die(5) - 0.5);
            // In x = (w - middle) / width the parabola through -1, 0 and 1 has its vertex at `vertex`.
            let slope = skew + 2.0 * vertex;
            let gain = |x: f64| 1.0 - sharp * (x * x + skew * x * x * x - slope * x);
            let looks = std::cell::Cell::new(0);
            let response = |w: f64| {
                looks.set(looks.get() + 1);
                let rounding = 3e-12 * ((w * 1e15).rem_euclid(7.0) / 3.5 - 1.0);
                CMat::from_element(1, 1, Complex::new(gain((w - middle) / width) + rounding, 0.0))
            };
            let search = Search::new(&empty, 0, &response, Vec::new());
            let look = |x: f64| search.look(middle + x * width).unwrap();
            let top = search.climb(look(-1.0), look(0.0), look(1.0)).unwrap();
            let exact = gain(slope / (1.0 + (1.0 + 3.0 * skew * slope).sqrt()));
            assert!((top.gain - exact).abs() < 1e-11, "{seed}: {top:?} {exact}");
            assert!(looks.get() <= 20, "{seed}: {} looks", looks.get());
        }
    }
}
