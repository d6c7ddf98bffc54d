//! Relaxed vector fitting.
//!
//! Sources: B. Gustavsen and A. Semlyen, *Rational approximation of frequency domain responses by vector
//! fitting*, IEEE Trans. Power Delivery 14(3), 1999; B. Gustavsen, *Improving the pole relocating properties
//! of vector fitting*, IEEE Trans. Power Delivery 21(3), 2006.

use super::FitError;
use super::measured::MeasuredResponse;
use hybank_core::spec::{FilterSpec, MAX_ORDER};
use hybank_core::units::{Decibels, Hertz, Seconds};
use hybank_linalg::{Complex, Mat};
use std::f64::consts::TAU;

/// A model that misses its measurement by more is refused.
pub const MAX_FIT_ERROR: Decibels = Decibels(1.0);
/// Rounds of pole relocation.
const MOST_ROUNDS: usize = 40;
/// Rounds without a better model after which the search ends.
const PATIENCE: usize = 6;
/// Least constant of the weight function relative to its mean, which is 1 (Gustavsen 2006, section V).
const LEAST_CONSTANT: f64 = 1e-8;
/// Delays that are tried where no model fits, and halvings of the interval around the best.
const DELAYS: usize = 24;
const HALVINGS: usize = 24;

/// A stable, strictly proper filter that is near a measurement.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedModel {
    /// State equations in rad/s: real poles and conjugate pairs side by side.
    pub filter: FilterSpec,
    /// The largest |model - measurement| over the largest gain that was measured, e, as 20 log10(1 + e).
    pub error: Decibels,
    /// Where that is.
    pub at: Hertz,
}

/// The model of `order` poles that has the least mean-square error, as far as relaxed vector fitting finds
/// it.
///
/// All frequencies have the same weight. Poles that would be unstable are mirrored at the imaginary axis.
///
/// # Errors
/// [`FitError`]; a model that misses the measurement by more than [`MAX_FIT_ERROR`] is refused, with the
/// delay that would have to be taken out first, if that is the reason.
pub fn vector_fit(measured: &MeasuredResponse, order: usize) -> Result<FittedModel, FitError> {
    if order == 0 || order > MAX_ORDER {
        return Err(FitError::Order { order, most: MAX_ORDER });
    }
    let points = measured.points().iter().filter(|(f, _)| f.0 > 0.0).count();
    if points < 2 * order {
        return Err(FitError::TooFew { points, order });
    }
    let model = best_model(measured, order)?;
    if model.error.0 <= MAX_FIT_ERROR.0 {
        return Ok(model);
    }
    let delay = delay_to_remove(measured, order).filter(|(_, error)| error.0 <= MAX_FIT_ERROR.0);
    Err(FitError::Poor { order, error: model.error, at: model.at, delay })
}

/// Values at s = j w with w in units of the largest frequency, the largest gain being 1.
struct Data {
    scale: Hertz,
    gain: f64,
    values: Vec<(Complex<f64>, Complex<f64>)>,
}

impl Data {
    fn new(measured: &MeasuredResponse) -> Result<Self, FitError> {
        let points = measured.points();
        let scale = points.last().map_or(Hertz(0.0), |point| point.0);
        let gain = points.iter().map(|(_, value)| value.norm()).fold(0.0, f64::max);
        if !(gain.is_normal() && scale.0.is_normal()) {
            return Err(FitError::Numbers);
        }
        let value = |(f, value): &(Hertz, Complex<f64>)| (Complex::new(0.0, f.0 / scale.0), value / gain);
        Ok(Self { scale, gain, values: points.iter().map(value).collect() })
    }
}

fn best_model(measured: &MeasuredResponse, order: usize) -> Result<FittedModel, FitError> {
    let data = Data::new(measured)?;
    let mut poles = starting_poles(order, 1.0);
    let mut best: Option<RationalModel> = None;
    let mut last_better = 0;
    for round in 0..MOST_ROUNDS {
        let candidate = RationalModel::new(&data, poles.clone())?;
        if best.as_ref().is_none_or(|best| candidate.rms < 0.999 * best.rms) {
            last_better = round;
            best = Some(candidate);
        } else if round - last_better >= PATIENCE {
            break;
        }
        poles = relocated(&data, &poles)?;
    }
    best.ok_or(FitError::Numbers).map(|best| best.model(&data))
}

/// A model with its residues.
struct RationalModel {
    poles: Vec<Pole>,
    residues: Vec<f64>,
    rms: f64,
    worst: (f64, Complex<f64>),
}

