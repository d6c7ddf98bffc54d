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
}

/// The aliases k of lowest frequency |W + 2 pi k|, `count` of them.
pub(super) fn lowest_aliases(model: &ChannelModel, w: f64, count: usize) -> Vec<i32> {
    let reach = count as i32;
    let mut aliases: Vec<i32> = (-reach..=reach).collect();
    aliases.sort_by(|a, b| model.alias(w, *a).abs().total_cmp(&model.alias(w, *b).abs()));
    aliases.truncate(count);
    aliases
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
    all.all(|x| x.is_finite()).then_some(BandScore { equations, noise })
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
