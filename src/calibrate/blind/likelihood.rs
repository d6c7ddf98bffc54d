//! The Whittle likelihood of spectral matrices: its score and its Fisher information.

use super::spectra::SpectralBand;
use crate::calibrate::fit::ChannelParameter;
use crate::calibrate::model::{ChannelModel, ChannelValues, Parameter};
use crate::linalg::least_squares::NormalEquations;
use crate::linalg::{CMat, Complex, Mat, solve};

/// Least noise of a band relative to its power: the rounding of the transforms.
const LEAST_NOISE: f64 = 1e-28;

/// What a band says: the score in place of J'r, the Fisher information in place of J'J.
pub(super) struct BandScore {
    pub(super) equations: NormalEquations,
    /// Noise per sample.
    pub(super) noise: f64,
    /// By how much the columns of A miss those of the data: chi squared, and its degrees of freedom.
    pub(super) squares: f64,
    pub(super) freedom: usize,
}

/// Score and information of one band with the given occupied aliases; `None` where the aliases cannot be
/// told apart or do not stand out of the noise.
///
/// With R = A S A* + s I, S and s of each band free, and R^ the measured matrix of L bins (Stoica and
/// Nehorai, 1990; the derivative dA of a parameter has one row only, that of its channel):
///
/// ```text
/// s = tr(P R^) / (N - p)             with P = I - A A^+, A^+ = (A* A)^-1 A*
/// S = A^+ R^ A^+* - s (A* A)^-1      G = S (A^+ R^ A^+*)^-1
/// gradient_a     = 2 L / s Re tr(G A^+ R^ P dA_a)
/// information_ab = 2 L / s Re tr(dA_a* P dA_b G S)
/// ```
pub(super) fn band_score(
    model: &ChannelModel,
    point: &ChannelValues,
    band: &SpectralBand,
    aliases: &[i32],
) -> Option<BandScore> {
    let (a, sources) = (model.steering(point, band.w, aliases), aliases.len());
    let inverse = solve(&(a.adjoint() * &a), &a.adjoint());
    let projection = CMat::identity(a.nrows(), a.nrows()) - &a * &inverse;
    let noise = (&projection * &band.matrix).trace().re / (a.nrows() - sources) as f64;
    let noise = noise.max(LEAST_NOISE * band.matrix.trace().re);
    let power = &inverse * &band.matrix * inverse.adjoint();
    let signal = &power - &inverse * inverse.adjoint() * Complex::from(noise);
    if !(0..sources).all(|k| signal[(k, k)].re > 0.0) {
        return None;
    }
    // G = S power^-1; both are Hermitian, so G* = power^-1 S.
    let share = solve(&power, &signal).adjoint();
    let weight = &share * &signal;
    let innovation = &share * &inverse * &band.matrix * &projection;
    let rows: Vec<CMat> =
        point.parameters.iter().map(|p| derivative(model, point, band.w, aliases, p, &a)).collect();
    let scale = 2.0 * band.count as f64 / noise;
    let channel = |r: usize| point.parameters[r].channel;
    let mut equations = NormalEquations::new(rows.len());
    equations.projection =
        Mat::from_fn(rows.len(), 1, |r, _| scale * (&rows[r] * innovation.column(channel(r)))[(0, 0)].re);
    equations.gram = Mat::from_fn(rows.len(), rows.len(), |r, c| {
        let coupling = projection[(channel(r), channel(c))];
        scale * (coupling * (&rows[c] * &weight * rows[r].adjoint())[(0, 0)]).re
    });
    let mut all = equations.projection.iter().chain(equations.gram.iter());
    let squares = mismatch(band, sources, noise * (a.nrows() - sources) as f64);
    let freedom = 2 * sources * (a.nrows() - sources);
    all.all(|x| x.is_finite()).then_some(BandScore { equations, noise, squares, freedom })
}

/// Chi squared of the columns that a model gives against free ones, from the power `left` outside of them.
///
/// Free columns leave the N - p least eigenvalues, whose sum is (N - p) (1 - p / L) times the noise on
/// average. The difference is that of 2 p (N - p) real angles between two subspaces, each with the variance
/// of noise over 2 L.
fn mismatch(band: &SpectralBand, sources: usize, left: f64) -> f64 {
    let values = band.eigenvalues();
    let (count, least): (f64, f64) = (band.count as f64, values.iter().skip(sources).sum());
    let free = (values.len() - sources) as f64 * (1.0 - sources as f64 / count);
    let noise = (least / free).max(LEAST_NOISE * band.matrix.trace().re);
    2.0 * count * (left - least) / noise
}

/// The row of dA that is not zero.
fn derivative(
    model: &ChannelModel,
    point: &ChannelValues,
    w: f64,
    aliases: &[i32],
    parameter: &Parameter,
    a: &CMat,
) -> CMat {
    let i = parameter.channel;
    CMat::from_fn(1, aliases.len(), |_, k| {
        let nu = model.alias(w, aliases[k]);
        let factor = match parameter.kind {
            ChannelParameter::Delay => Complex::new(0.0, -nu),
            ChannelParameter::Gain => Complex::ONE,
            ChannelParameter::Cutoff => model.cutoff_slope(i, nu, point.ln_cutoffs[i]),
        };
        factor * a[(i, k)]
    })
}