impl RationalModel {
    /// The residues of least mean-square error.
    fn new(data: &Data, poles: Vec<Pole>) -> Result<Self, FitError> {
        let n = order(&poles);
        let mut rows = Vec::with_capacity(2 * data.values.len() * (n + 1));
        for (s, value) in &data.values {
            let row: Vec<Complex<f64>> = fractions(&poles, *s).into_iter().chain([*value]).collect();
            rows.extend(row.iter().map(|x| x.re).chain(row.iter().map(|x| x.im)));
        }
        let residues = least_squares(&rows, n)?;
        let error = |(s, value): &(Complex<f64>, Complex<f64>)| {
            let terms = fractions(&poles, *s).into_iter().zip(&residues);
            ((terms.map(|(x, c)| x * c).sum::<Complex<f64>>() - value).norm(), *s)
        };
        let errors = data.values.iter().map(error);
        let worst =
            errors.clone().fold((0.0, Complex::new(0.0, 0.0)), |most, e| if e.0 > most.0 { e } else { most });
        let power: f64 = errors.map(|(e, _)| e * e).sum();
        let rms = (power / data.values.len() as f64).sqrt();
        if !rms.is_finite() {
            return Err(FitError::Numbers);
        }
        Ok(Self { poles, residues, rms, worst })
    }

    fn model(&self, data: &Data) -> FittedModel {
        let (a, b) = state_equations(&self.poles);
        let speed = TAU * data.scale.0;
        let rows = |m: &Mat, factor: f64| -> Vec<Vec<f64>> {
            m.row_iter().map(|row| row.iter().map(|x| factor * x).collect()).collect()
        };
        let c = self.residues.iter().map(|c| c * data.gain).collect();
        let filter = FilterSpec::StateSpace { a: rows(&a, speed), b: rows(&b, speed), c: vec![c] };
        let (worst, s) = self.worst;
        FittedModel { filter, error: Decibels(20.0 * worst.ln_1p() / 10f64.ln()), at: data.scale * s.im }
    }
}

/// The zeros of the weight function sigma = d + sum of c~_n times fraction n, where sigma H is nearest to
/// partial fractions with the same poles: `sum c_n phi_n - H (sum c~_n phi_n + d) = 0`, and the mean real
/// part of sigma 1.
fn relocated(data: &Data, poles: &[Pole]) -> Result<Vec<Pole>, FitError> {
    let n = order(poles);
    let (points, columns) = (data.values.len(), 2 * n + 1);
    let mut rows = Vec::with_capacity((2 * points + 1) * (columns + 1));
    let mut mean = vec![0.0; columns + 1];
    for (s, value) in &data.values {
        let phi = fractions(poles, *s);
        let weighted = phi.iter().map(|x| -value * x).chain([-value, Complex::new(0.0, 0.0)]);
        let row: Vec<Complex<f64>> = phi.iter().copied().chain(weighted).collect();
        rows.extend(row.iter().map(|x| x.re).chain(row.iter().map(|x| x.im)));
        phi.iter().zip(&mut mean[n..]).for_each(|(x, sum)| *sum += x.re);
    }
    (mean[2 * n], mean[2 * n + 1]) = (points as f64, points as f64);
    let power: f64 = data.values.iter().map(|(_, value)| value.norm_sqr()).sum();
    rows.extend(mean.iter().map(|x| x * power.sqrt() / points as f64));
    let solution = least_squares(&rows, columns)?;
    let constant = solution[2 * n];
    let constant = constant.abs().max(LEAST_CONSTANT).copysign(constant);
    let (mut a, b) = state_equations(poles);
    for (j, c) in solution[n..2 * n].iter().enumerate() {
        for i in 0..n {
            a[(i, j)] -= b[(i, 0)] * c / constant;
        }
    }
    let zeros = hybank_linalg::eigenvalues(&a).map_err(|_| FitError::Numbers)?;
    Ok(from_eigenvalues(&zeros))
}

/// x of least |A x - y|; `rows` are those of [A y], with `columns` columns of A. Columns are scaled to
/// length 1, and directions that are not determined stay zero.
fn least_squares(rows: &[f64], columns: usize) -> Result<Vec<f64>, FitError> {
    let width = columns + 1;
    // The transpose, column by column.
    let transposed = Mat::from_column_slice(width, rows.len() / width, rows);
    let triangle = hybank_linalg::lq_factor(&transposed).transpose();
    let mut a = triangle.columns(0, columns).into_owned();
    let lengths: Vec<f64> =
        a.column_iter().map(|column| column.norm()).map(|l| if l > 0.0 { l } else { 1.0 }).collect();
    a.column_iter_mut().zip(&lengths).for_each(|(mut column, length)| column /= *length);
    let y = triangle.column(columns).into_owned();
    if a.iter().chain(y.iter()).any(|x| !x.is_finite()) {
        return Err(FitError::Numbers);
    }
    let hybank_linalg::Svd { u, s: sigma, v } = hybank_linalg::svd(&a).map_err(|_| FitError::Numbers)?;
    let floor = sigma.first().copied().unwrap_or(0.0) * f64::EPSILON * width as f64;
    let projected = u.transpose() * y;
    let weights = projected.iter().zip(&sigma).map(|(p, s)| if *s > floor { p / s } else { 0.0 });
    let x = v * Mat::from_iterator(sigma.len(), 1, weights);
    Ok(x.iter().zip(&lengths).map(|(x, length)| x / length).collect())
}

