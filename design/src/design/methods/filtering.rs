//! A-posteriori filtering: the best causal estimate of z from y for a lifted plant, in the worst-case
//! (H-infinity) or mean-square (H2) sense, by one Riccati equation (thesis 5.3; Hassibi, Sayed,
//! Kailath, "Indefinite-Quadratic Estimation and Control", 1999, ch. 4).

use crate::design::DesignError;
use crate::design::plant::LiftedPlant;
use crate::lti::gramian::controllability_root;
use crate::lti::riccati::{RiccatiSolution, solve_doubling};
use crate::lti::{LtiError, StateSpace};
use hybank_linalg::{LinalgError, Mat};
use std::ops::{Range, RangeInclusive};
use std::rc::Rc;

/// What the Riccati solver in doubles takes for rounding.
struct Settings {
    /// A feedthrough below this fraction of its measurement is a rounding error: the channel adds no
    /// information.
    innovation_floor: f64,
    /// The result "impossible" is accepted up to this residual of the Riccati equation, in coordinates in
    /// which the mean-square covariance is the identity. The result is exact for a plant that differs by no
    /// more than that.
    conclusive_residual: f64,
    /// Least share of the largest error variance with which a direction is scaled: below, the variance is
    /// rounding.
    balancing_floor: f64,
    /// Rounding does not move an eigenvalue of a semidefinite matrix this far (relative) below zero.
    clearly_negative: f64,
}

/// Of every equation.
const SETTINGS: Settings = Settings {
    innovation_floor: 1e-12,
    conclusive_residual: 1e-7,
    balancing_floor: 1e-13,
    clearly_negative: 1e-5,
};

/// The plant with the measured inputs eliminated.
///
/// Measurements are of two kinds. Those *with feedthrough* depend on the inputs of the period itself: y_f =
/// L (C_f x + w1) with L triangular. *Delayed* ones (channels delayed by whole periods) are states of a
/// delay chain, a noise-free measurement y_d = s C_d x with their size s, so that R is singular. With
/// yw = [L^-1 y_f; y_d / s],
///
/// x+ = F x + B1 L^-1 y_f + B2 w2,  yw = C2 x + [w1; 0],  z = C1 x + X L^-1 y_f + Y w2.
///
/// The samples are nearly noise-free, so the square D2 D2' may be as ill-conditioned as 1e22; here it
/// never appears, only its triangular root L.
///
/// Substituting P = P0 + Delta turns the Riccati equation into one for Delta with R + C P0 C' in place of R
/// and F P0 F' + Q - P0 in place of Q. P0 is diagonal on the delay chains. The last state of a chain drives
/// no other state, so that no cross terms arise. The delayed measurements get unit noise, which the change
/// of Q compensates exactly. P0 decreases along the chain, which keeps Q positive at the last state;
/// otherwise the doubling algorithm would break down on its first step.
#[derive(Debug, Clone)]
pub(in crate::design) struct Innovations {
    f: Mat,
    b1: Mat,
    b2: Mat,
    c1: Mat,
    /// Rows with feedthrough first, then the delayed ones.
    c2: Mat,
    x: Mat,
    y: Mat,
    /// L, lower triangular.
    root: Mat,
    /// P0: q, q - 1, .. 1 times the variance along a delay chain of q links.
    p0: Mat,
    /// The channels with feedthrough.
    direct: Vec<usize>,
    delayed: Vec<DelayedChannel>,
    channels: usize,
    /// Feedthrough of the channel with the least, given the channels before it, relative to its size.
    pub(super) least_feedthrough: f64,
    /// The result "impossible" may be accepted: the coordinates are balanced and no channel is left out.
    conclusive: bool,
    /// The map to the plant's own coordinates, and the same there, where the columns of the delay chains
    /// have one entry 1 and exact zeros elsewhere; `None` if the coordinates are already those of the plant.
    plain: Option<(Mat, Box<Self>)>,
}

/// A channel read from the end of a delay chain.
#[derive(Debug, Clone)]
struct DelayedChannel {
    channel: usize,
    chain: Range<usize>,
    size: f64,
}

