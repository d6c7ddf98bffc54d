//! The Whittle likelihood of spectral matrices: its score and its Fisher information.

use super::spectra::Band;
use crate::calibrate::model::Model;
use crate::calibrate::parameters::{Kind, Parameter, Point};
use crate::linalg::{CMat, Complex, Mat, solve};
use std::f64::consts::TAU;

/// Least noise of a band relative to its power: the rounding of the transforms.
const LEAST_NOISE: f64 = 1e-28;

/// Score and information of some bands, for the parameters of a [`Point`].
pub(super) struct Score {
    /// Derivative of the log-likelihood by each parameter.
    pub(super) gradient: Mat,
    /// Fisher information.
    pub(super) information: Mat,
}

impl Score {
    pub(super) fn zero(parameters: usize) -> Self {
        Self { gradient: Mat::zeros(parameters, 1), information: Mat::zeros(parameters, parameters) }
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.gradient += &other.gradient;
        self.information += &other.information;
    }
}

/// The aliases k of lowest frequency |W + 2 pi k|, `count` of them.
pub(super) fn lowest_aliases(w: f64, count: usize) -> Vec<i32> {
    let reach = count as i32;
    let mut aliases: Vec<i32> = (-reach..=reach).collect();
    aliases.sort_by(|a, b| frequency(w, *a).abs().total_cmp(&frequency(w, *b).abs()));
    aliases.truncate(count);
    aliases
}

/// W + 2 pi k.
fn frequency(w: f64, alias: i32) -> f64 {
    w + TAU * f64::from(alias)
}

/// A_ik = g_i Phi_i(j nu_k / c_i) e^{-2 pi j k D_i / M} with nu_k = (W + 2 pi k) / M: the phase
/// e^{-j W D_i / M} that all aliases share is removed from the matrices.
pub(super) fn steering(model: &Model, point: &Point, w: f64, aliases: &[i32]) -> CMat {
    let m = model.ratio as f64;
    CMat::from_fn(model.channels(), aliases.len(), |i, column| {
        let nu = frequency(w, aliases[column]) / m;
        let turn = (f64::from(aliases[column]) * point.delays[i] / m).fract();
        model.response(i, nu, point.ln_cutoffs[i]) * Complex::from_polar(point.gain(i, model), -TAU * turn)
    })
}

/// What a band says about the noise: tr(P R) / (N - p) with the projection P onto the complement of A's
/// range.
pub(super) fn noise_power(matrix: &CMat, projection: &CMat, sources: usize) -> f64 {
    let power = (projection * matrix).trace().re / (matrix.nrows() - sources) as f64;
    power.max(LEAST_NOISE * matrix.trace().re)
}

/// I - A A^+, and A^+ = (A* A)^-1 A*.
pub(super) fn complement(a: &CMat) -> Option<(CMat, CMat)> {
    let adjoint = a.adjoint();
    let inverse = solve(&(&adjoint * a), &adjoint);
    let finite = inverse.iter().all(|x| x.re.is_finite() && x.im.is_finite());
    finite.then(|| (CMat::identity(a.nrows(), a.nrows()) - a * &inverse, inverse))
}

/// Score and information of one band with the given occupied aliases; `None` where the aliases cannot be
/// told apart or do not stand out of the noise.
///
/// With R = A S A* + s I, S and s of each band free, and R^ the measured matrix of L bins (Stoica and
/// Nehorai, 1990; the derivative dA of a parameter has one row only, that of its channel):
///
/// ```text
/// S = A^+ R^ A^+* - s (A* A)^-1      G = S (A^+ R^ A^+*)^-1
/// gradient_a     = 2 L / s Re tr(G A^+ R^ P dA_a)
/// information_ab = 2 L / s Re tr(dA_a* P dA_b G S)
/// ```
pub(super) fn band_score(model: &Model, point: &Point, band: &Band, aliases: &[i32]) -> Option<Score> {
    let a = steering(model, point, band.w, aliases);
    let (projection, inverse) = complement(&a)?;
    let sources = aliases.len();
    let noise = noise_power(&band.matrix, &projection, sources);
    let power = &inverse * &band.matrix * inverse.adjoint();
    let signal = &power - &inverse * inverse.adjoint() * Complex::from(noise);
    if !(0..sources).all(|k| signal[(k, k)].re > 0.0) {
        return None;
    }
    // G = S power^-1; both are Hermitian, so G* = power^-1 S.
    let share = solve(&power, &signal).adjoint();
    let weight = &share * &signal;
    let innovation = &share * &inverse * &band.matrix * &projection;
    let rows = point.parameters.iter().map(|p| derivative(model, point, band.w, aliases, p, &a));
    let rows: Vec<Vec<Complex<f64>>> = rows.collect();
    let scale = 2.0 * band.count as f64 / noise;
    let gradient = Mat::from_fn(rows.len(), 1, |r, _| {
        let channel = point.parameters[r].channel;
        let sum: Complex<f64> = rows[r].iter().enumerate().map(|(k, d)| d * innovation[(k, channel)]).sum();
        scale * sum.re
    });
    let information = Mat::from_fn(rows.len(), rows.len(), |r, c| {
        let coupling = projection[(point.parameters[r].channel, point.parameters[c].channel)];
        scale * (coupling * form(&rows[c], &weight, &rows[r])).re
    });
    let finite = gradient.iter().chain(information.iter()).all(|x| x.is_finite());
    finite.then_some(Score { gradient, information })
}

/// x W y*.
fn form(x: &[Complex<f64>], weight: &CMat, y: &[Complex<f64>]) -> Complex<f64> {
    let entry = |i: usize, j: usize| x[i] * weight[(i, j)] * y[j].conj();
    (0..x.len()).flat_map(|i| (0..y.len()).map(move |j| (i, j))).map(|(i, j)| entry(i, j)).sum()
}

/// The row of dA that is not zero.
fn derivative(
    model: &Model,
    point: &Point,
    w: f64,
    aliases: &[i32],
    parameter: &Parameter,
    a: &CMat,
) -> Vec<Complex<f64>> {
    let i = parameter.channel;
    let factor = |alias: i32| {
        let nu = frequency(w, alias) / model.ratio as f64;
        match parameter.kind {
            Kind::Delay => Complex::new(0.0, -nu),
            Kind::Gain => Complex::new(1.0, 0.0),
            Kind::Cutoff => model.cutoff_slope(i, nu, point.ln_cutoffs[i]),
        }
    };
    aliases.iter().enumerate().map(|(k, &alias)| factor(alias) * a[(i, k)]).collect()
}
