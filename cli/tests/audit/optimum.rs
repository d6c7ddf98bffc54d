//! The taps of least norm by a barrier method on finitely many frequencies, with peaks added until they fit.
//!
//! Minimise s subject to s I - K_l K_l* > 0 at all frequencies, K_l = [I, -F(z_l)] R_l with the Cholesky
//! factor R_l of the Gram matrix. The barrier -log det of [[s I, K], [K*, I]] is that of a linear matrix
//! inequality in s and the taps, so Newton's method follows its central path.

use super::bounds::cholesky;
use super::judge::{Filters, Judge, grid, on_circle};
use super::plant::Plant;
use nalgebra::{Complex as C64, DMatrix, DVector};

/// Points of the first grid.
const GRID: usize = 64;
/// The same for each of several plants.
const LEAST_GRID: usize = 12;
/// By how much the weight of s grows per step of the path.
const GROWTH: f64 = 12.0;
/// Duality gap of the barrier, relative, at the end of the path.
const GAP: f64 = 1e-8;
/// Newton steps per weight: quadratic from the first on, unless rounding decides.
const NEWTON: usize = 40;
/// Rounds of added peaks, and the excess of the norm over the grid's optimum that ends them.
const ROUNDS: usize = 8;
const EXCESS: f64 = 1e-6;

/// Added to the diagonal of the Hessian, scaled to one, where rounding makes it indefinite.
const RIDGES: [f64; 4] = [0.0, 1e-15, 1e-13, 1e-11];

type Matrix = DMatrix<C64<f64>>;

/// One frequency.
struct Point {
    /// z^-j for the lags j.
    back: Vec<C64<f64>>,
    /// Rows of the target and of the channels of R.
    target: Matrix,
    channels: Matrix,
}

/// Which tap: phase, channel, lag.
struct Tap {
    phase: usize,
    channel: usize,
    lag: usize,
}

struct Barrier<'a> {
    points: &'a [Point],
    taps: &'a [Tap],
}

impl Point {
    fn new(plant: &Plant, omega: f64, lags: usize) -> Option<Self> {
        let z = on_circle(omega);
        let root = cholesky(&plant.gram(&z))?;
        let n = plant.order();
        let root = Matrix::from_fn(n, n, |i, j| root[i].get(j).map_or(C64::default(), |x| x.rounded()));
        let back = z.conj().rounded();
        let (target, channels) =
            (root.rows(0, plant.ratio).into_owned(), root.rows(plant.ratio, plant.channels).into_owned());
        Some(Self { back: (0..lags).map(|j| back.powu(j as u32)).collect(), target, channels })
    }

    fn error(&self, taps: &[Tap], x: &DVector<f64>) -> Matrix {
        let mut filters = Matrix::zeros(self.target.nrows(), self.channels.nrows());
        for (tap, x) in taps.iter().zip(x.iter()) {
            filters[(tap.phase, tap.channel)] += self.back[tap.lag] * *x;
        }
        &self.target - filters * &self.channels
    }
}