/// A filter xh+ = a xh + b y, zh = c xh + d y.
pub(super) type ReferenceFilter = StateSpace;

/// The result for one gamma.
#[derive(Debug, Clone)]
pub(super) enum Trial {
    /// A stable filter that achieves it.
    Achieved(ReferenceFilter),
    /// The stabilising solution exists and has the wrong inertia, so no filter achieves gamma.
    Impossible,
    /// Undecided, for numerical reasons.
    Unresolved,
}

/// Solves the filtering Riccati equation of a plant.
pub(super) trait RiccatiSolver {
    /// Tries one gamma.
    fn h_infinity(&self, gamma: f64) -> Trial;
}

impl RiccatiSolver for Innovations {
    fn h_infinity(&self, gamma: f64) -> Trial {
        let margin = self.margin(gamma);
        if !margin.iter().all(|entry| entry.is_finite()) {
            return Trial::Unresolved;
        }
        if hybank_linalg::cholesky(&margin).is_err() {
            return if self.conclusive { Trial::Impossible } else { Trial::Unresolved };
        }
        let Ok((f, g, h)) = self.weights(&margin) else { return Trial::Unresolved };
        solve_doubling(&f.transpose(), &g, &h).map_or(Trial::Unresolved, |solution| self.evaluate(&solution))
    }
}

impl Innovations {
    /// The problem in balanced coordinates, if they exist, and in those of the plant. Near the limits of
    /// double precision sometimes only one of the two can be solved.
    pub(in crate::design) fn in_all_coordinates(plant: &LiftedPlant) -> Result<Vec<Rc<Self>>, DesignError> {
        let plain = Self::new(plant)?;
        Ok(plain.balanced().into_iter().chain([plain]).map(Rc::new).collect())
    }

    /// Separates the measured inputs (w1) from the rest (w2) by one LQ factorisation.
    pub(super) fn new(plant: &LiftedPlant) -> Result<Self, DesignError> {
        let sizes = output_sizes(plant.system())?;
        let (direct, delayed): (Vec<usize>, Vec<usize>) =
            (0..plant.channels()).partition(|&channel| plant.chain(channel).is_empty());
        let delayed = delayed
            .into_iter()
            .map(|channel| DelayedChannel { channel, chain: plant.chain(channel), size: sizes[channel] })
            .collect();
        let feedthroughs = relative_feedthroughs(plant, &direct, &sizes);
        let least = feedthroughs.iter().map(|&(_, share)| share).fold(1.0, f64::min);
        let informative = feedthroughs.into_iter().filter(|&(_, share)| share > SETTINGS.innovation_floor);
        Ok(Self::separate(plant, informative.map(|(channel, _)| channel).collect(), delayed, least))
    }

    fn separate(
        plant: &LiftedPlant,
        direct: Vec<usize>,
        delayed: Vec<DelayedChannel>,
        least_feedthrough: f64,
    ) -> Self {
        let measurement = plant.system().select_outputs(direct.iter().copied());
        let reference = plant.reference();
        let system = plant.system();
        let (known, references, n) = (direct.len(), plant.ratio(), system.order());
        // [D_f; D_z; B] = L Q: in the rotated inputs D is lower triangular.
        let l =
            hybank_linalg::lq_factor(&hybank_linalg::vstack(&[measurement.d(), reference.d(), system.b()]));
        let rest = l.ncols() - known;
        let block =
            |row: usize, col: usize, rows: usize, cols: usize| l.view((row, col), (rows, cols)).into_owned();
        let root = block(0, 0, known, known);
        let (x, y) = (block(known, 0, references, known), block(known, known, references, rest));
        let below = known + references;
        let (b1, b2) = (block(below, 0, n, known), block(below, known, n, rest));
        let cf = hybank_linalg::solve_lower(&root, measurement.c());
        let c1 = reference.c() - &x * &cf;
        let f = system.a() - &b1 * &cf;
        let c2 = hybank_linalg::vstack(&[&cf, &last_links(&delayed, n)]);
        let p0 = chain_variances(&delayed, n);
        let channels = plant.channels();
        let (conclusive, plain) = (false, None);
        Self {
            f,
            b1,
            b2,
            c1,
            c2,
            x,
            y,
            root,
            p0,
            direct,
            delayed,
            channels,
            least_feedthrough,
            conclusive,
            plain,
        }
    }

