//! The gain of a written bank at any frequency and its largest gain, by the quotients of `plant`.

use super::fronts::numbers;
use super::plant::{Errors, Library, Plant};
use super::real::{Complex, Real, real};
use nalgebra::{Complex as C64, DMatrix};
use serde_json::Value;
use std::f64::consts::{PI, TAU};

/// Points of the first grid of frequencies.
const GRID: usize = 96;
/// Distances from a resonance, in its widths.
const SKIRT: [f64; 5] = [0.0, 0.3, 1.0, 2.0, 5.0];
/// Maxima whose parabola through the grid stays this share below the largest one are not refined.
const LOW: f64 = 0.97;
/// Most steps of a refinement; parabolas need about eight.
const STEPS: usize = 24;
/// Change of the gain at which a refinement ends: the rounding of doubles.
const FLAT: f64 = 4e-16;

/// The synthesis filters as written.
pub(crate) enum Filters {
    /// Channel, then tap.
    Taps(Vec<Vec<Real>>),
    /// a, b, c, d.
    States([Vec<Vec<Real>>; 4]),
}

/// A bank and its front ends.
pub(crate) struct Judge {
    pub(crate) plant: Plant,
    pub(crate) filters: Filters,
}

/// A local maximum of the gain.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Peak {
    pub(crate) gain: f64,
    pub(crate) omega: f64,
}

/// e^{j omega} up to rounding of the angle, exactly on the unit circle.
pub(crate) fn on_circle(omega: f64) -> Complex {
    if omega == PI {
        return -&Complex::one();
    }
    let half = Complex::new(real(1.0), real((0.5 * omega).tan()));
    (&half * &half).times(&(real(1.0) / half.square_size()))
}

impl Filters {
    /// The taps or matrices of a bank file.
    pub(crate) fn read(bank: &Value) -> Self {
        if let Some(block) = bank.get("state_space").filter(|block| block.is_object()) {
            let rows =
                |key: &str| block[key].as_array().expect("rows").iter().map(numbers).collect::<Vec<_>>();
            let matrix = |key| rows(key).into_iter().map(|row| row.into_iter().map(real).collect()).collect();
            return Self::States(["a", "b", "c", "d"].map(matrix));
        }
        let channels = bank["channels"].as_array().expect("channels");
        let of = |list: &Value| numbers(list).into_iter().map(real).collect::<Vec<_>>();
        Self::Taps(channels.iter().map(|channel| of(&channel["taps"])).collect())
    }

    /// Taps that were found elsewhere.
    pub(crate) fn of_taps(taps: &[Vec<f64>]) -> Self {
        Self::Taps(taps.iter().map(|list| list.iter().copied().map(real).collect()).collect())
    }

    /// F(z), M rows of N.
    fn at(&self, z: &Complex, ratio: usize) -> Vec<Vec<Complex>> {
        match self {
            Self::Taps(taps) => {
                let back = z.conj();
                let filter = |list: &Vec<Real>, p: usize| {
                    let lags = list.iter().skip(p).step_by(ratio).rev();
                    lags.fold(Complex::zero(), |sum, tap| &(&sum * &back) + &Complex::real(tap.clone()))
                };
                (0..ratio).map(|p| taps.iter().map(|list| filter(list, p)).collect()).collect()
            }
            Self::States([a, b, c, d]) => {
                let states = resolvent(a, b, z);
                let entry = |(c, d): (&Vec<Real>, &Vec<Real>)| -> Vec<Complex> {
                    let sum = |i: usize| {
                        let terms = c.iter().zip(&states).filter(|(c, _)| **c != real(0.0));
                        terms.fold(Complex::real(d[i].clone()), |sum, (c, x)| &sum + &x[i].times(c))
                    };
                    (0..d.len()).map(sum).collect()
                };
                c.iter().zip(d).map(entry).collect()
            }
        }
    }
}