impl Barrier<'_> {
    /// weight s - sum log det(s I - K K*); `None` outside.
    fn value(&self, weight: f64, x: &DVector<f64>, s: f64) -> Option<f64> {
        let mut value = weight * s;
        for point in self.points {
            let k = point.error(self.taps, x);
            let m = k.nrows();
            let factor = (Matrix::identity(m, m) * C64::from(s) - &k * k.adjoint()).cholesky()?;
            let pivots = (0..m).map(|i| factor.l_dirty()[(i, i)]);
            // Complex numbers have roots of negative pivots too.
            if pivots.clone().any(|pivot| pivot.re <= pivot.im.abs()) {
                return None;
            }
            value -= 2.0 * pivots.map(|pivot| pivot.re.ln()).sum::<f64>();
        }
        value.is_finite().then_some(value)
    }

    /// Gradient and Hessian in the taps and s.
    fn derivatives(&self, weight: f64, x: &DVector<f64>, s: f64) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let n = self.taps.len();
        let mut gradient = DVector::zeros(n + 1);
        let mut hessian = DMatrix::zeros(n + 1, n + 1);
        gradient[n] = weight;
        for point in self.points {
            let k = point.error(self.taps, x);
            let m = k.nrows();
            let b = (Matrix::identity(m, m) * C64::from(s) - &k * k.adjoint()).try_inverse()?;
            // Blocks of the inverse of [[s I, K], [K*, I]]: Z21 = -K* B, Z22 = I + K* B K.
            let z21 = -(k.adjoint() * &b);
            let hz = &point.channels * &z21;
            let hzb = &hz * &b;
            let hk = &point.channels * k.adjoint();
            let q = &point.channels * point.channels.adjoint() + &hk * &b * hk.adjoint();
            gradient[n] -= b.trace().re;
            hessian[(n, n)] += b.norm_squared();
            for (a, tap) in self.taps.iter().enumerate() {
                let phase = point.back[tap.lag];
                gradient[a] += 2.0 * (phase * hz[(tap.channel, tap.phase)]).re;
                hessian[(n, a)] -= 2.0 * (phase * hzb[(tap.channel, tap.phase)]).re;
                for (c, other) in self.taps[..=a].iter().enumerate() {
                    let turn = point.back[other.lag];
                    let first =
                        phase * turn * hz[(tap.channel, other.phase)] * hz[(other.channel, tap.phase)];
                    let second =
                        phase * turn.conj() * b[(other.phase, tap.phase)] * q[(tap.channel, other.channel)];
                    hessian[(a, c)] += 2.0 * (first + second).re;
                }
            }
        }
        hessian.fill_upper_triangle_with_lower_triangle();
        Some((gradient, hessian))
    }

    /// Newton's steps with halving for one weight.
    fn descend(&self, weight: f64, x: &mut DVector<f64>, s: &mut f64) -> Option<()> {
        let n = self.taps.len();
        for _ in 0..NEWTON {
            let (gradient, hessian) = self.derivatives(weight, x, *s)?;
            let scale = DVector::from_fn(n + 1, |i, _| 1.0 / hessian[(i, i)].sqrt());
            let scaled = DMatrix::from_fn(n + 1, n + 1, |i, j| hessian[(i, j)] * scale[i] * scale[j]);
            let right = gradient.component_mul(&scale);
            let factor = RIDGES
                .iter()
                .find_map(|ridge| (&scaled + DMatrix::identity(n + 1, n + 1) * *ridge).cholesky());
            let step = -factor?.solve(&right).component_mul(&scale);
            let decrement = -gradient.dot(&step);
            let now = self.value(weight, x, *s)?;
            let mut length = 1.0;
            loop {
                let (next, wider) = (&*x + step.rows(0, n) * length, *s + length * step[n]);
                let better = self.value(weight, &next, wider);
                if better.is_some_and(|value| value <= now - 0.1 * length * decrement) {
                    (*x, *s) = (next, wider);
                    break;
                }
                length *= 0.5;
                if length < 1e-8 {
                    return Some(());
                }
            }
            if decrement < 1e-6 {
                break;
            }
        }
        Some(())
    }

    fn solve(&self, x: &mut DVector<f64>) -> Option<f64> {
        let worst = |x: &DVector<f64>| {
            self.points.iter().map(|point| point.error(self.taps, x).norm_squared()).fold(0.0, f64::max)
        };
        let constraints = self.points.iter().map(|point| point.target.nrows()).sum::<usize>() as f64;
        let mut s = 1.5 * worst(x);
        let mut weight = constraints / s;
        loop {
            self.descend(weight, x, &mut s)?;
            if constraints / weight < GAP * s {
                return Some(s.sqrt());
            }
            weight *= GROWTH;
        }
    }
}

/// The taps of least norm for these front ends: channel, then tap. `None` where doubles do not suffice.
pub(crate) struct Optimum {
    pub(crate) taps: Vec<Vec<f64>>,
    /// The norm of these taps, by the judge.
    pub(crate) norm: f64,
}

/// Minimises the largest norm over `plants`, which have the same shape, with `count` taps per channel.
pub(crate) fn optimum(plants: Vec<Plant>, count: usize) -> Option<Optimum> {
    let (m, channels) = (plants[0].ratio, plants[0].channels);
    let place = |channel: usize, n: usize| Tap { phase: n % m, channel, lag: n / m };
    let taps: Vec<Tap> =
        (0..channels).flat_map(|i| (0..count).map(move |n| (i, n))).map(|(i, n)| place(i, n)).collect();
    let lags = count.div_ceil(m);
    // Several plants share the first grid, since their errors are alike.
    let number = (GRID / plants.len()).max(LEAST_GRID);
    let on_grid = |plant: &Plant| -> Vec<Point> {
        let frequencies = grid(number, &plant.resonances(), &[]);
        frequencies.iter().filter_map(|&omega| Point::new(plant, omega, lags)).collect()
    };
    let mut points: Vec<Point> = plants.iter().flat_map(on_grid).collect();
    let mut x = DVector::zeros(taps.len());
    let mut judges: Vec<Judge> =
        plants.into_iter().map(|plant| Judge { plant, filters: Filters::of_taps(&[]) }).collect();
    let mut best: Option<Optimum> = None;
    for _ in 0..ROUNDS {
        let bound = Barrier { points: &points, taps: &taps }.solve(&mut x)?;
        let lists: Vec<Vec<f64>> = x.as_slice().chunks(count).map(<[f64]>::to_vec).collect();
        let mut norm = 0.0f64;
        for judge in &mut judges {
            judge.filters = Filters::of_taps(&lists);
            let mut peaks = judge.peaks(&[]);
            norm = norm.max(peaks[0].gain);
            peaks.retain(|peak| peak.gain > bound);
            points.extend(peaks.iter().filter_map(|peak| Point::new(&judge.plant, peak.omega, lags)));
        }
        if best.as_ref().is_none_or(|best| norm < best.norm) {
            best = Some(Optimum { taps: lists, norm });
        }
        if norm <= bound * (1.0 + EXCESS) {
            break;
        }
    }
    best
}