    /// Whether the feedthrough of a channel is rounding, so that the channel was left out.
    fn leaves_out_a_channel(&self) -> bool {
        self.least_feedthrough <= SETTINGS.innovation_floor
    }

    /// F P0 F' - P0: what the substitution adds to Q.
    fn shift_of_q(&self) -> Mat {
        &self.f * &self.p0 * self.f.transpose() - &self.p0
    }

    /// The same problem in state coordinates in which the mean-square optimal prediction error is white.
    /// The states of smooth front ends differ by many decades and are nearly dependent. The covariances of
    /// all gammas are near the mean-square one, so in these coordinates they are near the identity.
    ///
    /// `None` where the mean-square problem has no usable solution.
    pub(super) fn balanced(&self) -> Option<Self> {
        let p = self.mean_square_covariance()?;
        let (values, vectors) = hybank_linalg::symmetric_eigen(&p).ok()?;
        let floor = SETTINGS.balancing_floor * values.iter().fold(0.0_f64, |m, v| m.max(*v));
        if floor <= 0.0 || !floor.is_finite() {
            return None;
        }
        let n = p.nrows();
        let scale = |k: usize| values[k].max(0.0) + floor;
        let forward = Mat::from_fn(n, n, |i, k| vectors[(i, k)] * scale(k).sqrt());
        let back = Mat::from_fn(n, n, |k, i| vectors[(i, k)] / scale(k).sqrt());
        Some(Self {
            plain: Some((forward.clone(), Box::new(self.clone()))),
            f: &back * &self.f * &forward,
            b1: &back * &self.b1,
            b2: &back * &self.b2,
            c1: &self.c1 * &forward,
            c2: &self.c2 * &forward,
            p0: hybank_linalg::symmetric_part(&(&back * &self.p0 * back.transpose())),
            conclusive: !self.leaves_out_a_channel(),
            ..self.clone()
        })
    }

    /// sigma_max(Y), a lower bound of the error of every causal filter: no measurement that is available in
    /// time depends on these inputs.
    ///
    /// Zero if a channel was left out, because it measures some of these inputs.
    pub(super) fn unmeasured_feedthrough(&self) -> Result<f64, DesignError> {
        if self.y.is_empty() || self.leaves_out_a_channel() {
            return Ok(0.0);
        }
        Ok(hybank_linalg::singular_values(&self.y)?[0])
    }

    /// The mean-square optimal (Kalman) filter, which is the limit for gamma to infinity.
    pub(super) fn h2(&self) -> Option<ReferenceFilter> {
        self.filter(&self.mean_square_covariance()?)
    }

    /// The covariance of the mean-square optimal prediction error of the state.
    fn mean_square_covariance(&self) -> Option<Mat> {
        let g = self.c2.transpose() * &self.c2;
        let h = &self.b2 * self.b2.transpose() + self.shift_of_q();
        Some(solve_doubling(&self.f.transpose(), &g, &h)?.x + &self.p0)
    }

