//! From a written filter to a gain and blocks in series, in normalised time, and the scaling of states by
//! powers of two, which causes no rounding.

use super::AnalogError;
use super::families::{self, Member};
use super::pairing::pair_sections;
use super::polynomial::enclosed_roots;
use super::roots::{Factors, RootSet};
use super::section::{Biquad, Realisation};
use crate::arithmetic::{Ball, LongBall, Real};
use hybank_core::spec::{FilterSpec, Passband};
use hybank_core::units::Seconds;
use hybank_linalg::{Complex, Mat, eigenvalues, inverse, power_of_two, solve, to_complex};
use nalgebra::DMatrix;

/// One block of a series, with one input and one output.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum SeriesBlock<T> {
    /// One or two poles with at most as many zeros.
    Section(Biquad<T>),
    /// State equations as the spec gives them.
    State(Realisation<T>),
}

/// A gain and blocks in series.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Chain<T> {
    pub(super) gain: T,
    pub(super) blocks: Vec<SeriesBlock<T>>,
}

/// A number in which written filters are realised: `f64` for the design, a ball for the proof.
pub(super) trait RealNumber: Real {
    /// Zeros, poles and gain of `num(s) / den(s)`.
    fn quotient(num: &[f64], den: &[f64]) -> Result<Factors<Self>, AnalogError>;

    /// Zeros, poles and gain of a member of a family, in normalised time.
    fn family(member: &Member, passband: Passband, h: Seconds) -> Result<Factors<Self>, AnalogError>;
}

impl RealNumber for LongBall {
    fn quotient(num: &[f64], den: &[f64]) -> Result<Factors<Self>, AnalogError> {
        let [num, den] = [num, den].map(without_leading_zeros);
        let (zeros, poles) = (enclosed_roots(num, "num")?, enclosed_roots(den, "den")?);
        Ok(Factors { zeros, poles, gain: Self::from(num[0]) / Self::from(den[0]) })
    }

    fn family(member: &Member, passband: Passband, h: Seconds) -> Result<Factors<Self>, AnalogError> {
        families::placed(member, passband, h)
    }
}

impl RealNumber for f64 {
    fn quotient(num: &[f64], den: &[f64]) -> Result<Factors<Self>, AnalogError> {
        Ok(Ball::quotient(num, den)?.rounded())
    }

    fn family(member: &Member, passband: Passband, h: Seconds) -> Result<Factors<Self>, AnalogError> {
        Ok(families::placed(member, passband, h)?.rounded())
    }
}

fn without_leading_zeros(values: &[f64]) -> &[f64] {
    let start = values.iter().position(|&x| x != 0.0).unwrap_or(values.len());
    &values[start..]
}

impl<T: RealNumber> SeriesBlock<T> {
    pub(super) fn realise(&self) -> Realisation<T> {
        match self {
            Self::Section(section) => section.realise(),
            Self::State(state) => state.clone(),
        }
    }
}

impl SeriesBlock<f64> {
    pub(super) fn response(&self, s: Complex<f64>) -> Complex<f64> {
        match self {
            Self::Section(section) => section.response(s),
            Self::State(state) => state_response(state, s),
        }
    }

    pub(super) fn poles(&self) -> Result<Vec<Complex<f64>>, AnalogError> {
        match self {
            Self::Section(section) => Ok(section.poles.list()),
            Self::State(state) => Ok(eigenvalues(&state.a)?),
        }
    }
}

/// d + c (s - a)^-1 b.
pub(super) fn state_response(state: &Realisation<f64>, s: Complex<f64>) -> Complex<f64> {
    let n = state.a.nrows();
    let pencil = hybank_linalg::CMat::identity(n, n) * s - to_complex(&state.a);
    let x = solve(&pencil, &to_complex(&state.b));
    (to_complex(&state.c) * x)[(0, 0)] + state.d
}

impl<T: RealNumber> Chain<T> {
    /// Normalises by the fast period `h` a filter whose written form has been checked.
    pub(super) fn new(filter: &FilterSpec, h: Seconds) -> Result<Self, AnalogError> {
        let period = T::from(h.0);
        match filter {
            FilterSpec::TransferFunction { num, den } => {
                Ok(Self::of_sections(T::quotient(num, den)?.stretched(period)))
            }
            FilterSpec::ZeroPoleGain { zeros, poles, gain } => {
                let complex = |list: &[[f64; 2]]| -> Vec<Complex<f64>> {
                    list.iter().map(|&[re, im]| Complex::new(re, im)).collect()
                };
                let (zeros, poles) =
                    (RootSet::new(&complex(zeros), "zero")?, RootSet::new(&complex(poles), "pole")?);
                Ok(Self::of_sections(Factors { zeros, poles, gain: T::from(*gain) }.stretched(period)))
            }
            FilterSpec::StateSpace { a, b, c } => Ok(Self::of_matrices(a, b, c, period)),
            FilterSpec::Family { family, order, passband, ripple_db, attenuation_db } => {
                let member = Member {
                    family: *family,
                    order: order.unwrap_or(1),
                    ripple_db: ripple_db.unwrap_or(0.0),
                    attenuation_db: attenuation_db.unwrap_or(0.0),
                };
                Ok(Self::of_sections(T::family(&member, *passband, h)?))
            }
            FilterSpec::Cascade { cascade } => {
                let mut whole = Self { gain: T::from(1.0), blocks: Vec::new() };
                for stage in cascade {
                    let stage = Self::new(stage, h)?;
                    whole.gain = whole.gain * stage.gain;
                    whole.blocks.extend(stage.blocks);
                }
                Ok(whole)
            }
        }
    }