/// (zI - A)^-1 B by elimination with row pivots; zeros cost nothing, so the written sections stay cheap.
fn resolvent(a: &[Vec<Real>], b: &[Vec<Real>], z: &Complex) -> Vec<Vec<Complex>> {
    let (n, inputs) = (a.len(), b.first().map_or(0, Vec::len));
    let mut rows: Vec<Vec<Complex>> = (0..n)
        .map(|i| {
            a[i].iter().map(|x| Complex::real(-x)).chain(b[i].iter().cloned().map(Complex::real)).collect()
        })
        .collect();
    (0..n).for_each(|i| rows[i][i] = &rows[i][i] + z);
    for k in 0..n {
        let pivot = (k..n).max_by(|&i, &j| rows[i][k].size().total_cmp(&rows[j][k].size())).expect("a row");
        rows.swap(k, pivot);
        let top = rows[k].clone();
        let inverse = top[k].inverse();
        for row in rows.iter_mut().skip(k + 1).filter(|row| !row[k].is_zero()) {
            let factor = &row[k] * &inverse;
            for j in (k..n + inputs).filter(|j| !top[*j].is_zero()) {
                row[j] = &row[j] - &(&factor * &top[j]);
            }
        }
    }
    let mut solution = vec![vec![Complex::zero(); inputs]; n];
    for k in (0..n).rev() {
        let inverse = rows[k][k].inverse();
        for i in 0..inputs {
            let known = (k + 1..n).filter(|j| !rows[k][*j].is_zero());
            let rest = known.fold(rows[k][n + i].clone(), |sum, j| &sum - &(&rows[k][j] * &solution[j][i]));
            solution[k][i] = &rest * &inverse;
        }
    }
    solution
}

impl Judge {
    /// A bank as its file says.
    pub(crate) fn of(bank: &Value) -> Self {
        let channels = bank["channels"].as_array().expect("channels").len();
        Self::off_by(bank, &Errors::none(channels), &mut Library::default())
    }

    /// The same with channels that are off by `errors`.
    pub(crate) fn off_by(bank: &Value, errors: &Errors, library: &mut Library) -> Self {
        let latency = bank["latency"].as_u64().expect("a latency") as usize;
        let plant = Plant::new(&bank["spec"], latency, errors, library);
        Self { plant, filters: Filters::read(bank) }
    }

    /// K K* at z, every cancellation done in all digits.
    fn square(&self, z: &Complex) -> DMatrix<C64<f64>> {
        let m = self.plant.ratio;
        let (gram, filters) = (self.plant.gram(z), self.filters.at(z, m));
        // S [I, -F]*, then [I, -F] times that.
        let right = |a: usize, p: usize| {
            let terms = filters[p].iter().enumerate();
            terms.fold(gram[a][p].clone(), |sum, (i, f)| &sum - &(&gram[a][m + i] * &f.conj()))
        };
        let half: Vec<Vec<Complex>> =
            (0..self.plant.order()).map(|a| (0..m).map(|p| right(a, p)).collect()).collect();
        let whole = |q: usize, p: usize| {
            let terms = filters[q].iter().enumerate();
            terms.fold(half[q][p].clone(), |sum, (i, f)| &sum - &(f * &half[m + i][p])).rounded()
        };
        DMatrix::from_fn(m, m, whole)
    }

    /// The largest singular value of K at e^{j omega}.
    pub(crate) fn gain(&self, omega: f64) -> f64 {
        largest(self.square(&on_circle(omega)))
    }

    /// Local maxima of the gain, the largest first; `more` are further frequencies to look at.
    pub(crate) fn peaks(&self, more: &[f64]) -> Vec<Peak> {
        peaks(&|omega| self.gain(omega), &self.plant.resonances(), more)
    }

    /// The norm: the largest gain that was found.
    pub(crate) fn norm(&self, more: &[f64]) -> Peak {
        self.peaks(more)[0]
    }
}

/// sqrt of the largest eigenvalue of a Hermitian matrix.
pub(crate) fn largest(square: DMatrix<C64<f64>>) -> f64 {
    square.symmetric_eigenvalues().max().max(0.0).sqrt()
}