    /// Mean squares of the errors of the references with the measurements up to their own slow period, and
    /// with those of `periods.start()` to `periods.end()` further ones: it ends where the second half of
    /// them lowered no square by more than the share `negligible` of `limits`, those with all measurements.
    /// `None` if the Riccati equation could not be solved.
    pub(in crate::design) fn smoothed(
        &self,
        periods: RangeInclusive<usize>,
        limits: &[f64],
        negligible: f64,
    ) -> Option<Vec<Vec<f64>>> {
        let p = self.mean_square_covariance()?;
        let root = hybank_linalg::cholesky(&self.innovation(&p)).ok()?;
        // Of the state with the innovations of unit variance.
        let pc = &p * hybank_linalg::solve_lower(&root, &self.c2).transpose();
        let unit = hybank_linalg::solve_lower(&root, &self.c2);
        let mut gain = &self.c1 * &pc;
        // Of the errors of the references with that of the state.
        let mut cross =
            (&self.c1 * &p - &gain * pc.transpose()) * self.f.transpose() + &self.y * self.b2.transpose();
        let lowered = |gain: &Mat| gain.row_iter().map(|row| row.norm_squared()).collect::<Vec<f64>>();
        let mut steps: Vec<Vec<f64>> = Vec::new();
        for period in 1..=*periods.end() {
            gain = &cross * unit.transpose();
            steps.push(lowered(&gain));
            let last = |k: usize| steps[period / 2..].iter().map(|step| step[k]).sum::<f64>();
            if period > *periods.start() && (0..limits.len()).all(|k| last(k) <= negligible * limits[k]) {
                break;
            }
            cross = (cross - &gain * pc.transpose()) * self.f.transpose();
        }
        let mut all = vec![limits.to_vec()];
        for step in steps.iter().rev() {
            let after = &all[all.len() - 1];
            all.push(after.iter().zip(step).map(|(square, step)| square + step).collect());
        }
        all.reverse();
        Some(all)
    }

    /// E = gamma^2 I - Y Y'; a filter needs it positive.
    fn margin(&self, gamma: f64) -> Mat {
        let references = self.y.nrows();
        Mat::identity(references, references) * (gamma * gamma) - &self.y * self.y.transpose()
    }

    /// (F, G, H) of the Riccati equation Delta = F Delta (I + G Delta)^-1 F' + H for a positive E.
    fn weights(&self, e: &Mat) -> Result<(Mat, Mat, Mat), LinalgError> {
        let solved = hybank_linalg::solve_positive(e, &hybank_linalg::hstack(&[&self.c1, &self.y]))?;
        let (ec, ey) = (solved.columns(0, self.c1.ncols()), solved.columns(self.c1.ncols(), self.y.ncols()));
        let by = &self.b2 * self.y.transpose();
        let f = &self.f + &by * ec;
        let g = self.c2.transpose() * &self.c2 - self.c1.transpose() * ec;
        let h = &self.b2 * self.b2.transpose() + &by * ey * self.b2.transpose() + self.shift_of_q();
        Ok((f, hybank_linalg::symmetric_part(&g), hybank_linalg::symmetric_part(&h)))
    }

    /// gamma is achieved iff P >= 0 and C1 P+ C1' < E with the a-posteriori covariance P+. As gamma
    /// decreases through the optimum, that margin closes, and an eigenvalue of P goes through infinity and
    /// becomes negative. Only such an eigenvalue shows that gamma is impossible. Rounding
    /// errors affect the margin, so the caller computes the norm of the error system of the filter.
    fn evaluate(&self, solution: &RiccatiSolution) -> Trial {
        let p = &solution.x + &self.p0;
        let Ok(eigenvalues) = hybank_linalg::hermitian_eigenvalues(&p) else { return Trial::Unresolved };
        let largest = eigenvalues.iter().fold(0.0_f64, |m, e| m.max(e.abs()));
        if eigenvalues.first().is_some_and(|&least| least < -SETTINGS.clearly_negative * largest) {
            let is_shown = solution.residual < SETTINGS.conclusive_residual && self.conclusive;
            return if is_shown { Trial::Impossible } else { Trial::Unresolved };
        }
        self.filter(&p).map_or(Trial::Unresolved, Trial::Achieved)
    }

    /// Ry = diag(I, 0) + C2 P C2': the delayed measurements have no noise.
    fn innovation(&self, p: &Mat) -> Mat {
        let mut ry = hybank_linalg::symmetric_part(&(&self.c2 * p * self.c2.transpose()));
        for i in 0..self.direct.len() {
            ry[(i, i)] += 1.0;
        }
        ry
    }