    fn of_sections(factors: Factors<T>) -> Self {
        let sections = pair_sections(&factors.poles, &factors.zeros);
        let gain = sections.iter().fold(factors.gain, |gain, section| section.unscaled(gain));
        Self { gain, blocks: sections.into_iter().map(SeriesBlock::Section).collect() }
    }

    fn of_matrices(a: &[Vec<f64>], b: &[Vec<f64>], c: &[Vec<f64>], h: T) -> Self {
        let n = a.len();
        let state = Realisation {
            a: DMatrix::from_fn(n, n, |i, j| T::from(a[i][j]) * h),
            b: DMatrix::from_fn(n, 1, |i, _| T::from(b[i][0]) * h),
            c: DMatrix::from_fn(1, n, |_, j| T::from(c[0][j])),
            d: T::from(0.0),
        };
        Self { gain: T::from(1.0), blocks: vec![SeriesBlock::State(state)] }
    }

    /// H(s / factor), a positive number.
    pub(super) fn stretched(&self, factor: T) -> Self {
        let stretched = |block: &SeriesBlock<T>| match block {
            SeriesBlock::Section(Biquad { poles, zeros }) => {
                SeriesBlock::Section(Biquad { poles: poles.scaled(factor), zeros: zeros.scaled(factor) })
            }
            SeriesBlock::State(state) => SeriesBlock::State(state.stretched(factor)),
        };
        Self { gain: self.gain, blocks: self.blocks.iter().map(stretched).collect() }
    }

    /// The blocks in series. The gain is applied at the output, so that states keep their size.
    pub(super) fn realise(&self) -> Realisation<T> {
        self.blocks
            .iter()
            .fold(Realisation::wire(), |whole, block| whole.then(&block.realise()))
            .amplified(self.gain)
    }
}

/// Doublings of [`gramian`]: covers pole spreads up to 2^60.
const MAX_DOUBLINGS: usize = 60;

/// Scales every state by a power of two to unit input energy: the diagonal of the controllability Gramian
/// lies between 0.37 and 1.6 afterwards. States that the input does not drive keep their scale. The input is
/// white, or white noise through `signal`.
pub(super) fn with_unit_states<T: Real>(
    signal: Option<&Realisation<f64>>,
    system: &Realisation<T>,
) -> Realisation<T> {
    let mut scaled = system.clone();
    for (i, energy) in own_energy(signal, &system.rounded()).into_iter().enumerate() {
        let factor = power_of_two(energy.sqrt());
        let times = |by: f64| move |x: &mut T| *x = *x * T::from(by);
        scaled.a.row_mut(i).apply(times(1.0 / factor));
        scaled.b.row_mut(i).apply(times(1.0 / factor));
        scaled.a.column_mut(i).apply(times(factor));
        scaled.c.column_mut(i).apply(times(factor));
    }
    scaled
}

/// The energy of each state of `system`.
fn own_energy(signal: Option<&Realisation<f64>>, system: &Realisation<f64>) -> Vec<f64> {
    let (whole, first) = match signal {
        Some(signal) => (signal.then(system), signal.a.nrows()),
        None => (system.clone(), 0),
    };
    let gramian = gramian(&whole);
    (first..whole.a.nrows()).map(|i| gramian[(i, i)]).collect()
}

/// ||c (s - a)^-1 b||_2^2.
pub(super) fn output_energy(system: &Realisation<f64>) -> f64 {
    (&system.c * gramian(system) * system.c.transpose())[(0, 0)]
}

/// Controllability Gramian P, a P + P a' + b b' = 0, for a stable `a`.
///
/// The bilinear map e = (alpha + a)(alpha - a)^-1 turns it into P = e P e' + 2 alpha g g' with
/// g = (alpha - a)^-1 b, whose series is summed by doubling. Every term is positive, so the
/// diagonal is accurate enough for scaling even if P is nearly singular.
fn gramian(system: &Realisation<f64>) -> Mat {
    let n = system.a.nrows();
    let alpha = typical_rate(&system.a);
    let resolvent = inverse(&(Mat::identity(n, n) * alpha - &system.a));
    let g = &resolvent * &system.b;
    let mut e = &resolvent * (&system.a + Mat::identity(n, n) * alpha);
    let mut p = &g * g.transpose() * (2.0 * alpha);
    for _ in 0..MAX_DOUBLINGS {
        p += &e * &p * e.transpose();
        e = &e * &e;
        if e.amax() <= f64::EPSILON {
            break;
        }
    }
    p
}

/// Geometric mean of the diagonal's moduli: between the fast and the slow poles.
fn typical_rate(a: &Mat) -> f64 {
    let n = a.nrows().max(1) as f64;
    let logs: f64 = a.diagonal().iter().filter(|x| **x != 0.0).map(|x| x.abs().ln()).sum();
    (logs / n).exp()
}