/// The delay without which a model is best, and its error.
fn delay_to_remove(measured: &MeasuredResponse, order: usize) -> Option<(Seconds, Decibels)> {
    let most = measured.mean_delay();
    if !(most.0 > 0.0 && most.0.is_finite()) {
        return None;
    }
    let error = |delay: f64| {
        let turned = measured.without_delay(Seconds(delay));
        best_model(&turned, order).map_or(f64::INFINITY, |model| model.error.0)
    };
    let step = most.0 / DELAYS as f64;
    let tried = (0..=DELAYS).map(|k| (k as f64 * step, error(k as f64 * step)));
    let (mut best, mut least) = tried.min_by(|x, y| x.1.total_cmp(&y.1))?;
    let mut width = step / 2.0;
    for _ in 0..HALVINGS {
        for delay in [best - width, best + width] {
            let found = error(delay);
            if found < least {
                (best, least) = (delay, found);
            }
        }
        width /= 2.0;
    }
    Some((Seconds(best), Decibels(least)))
}

/// Least -Re(p) / |p| of a pole that is found: the response of a sharper one is not seen in a measurement.
const LEAST_DAMPING: f64 = 1e-6;

/// A real pole, or a pair of conjugate ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Pole {
    Real(f64),
    /// The one with the positive imaginary part.
    Pair(Complex<f64>),
}

/// Poles as they are known before anything else is: lightly damped, spread evenly over the band up to
/// `most`.
///
/// Source: Gustavsen and Semlyen 1999, section 3.2.
pub(super) fn starting_poles(order: usize, most: f64) -> Vec<Pole> {
    let pairs = order / 2;
    let place = |k: usize| most * (k as f64 + 0.5) / pairs as f64;
    let mut poles: Vec<Pole> =
        (0..pairs).map(|k| Pole::Pair(Complex::new(-0.01 * place(k), place(k)))).collect();
    if order % 2 == 1 {
        poles.push(Pole::Real(-most));
    }
    poles
}

/// Poles from eigenvalues: conjugates become pairs, and those in the right half-plane are mirrored.
pub(super) fn from_eigenvalues(values: &[Complex<f64>]) -> Vec<Pole> {
    let stable = |p: Complex<f64>| Complex::new(-p.re.abs().max(LEAST_DAMPING * p.norm()), p.im);
    let upper = values.iter().filter(|p| p.im >= 0.0);
    upper.map(|&p| if p.im == 0.0 { Pole::Real(stable(p).re) } else { Pole::Pair(stable(p)) }).collect()
}

/// States of all poles.
pub(super) fn order(poles: &[Pole]) -> usize {
    poles.iter().map(|pole| if matches!(pole, Pole::Real(_)) { 1 } else { 2 }).sum()
}

/// The real partial fractions at s: 1/(s - p), and for a pair the sum of both and j times their difference.
pub(super) fn fractions(poles: &[Pole], s: Complex<f64>) -> Vec<Complex<f64>> {
    let mut all = Vec::with_capacity(order(poles));
    for pole in poles {
        match pole {
            Pole::Real(p) => all.push((s - p).inv()),
            Pole::Pair(p) => {
                let (one, other) = ((s - p).inv(), (s - p.conj()).inv());
                all.extend([one + other, Complex::<f64>::i() * (one - other)]);
            }
        }
    }
    all
}

/// (A, b) with c (sI - A)^-1 b = sum of c_n times fraction n.
pub(super) fn state_equations(poles: &[Pole]) -> (Mat, Mat) {
    let n = order(poles);
    let (mut a, mut b) = (Mat::zeros(n, n), Mat::zeros(n, 1));
    let mut k = 0;
    for pole in poles {
        match pole {
            Pole::Real(p) => {
                (a[(k, k)], b[(k, 0)]) = (*p, 1.0);
                k += 1;
            }
            Pole::Pair(p) => {
                (a[(k, k)], a[(k + 1, k + 1)]) = (p.re, p.re);
                (a[(k, k + 1)], a[(k + 1, k)]) = (p.im, -p.im);
                b[(k, 0)] = 2.0;
                k += 2;
            }
        }
    }
    (a, b)
}