    /// The central filter of a covariance: gains K = F P C2' Ry^-1 and Df = C1 P C2' Ry^-1. Its states are
    /// estimates of the plant's states, in all coordinates of P.
    fn filter(&self, p: &Mat) -> Option<ReferenceFilter> {
        let pc = p * self.c2.transpose();
        let gain = hybank_linalg::solve_positive(&self.innovation(p), &pc.transpose()).ok()?.transpose();
        let filter = match &self.plain {
            None => self.with_gain(&gain),
            Some((forward, plain)) => plain.with_gain(&(forward * gain)),
        };
        (filter.spectral_radius().ok()? < 1.0).then_some(filter)
    }

    /// The filter that corrects its state by `gain` times the innovation.
    fn with_gain(&self, gain: &Mat) -> ReferenceFilter {
        let Self { f, b1, c1, c2, .. } = self;
        let (mut k, mut df) = (f * gain, c1 * gain);
        let (a, c) = (f - &k * c2, c1 - &df * c2);
        let known = self.direct.len();
        k.columns_mut(0, known).zip_apply(b1, |gain, feedthrough| *gain += feedthrough);
        df.columns_mut(0, known).zip_apply(&self.x, |gain, feedthrough| *gain += feedthrough);
        StateSpace::new(a, self.on_channels(&k), c, self.on_channels(&df))
    }

    /// From gains on yw to gains on the channels, zero for those left out.
    fn on_channels(&self, gains: &Mat) -> Mat {
        let known = self.direct.len();
        let whitened = gains.columns(0, known).transpose();
        let direct = hybank_linalg::solve(&self.root.transpose(), &whitened).transpose();
        let mut all = Mat::zeros(gains.nrows(), self.channels);
        for (i, &channel) in self.direct.iter().enumerate() {
            all.set_column(channel, &direct.column(i));
        }
        for (i, delayed) in self.delayed.iter().enumerate() {
            all.set_column(delayed.channel, &(gains.column(known + i) / delayed.size));
        }
        all
    }
}

/// The rows C_d, which output the last state of each chain, in units of its size.
fn last_links(delayed: &[DelayedChannel], n: usize) -> Mat {
    let entry = |row: usize, state: usize| {
        if state + 1 == delayed[row].chain.end { 1.0 / delayed[row].size } else { 0.0 }
    };
    Mat::from_fn(delayed.len(), n, entry)
}

fn chain_variances(delayed: &[DelayedChannel], n: usize) -> Mat {
    let mut p0 = Mat::zeros(n, n);
    for channel in delayed {
        for (weight, state) in channel.chain.clone().rev().enumerate() {
            p0[(state, state)] = (weight + 1) as f64 * channel.size * channel.size;
        }
    }
    p0
}

/// The feedthrough of each channel, given the channels before it, relative to the channel's size. Channels
/// whose feedthrough is rounding do not count for those after them.
fn relative_feedthroughs(plant: &LiftedPlant, direct: &[usize], sizes: &[f64]) -> Vec<(usize, f64)> {
    let mut kept: Vec<usize> = Vec::with_capacity(direct.len());
    let mut share = |channel: usize| {
        kept.push(channel);
        let l = hybank_linalg::lq_factor(&plant.system().d().select_rows(&kept));
        let row = kept.len() - 1;
        let innovation = if row < l.ncols() { l[(row, row)].abs() } else { 0.0 };
        if innovation <= SETTINGS.innovation_floor * sizes[channel] {
            kept.pop();
        }
        (channel, innovation / sizes[channel])
    };
    direct.iter().map(|&channel| share(channel)).collect()
}

/// RMS of each output for white inputs.
pub(super) fn output_sizes(system: &StateSpace) -> Result<Vec<f64>, LtiError> {
    let history = system.c() * controllability_root(system.a(), system.b())?;
    let size = |i: usize| history.row(i).norm().hypot(system.d().row(i).norm());
    Ok((0..system.outputs()).map(size).collect())
}

#[cfg(test)]
pub(super) mod tests;