/// Grid frequencies, closer near the resonances.
pub(crate) fn grid(points: usize, resonances: &[(f64, f64)], more: &[f64]) -> Vec<f64> {
    let folded = |omega: f64| {
        let turn = omega.rem_euclid(TAU);
        if turn > PI { TAU - turn } else { turn }
    };
    let near = resonances
        .iter()
        .flat_map(|(omega, width)| SKIRT.iter().flat_map(move |x| [omega - x * width, omega + x * width]));
    let even = (0..=points).map(|k| PI * k as f64 / points as f64);
    let mut grid: Vec<f64> = even.chain(near.map(folded)).chain(more.iter().copied().map(folded)).collect();
    grid.sort_by(f64::total_cmp);
    grid.dedup_by(|a, b| *a - *b < 1e-12);
    grid
}

/// Local maxima of a gain over the frequency, refined by golden sections, the largest first.
pub(crate) fn peaks(gain: &dyn Fn(f64) -> f64, resonances: &[(f64, f64)], more: &[f64]) -> Vec<Peak> {
    let grid = grid(GRID, resonances, more);
    let values: Vec<f64> = grid.iter().map(|&omega| gain(omega)).collect();
    let last = grid.len() - 1;
    let is_peak =
        |k: usize| (k == 0 || values[k] >= values[k - 1]) && (k == last || values[k] >= values[k + 1]);
    // The gain is even about both ends, so the neighbour of an end is its mirror image on the other side
    // too.
    let bracket = |k: usize| {
        let (before, after) = (if k == 0 { 1 } else { k - 1 }, if k == last { last - 1 } else { k + 1 });
        let mirrored = |from: usize| 2.0 * grid[k] - grid[from];
        let left = if k == 0 { mirrored(1) } else { grid[before] };
        let right = if k == last { mirrored(last - 1) } else { grid[after] };
        [(left, values[before]), (grid[k], values[k]), (right, values[after])]
    };
    let tops: Vec<Bracket> = (0..=last).filter(|&k| is_peak(k)).map(bracket).collect();
    let estimates: Vec<f64> = tops.iter().map(|top| vertex(top).map_or(top[1].1, |(_, gain)| gain)).collect();
    let least = LOW * estimates.iter().copied().fold(0.0, f64::max);
    let high = tops.into_iter().zip(estimates).filter(|(_, estimate)| *estimate >= least);
    let mut found: Vec<Peak> = high.map(|(top, _)| refined(gain, top)).collect();
    found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    found
}

/// Three frequencies with their gains, the middle one the largest.
type Bracket = [(f64, f64); 3];

/// The top of the parabola through three points, if it has one between them.
fn vertex(top: &Bracket) -> Option<(f64, f64)> {
    let [(a, fa), (b, fb), (c, fc)] = *top;
    let (left, right) = ((fb - fa) / (b - a), (fc - fb) / (c - b));
    let bend = (right - left) / (c - a);
    let x = 0.5 * (a + b) - 0.5 * left / bend;
    (bend < 0.0 && x > a && x < c).then_some((x, fb + (x - b) * (left + bend * (x - a))))
}

/// The local maximum in a bracket, by parabolas, and by halving the longer side where they come too near to
/// the middle.
fn refined(gain: &dyn Fn(f64) -> f64, mut top: Bracket) -> Peak {
    for step in 0..STEPS {
        let [(a, _), (b, best), (c, _)] = top;
        let halved = if b - a > c - b { 0.5 * (a + b) } else { 0.5 * (b + c) };
        let estimate = vertex(&top).filter(|_| step % 3 != 2);
        let x = estimate.map_or(halved, |(x, _)| x);
        let settled = estimate.is_some_and(|(_, value)| value - best <= FLAT * best);
        if settled || (x - b).abs() < 1e-12 {
            break;
        }
        let value = gain(x);
        top = match (value >= best, x < b) {
            (true, true) => [top[0], (x, value), top[1]],
            (true, false) => [top[1], (x, value), top[2]],
            (false, true) => [(x, value), top[1], top[2]],
            (false, false) => [top[0], top[1], (x, value)],
        };
    }
    Peak { gain: top[1].1, omega: top[1].0 }
}
